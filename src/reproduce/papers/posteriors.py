"""All posteriors of both papers, in the order of the book."""

from __future__ import annotations

from functools import cache

from reproduce.papers.chen2023.posteriors import POSTERIORS as CHEN
from reproduce.papers.declare_posterior import Declaration
from reproduce.papers.niu2024.posteriors import POSTERIORS as NIU


@cache
def posteriors() -> dict[str, Declaration]:
    """Return the declaration of every posterior by its key.

    Examples
    --------
    >>> list(posteriors())[0]
    'registration'
    """
    return {declared.key: declared for declared in (*NIU, *CHEN)}
