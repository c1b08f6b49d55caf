"""Examine the relations of a paper: which agree, which contradict, and on what agreement rests.

Contradictions form groups, and sets of cells that cannot all be right.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from reproduce.audit.relation import Relation, Sheet, Unknown
from reproduce.printed.cells import Cell
from reproduce.printed.corners import Corners, corner_intervals
from reproduce.printed.number import Interval, PrintedNumber, si_factor

# Floating-point noise between the two sides of a relation, as a fraction of them.
_NOISE = 1e-9
# Fraction by which binary arithmetic may move the end of an interval.
_SLACK = 1e-12
# Two intervals of one printed number touch at an end, or share at least half a unit of the finer
# number. This fraction of the interval distinguishes the two cases.
_END = 1e-3
# Name of the tolerance among the inputs of a relation.
_TOLERANCE = "tolerance"
RelationOutcome = Literal[
    "agrees",
    "agrees only through rounding",
    "agrees only within a tolerance",
    "contradicts",
]
OUTCOMES: tuple[RelationOutcome, ...] = (
    "agrees",
    "agrees only through rounding",
    "agrees only within a tolerance",
    "contradicts",
)


@dataclass(frozen=True)
class _ByAnotherRule(PrintedNumber):
    """A number as if it had been rounded by another rule, which says to which sides it reaches."""

    sides: Callable[[float], tuple[bool, bool]] = lambda _: (True, True)

    @property
    def low(self) -> float:
        return self.value - 2 * self.half_unit * self.sides(self.value)[0]

    @property
    def high(self) -> float:
        return self.value + 2 * self.half_unit * self.sides(self.value)[1]


# What else a plain number may have been rounded by. Half up and half to even differ on a tie alone.
_OTHER_RULES: dict[str, Callable[[float], tuple[bool, bool]]] = {
    "truncation": lambda value: (value <= 0, value >= 0),
    "ceiling": lambda _: (True, False),
}


def _last_digit(cell: Cell) -> float:
    """Return one unit of the last printed digit, in SI units; one for a count."""
    return 10.0**cell.number.exponent * si_factor(cell.unit)


@dataclass(frozen=True)
class Examined:
    """What became of one relation.

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
    cells: Sheet,
    sides: Mapping[str, float],
    unknown: float = math.nan,
) -> dict[str, float]:
    """Return left minus right in SI, with inputs at the ends of their intervals."""
    values = {}
    for address in relation.addresses:
        low, high = cells[address].allowed
        inner = _END * (high - low) * relation.repeats
        low, high = low + inner - _SLACK * abs(low), high - inner + _SLACK * abs(high)
        values[address] = {-1.0: low, 1.0: high}.get(
            sides.get(address, 0.0), cells[address].si
        )
    right = relation.sides(values, unknown)[1]
    if (tolerance := relation.tolerance) and (side := sides.get(_TOLERANCE)):
        right += side * tolerance.si * (1.0 if tolerance.unit else right)
    lefts = relation.signed(values, unknown)
    return {str(i): left - right for i, left in enumerate(lefts)}


def _contradiction(relation: Relation, cells: Sheet) -> tuple[str, ...]:
    """Return the inputs that could reduce a contradiction; empty if the relation can hold."""
    inputs = (*relation.addresses, _TOLERANCE)
    if relation.unknown is not None:
        return () if _projection(relation, cells) else inputs
    found = corner_intervals(lambda sides: _gaps(relation, cells, sides), inputs)
    for low, high, moved in found.values():
        if math.isnan(low) and math.isnan(high):  # such as a root of a negative number
            return inputs
        if low > 0 and relation.formula.sign != ">=":
            return tuple(name for name, sides in moved.items() if sides[0])
        if high < 0 and relation.formula.sign != "<=":
            return tuple(name for name, sides in moved.items() if sides[1])
    return ()


