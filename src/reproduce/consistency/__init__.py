"""Cross-examine the printed numbers of a paper against each other, by interval arithmetic."""
