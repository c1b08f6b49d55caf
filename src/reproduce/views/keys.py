"""Keys as a reader may type them, with suggestions for slips."""

from __future__ import annotations

import difflib

from reproduce.judge.studies import studies
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import library

__all__ = ["UnknownKeyError", "check_key", "place", "title"]


class UnknownKeyError(KeyError):
    """No item has this key; the message suggests the nearest ones."""

    def __str__(self) -> str:
        """Return the message without KeyError's quotes."""
        return str(self.args[0])


def check_key(key: str) -> str:
    """Return `key` if it names an item.

    Examples
    --------
    >>> check_key("niu2024/table-3")
    'niu2024/table-3'
    """
    known = list(catalogue())
    if key in known:
        return key
    if key in studies():
        raise UnknownKeyError(f"{key} is a table of our own: it holds no printed number to judge")
    near = difflib.get_close_matches(key, [*known, *studies()], n=3, cutoff=0.5)
    hint = f"; did you mean {', '.join(near)}?" if near else ""
    raise UnknownKeyError(f"unknown key {key!r}{hint} (`reproduce list` shows all keys)")


def title(key: str) -> str:
    """Return the title of an item, in our words."""
    table = library().get(key)
    if table is not None:
        return table.title
    draw = catalogue()[key].draw
    return "" if draw is None else draw.title


def place(key: str) -> str:
    """Return where an item stands in its paper, such as ``Table 3`` or ``Figure 4``."""
    table = library().get(key)
    if table is not None:
        return table.place
    return f"Figure {key.rpartition('-')[2]}"
