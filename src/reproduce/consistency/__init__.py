"""Consistency of the printed numbers of a paper, by interval arithmetic."""
