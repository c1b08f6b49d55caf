"""Outcome of every relation of a paper: agreement or contradiction."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Literal, NamedTuple

from reproduce.consistency._relation import Relation, Sheet
from reproduce.printed.corners import corner_intervals
from reproduce.printed.number import Interval, PrintedNumber

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
# Address to low end, printed value and high end, in SI units.
_Ends = dict[str, tuple[float, float, float]]


def _rounding_interval(number: PrintedNumber, rule: str = "") -> Interval:
    """Return the values that a number stands for, in the printed unit; a bound is a point.

    The default is rounding to the nearest digit, with the tolerance of a qualifier. The rule
    ``digits`` ignores *about* and *nominal*, and ``exact`` ignores rounding. ``truncation`` and
    ``ceiling`` apply to numbers without a qualifier.
    """
    value, step, half = number.value, 2 * number.half_unit, number.half_width
    match rule, number.qualifier:
        case "exact", _:
            half = 0.0
        case "digits", _ if not number.is_bound:
            half = number.half_unit
        case "truncation", "":
            return value - step * (value <= 0), value + step * (value >= 0)
        case "ceiling", "":
            return value - step, value
    return value - half, value + half


def _ends(relation: Relation, cells: Sheet, rule: str = "") -> _Ends:
    """Return the ends of the numbers of a relation, and of its tolerance as a multiple of it.

    The rules ``digits`` and ``exact`` ignore the tolerance.
    The number of a relation of kind ``print`` is one unit of the last printed digit.
    """
    tolerance = float(rule not in {"digits", "exact"})
    ends = {_TOLERANCE: (-tolerance, 0.0, tolerance)}
    for address in relation.addresses:
        number, unit = cells[address].number, cells[address].si_unit
        value, (low, high) = number.value, _rounding_interval(number, rule)
        if relation.kind == "print":
            low = value = high = 10.0**number.exponent
        inner = _END_RATIO * (high - low) * relation.repeats
        room = _SLACK_RATIO * max(abs(low), abs(high)) - inner
        ends[address] = unit * (low - room), unit * value, unit * (high + room)
    return ends


class RelationResult(NamedTuple):
    """The result for one relation.

    `left` and `right` are its sides with the printed values inserted, in SI, and with the middle of
    the common values of its unknown. `rescued_by` is the rounding rule that lifts a contradiction
    if all numbers were rounded by it. `allowed` is the interval of the values of its unknown that
    it allows, in SI, or None.
    """

    relation: Relation
    outcome: RelationOutcome
    left: float
    right: float
    rescued_by: str
    allowed: Interval | None


class _Agreement(NamedTuple):
    """Values of a number that is not printed, from the relations that contain it, in SI.

    `by_relation` has the interval that each relation allows, without empty intervals. `common` has
    the values that the largest agreeing set allows, and `members` the relations of this set. If
    several sets are largest, the members are the relations that all of these sets contain. Without
    members, all values of the domain are common.
    """

    by_relation: dict[str, Interval]
    common: Interval
    members: Collection[str]


def _gaps(
    relation: Relation,
    ends: _Ends,
    sides: Mapping[str, int],
    unknown: float,
) -> dict[str, float]:
    """Return left minus right in SI, with inputs at the ends of their intervals."""
    values = {
        address: three[sides.get(address, 0) + 1] for address, three in ends.items()
    }
    _, right, *lefts = relation.values(values, unknown)
    if relation.tolerance:
        right += values[_TOLERANCE] * relation.tolerance.of(right)
    return {str(i): left - right for i, left in enumerate(lefts)}


def _contradicts(relation: Relation, ends: _Ends, unknown: float = math.nan) -> bool:
    """Return whether no values within the ends satisfy a relation, for a value of its unknown."""
    gaps = corner_intervals(lambda sides: _gaps(relation, ends, sides, unknown), ends)
    return any(
        (math.isnan(low) and math.isnan(high))  # such as a root of a negative number
        or (low > 0 and relation.formula.sign != ">=")
        or (high < 0 and relation.formula.sign != "<=")
        for low, high, _ in gaps.values()
    )


def _projection(relation: Relation, domain: Interval, ends: _Ends) -> Interval:
    """Return the values of its unknown that a relation allows; low > high if none."""
    from scipy.optimize import brentq  # loaded only for a relation with an unknown

    low, high = domain

    def root(sides: Mapping[str, int]) -> dict[str, float]:
        def gap(value: float) -> float:
            return _gaps(relation, ends, sides, value)["0"]

        first, last = gap(low), gap(high)
        if first * last > 0:  # the root is outside of the domain
            return {"root": -math.inf if abs(first) < abs(last) else math.inf}
        return {"root": brentq(gap, low, high, xtol=1e-300)}

    least, greatest, _ = corner_intervals(root, ends)["root"]
    return max(least, low), min(greatest, high)


def _agreements(
    cells: Sheet, relations: Sequence[Relation], rule: str = ""
) -> dict[str, _Agreement]:
    """Return the largest set of relations that agree on one value, for each unknown by name."""
    found = {}
    for unknown in dict.fromkeys(r.unknown for r in relations if r.unknown):
        allowed = {
            relation.name: (low, high)
            for relation in relations
            if relation.unknown == unknown
            for low, high in [
                _projection(relation, unknown.domain, _ends(relation, cells, rule))
            ]
            if low <= high
        }
        # One of the largest overlaps starts at each lower end.
        overlaps = [
            {name for name, (low, high) in allowed.items() if low <= start <= high}
            for start, _ in allowed.values()
        ]
        size = max(map(len, overlaps), default=0)
        shared = set(allowed).intersection(*(o for o in overlaps if len(o) == size))
        members = {name: one for name, one in allowed.items() if name in shared}
        lows, highs = zip(unknown.domain, *members.values(), strict=True)
        common = max(lows), min(highs)
        found[unknown.name] = _Agreement(allowed, common, members)
    return found


def _contradicted(
    cells: Sheet, relations: Sequence[Relation], rule: str = ""
) -> set[str]:
    """Return the names of the relations that cannot hold if all numbers follow a rounding rule.

    A relation with an unknown cannot hold if it is outside of the largest set that agrees on one
    value. If several sets are largest, it cannot be decided which set is right, and the relations
    that are not in all of them count as contradicting.
    """
    shared = _agreements(cells, relations, rule)
    return {
        relation.name
        for relation in relations
        if (
            relation.name not in shared[relation.unknown.name].members
            if relation.unknown
            else _contradicts(relation, _ends(relation, cells, rule))
        )
    }


def examine(cells: Sheet, relations: Sequence[Relation]) -> list[RelationResult]:
    """Return the outcome of every relation, in order.

    A relation agrees only within a tolerance if it contradicts without its tolerance, and with
    *about* and *nominal* numbers that stand for their rounding only.
    """
    wrong = _contradicted(cells, relations)
    # The first of two rules that lift a contradiction is the last one here.
    rescued_by = {
        name: rule
        for rule in reversed(_OTHER_RULES)
        for name in wrong - _contradicted(cells, relations, rule)
    }
    beyond_rounding = _contradicted(cells, relations, "digits")
    shared, results = _agreements(cells, relations), []
    for relation in relations:
        unknown, allowed = math.nan, None
        if relation.unknown:
            agreement = shared[relation.unknown.name]
            unknown = sum(agreement.common) / 2
            allowed = agreement.by_relation.get(relation.name)
        # An equation need only give the printed digits of its result.
        ends = _ends(relation, cells, "exact")
        if relation.result:
            ends[relation.result] = _ends(relation, cells, "digits")[relation.result]
        values = {address: value for address, (_, value, _) in ends.items()}
        left, right, *_ = relation.values(values, unknown)
        outcome: RelationOutcome = "agrees only through rounding"
        if relation.name in wrong:
            outcome = "contradicts"
        elif not _contradicts(relation, ends, unknown):
            outcome = "agrees"
        elif relation.name in beyond_rounding:
            outcome = "agrees only within a tolerance"
        rule = rescued_by.get(relation.name, "")
        results.append(RelationResult(relation, outcome, left, right, rule, allowed))
    return results
