"""How contradictions hang together: in groups, and as smallest sets that cannot all be right."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from reproduce.audit.examine import by_value, contradicted, uniform
from reproduce.audit.intervals import EVERYTHING, meet
from reproduce.audit.relation import Relation
from reproduce.audit.rounding import Sheet, last_digit
from reproduce.audit.solve import contract, printed_intervals, projection, propagate
from reproduce.printed.number import Interval


def groups(cells: Sheet, relations: Sequence[Relation]) -> list[frozenset[str]]:
    """Sort the contradictions, by name, into groups that share cells or unknowns."""
    wrong = contradicted(cells, relations)
    pools: list[tuple[list[Relation], set[str]]] = []
    for relation in (r for r in relations if r.name in wrong):
        touching = [pool for pool in pools if not pool[1].isdisjoint(relation.variables)]
        pools = [pool for pool in pools if pool not in touching]
        members = [*itertools.chain.from_iterable(pool[0] for pool in touching), relation]
        pools.append((members, {name for member in members for name in member.variables}))
    order = {relation.name: i for i, relation in enumerate(relations)}
    found = [frozenset(member.name for member in members) for members, _ in pools]
    return sorted(found, key=lambda names: min(order[name] for name in names))


def apart(relations: Sequence[Relation], together: frozenset[str]) -> list[frozenset[str]]:
    """Split a group that no few slips explain: by shared unknowns, all other relations alone."""
    found: dict[str, set[str]] = {}
    for relation in (r for r in relations if r.name in together):
        shared = f"unknown {relation.unknown.name}" if relation.unknown else relation.name
        found.setdefault(shared, set()).add(relation.name)
    return [frozenset(names) for names in found.values()]


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
    odd = [conflict for relation in relations for conflict in _odd(cells, relation)]
    relations = by_value(relations)
    intervals = printed_intervals(cells, relations)
    alone = [[relation] for relation in relations if contract(relation, intervals) is None]
    found = [_smallest(r, intervals) for r in (*alone, *_disjoint_pairs(relations, intervals))]
    wrong = contradicted(cells, relations)
    kept = [relation for relation in relations if relation.name not in wrong]
    while propagate(kept, intervals) is None:
        together = _needed(kept, intervals)
        found.append(_smallest(together, intervals))
        kept.remove(together[-1])
    unique = {frozenset(conflict.cells): conflict for conflict in reversed([*odd, *found])}
    return sorted(unique.values(), key=lambda conflict: (len(conflict.cells), conflict.cells))


def _odd(cells: Sheet, relation: Relation) -> list[Conflict]:
    """Return the pairs of cells that a relation wants printed to one digit and that are not."""
    if relation.kind != "print" or uniform(cells, relation):
        return []
    pairs = itertools.combinations(relation.addresses, 2)
    unlike = [(a, b) for a, b in pairs if last_digit(cells[a]) != last_digit(cells[b])]
    return [Conflict(pair, (relation.name,)) for pair in unlike]


def _disjoint_pairs(
    relations: Sequence[Relation], intervals: Mapping[str, Interval]
) -> list[list[Relation]]:
    """Return the pairs of relations that allow no common value of the unknown they share."""
    shared = [(r, p) for r in relations if r.unknown if (p := projection(r, intervals)) is not None]
    return [
        [one, two]
        for (one, a), (two, b) in itertools.combinations(shared, 2)
        if one.unknown is two.unknown and not meet(a, b)
    ]


def _needed(relations: Sequence[Relation], intervals: Mapping[str, Interval]) -> list[Relation]:
    """Drop relations in their order as long as the rest cannot hold together.

    What cannot hold without a whole block cannot hold without any part of it, so blocks are tried
    first.
    """

    def kept(block: Sequence[Relation], others: Sequence[Relation]) -> list[Relation]:
        if propagate(others, intervals) is None:
            return []
        if len(block) == 1:
            return list(block)
        middle = len(block) // 2
        first = kept(block[:middle], [*others, *block[middle:]])
        return first + kept(block[middle:], [*others, *first])

    return kept(relations, [])


def _smallest(relations: Sequence[Relation], intervals: Mapping[str, Interval]) -> Conflict:
    """Free cells one by one as long as the rest is still in conflict."""
    blamed = dict.fromkeys(a for relation in relations for a in relation.addresses)
    state = dict(intervals)
    for address in list(blamed):
        freed = state | {address: EVERYTHING}
        if propagate(relations, freed) is None:
            state = freed
            del blamed[address]
    return Conflict(tuple(blamed), tuple(relation.name for relation in relations))
