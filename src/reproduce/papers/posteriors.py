"""All posteriors of all papers, in the order of the book."""

from __future__ import annotations

import importlib.util
from functools import cache

from reproduce.locate import papers
from reproduce.papers.declare_posterior import Declaration


@cache
def posteriors() -> dict[str, Declaration]:
    """Return the declaration of every posterior by its key.

    What each paper's module ``posteriors``, if it has one, lists as ``POSTERIORS``.

    Examples
    --------
    >>> list(posteriors())[0]
    'registration'
    """
    names = [f"reproduce.papers.{paper}.posteriors" for paper in papers()]
    found = [importlib.import_module(name) for name in names if importlib.util.find_spec(name)]
    return {declared.key: declared for module in found for declared in module.POSTERIORS}
