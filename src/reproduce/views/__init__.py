"""Command line, notebooks, pages, citations and exports: they call, they compute nothing."""
