"""All items of all papers, in the order of the papers; a module is imported on first use."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from itertools import chain
from typing import Any, TypeVar

from reproduce.locate import papers, schematic_files
from reproduce.papers.declare import (
    Computation,
    DeclarationMap,
    Drawing,
    Item,
    Schematic,
    Study,
)
from reproduce.printed.inputs import load_inputs

Made = TypeVar("Made")


class Catalogue(Mapping[str, Made]):
    """Declarations of one kind, by key."""

    def __init__(self, kind: str, make: Callable[[list[Any]], Made]) -> None:
        self._make = make
        self.modules: dict[str, str] = {}
        for paper in papers():
            package = f"{__package__}.{paper}"
            keys = getattr(importlib.import_module(package), kind, {})
            for key, name in keys.items():
                self.modules[key] = f"{package}.{name}" if name else ""

    def __getitem__(self, key: str) -> Made:
        """Return the declaration of a key."""
        if key not in self.modules:
            raise KeyError(
                f"unknown key {key!r}; expected one of {', '.join(self.modules)}"
            )
        return self._make(_declarations(key, self.modules[key]))

    def __iter__(self) -> Iterator[str]:
        """Iterate over the keys."""
        return iter(self.modules)

    def __len__(self) -> int:
        """Return the number of keys."""
        return len(self.modules)


@cache
def catalogue() -> Catalogue[Item]:
    """Return every item by its key, paper by paper, in the order of the papers.

    Examples
    --------
    >>> list(catalogue())[0]
    'niu2024/text-context'
    """
    return Catalogue("ITEMS", _item)


@cache
def studies() -> Catalogue[Study]:
    """Return the supplementary tables by key.

    Examples
    --------
    >>> "chen2023/heat" in studies()
    True
    """
    return Catalogue("STUDIES", lambda found: found[0])


@cache
def drawings() -> Catalogue[Drawing | Schematic]:
    """Return the supplementary drawings by key.

    Examples
    --------
    >>> "niu2024/drawing-fusion-star" in drawings()
    True
    """
    return Catalogue("DRAWINGS", lambda found: found[0])


def _item(found: list[Any]) -> Item:
    computations = tuple(one for one in found if isinstance(one, Computation))
    drawn = (one for one in found if isinstance(one, Drawing | Schematic))
    return Item(computations, next(drawn, None))


@cache
def _declarations(key: str, module: str) -> list[Any]:
    """Return the declarations of a key: those of its module and its schematic."""
    files = schematic_files(key)
    found: list[Any] = [Schematic(key, files)] if files else []
    if module:
        for one in vars(importlib.import_module(module)).values():
            own = isinstance(one, Computation | DeclarationMap) and one.key == key
            if own and one.function.__module__ == module:
                found.append(one)
        if not found:
            raise ValueError(f"{key}: expected its declaration in {module}, got none.")
    return found


def computation_for(address: str) -> Computation | None:
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
    declared: list[Computation | DeclarationMap | Schematic | None]
    if "#" in key:
        declared = [computation_for(key)]
    elif key in catalogue():
        declared = [*catalogue()[key].computations, catalogue()[key].draw]
    else:
        declared = [studies()[key] if key in studies() else drawings()[key]]
    return upstream(tuple(chain.from_iterable(one.inputs for one in declared if one)))


@cache
def upstream(patterns: tuple[str, ...]) -> tuple[str, ...]:
    """Return the addresses of the numbers that match, and of all that these are computed from."""
    found: dict[str, None] = {}
    waiting = list(patterns)
    while waiting:
        for address, cell in load_inputs([waiting.pop(0)]).cells.items():
            if address not in found and cell.is_number:
                found[address] = None
                above = computation_for(address)
                waiting += above.inputs if above else ()
    return tuple(found)
