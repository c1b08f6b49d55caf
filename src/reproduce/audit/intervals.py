"""Intervals through relations, forwards and backwards, rounded outwards.

A formula becomes a row of steps, each of which makes one number of one or two others. Forwards, a
step encloses what its operands allow; backwards, it narrows its operands to what is left of its
result (HC4 in the words of interval analysis). What is removed cannot hold: an empty result proves
that no values which print as they do keep the relation. An angle whose tangent or sine is taken
lies within a quarter of a turn.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from reproduce.audit.relation import Relation, Sheet, functions
from reproduce.printed.number import Interval

_INF = math.inf
EVERYTHING: Interval = (-_INF, _INF)
_POINT: Interval = (0.0, 0.0)
_POSITIVE: Interval = (0.0, _INF)
_TARGETS: dict[str, Interval] = {"=": _POINT, "<=": (-_INF, 0.0), ">=": _POSITIVE}
_QUARTER: Interval = (-math.pi / 2, math.pi / 2)
# Far more than a C library errs by, and than a root does whose exponent is rounded.
_ROOM = 1e-13
# Interval ends in binary may miss a decimal tie by one unit in the last place; without this the
# last bit would decide.
_SLACK = 1e-12
# Two intervals of print meet at an end, or share at least half a unit of the finer print; this
# share of them tells the two cases apart whatever the noise of binary arithmetic.
_END = 1e-3
# Two relations can pass ever smaller gains back and forth; whoever stops here has not been refuted.
_VISITS = 5_000
_Found = Interval | None
_Pair = tuple[Interval, Interval] | None
_Step = tuple[
    Callable[[Interval, Interval], _Found], Callable[[Interval, Interval, Interval], _Pair]
]


def meet(one: Interval, two: Interval) -> _Found:
    """Return what two intervals share, or None."""
    low = one[0] if one[0] > two[0] else two[0]
    high = one[1] if one[1] < two[1] else two[1]
    return (low, high) if low <= high else None


def _widened(interval: Interval, share: float = _SLACK) -> Interval:
    """Widen an interval by the noise of binary arithmetic."""
    low, high = interval
    return low - share * abs(low), high + share * abs(high)


def _hull(within: Interval, parts: Sequence[Interval]) -> _Found:
    met = [found for part in parts if (found := meet(within, part))]
    return (min(low for low, _ in met), max(high for _, high in met)) if met else None


def _both(x: _Found, y: _Found) -> _Pair:
    return (x, y) if x and y else None


def _out(low: float, high: float) -> Interval:
    """Round outwards; nought stays nought."""
    return low and math.nextafter(low, -_INF), high and math.nextafter(high, _INF)


def _sum(p: float, q: float, towards: float) -> float:
    """Add, and round towards one side by the error of the sum (Knuth's TwoSum)."""
    total = p + q
    part = total - p
    error = (p - (total - part)) + (q - part)
    return math.nextafter(total, towards) if error * towards > 0 else total


def _add(x: Interval, y: Interval) -> Interval:
    return _sum(x[0], y[0], -_INF), _sum(x[1], y[1], _INF)


def _subtract(x: Interval, y: Interval) -> Interval:
    return _add(x, (-y[1], -y[0]))


def _multiply(x: Interval, y: Interval) -> Interval:
    ends = [p and q and p * q for p in x for q in y]  # nought times infinity is nought
    return _out(min(ends), max(ends))


def _quotients(x: Interval, y: Interval) -> list[Interval]:
    """Return the values of x / y: in two intervals where nought is inside y but not in x."""
    start, end = y
    if start > 0 or end < 0:
        return [_multiply(x, _out(1 / end, 1 / start))]
    if x[0] <= 0 <= x[1]:
        return [EVERYTHING]
    below = [_out(-_INF, 1 / start)] if start < 0 else []
    above = [_out(1 / end, _INF)] if end > 0 else []
    return [_multiply(x, part) for part in (*below, *above)]


def _lesser(z: Interval, x: Interval, y: Interval) -> _Pair:
    """Narrow two numbers by the lesser of them: one alone is it if the other lies above."""
    alone, other = z[1] if y[0] > z[1] else _INF, z[1] if x[0] > z[1] else _INF
    return _both(meet(x, (z[0], alone)), meet(y, (z[0], other)))


_ADD: _Step = (
    _add,
    lambda z, x, y: _both(meet(x, _subtract(z, y)), meet(y, _subtract(z, x))),
)
_SUBTRACT: _Step = (
    _subtract,
    lambda z, x, y: _both(meet(x, _add(z, y)), meet(y, _subtract(x, z))),
)
_MULTIPLY: _Step = (
    _multiply,
    lambda z, x, y: _both(_hull(x, _quotients(z, y)), _hull(y, _quotients(z, x))),
)
_DIVIDE: _Step = (
    lambda x, y: _hull(EVERYTHING, _quotients(x, y)),
    lambda z, x, y: _both(meet(x, _multiply(z, y)), _hull(y, _quotients(x, z))),
)
_LEAST: _Step = (lambda x, y: (min(x[0], y[0]), min(x[1], y[1])), _lesser)


def _rising(
    function: Callable[[float], float],
    inverse: Callable[[float], float],
    domain: Interval = EVERYTHING,
    values: Interval = EVERYTHING,
) -> _Step:
    """Return the step of a function that rises over its domain from end to end of its values."""

    def forwards(x: Interval, _: Interval) -> _Found:
        inside = meet(x, domain)
        ends = inside and _widened((function(inside[0]), function(inside[1])), _ROOM)
        return ends and meet(ends, values)

    def backwards(z: Interval, x: Interval, _: Interval) -> _Pair:
        left, inside = meet(z, values), meet(x, domain)
        if left is None or inside is None:
            return None
        low = domain[0] if left[0] <= values[0] else inverse(left[0])
        high = domain[1] if left[1] >= values[1] else inverse(left[1])
        narrowed = meet(inside, _widened((low, high), _ROOM))
        return _both(narrowed, narrowed)

    return forwards, backwards


def _size(x: Interval, _: Interval) -> Interval:
    near, far = sorted(map(abs, x))
    return (0.0 if x[0] <= 0 <= x[1] else near), far


def _of_size(z: Interval, x: Interval, _: Interval) -> _Pair:
    size = meet(z, _POSITIVE)
    narrowed = size and _hull(x, [(-size[1], -size[0]), size])
    return _both(narrowed, narrowed)


@functools.cache
def _power(exponent: int) -> _Step:
    return _rising(
        lambda x: math.prod([x] * exponent),
        lambda z: math.copysign(abs(z) ** (1 / exponent), z),
        *([EVERYTHING] * 2 if exponent % 2 else [_POSITIVE] * 2),
    )


_ONE: dict[str, _Step] = {
    "abs": (_size, _of_size),
    "sqrt": _rising(math.sqrt, lambda z: z * z, _POSITIVE, _POSITIVE),
    "atan": _rising(math.atan, math.tan, values=_QUARTER),
    "tan": _rising(math.tan, math.atan, _QUARTER),
    "sin": _rising(math.sin, math.asin, _QUARTER, (-1.0, 1.0)),
}


class _Steps:
    """The intervals of a formula's numbers before any step, and the steps between them."""

    def __init__(self, size: int) -> None:
        self.start: list[Interval] = [EVERYTHING] * size
        self.steps: list[tuple[_Step, int, int, int]] = []
        one = {name: functools.partial(self._twice, step) for name, step in _ONE.items()}
        self.functions = functions(
            {
                **one,
                "min": functools.partial(self.further, _LEAST),
                "max": lambda x, y: -self.further(_LEAST, -x, -y),
            }
        )

    def _twice(self, step: _Step, x: Any) -> _Number:
        return self.further(step, x, x)

    def further(self, step: _Step, x: Any, y: Any) -> _Number:
        """Take one step more, from numbers of the formula or plain ones."""
        one, two = self._place(x), self._place(y)
        self.start.append(EVERYTHING)
        self.steps.append((step, len(self.start) - 1, one, two))
        return _Number(self, len(self.start) - 1)

    def _place(self, operand: Any) -> int:
        if isinstance(operand, _Number):
            return operand.at
        self.start.append((operand, operand))
        return len(self.start) - 1


def _operator(step: _Step, reflected: bool = False) -> Callable[[_Number, Any], _Number]:
    def operate(self: _Number, other: Any) -> _Number:
        return self.steps.further(step, *((other, self) if reflected else (self, other)))

    return operate


class _Number:
    """The place of a number among the steps; arithmetic with it takes one step more."""

    def __init__(self, steps: _Steps, at: int) -> None:
        self.steps, self.at = steps, at

    __add__, __radd__ = _operator(_ADD), _operator(_ADD, True)
    __sub__, __rsub__ = _operator(_SUBTRACT), _operator(_SUBTRACT, True)
    __mul__, __rmul__ = _operator(_MULTIPLY), _operator(_MULTIPLY, True)
    __truediv__, __rtruediv__ = _operator(_DIVIDE), _operator(_DIVIDE, True)

    def __neg__(self) -> _Number:
        return 0.0 - self

    def __pow__(self, exponent: int) -> _Number:
        base = self if exponent % 2 else self.steps.functions["abs"](self)
        return self.steps.further(_power(exponent), base, base)


@functools.lru_cache(maxsize=5_000)
def _contractor(relation: Relation) -> Callable[[tuple[Interval, ...]], list[Interval] | None]:
    """Compile a relation to a function that narrows intervals.

    It takes one interval for each address, then one for the unknown and one for the departure that
    the tolerance allows; it returns them narrowed, or None if nothing is left.
    """
    size = len(relation.addresses) + 2
    steps = _Steps(size)
    numbers: list[Any] = [_Number(steps, at) for at in range(size)]
    *cells, unknown, departure = numbers
    values = relation.values(dict(zip(relation.addresses, cells, strict=True)), unknown)
    left, right = relation.formula.values(values, steps.functions)
    relative = relation.tolerance is not None and relation.tolerance.unit is None
    right = right * (1 + departure) if relative else right + departure
    gap, target = steps.further(_SUBTRACT, left, right).at, _TARGETS[relation.formula.sign]

    def contract(box: tuple[Interval, ...]) -> list[Interval] | None:
        at = [*box, *steps.start[size:]]
        for (forwards, _), z, x, y in steps.steps:
            found = forwards(at[x], at[y])
            if found is None:
                return None
            at[z] = found
        left = meet(at[gap], target)
        if left is None:
            return None
        at[gap] = left
        for (_, backwards), z, x, y in reversed(steps.steps):
            pair = backwards(at[z], at[x], at[y])
            if pair is None:
                return None
            at[x], at[y] = pair
        return at[:size]

    return contract


@functools.lru_cache(maxsize=200_000)
def _narrowed(relation: Relation, box: tuple[Interval, ...]) -> list[Interval] | None:
    """Narrow the variables of a relation, which come in their order."""
    room = relation.tolerance.si if relation.tolerance else 0.0
    point = [] if relation.unknown else [_POINT]
    return _contractor(relation)((*box, *point, (-room, room)))


def printed_intervals(cells: Sheet, relations: Iterable[Relation]) -> dict[str, Interval]:
    """Return the interval of print, in SI, for every cell of some relations."""
    return {a: cells[a].allowed for r in relations for a in r.addresses}


def contract(relation: Relation, intervals: Mapping[str, Interval]) -> dict[str, Interval] | None:
    """Narrow the intervals of a relation's cells to the values that can keep it.

    Address to narrowed interval, the unknown under its name; None if nothing is left.
    """
    box = [_met(intervals[a], relation.repeats) for a in relation.addresses]
    if relation.unknown is not None:
        box.append(relation.unknown.domain)
    found = _narrowed(relation, tuple(box))
    return None if found is None else dict(zip(relation.variables, found, strict=False))


def projection(relation: Relation, intervals: Mapping[str, Interval]) -> Interval | None:
    """Return the values of its unknown that a relation allows on its own; None without any."""
    found = contract(relation, intervals) if relation.unknown else None
    return found[relation.unknown.name] if found and relation.unknown else None


def _met(interval: Interval, repeated: bool) -> Interval:
    """Widen an interval of print, without its ends where one number is printed twice."""
    low, high = interval
    if repeated and math.isfinite(high - low):
        interval = low + _END * (high - low), high - _END * (high - low)
    return _widened(interval)


def propagate(
    relations: Iterable[Relation], intervals: Mapping[str, Interval]
) -> dict[str, Interval] | None:
    """Narrow all cells by all relations together, back and forth until nothing moves.

    Address (and name of unknown) to narrowed interval; None if they cannot all hold.
    """
    every = list(relations)
    repeated = {a for r in every if r.repeats for a in r.addresses}
    state = {a: _met(intervals[a], a in repeated) for r in every for a in r.addresses}
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
