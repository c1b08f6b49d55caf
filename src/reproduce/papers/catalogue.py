"""All items of both papers, in order of print."""

from __future__ import annotations

from reproduce.papers import chen2023, niu2024
from reproduce.papers.declare import Item


def catalogue() -> dict[str, Item]:
    """Return every item by its key, paper by paper, in order of print.

    Returns
    -------
    dict
        Key to item.

    Examples
    --------
    >>> list(catalogue())[0]
    'niu2024/text-context'
    """
    return {item.key: item for paper in (niu2024, chen2023) for item in paper.ITEMS}
