"""Intervals through a formula, forwards and backwards, rounded outwards.

A formula becomes a row of steps, each of which makes one number of one or two others. Forwards, a
step encloses what its operands allow; backwards, it narrows its operands to what is left of its
result (HC4 in the words of interval analysis). Nothing is removed that could hold: a sum is rounded
by its own error, the ends of a product or quotient go one float outwards, and those of a function
by `_ROOM`.
"""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable, Sequence
from typing import Any

from reproduce.audit.formula import functions
from reproduce.audit.relation import Relation
from reproduce.printed.number import Interval

_INF = math.inf
EVERYTHING: Interval = (-_INF, _INF)
_TARGETS: dict[str, Interval] = {"=": (0.0, 0.0), "<=": (-_INF, 0.0), ">=": (0.0, _INF)}
_LARGEST, _SMALLEST = sys.float_info.max, math.ulp(0.0)
# Far more than a C library errs by, and than a root does whose exponent 1/n is rounded: no float
# has a logarithm above 745, and 745 / 3 half units of the last place are 3e-14.
_ROOM = 1e-13
_Found = Interval | None
_Pair = tuple[Interval, Interval] | None
_Step = tuple[
    Callable[[Interval, Interval], _Found], Callable[[Interval, Interval, Interval], _Pair]
]


def _ends(low: float, high: float) -> Interval:
    """Return an interval; what overflows is beyond the largest float, but not infinite."""
    return low if low < _LARGEST else _LARGEST, high if high > -_LARGEST else -_LARGEST


def _out(low: float, high: float) -> Interval:
    return _ends(low and math.nextafter(low, -_INF), high and math.nextafter(high, _INF))


def _loose(low: float, high: float) -> Interval:
    return _ends(low * (1 - math.copysign(_ROOM, low)), high * (1 + math.copysign(_ROOM, high)))


def meet(one: Interval, two: Interval) -> _Found:
    """Return what two intervals share, or None."""
    low = one[0] if one[0] > two[0] else two[0]
    high = one[1] if one[1] < two[1] else two[1]
    return (low, high) if low <= high else None


def _hull(within: Interval, parts: Sequence[Interval]) -> _Found:
    if len(parts) == 1:
        return meet(within, parts[0])
    met = [found for part in parts if (found := meet(within, part))]
    return (min(low for low, _ in met), max(high for _, high in met)) if met else None


def _both(x: _Found, y: _Found) -> _Pair:
    return (x, y) if x and y else None


def _sum(p: float, q: float, towards: float) -> float:
    """Add, and round towards one side by the error of the sum (Knuth's TwoSum)."""
    total = p + q
    part = total - p
    error = (p - (total - part)) + (q - part)
    return math.nextafter(total, towards) if error * towards > 0 else total


def _add(x: Interval, y: Interval) -> Interval:
    return _ends(_sum(x[0], y[0], -_INF), _sum(x[1], y[1], _INF))


def _subtract(x: Interval, y: Interval) -> Interval:
    return _ends(_sum(x[0], -y[1], -_INF), _sum(x[1], -y[0], _INF))


def _product(p: float, q: float) -> float:
    """Multiply two ends; nought times infinity is nought, and what underflows is not."""
    return p and q and (p * q or math.copysign(_SMALLEST, p * q))


def _quotient(p: float, q: float) -> float:
    return p and math.isfinite(q) and (p / q or math.copysign(_SMALLEST, p / q))


def _multiply(x: Interval, y: Interval) -> Interval:
    if x[0] > 0 and y[0] > 0:
        return _out(_product(x[0], y[0]), _product(x[1], y[1]))
    ends = [_product(p, q) for p in x for q in y]
    return _out(min(ends), max(ends))


def _quotients(x: Interval, y: Interval) -> list[Interval]:
    """Return the values of x / y: in two intervals where nought is inside y but not in x."""
    (low, high), (start, end) = x, y
    if low > 0 and start > 0:
        return [_out(_quotient(low, end), _quotient(high, start))]
    if start > 0 or end < 0:
        ends = [_quotient(p, q) for p in x for q in y]
        return [_out(min(ends), max(ends))]
    if low <= 0 <= high:
        return [EVERYTHING]
    if high < 0:
        low, start, end = -high, -end, -start
    below = [(-_INF, _out(0.0, _quotient(low, start))[1])] if start < 0 else []
    above = [(_out(_quotient(low, end), 0.0)[0], _INF)] if end > 0 else []
    return below + above


