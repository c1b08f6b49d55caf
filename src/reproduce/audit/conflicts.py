"""How contradictions hang together: in groups, and as smallest sets that cannot all be right."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from reproduce.audit.examine import by_value, contradicted, last_digit
from reproduce.audit.intervals import EVERYTHING, meet, printed_intervals, projection, propagate
from reproduce.audit.relation import Relation, Sheet


def groups(cells: Sheet, relations: Sequence[Relation]) -> list[list[Relation]]:
    """Sort the contradictions into groups that share cells or unknowns."""
    wrong = contradicted(cells, relations)
    found: list[list[Relation]] = []
    for relation in (r for r in relations if r.name in wrong):
        shares = set(relation.variables)
        touching = [group for group in found if any(shares & set(r.variables) for r in group)]
        found = [group for group in found if group not in touching]
        found.append([*itertools.chain.from_iterable(touching), relation])
    order = {relation.name: i for i, relation in enumerate(relations)}
    return sorted(
        (sorted(group, key=lambda r: order[r.name]) for group in found),
        key=lambda group: order[group[0].name],
    )


@dataclass(frozen=True)
class Conflict:
    """Addresses of cells that cannot all be right, and the names of the relations that say so.

    With any one of the cells free, the relations can hold.
    """

    cells: tuple[str, ...]
    relations: tuple[str, ...]


def conflicts(cells: Sheet, relations: Sequence[Relation]) -> list[Conflict]:
    """Return the smallest sets of cells that cannot all be right, in order of their size.

    A relation that contradicts by itself gives one set. Relations that share an unknown conflict
    in pairs: intervals of one number have a common point if and only if every two of them have.
    Relations that hold one by one but not together are found by propagation through all. Each set
    is minimal: free any of its cells, and the rest can be right.
    """
    wrong = contradicted(cells, relations)
    found = [
        Conflict((a, b), (r.name,))
        for r in relations
        if r.kind == "print" and r.name in wrong
        for a, b in itertools.combinations(r.addresses, 2)
        if last_digit(cells[a]) != last_digit(cells[b])
    ]
    kept = by_value(relations)
    intervals = printed_intervals(cells, kept)

    def apart(together: Sequence[Relation]) -> bool:
        return propagate(together, intervals) is None

    alone = [[relation] for relation in kept if apart([relation])]
    asked = [(r, p) for r in kept if (p := projection(r, intervals)) is not None]
    pairs = [
        [one, two]
        for (one, a), (two, b) in itertools.combinations(asked, 2)
        if one.unknown is two.unknown and not meet(a, b)
    ]
    found += [_smallest(cells, together) for together in (*alone, *pairs)]
    kept = [relation for relation in kept if relation.name not in wrong]
    while apart(kept):
        needed = list(kept)
        for relation in kept:
            without = [other for other in needed if other is not relation]
            needed = without if apart(without) else needed
        found.append(_smallest(cells, needed))
        kept.remove(needed[-1])
    unique = {frozenset(conflict.cells): conflict for conflict in reversed(found)}
    return sorted(unique.values(), key=lambda conflict: (len(conflict.cells), conflict.cells))


def _smallest(cells: Sheet, relations: Sequence[Relation]) -> Conflict:
    """Free cells one by one as long as the rest is still in conflict."""
    state = printed_intervals(cells, relations)
    blamed = list(state)
    for address in list(state):
        freed = state | {address: EVERYTHING}
        if propagate(relations, freed) is None:
            state = freed
            blamed.remove(address)
    return Conflict(tuple(blamed), tuple(relation.name for relation in relations))
