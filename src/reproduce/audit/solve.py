"""Intervals through relations, both ways.

Every contraction is rigorous: what is removed cannot hold. An empty result proves that no values
which print as they do keep the relation.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping

from reproduce.audit.intervals import EVERYTHING, contractor
from reproduce.audit.relation import Relation
from reproduce.audit.rounding import RoundingRule, Sheet, allowed
from reproduce.printed.number import Interval

# Floating-point noise between the two sides of a relation, as a share of them.
NOISE = 1e-9
# Interval ends in binary may miss a decimal tie by one unit in the last place; without this the
# last bit would decide.
_SLACK = 1e-12
_END = 1e-3
# Two relations can pass ever smaller gains back and forth; whoever stops here has not been refuted.
_VISITS = 5_000
_POINT = 0.0, 0.0


def printed_intervals(
    cells: Sheet, relations: Iterable[Relation], rule: RoundingRule = "nearest"
) -> dict[str, Interval]:
    """Return the interval of print, in SI, for every cell of some relations."""
    return {a: allowed(cells[a], rule) for r in relations for a in r.addresses}


def enclosure(relation: Relation, cells: Sheet) -> Interval:
    """Enclose, in SI, what the right side gives for its result, whatever the rounding.

    Exact but for outward rounding where the formula names each cell once.
    """
    if relation.result is None or relation.unknown or relation.tolerance:
        raise ValueError(f"{relation.name!r}: expected an equation solved for one cell")
    inputs = printed_intervals(cells, [relation]) | {relation.result: EVERYTHING}
    found = contractor(relation)((*[inputs[a] for a in relation.addresses], _POINT, _POINT))
    if found is None:
        raise ArithmeticError(f"{relation.name!r}: no values that print so give a result")
    return found[relation.addresses.index(relation.result)]


def contract(
    relation: Relation, intervals: Mapping[str, Interval], unknown: Interval | None = None
) -> dict[str, Interval] | None:
    """Narrow the intervals of a relation's cells to the values that can keep it.

    Address to narrowed interval, the unknown under its name; None if nothing is left.
    """
    ends = [intervals[a] for a in relation.addresses]
    box = [*map(widened, map(_open, ends) if relation.repeats else ends)]
    if relation.unknown is not None:
        box.append(unknown or relation.unknown.domain)
    found = _narrowed(relation, tuple(box))
    return None if found is None else dict(zip(relation.variables, found, strict=False))


def projection(relation: Relation, intervals: Mapping[str, Interval]) -> Interval | None:
    """Return the values of the unknown that a relation allows on its own."""
    if relation.unknown is None:
        raise ValueError(f"{relation.name!r} has no unknown; ask `contract` about its cells")
    found = contract(relation, intervals)
    return None if found is None else found[relation.unknown.name]


@functools.lru_cache(maxsize=200_000)
def _narrowed(relation: Relation, box: tuple[Interval, ...]) -> list[Interval] | None:
    """Narrow the variables of a relation, which come in their order."""
    room = relation.tolerance.si if relation.tolerance else 0.0
    point = [] if relation.unknown else [_POINT]
    return contractor(relation)((*box, *point, (-room, room)))


def widened(interval: Interval) -> Interval:
    """Widen an interval by the noise of binary arithmetic."""
    low, high = interval
    return low - _SLACK * abs(low), high + _SLACK * abs(high)


def _open(interval: Interval) -> Interval:
    """Take the ends off an interval of print, for where one number is printed twice.

    Two intervals of print meet at an end, or share at least half a unit of the finer print; a
    thousandth tells the two cases apart whatever the noise of binary arithmetic.
    """
    low, high = interval
    if math.isinf(high - low):
        return interval
    return low + _END * (high - low), high - _END * (high - low)


def propagate(
    relations: Iterable[Relation], intervals: Mapping[str, Interval]
) -> dict[str, Interval] | None:
    """Narrow all cells by all relations together, back and forth until nothing moves.

    Address (and name of unknown) to narrowed interval; None if they cannot all hold.
    """
    every = list(relations)
    state: dict[str, Interval] = {a: widened(intervals[a]) for r in every for a in r.addresses}
    for repeat in (relation for relation in every if relation.repeats):
        state |= {a: _open(widened(intervals[a])) for a in repeat.addresses}
    state |= {r.unknown.name: r.unknown.domain for r in every if r.unknown}
    touching: dict[str, list[Relation]] = {}
    for relation in every:
        for name in relation.variables:
            touching.setdefault(name, []).append(relation)
    queue = dict.fromkeys(every)
    for _ in range(_VISITS):
        if not queue:
            break
        relation = next(iter(queue))
        del queue[relation]
        found = _narrowed(relation, tuple([state[name] for name in relation.variables]))
        if found is None:
            return None
        for name, interval in zip(relation.variables, found, strict=False):
            if _narrower(interval, state[name]):
                low, high = state[name]
                state[name] = max(interval[0], low), min(interval[1], high)
                queue |= dict.fromkeys(r for r in touching[name] if r is not relation)
    return state


def _narrower(new: Interval, old: Interval) -> bool:
    """Tell whether an interval shrank by enough to be worth telling the others."""
    if math.isinf(old[0]) or math.isinf(old[1]):
        return new != old and not (new[0] <= old[0] and new[1] >= old[1])
    return (old[1] - old[0]) - (new[1] - new[0]) > 1e-6 * (old[1] - old[0])
