"""Output: tables, figures, posteriors, citations, exports and the command line."""
