"""Computed against printed: verdicts and the ledger."""
