"""All items of all papers, in the order of the papers; a module is imported on first use."""

from __future__ import annotations

import importlib
from collections import UserDict
from collections.abc import Callable, Mapping
from functools import cache
from operator import itemgetter
from typing import Any

from reproduce.locate import data_files, papers
from reproduce.papers.declare import (
    Computation,
    Drawing,
    Item,
    PaperFunction,
    Schematic,
    Study,
)
from reproduce.printed.inputs import load_inputs


class _Catalogue(UserDict[str, Any]):
    """Declarations of one kind by key. Its `data` are the modules of the keys."""

    def __init__(self, kind: str, make: Callable[[list[Any]], Any]) -> None:
        super().__init__()
        self._make = make
        for paper in papers():
            package = f"{__package__}.{paper}"
            keys = getattr(importlib.import_module(package), kind, {})
            self.data |= {
                key: f"{package}.{name}" if name else "" for key, name in keys.items()
            }

    def __getitem__(self, key: str) -> Any:
        """Return the declaration of a key."""
        return self._make(_declarations(key, self.data[key]))


@cache
def catalogue() -> Mapping[str, Item]:
    """Return every item by its key, paper by paper, in the order of the papers.

    Examples
    --------
    >>> list(catalogue())[0]
    'niu2024/text-context'
    """
    return _Catalogue("ITEMS", _item)


@cache
def studies() -> Mapping[str, Study]:
    """Return the supplementary tables by key.

    Examples
    --------
    >>> "chen2023/heat" in studies()
    True
    """
    return _Catalogue("STUDIES", itemgetter(0))


@cache
def drawings() -> Mapping[str, Drawing | Schematic]:
    """Return the supplementary drawings by key.

    Examples
    --------
    >>> "niu2024/drawing-fusion-star" in drawings()
    True
    """
    return _Catalogue("DRAWINGS", itemgetter(0))


def _item(declared: list[Any]) -> Item:
    """Return the item of some declarations."""
    computations = tuple(each for each in declared if isinstance(each, Computation))
    figures = [each for each in declared if isinstance(each, Drawing | Schematic)]
    return Item(computations, *figures[:1])


@cache
def _declarations(key: str, module: str) -> list[Any]:
    """Return the declarations of a key in its module; without a module, its schematic."""
    if not module:
        return [Schematic(key, path) for path in data_files(f"schematics/{key}.svg")]
    declared = [
        value
        for value in vars(importlib.import_module(module)).values()
        if isinstance(value, PaperFunction)
        and (value.key, value.function.__module__) == (key, module)
    ]
    if not declared:
        raise ValueError(
            f"{key}: expected its declaration in {module}, got none. Add it, or correct the key "
            "in the package of the paper."
        )
    return declared


def computation_for(address: str) -> Computation | None:
    """Return the computation of a printed cell; None for an input."""
    key, _, name = address.partition("#")
    computations = catalogue()[key].computations
    return next((each for each in computations if each.makes(name)), None)


def changeable(key: str) -> tuple[str, ...]:
    """Return the inputs of an item, a cell or a study, direct or through other items.

    Parameters
    ----------
    key : str
        Key, or address of a cell.

    Returns
    -------
    tuple of str
        Addresses of the printed numbers, nearest first.

    Examples
    --------
    >>> "niu2024/text-simulation#noise" in changeable("niu2024/table-3")
    True
    """
    declared: list[PaperFunction | Schematic | None]
    if "#" in key:
        declared = [computation_for(key)]
    elif key in catalogue():
        item = catalogue()[key]
        declared = [*item.computations, item.draw]
    else:
        declared = [studies().get(key) or drawings()[key]]
    return upstream(
        tuple(address for each in declared if each for address in each.inputs)
    )


@cache
def upstream(patterns: tuple[str, ...]) -> tuple[str, ...]:
    """Return the addresses of the numbers that match, and of all their inputs."""
    addresses: dict[str, None] = {}
    waiting = list(patterns)
    while waiting:
        for address, cell in load_inputs([waiting.pop(0)]).cells.items():
            if address not in addresses and cell.is_number:
                addresses[address] = None
                above = computation_for(address)
                waiting += above.inputs if above else ()
    return tuple(addresses)
