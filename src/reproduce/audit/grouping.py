"""Contradictions that hang together."""

from __future__ import annotations

from collections.abc import Sequence

from reproduce.audit.examine import contradicted
from reproduce.audit.quantity import Sheet
from reproduce.audit.relation import Relation


def groups(cells: Sheet, relations: Sequence[Relation]) -> list[frozenset[str]]:
    """Sort the contradictions into groups that hang together by a cell or an unknown.

    Names of relations, each in one group, in order of first appearance.
    """
    wrong = contradicted(cells, relations)
    pools: list[tuple[frozenset[str], frozenset[object]]] = []
    for relation in (r for r in relations if r.name in wrong):
        names, shared = frozenset({relation.name}), _shared(relation)
        touching = [pool for pool in pools if pool[1] & shared]
        pools = [pool for pool in pools if not pool[1] & shared]
        for other_names, other_shared in touching:
            names, shared = names | other_names, shared | other_shared
        pools.append((names, shared))
    order = {relation.name: i for i, relation in enumerate(relations)}
    return sorted((names for names, _ in pools), key=lambda n: min(order[name] for name in n))


def _shared(relation: Relation) -> frozenset[object]:
    unknown = {relation.unknown.name} if relation.unknown else set()
    return frozenset(relation.addresses) | unknown


def apart(relations: Sequence[Relation], together: frozenset[str]) -> list[frozenset[str]]:
    """Split a group that no few slips explain: by shared unknowns, all other relations alone.

    Smaller groups, in order of first appearance.
    """
    found: dict[str, set[str]] = {}
    for relation in (r for r in relations if r.name in together):
        shared = f"unknown {relation.unknown.name}" if relation.unknown else relation.name
        found.setdefault(shared, set()).add(relation.name)
    return [frozenset(names) for names in found.values()]
