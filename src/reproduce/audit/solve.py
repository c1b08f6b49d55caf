"""Intervals through relations, both ways.

Every contraction is rigorous: what is removed cannot hold. An empty result proves that no values
which print as they do keep the relation.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping

from reproduce.audit.intervals import contractor
from reproduce.audit.quantity import Interval
from reproduce.audit.relation import Relation
from reproduce.printed.units import si_factor

# Interval ends in binary may miss a decimal tie by one unit in the last place; without this the
# last bit would decide.
SLACK = 1e-12
_END = 1e-3
_NOISE = 1e-9
# Two relations can pass ever smaller gains back and forth; whoever stops here has not been refuted.
_VISITS = 5_000


def contract(
    relation: Relation, boxes: Mapping[str, Interval], unknown: Interval | None = None
) -> dict[str, Interval] | None:
    """Narrow the intervals of a relation's cells to the values that can keep it.

    Address to narrowed interval, the unknown under its name; None if nothing is left.
    """
    found = _alone(relation, tuple([boxes[a] for a in relation.addresses]), unknown)
    return None if found is None else dict(zip(_variables(relation), found, strict=False))


def possible(relation: Relation, boxes: Mapping[str, Interval]) -> bool:
    """Tell whether `contract` leaves anything; quicker for an inequality that plainly holds."""
    return _possible(relation, tuple([boxes[a] for a in relation.addresses]))


@functools.lru_cache(maxsize=200_000)
def _possible(relation: Relation, box: tuple[Interval, ...]) -> bool:
    if relation.formula.sign != "=" and relation.unknown is None:
        middle = [(low + high) / 2 for low, high in box]
        left, right = relation.sides(dict(zip(relation.addresses, middle, strict=True)))
        less, more = (left, right) if relation.formula.sign == "<=" else (right, left)
        if less <= more - _NOISE * (abs(less) + abs(more)):
            return True
    return _alone(relation, box, None) is not None


@functools.lru_cache(maxsize=200_000)
def _alone(
    relation: Relation, box: tuple[Interval, ...], unknown: Interval | None
) -> list[Interval] | None:
    found = [widened(_open(relation, interval)) for interval in box]
    return _narrowed(relation, (*found, unknown or domain(relation)))


@functools.lru_cache(maxsize=200_000)
def _narrowed(relation: Relation, box: tuple[Interval, ...]) -> list[Interval] | None:
    """Narrow the cells and the unknown of a relation, which come in this order."""
    room = 0.0
    if relation.tolerance is not None:
        room = relation.tolerance.absolute if relation.tolerance.unit else relation.tolerance.size
    return contractor(relation)((*box, (-room, room)))


def widened(interval: Interval) -> Interval:
    """Widen an interval by `SLACK`."""
    low, high = interval
    return low - SLACK * abs(low), high + SLACK * abs(high)


def _open(relation: Relation, interval: Interval) -> Interval:
    """Take the ends off an interval of print where one number is printed twice.

    Two intervals of print meet at an end, or share at least half a unit of the finer print; a
    thousandth tells the two cases apart whatever the noise of binary arithmetic.
    """
    low, high = interval
    if not relation.repeats or math.isinf(high - low):
        return interval
    return low + _END * (high - low), high - _END * (high - low)


def domain(relation: Relation) -> Interval:
    """Return where the unknown of a relation may lie, in SI; a point if it has none."""
    if relation.unknown is None:
        return 0.0, 0.0
    factor = si_factor(relation.unknown.unit)
    return relation.unknown.low * factor, relation.unknown.high * factor


def projection(relation: Relation, boxes: Mapping[str, Interval]) -> Interval | None:
    """Return the values of the unknown that a relation allows on its own."""
    if relation.unknown is None:
        raise ValueError(f"{relation.name!r} has no unknown; ask `contract` about its cells")
    found = contract(relation, boxes)
    return None if found is None else found[relation.unknown.name]


def propagate(
    relations: Iterable[Relation], boxes: Mapping[str, Interval]
) -> dict[str, Interval] | None:
    """Narrow all cells by all relations together, back and forth until nothing moves.

    Address (and name of unknown) to narrowed interval; None if they cannot all hold.
    """
    every = list(relations)
    state: dict[str, Interval] = {a: widened(boxes[a]) for r in every for a in r.addresses}
    for repeat in (relation for relation in every if relation.repeats):
        state |= {a: _open(repeat, widened(boxes[a])) for a in repeat.addresses}
    state |= {r.unknown.name: domain(r) for r in every if r.unknown}
    touching: dict[str, list[Relation]] = {}
    for relation in every:
        for name in _variables(relation):
            touching.setdefault(name, []).append(relation)
    queue = dict.fromkeys(range(len(every)))
    position = {id(relation): i for i, relation in enumerate(every)}
    for _ in range(_VISITS):
        if not queue:
            break
        relation = every[next(iter(queue))]
        del queue[position[id(relation)]]
        names = _variables(relation)
        point = [] if relation.unknown else [domain(relation)]
        found = _narrowed(relation, (*[state[name] for name in names], *point))
        if found is None:
            return None
        for name, interval in zip(names, found, strict=False):
            if _narrower(interval, state[name]):
                state[name] = _both(interval, state[name])
                queue |= {position[id(r)]: None for r in touching[name] if r is not relation}
    return state


@functools.cache
def _variables(relation: Relation) -> tuple[str, ...]:
    """Return the cells of a relation, and its unknown if it has one."""
    return (*relation.addresses, *([relation.unknown.name] if relation.unknown else []))


def _narrower(new: Interval, old: Interval) -> bool:
    """Tell whether an interval shrank by enough to be worth telling the others."""
    if math.isinf(old[0]) or math.isinf(old[1]):
        return new != old and not (new[0] <= old[0] and new[1] >= old[1])
    return (old[1] - old[0]) - (new[1] - new[0]) > 1e-6 * (old[1] - old[0])


def _both(one: Interval, two: Interval) -> Interval:
    return max(one[0], two[0]), min(one[1], two[1])
