"""All items of both papers, in order of print."""

from __future__ import annotations

from collections.abc import Callable

from reproduce.papers import chen2023, niu2024
from reproduce.papers.declare import Item
from reproduce.papers.study import Study


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


def studies() -> dict[str, Callable[[], Study]]:
    """Return the tables of our own that stand beside the papers, by name.

    Returns
    -------
    dict
        Name, such as ``chen2023/readings``, to the function that computes the table.

    Examples
    --------
    >>> sorted(studies())[0].partition("/")[0]
    'chen2023'
    """
    return dict(chen2023.STUDIES)
