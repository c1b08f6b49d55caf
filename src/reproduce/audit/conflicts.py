"""The smallest sets of cells that cannot all be right."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from reproduce.audit.examine import boxes_of, by_value, contradicted, uniform
from reproduce.audit.intervals import EVERYTHING
from reproduce.audit.quantity import Interval, Sheet
from reproduce.audit.relation import Relation
from reproduce.audit.solve import contract, projection, propagate


@dataclass(frozen=True)
class Conflict:
    """Cells that cannot all be right, and the relations that say so.

    Parameters
    ----------
    cells : tuple of str
        Addresses; with any one of them free, the relations can hold.
    relations : tuple of str
        Names of the relations.
    """

    cells: tuple[str, ...]
    relations: tuple[str, ...]


def conflicts(cells: Sheet, relations: Sequence[Relation]) -> list[Conflict]:
    """Return the smallest sets of cells that cannot all be right.

    A relation that contradicts by itself gives one set. Relations that share an unknown conflict
    in pairs: intervals of one number have a common point if and only if every two of them have.
    Relations that hold one by one but not together are found by propagation through all.

    The smallest first; each is minimal: free any of its cells, and the rest can be right.
    """
    odd = [conflict for relation in relations for conflict in _odd(cells, relation)]
    relations = by_value(relations)
    boxes = boxes_of(cells, relations, "nearest")
    found = [_smallest([relation], boxes) for relation in _impossible(relations, boxes)]
    found += [_smallest(pair, boxes) for pair in _disjoint_pairs(relations, boxes)]
    wrong = contradicted(cells, relations)
    kept = [relation for relation in relations if relation.name not in wrong]
    while propagate(kept, boxes) is None:
        together = _needed(kept, boxes)
        found.append(_smallest(together, boxes))
        kept.remove(together[-1])
    unique = {frozenset(conflict.cells): conflict for conflict in reversed([*odd, *found])}
    return sorted(unique.values(), key=lambda conflict: (len(conflict.cells), conflict.cells))


def _odd(cells: Sheet, relation: Relation) -> list[Conflict]:
    """Return the pairs of cells that a relation wants printed to one digit and that are not."""
    if relation.kind != "print" or uniform(cells, relation):
        return []
    pairs = itertools.combinations(relation.addresses, 2)
    unlike = [pair for pair in pairs if cells[pair[0]].last_digit != cells[pair[1]].last_digit]
    return [Conflict(pair, (relation.name,)) for pair in unlike]


def _impossible(relations: Sequence[Relation], boxes: Mapping[str, Interval]) -> list[Relation]:
    return [relation for relation in relations if contract(relation, boxes) is None]


def _disjoint_pairs(
    relations: Sequence[Relation], boxes: Mapping[str, Interval]
) -> list[list[Relation]]:
    shared = [(r, p) for r in relations if r.unknown if (p := projection(r, boxes)) is not None]
    return [
        [one, two]
        for (one, a), (two, b) in itertools.combinations(shared, 2)
        if one.unknown is two.unknown and (a[1] < b[0] or b[1] < a[0])
    ]


def _needed(relations: Sequence[Relation], boxes: Mapping[str, Interval]) -> list[Relation]:
    """Drop relations in their order as long as the rest cannot hold together.

    What cannot hold without a whole block cannot hold without any part of it, so blocks are tried
    first.
    """

    def kept(block: Sequence[Relation], others: Sequence[Relation]) -> list[Relation]:
        if propagate(others, boxes) is None:
            return []
        if len(block) == 1:
            return list(block)
        middle = len(block) // 2
        first = kept(block[:middle], [*others, *block[middle:]])
        return first + kept(block[middle:], [*others, *first])

    return kept(relations, [])


def _smallest(relations: Sequence[Relation], boxes: Mapping[str, Interval]) -> Conflict:
    """Free cells one by one as long as the rest is still in conflict."""
    blamed = dict.fromkeys(a for relation in relations for a in relation.addresses)
    state = dict(boxes)
    for address in list(blamed):
        freed = state | {address: EVERYTHING}
        if propagate(relations, freed) is None:
            state = freed
            del blamed[address]
    return Conflict(tuple(blamed), tuple(relation.name for relation in relations))
