"""All items of all papers, in order of print; the module of an item is imported when it is used."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from itertools import chain
from typing import Any, TypeVar

from reproduce.locate import papers
from reproduce.papers.declare import Computation, Drawing, Item, Own, Study
from reproduce.printed.given import given

Made = TypeVar("Made")


class Declared(Mapping[str, Made]):
    """What is declared, by key; a module is imported when it is used."""

    def __init__(
        self, modules: Mapping[str, str], make: Callable[[str, str], Made]
    ) -> None:
        self.modules, self._make = modules, cache(make)

    def __getitem__(self, key: str) -> Made:
        """Return what is declared under a key."""
        if key not in self.modules:
            raise KeyError(
                f"unknown key {key!r}; expected one of {', '.join(self.modules)}"
            )
        return self._make(key, self.modules[key])

    def __iter__(self) -> Iterator[str]:
        """Go through the keys, paper by paper, in order of print."""
        return iter(self.modules)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.modules)


@cache
def catalogue() -> Declared[Item]:
    """Return every item by its key, paper by paper, in order of print.

    Examples
    --------
    >>> list(catalogue())[0]
    'niu2024/text-context'
    """
    return Declared(_modules("ITEMS"), _item)


@cache
def studies() -> Declared[Study]:
    """Return the tables of our own that stand beside the papers, by key.

    Examples
    --------
    >>> "chen2023/heat" in studies()
    True
    """
    return Declared(_modules("STUDIES"), _own)


@cache
def drawings() -> Declared[Drawing]:
    """Return the drawings of our own that stand beside the papers, by key.

    Examples
    --------
    >>> "niu2024/drawing-fusion-star" in drawings()
    True
    """
    return Declared(_modules("DRAWINGS"), _own)


def _modules(kind: str) -> dict[str, str]:
    found = {}
    for paper in papers():
        package = f"{__package__}.{paper}"
        for key, name in getattr(importlib.import_module(package), kind, {}).items():
            found[key] = f"{package}.{name}" if name else ""
    return found


def _item(key: str, name: str) -> Item:
    found = _declared(key, name) if name else []
    computations = tuple(one for one in found if isinstance(one, Computation))
    return Item(key, computations, *(one for one in found if isinstance(one, Drawing)))


def _own(key: str, name: str) -> Any:
    """Return the study or the drawing that a module, by its full name, declares under a key."""
    return _declared(key, name)[0]


def _declared(key: str, name: str) -> list[Computation | Own]:
    """Return what a module declares under a key; not what it imports."""
    every = vars(importlib.import_module(name)).values()
    own = (one for one in every if isinstance(one, Computation | Own))
    found = [one for one in own if one.key == key and one.function.__module__ == name]
    if not found:
        raise ValueError(f"{key}: expected its declaration in {name}")
    return found


def maker(address: str) -> Computation | None:
    """Return the computation that makes a printed cell; None for an input."""
    key, _, name = address.partition("#")
    return next((one for one in catalogue()[key].computations if one.makes(name)), None)


def changeable(key: str) -> tuple[str, ...]:
    """Return every number that an item, a cell or a study reads, directly or through other items.

    Addresses, nearest first.

    Examples
    --------
    >>> "niu2024/text-simulation#noise" in changeable("niu2024/table-3")
    True
    """
    declared: list[Computation | Own | None]
    if "#" in key:
        declared = [maker(key)]
    elif key in catalogue():
        declared = [*catalogue()[key].computations, catalogue()[key].draw]
    else:
        declared = [studies()[key] if key in studies() else drawings()[key]]
    return upstream(tuple(chain.from_iterable(one.given for one in declared if one)))


@cache
def upstream(patterns: tuple[str, ...]) -> tuple[str, ...]:
    """Return the addresses of the numbers that match, and of all that these are computed from."""
    found: dict[str, None] = {}
    waiting = list(patterns)
    while waiting:
        for address, cell in given([waiting.pop(0)]).cells.items():
            if address not in found and cell.is_number:
                found[address] = None
                above = maker(address)
                waiting += above.given if above else ()
    return tuple(found)