def _projection(relation: Relation, cells: Sheet) -> Corners | None:
    """Return the interval of its unknown that a relation allows, in SI; None if it is empty."""
    if relation.unknown is None:
        return None
    from scipy.optimize import brentq  # loaded only for a relation with an unknown

    low, high = relation.unknown.domain

    def root(sides: Mapping[str, float]) -> dict[str, float]:
        gaps = [_gaps(relation, cells, sides, end)["0"] for end in (low, high)]
        if gaps[0] * gaps[1] > 0:  # the root is outside of the domain
            return {"root": -math.inf if abs(gaps[0]) < abs(gaps[1]) else math.inf}
        found = brentq(
            lambda u: _gaps(relation, cells, sides, u)["0"], low, high, xtol=1e-300
        )
        return {"root": float(found)}

    found = corner_intervals(root, (*relation.addresses, _TOLERANCE))["root"]
    shared = max(found.low, low), min(found.high, high)
    return Corners(*shared, found.sides) if shared[0] <= shared[1] else None


def agreements(cells: Sheet, relations: Iterable[Relation]) -> dict[str, Agreement]:
    """Find, for each unknown by name, the largest set of relations that agree on one value."""
    groups: dict[Unknown, list[Relation]] = {}
    for relation in relations:
        if relation.unknown is not None:
            groups.setdefault(relation.unknown, []).append(relation)
    found = {}
    for unknown, group in groups.items():
        allows = {
            r.name: own[:2] for r in group if (own := _projection(r, cells)) is not None
        }
        found[unknown.name] = _largest_agreement(unknown, allows)
    return found


def _largest_agreement(unknown: Unknown, allows: dict[str, Interval]) -> Agreement:
    """Slide over the lower ends: one of them lies in each largest overlap."""
    overlaps = [
        frozenset(n for n, (low, high) in allows.items() if low <= start <= high)
        for start, _ in allows.values()
    ]
    size = max(map(len, overlaps), default=0)
    largest = [overlap for overlap in overlaps if len(overlap) == size]
    shared = frozenset.intersection(*largest) if largest else frozenset()
    lows, highs = zip(unknown.domain, *(allows[name] for name in shared), strict=True)
    common = max(lows), min(highs)
    return Agreement(unknown, allows, common, tuple(n for n in allows if n in shared))


def contradicted(cells: Sheet, relations: Sequence[Relation]) -> frozenset[str]:
    """Return the names of the relations that cannot hold.

    A relation with an unknown cannot hold if it is outside the largest set that agrees on one
    value. Where several sets are largest, it cannot be said which is right, and the relations
    that are not in all of them count as contradicting.
    """
    shared = agreements(cells, relations)

    def holds(relation: Relation) -> bool:
        if relation.kind == "print":
            return _agrees(relation, cells, *_sides(relation, cells, shared))
        if relation.unknown is None:
            return not _contradiction(relation, cells)
        return relation.name in shared[relation.unknown.name].members

    return frozenset(relation.name for relation in relations if not holds(relation))


def examine(cells: Sheet, relations: Sequence[Relation]) -> list[Examined]:
    """Return the outcome of every relation, in order.

    A relation agrees only within a tolerance if it contradicts without its tolerance and if
    *about* and *nominal* stand for no more than the rounding of a number.
    """
    wrong = contradicted(cells, relations)
    narrow = _without_qualifiers(cells)
    strict = [replace(relation, tolerance=None) for relation in relations]
    beyond_rounding = contradicted(narrow, strict)
    lifted = {
        rule: wrong - contradicted(_printed_by(rule, cells), relations)
        for rule in _OTHER_RULES
    }
    shared = agreements(cells, relations)
    findings = []
    for relation, without in zip(relations, strict, strict=True):
        left, right = _sides(relation, cells, shared)
        outcome: RelationOutcome = "contradicts"
        if relation.name not in wrong:
            outcome = "agrees only through rounding"
            if _agrees(without, narrow, left, right):
                outcome = "agrees"
            elif relation.name in beyond_rounding:
                outcome = "agrees only within a tolerance"
        rescue = next(
            (rule for rule, names in lifted.items() if relation.name in names), ""
        )
        findings.append(Examined(relation, outcome, left, right, rescue))
    return findings


def _without_qualifiers(cells: Sheet) -> Sheet:
    """Return the sheet as if no number were qualified by about or nominal."""
    return {
        address: replace(cell, content=replace(cell.number, qualifier=None))
        if cell.number.qualifier in {"about", "nominal"}
        else cell
        for address, cell in cells.items()
    }


