"""Keys of all items in ``data/items/PAPER.toml``, in order, and their modules."""

from __future__ import annotations

from functools import cache
from typing import Literal, get_args

from reproduce.locate import papers, read_toml

# The module of each key in a file `data/items/PAPER.toml`, by kind.
_Kind = Literal["items", "studies", "drawings"]
KINDS: tuple[_Kind, ...] = get_args(_Kind)
_Keys = dict[_Kind, dict[str, str]]


@cache
def catalogue(kind: _Kind = "items") -> dict[str, str]:
    """Return the module of each key of a kind, paper by paper, in the order of the papers.

    A key that is only quoted, or drawn by hand, has no module.

    Examples
    --------
    >>> list(catalogue())[0]
    'niu2024/text-context'
    >>> "chen2023/heat" in catalogue("studies")
    True
    """
    return {
        f"{paper}/{key}": name and f"{__package__}.{paper}.{name}"
        for paper, folder in papers().items()
        for keys in [read_toml(folder / f"items/{paper}.toml", _Keys)]
        for key, name in keys.get(kind, {}).items()
    }
