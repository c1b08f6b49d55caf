"""Computed against printed: verdicts, the ledger, and both again under a change."""
