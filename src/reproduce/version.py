"""The version of the project and the day of its release."""

__all__ = ["RELEASED"]

__version__ = "0.1.0"
RELEASED = "2026-11-21"