def _lesser(z: Interval, x: Interval, y: Interval) -> _Pair:
    """Narrow two numbers by the lesser of them: one alone is it if the other lies above."""
    alone, other = z[1] if y[0] > z[1] else _INF, z[1] if x[0] > z[1] else _INF
    return _both(meet(x, (z[0], alone)), meet(y, (z[0], other)))


_TWO: dict[str, _Step] = {
    "add": (_add, lambda z, x, y: _both(meet(x, _subtract(z, y)), meet(y, _subtract(z, x)))),
    "sub": (_subtract, lambda z, x, y: _both(meet(x, _add(z, y)), meet(y, _subtract(x, z)))),
    "mul": (
        _multiply,
        lambda z, x, y: _both(_hull(x, _quotients(z, y)), _hull(y, _quotients(z, x))),
    ),
    "truediv": (
        lambda x, y: _hull(EVERYTHING, _quotients(x, y)),
        lambda z, x, y: _both(meet(x, _multiply(z, y)), _hull(y, _quotients(x, z))),
    ),
    "min": (lambda x, y: (min(x[0], y[0]), min(x[1], y[1])), _lesser),
}


def _rising(
    function: Callable[[float], float],
    inverse: Callable[[float], float],
    domain: Interval = EVERYTHING,
    values: Interval = EVERYTHING,
) -> _Step:
    """Return the step of a function that rises over its domain from end to end of its values."""

    def forwards(x: Interval, _: Interval) -> _Found:
        inside = meet(x, domain)
        return inside and meet(_loose(function(inside[0]), function(inside[1])), values)

    def backwards(z: Interval, x: Interval, _: Interval) -> _Pair:
        left = meet(z, values)
        if left is None:
            return None
        low = domain[0] if left[0] <= values[0] else inverse(left[0])
        high = domain[1] if left[1] >= values[1] else inverse(left[1])
        inside = meet(x, domain)
        narrowed = inside and meet(inside, _loose(low, high))
        return _both(narrowed, narrowed)

    return forwards, backwards


def _turning(
    function: Callable[[float], float],
    inverse: Callable[[float], float],
    values: Interval,
    sign: int,
) -> _Step:
    """Return the step of a function that rises over half a turn, and repeats it times `sign`."""
    half = math.pi / 2
    rises, narrows = _rising(function, inverse, (-half, half), values)

    def branch(x: Interval) -> tuple[Interval, Interval, bool] | None:
        turns = round((x[0] + x[1]) / math.tau) if math.isfinite(x[1] - x[0]) else 0
        moved = _loose(turns * math.pi, turns * math.pi)
        at = _subtract(x, moved) if turns else x
        return (at, moved, sign < 0 and turns % 2 == 1) if max(-at[0], at[1]) <= half else None

    def forwards(x: Interval, _: Interval) -> _Found:
        found = branch(x)
        if found is None:
            return values
        z = rises(found[0], found[0])
        return (-z[1], -z[0]) if z and found[2] else z

    def backwards(z: Interval, x: Interval, _: Interval) -> _Pair:
        found = branch(x)
        if found is None:
            return x, x
        pair = narrows((-z[1], -z[0]) if found[2] else z, found[0], found[0])
        narrowed = pair and meet(x, _add(pair[0], found[1]))
        return _both(narrowed, narrowed)

    return forwards, backwards


@functools.cache
def _power(exponent: int, absolute: bool = False) -> _Step:
    """Return the step of a power, or of a power of the absolute value."""
    widened = _ends if exponent == 1 else _loose

    def power(value: float) -> float:
        return math.prod([value] * exponent)

    def root(value: float) -> float:
        return math.copysign(abs(value) ** (1 / exponent), value)

    def forwards(x: Interval, _: Interval) -> Interval:
        near, far = sorted(map(abs, x))
        return widened(0.0 if x[0] <= 0 <= x[1] else power(near), power(far))

    def backwards(z: Interval, x: Interval, _: Interval) -> _Pair:
        if z[1] < 0:
            return None
        low, high = widened(root(max(z[0], 0.0)), root(z[1]))
        narrowed = _hull(x, ((-high, -low), (low, high)))
        return _both(narrowed, narrowed)

    return _rising(power, root) if exponent % 2 and not absolute else (forwards, backwards)


