"""Small pieces of HTML that several pages share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from reproduce.views.grid import Grid


def html_table(head: Sequence[str], rows: Iterable[Sequence[str]], caption: str) -> str:
    """Return a table; the first column names the row."""
    return str(Grid(caption, head, tuple(rows)).html)