def _printed_by(rule: str, cells: Sheet) -> Sheet:
    """Return the sheet as if all plain numbers had been rounded by another rule."""
    sides, anew = _OTHER_RULES[rule], dict(cells)
    for address, cell in cells.items():
        if not cell.number.qualifier:
            number = _ByAnotherRule(cell.text, cell.number.exact, sides=sides)
            anew[address] = replace(cell, content=number)
    return anew


def _sides(
    relation: Relation, cells: Sheet, shared: dict[str, Agreement]
) -> tuple[float, float]:
    value = _last_digit if relation.kind == "print" else lambda cell: cell.si
    values = {a: value(cells[a]) for a in relation.addresses}
    if relation.unknown is None:
        return relation.sides(values)
    agreement = shared[relation.unknown.name]
    if not agreement.members:
        return math.nan, math.nan
    return relation.sides(values, sum(agreement.common) / 2)


def _agrees(relation: Relation, cells: Sheet, left: float, right: float) -> bool:
    """Tell whether the relation holds with the printed values inserted as they stand.

    An equation need only give the printed digits of its result.
    """
    room = _NOISE * max(abs(left), abs(right))
    if tolerance := relation.tolerance:
        room += tolerance.si if tolerance.unit else tolerance.si * abs(right)
    if relation.result is not None and relation.kind != "print":
        result = cells[relation.result]
        if result.number.qualifier != "nominal":
            room += result.number.reach * si_factor(result.unit)
    return relation.missed_by(left, right) <= room


def groups(cells: Sheet, relations: Sequence[Relation]) -> list[list[Relation]]:
    """Sort the contradictions into groups that share cells or unknowns."""
    wrong = contradicted(cells, relations)
    found: list[list[Relation]] = []
    for relation in (r for r in relations if r.name in wrong):
        shares = set(relation.variables)
        touching = [
            group for group in found if any(shares & set(r.variables) for r in group)
        ]
        found = [group for group in found if group not in touching]
        found.append([*itertools.chain.from_iterable(touching), relation])
    order = {relation.name: i for i, relation in enumerate(relations)}
    return sorted(
        (sorted(group, key=lambda r: order[r.name]) for group in found),
        key=lambda group: order[group[0].name],
    )


@dataclass(frozen=True)
class Conflict:
    """Addresses of cells that cannot all be right, and the names of the relations between them."""

    cells: tuple[str, ...]
    relations: tuple[str, ...]


def conflicts(
    cells: Sheet, relations: Sequence[Relation], joint: Sequence[Relation] = ()
) -> list[Conflict]:
    """Return sets of cells that cannot all be right, in order of their size.

    A relation that contradicts by itself gives one set: the cells that could reduce it. Relations
    that share an unknown conflict in pairs: intervals of one number have a common point if and only
    if every two of them have. `joint` contains the declared combinations of relations, each named
    after its parts.
    """
    wrong = contradicted(cells, relations)
    found = [
        Conflict((a, b), (r.name,))
        for r in relations
        if r.kind == "print" and r.name in wrong
        for a, b in itertools.combinations(r.addresses, 2)
        if _last_digit(cells[a]) != _last_digit(cells[b])
    ]
    for relation in (*relations, *joint):
        if relation.kind != "print" and (blamed := _contradiction(relation, cells)):
            own = tuple(a for a in relation.addresses if a in blamed)
            found.append(Conflict(own, tuple(relation.name.split(" + "))))
    asked = [(r, p) for r in relations if (p := _projection(r, cells)) is not None]
    for (one, a), (two, b) in itertools.combinations(asked, 2):
        if one.unknown is two.unknown and max(a.low, b.low) > min(a.high, b.high):
            both = dict.fromkeys(x for x in (*a.sides, *b.sides) if x != _TOLERANCE)
            found.append(Conflict(tuple(both), (one.name, two.name)))
    unique = {frozenset(conflict.cells): conflict for conflict in reversed(found)}
    return sorted(
        unique.values(), key=lambda conflict: (len(conflict.cells), conflict.cells)
    )
