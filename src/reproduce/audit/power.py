"""How much the relations can see: slips planted in each printed cell, one at a time."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from reproduce.audit.examine import contradicted
from reproduce.audit.quantity import Quantity, Sheet
from reproduce.audit.relation import Relation
from reproduce.audit.slips import of_digits, readable

Planted = Literal["digit", "swap", "drop", "sign"]
KINDS: tuple[Planted, ...] = ("digit", "swap", "drop", "sign")


@dataclass(frozen=True)
class Plant:
    """A slip planted in one cell.

    Parameters
    ----------
    address : str
        The cell.
    kind : str
        One digit changed, two neighbours swapped, a digit dropped, the sign changed.
    text : str
        What the cell then prints.
    """

    address: str
    kind: Planted
    text: str


def plants(cells: Sheet, seed: int) -> Iterator[Plant]:
    """Yield one slip of each kind for every cell that can have it.

    Parameters
    ----------
    cells : mapping of str to Quantity
        The printed numbers.
    seed : int
        Which digit is hit; each cell has its own stream, so that the choice for one does not
        depend on the others.

    Yields
    ------
    Plant
        In the order of the cells.
    """
    for address, printed in cells.items():
        rng = np.random.default_rng([seed, zlib.crc32(address.encode())])
        for kind in KINDS:
            ways = sorted(_ways(printed, kind))
            if ways:
                yield Plant(address, kind, ways[rng.integers(len(ways))])


def _ways(printed: Quantity, kind: Planted) -> set[str]:
    text = printed.number.text
    if kind == "drop":
        mantissa, mark, power = text.partition("e")
        found = {mantissa[:i] + mantissa[i + 1 :] + mark + power for i in _digits(mantissa)}
    else:
        found = {before for way, before in of_digits(text) if way == kind}
    return {way for way in found - {text} if readable(way)}


def _digits(mantissa: str) -> list[int]:
    places = [i for i, character in enumerate(mantissa) if character.isdigit()]
    return places if len(places) > 1 else []


def seen_by_relations(
    cells: Sheet, relations: Sequence[Relation], planted: Sequence[Plant]
) -> list[bool]:
    """Tell which slips turn a relation that holds into a contradiction.

    Parameters
    ----------
    cells : mapping of str to Quantity
        The printed numbers.
    relations : sequence of Relation
        What they should keep.
    planted : sequence of Plant
        The slips, each tried alone.

    Returns
    -------
    list of bool
        One for each slip.
    """
    before = contradicted(cells, relations)
    seen = []
    for plant in planted:
        touched = _touched(plant.address, relations)
        changed = {**cells, plant.address: cells[plant.address].printing(plant.text)}
        seen.append(bool(contradicted(changed, touched) - before))
    return seen


def _touched(address: str, relations: Sequence[Relation]) -> list[Relation]:
    hit = [relation for relation in relations if address in relation.addresses]
    shared = {relation.unknown.name for relation in hit if relation.unknown}
    return [r for r in relations if r in hit or (r.unknown and r.unknown.name in shared)]
