"""All items in ``data/items/PAPER.toml``, in order; a module is imported on first use."""

from __future__ import annotations

import importlib
from collections import ChainMap
from collections.abc import Sequence
from functools import cache
from typing import Literal, get_args

from reproduce.locate import data_files, papers, read_toml
from reproduce.papers.declare import (
    Computation,
    Drawing,
    PaperFunction,
    Schematic,
    Study,
)
from reproduce.printed.inputs import load_inputs

# The module of each key in a file `data/items/PAPER.toml`, by kind.
_Kind = Literal["items", "studies", "drawings"]
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
    modules: dict[str, str] = {}
    for paper, folder in papers().items():
        keys = read_toml(folder / f"items/{paper}.toml", _Keys).get(kind, {})
        modules |= {
            f"{paper}/{key}": name and f"{__package__}.{paper}.{name}"
            for key, name in keys.items()
        }
    return modules


@cache
def declarations(key: str) -> Sequence[PaperFunction | Schematic]:
    """Return the declarations of an item, a supplementary table or a drawing.

    They are in the module of the key. Without a module, its schematic is the declaration.
    """
    module = ChainMap(*map(catalogue, get_args(_Kind)))[key]
    if not module:
        return [Schematic(key, path) for path in data_files(f"schematics/{key}.svg")]
    declared = [
        value
        for value in vars(importlib.import_module(module)).values()
        if isinstance(value, PaperFunction) and value.key == key
    ]
    if not declared:
        raise ValueError(
            f"{key}: expected its declaration in {module}, got none. Add it, or correct the key "
            "in data/items/."
        )
    return declared


def computations(key: str) -> list[Computation]:
    """Return the computations of an item."""
    return [each for each in declarations(key) if isinstance(each, Computation)]


def drawing(key: str) -> Drawing | Schematic | None:
    """Return the drawing of a figure or of a supplementary drawing; None for other keys."""
    drawn = (
        each for each in declarations(key) if isinstance(each, Drawing | Schematic)
    )
    return next(drawn, None)


def study(key: str) -> Study:
    """Return a supplementary table; raise KeyError for other keys."""
    for each in declarations(key):
        if isinstance(each, Study):
            return each
    raise KeyError(f"key: expected a supplementary table, got {key}")


def computation_for(address: str) -> Computation | None:
    """Return the computation of a printed cell; None for an input."""
    key, _, name = address.partition("#")
    return next((each for each in computations(key) if each.makes(name)), None)


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
    declared = [computation_for(key)] if "#" in key else declarations(key)
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
