"""Cross-examine the numbers of a table against each other, by interval arithmetic."""
