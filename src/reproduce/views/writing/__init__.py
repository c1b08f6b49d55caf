"""How numbers, tables, figures and citations are written, the same wherever they are shown."""
