"""Outcome of every relation of a paper: agreement or contradiction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from reproduce.consistency.relation import Relation, Sheet, Unknown
from reproduce.printed.cells import PrintedCell
from reproduce.printed.corners import corner_intervals
from reproduce.printed.number import Interval, PrintedNumber, si_factor

# Floating-point noise between the two sides of a relation, as a fraction of them.
_NOISE_RATIO = 1e-9
# Fraction by which binary arithmetic may move the end of an interval.
_SLACK_RATIO = 1e-12
# Two intervals of one printed number touch at an end, or have at least half a unit of the finer
# number in common. This fraction of the interval distinguishes the two cases.
_END_RATIO = 1e-3
# Name of the tolerance among the inputs of a relation.
_TOLERANCE = "tolerance"
# Rules by which a paper may have rounded, besides rounding to the nearest digit.
_OTHER_RULES = ("truncation", "ceiling")
RelationOutcome = Literal[
    "agrees",
    "agrees only through rounding",
    "agrees only within a tolerance",
    "contradicts",
]
OUTCOMES: tuple[RelationOutcome, ...] = get_args(RelationOutcome)
# Address to low end, printed value and high end, in SI units.
_Ends = Mapping[str, tuple[float, float, float]]


def _rounding_interval(number: PrintedNumber, rule: str = "") -> Interval:
    """Return the values that a number stands for, in the printed unit; a bound is a point.

    The default is rounding to the nearest digit, with the tolerance of a qualifier. The rule
    ``digits`` ignores *about* and *nominal*. ``truncation`` and ``ceiling`` apply to numbers
    without a qualifier.
    """
    value, step = number.value, 2 * number.half_unit
    below = above = number.half_width
    if rule == "digits" and not number.is_bound:
        below = above = number.half_unit
    elif rule == "truncation" and not number.qualifier:
        below, above = step * (value <= 0), step * (value >= 0)
    elif rule == "ceiling" and not number.qualifier:
        below, above = step, 0.0
    return value - below, value + above


def _ends(cells: Sheet, rule: str) -> _Ends:
    ends = {}
    for address, cell in cells.items():
        factor = si_factor(cell.unit)
        low, high = (factor * end for end in _rounding_interval(cell.number, rule))
        slack = _SLACK_RATIO * max(abs(low), abs(high))
        ends[address] = (low - slack, cell.si, high + slack)
    return ends


def _last_digit(cell: PrintedCell) -> float:
    """Return one unit of the last printed digit, in SI units; one for a count."""
    return 10.0**cell.number.exponent * si_factor(cell.unit)


@dataclass(frozen=True)
class RelationResult:
    """The result for one relation.

    `left` and `right` are its sides with the printed values inserted, in SI; NaN with an unknown
    that nothing fixes. `rescued_by` is the rounding rule that lifts a contradiction if all numbers
    were rounded by it.
    """

    relation: Relation
    outcome: RelationOutcome
    left: float
    right: float
    rescued_by: str = ""


@dataclass(frozen=True)
class Agreement:
    """Values of a number that is not printed, from the relations that contain it, in SI.

    `by_relation` has the interval that each relation allows, without empty intervals. `common` has
    the values that the largest agreeing set allows, and `members` the relations of this set. If
    several sets are largest, the members are the relations that all of these sets contain.
    """

    unknown: Unknown
    by_relation: dict[str, Interval]
    common: Interval
    members: tuple[str, ...]


def _gaps(
    relation: Relation,
    ends: _Ends,
    sides: Mapping[str, float],
    unknown: float = math.nan,
) -> dict[str, float]:
    """Return left minus right in SI, with inputs at the ends of their intervals."""
    values = {}
    for address in relation.addresses:
        low, printed, high = ends[address]
        inner = _END_RATIO * (high - low) * relation.repeats
        side = sides.get(address, 0.0)
        values[address] = (printed, high - inner, low + inner)[int(side)]
    _, right, *lefts = relation.values(values, unknown)
    if relation.tolerance:
        right += sides.get(_TOLERANCE, 0.0) * relation.tolerance.of(right)
    return {str(i): left - right for i, left in enumerate(lefts)}


def _contradicts(relation: Relation, ends: _Ends) -> bool:
    """Return whether no values within the ends satisfy a relation without an unknown."""
    inputs = (*relation.addresses, _TOLERANCE)
    gaps = corner_intervals(lambda sides: _gaps(relation, ends, sides), inputs)
    return any(
        (math.isnan(low) and math.isnan(high))  # such as a root of a negative number
        or (low > 0 and relation.formula.sign != ">=")
        or (high < 0 and relation.formula.sign != "<=")
        for low, high, _ in gaps.values()
    )


def _projection(relation: Relation, domain: Interval, ends: _Ends) -> Interval:
    """Return the part of the domain of its unknown that a relation allows; low > high if none."""
    from scipy.optimize import brentq  # loaded only for a relation with an unknown

    low, high = domain

    def root(sides: Mapping[str, float]) -> dict[str, float]:
        def gap(unknown: float) -> float:
            return _gaps(relation, ends, sides, unknown)["0"]

        first, last = gap(low), gap(high)
        if first * last > 0:  # the root is outside of the domain
            return {"root": -math.inf if abs(first) < abs(last) else math.inf}
        return {"root": float(brentq(gap, low, high, xtol=1e-300))}

    corners = corner_intervals(root, (*relation.addresses, _TOLERANCE))["root"]
    return max(corners.low, low), min(corners.high, high)


def agreements(
    cells: Sheet, relations: Sequence[Relation], rule: str = ""
) -> dict[str, Agreement]:
    """Return the largest set of relations that agree on one value, for each unknown by name."""
    ends, found = _ends(cells, rule), dict[str, Agreement]()
    for unknown in {r.unknown.name: r.unknown for r in relations if r.unknown}.values():
        allowed = {
            relation.name: _projection(relation, unknown.domain, ends)
            for relation in relations
            if relation.unknown == unknown
        }
        possible = {name: one for name, one in allowed.items() if one[0] <= one[1]}
        found[unknown.name] = _largest_agreement(unknown, possible)
    return found


def _largest_agreement(unknown: Unknown, allowed: dict[str, Interval]) -> Agreement:
    """Return the relations that every largest overlap contains; one starts at each lower end."""
    overlaps = [
        {name for name, (low, high) in allowed.items() if low <= start <= high}
        for start, _ in allowed.values()
    ]
    size = max(map(len, overlaps), default=0)
    shared = {*allowed}.intersection(*(one for one in overlaps if len(one) == size))
    members = tuple(name for name in allowed if name in shared)
    lows, highs = zip(unknown.domain, *(allowed[name] for name in members), strict=True)
    return Agreement(unknown, allowed, (max(lows), min(highs)), members)


def contradicted(
    cells: Sheet, relations: Sequence[Relation], rule: str = ""
) -> frozenset[str]:
    """Return the names of the relations that cannot hold if all numbers follow a rounding rule.

    A relation with an unknown cannot hold if it is outside of the largest set that agrees on one
    value. If several sets are largest, it cannot be decided which set is right, and the relations
    that are not in all of them count as contradicting.
    """
    ends, shared = _ends(cells, rule), agreements(cells, relations, rule)

    def holds(relation: Relation) -> bool:
        if relation.kind == "print":
            return _agrees(relation, cells, *_sides(relation, cells, shared))
        if relation.unknown is None:
            return not _contradicts(relation, ends)
        return relation.name in shared[relation.unknown.name].members

    return frozenset(relation.name for relation in relations if not holds(relation))


def examine(cells: Sheet, relations: Sequence[Relation]) -> list[RelationResult]:
    """Return the outcome of every relation, in order.

    A relation agrees only within a tolerance if it contradicts without its tolerance, and with
    *about* and *nominal* numbers that stand for their rounding only.
    """
    wrong = contradicted(cells, relations)
    rescues = {
        rule: wrong - contradicted(cells, relations, rule) for rule in _OTHER_RULES
    }
    strict = [r.model_copy(update={"tolerance": None}) for r in relations]
    beyond_rounding = contradicted(cells, strict, "digits")
    shared, results = agreements(cells, relations), []
    for relation in relations:
        left, right = _sides(relation, cells, shared)
        outcome: RelationOutcome = "agrees only through rounding"
        if relation.name in wrong:
            outcome = "contradicts"
        elif _agrees(relation, cells, left, right):
            outcome = "agrees"
        elif relation.name in beyond_rounding:
            outcome = "agrees only within a tolerance"
        rule = next((r for r in _OTHER_RULES if relation.name in rescues[r]), "")
        results.append(RelationResult(relation, outcome, left, right, rule))
    return results


def _sides(
    relation: Relation, cells: Sheet, shared: Mapping[str, Agreement]
) -> tuple[float, float]:
    """Return both sides with the printed values inserted, or with the last digits."""
    value = _last_digit if relation.kind == "print" else lambda cell: cell.si
    unknown = 0.0
    if relation.unknown is not None:
        agreement = shared[relation.unknown.name]
        unknown = sum(agreement.common) / 2 if agreement.members else math.nan
    values = {address: value(cells[address]) for address in relation.addresses}
    left, right, *_ = relation.values(values, unknown)
    return float(left), float(right)


def _agrees(relation: Relation, cells: Sheet, left: float, right: float) -> bool:
    """Return whether the relation holds with the printed values inserted, without tolerances.

    An equation need only give the printed digits of its result.
    """
    room = _NOISE_RATIO * max(abs(left), abs(right))
    if relation.result is not None and relation.kind != "print":
        cell = cells[relation.result]
        low, high = _rounding_interval(cell.number, "digits")
        room += (high - low) / 2 * si_factor(cell.unit)
    return relation.missed_by(left, right) <= room
