"""Comparison of computed with printed numbers: verdicts, the ledger, and reruns."""