_ONE: dict[str, _Step] = {
    "abs": _power(1, absolute=True),
    "sqrt": _rising(math.sqrt, lambda z: z * z, (0.0, _INF), (0.0, _INF)),
    "atan": _rising(math.atan, math.tan, values=(-math.pi / 2, math.pi / 2)),
    "tan": _turning(math.tan, math.atan, EVERYTHING, 1),
    "sin": _turning(math.sin, math.asin, (-1.0, 1.0), -1),
}


class _Steps:
    """The intervals of a formula's numbers before any step, and the steps between them."""

    def __init__(self, size: int) -> None:
        self.start: list[Interval] = [EVERYTHING] * size
        self.steps: list[tuple[_Step, int, int, int]] = []

    def further(self, step: _Step, x: Any, y: Any) -> _Number:
        """Take one step more, from numbers of the formula or plain ones."""
        one, two = self._place(x), self._place(y)
        self.start.append(EVERYTHING)
        self.steps.append((step, len(self.start) - 1, one, two))
        return _Number(self, len(self.start) - 1)

    def _place(self, operand: Any) -> int:
        if isinstance(operand, _Number):
            return operand.at
        self.start.append(operand if isinstance(operand, tuple) else (operand, operand))
        return len(self.start) - 1

    def functions(self) -> dict[str, Any]:
        """Return the functions that a formula may name."""
        one = {name: lambda x, s=step: self.further(s, x, x) for name, step in _ONE.items()}
        quarter = _loose(math.pi / 2, math.pi / 2)
        least = functools.partial(self.further, _TWO["min"])
        others: dict[str, Callable[..., Any]] = {
            "cos": lambda x: one["sin"](self.further(_TWO["add"], x, quarter)),
            "min": least,
            "max": lambda x, y: -least(-x, -y),
        }
        return functions({**one, **others})


class _Number:
    """The place of a number among the steps; arithmetic with it takes one step more."""

    def __init__(self, steps: _Steps, at: int) -> None:
        self.steps, self.at = steps, at

    def __neg__(self) -> _Number:
        return self.steps.further(_TWO["sub"], 0.0, self)

    def __pow__(self, exponent: int) -> _Number:
        return self.steps.further(_power(exponent), self, self)


def _operator(name: str, reflected: bool) -> Callable[[_Number, Any], _Number]:
    def operate(self: _Number, other: Any) -> _Number:
        if name == "mul" and isinstance(other, _Number) and other.at == self.at:
            return self.steps.further(_power(2), self, self)
        return self.steps.further(_TWO[name], *((other, self) if reflected else (self, other)))

    return operate


for _name in ("add", "sub", "mul", "truediv"):
    setattr(_Number, f"__{_name}__", _operator(_name, reflected=False))
    setattr(_Number, f"__r{_name}__", _operator(_name, reflected=True))


@functools.lru_cache(maxsize=5_000)
def contractor(relation: Relation) -> Callable[[tuple[Interval, ...]], list[Interval] | None]:
    """Compile a relation to a function that narrows intervals.

    It takes one interval for each address, then one for the unknown and one for the departure that
    the tolerance allows; it returns them narrowed, or None if nothing is left.
    """
    size = len(relation.addresses) + 2
    steps = _Steps(size)
    numbers: list[Any] = [_Number(steps, at) for at in range(size)]
    *cells, unknown, departure = numbers
    values = relation.values(dict(zip(relation.addresses, cells, strict=True)), unknown)
    formula, known = relation.formula, steps.functions()
    left, right = formula.left(values, known), formula.right(values, known)
    relative = relation.tolerance is not None and relation.tolerance.unit is None
    right = right * (1 + departure) if relative else right + departure
    gap = steps.further(_TWO["sub"], left, right).at
    target = _TARGETS[formula.sign]

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
