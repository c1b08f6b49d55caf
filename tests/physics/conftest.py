"""Hypothesis draws the same examples on every run, and never fails for a slow machine."""

from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")
