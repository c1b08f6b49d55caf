"""Keys as a reader may type them, with suggestions for slips, and what they name."""

from __future__ import annotations

import difflib

from reproduce.papers.catalogue import catalogue, drawings, studies
from reproduce.printed.cells import PAPERS, anchor, library


def check_key(key: str) -> str:
    """Return `key` if it names an item.

    Examples
    --------
    >>> check_key("niu2024/table-3")
    'niu2024/table-3'
    """
    if not isinstance(key, str):
        raise TypeError(f"expected a key such as 'niu2024/table-3', got {key!r}")
    known = list(catalogue())
    if key in known:
        return key
    if key in studies():
        raise KeyError(
            f"{key} is a table of our own: it holds no printed number to judge"
        )
    near = difflib.get_close_matches(
        key, [*known, *studies(), *drawings()], n=3, cutoff=0.5
    )
    hint = f"; did you mean {', '.join(near)}?" if near else ""
    raise KeyError(f"unknown key {key!r}{hint} (`reproduce list` shows all keys)")


def resolved(text: str) -> str:
    """Return the address that a pasted text names: a page's with its anchor, or a citation's.

    Examples
    --------
    >>> resolved("file:///book/niu2024/simulation.html#niu2024-table-3-scale-red")
    'niu2024/table-3#scale.red'
    """
    address = text.strip().partition(": printed ")[0]
    names = [
        *library(),
        *(cell.address for table in library().values() for cell in table.cells),
    ]
    return {anchor(name): name for name in names}.get(
        address.rpartition("#")[2], address
    )


def check_paper(paper: str) -> str:
    """Return `paper` if it is the key of one."""
    if paper not in PAPERS:
        raise ValueError(
            f"unknown paper {paper!r}: expected one of {', '.join(PAPERS)}"
        )
    return paper


def title(key: str) -> str:
    """Return the title of an item, or of a table or drawing of our own, in our words."""
    if key in library():
        return library()[key].title
    if key in studies():
        return studies()[key].title
    draw = drawings()[key] if key in drawings() else catalogue()[key].draw
    return "" if draw is None else draw.title


def place(key: str) -> str:
    """Return where an item stands in its paper, such as ``Table 3`` or ``Figure 4``."""
    if key in studies():
        return "a table of our own"
    if key in drawings():
        return "Our own drawing"
    return (
        library()[key].place if key in library() else f"Figure {key.rpartition('-')[2]}"
    )
