"""Examine the relations of a table: which agree, which only through rounding, which contradict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from reproduce.audit.relation import Relation, Unknown
from reproduce.audit.rounding import (
    ROUNDINGS,
    RoundingRule,
    Sheet,
    allowed,
    last_digit,
    rules_that_print,
)
from reproduce.audit.solve import NOISE, contract, printed_intervals, projection
from reproduce.printed.number import Interval
from reproduce.printed.units import si_factor

RelationOutcome = Literal["agrees", "agrees only through rounding", "contradicts"]
OUTCOMES: tuple[RelationOutcome, ...] = ("agrees", "agrees only through rounding", "contradicts")
_NEAREST = frozenset({"half-up", "half-even"})
_OTHER_RULES: tuple[RoundingRule, ...] = ("truncation", "ceiling")


@dataclass(frozen=True)
class Examined:
    """What became of one relation.

    `left` and `right` are its sides with the printed values inserted, in SI; NaN with an unknown
    that nothing fixes. `rules` are the rounding rules that turn the right side into the printed
    result. `rescued_by` is the rule that lifts a contradiction if all numbers were rounded by it.
    """

    relation: Relation
    outcome: RelationOutcome
    left: float
    right: float
    rules: frozenset[str] = frozenset()
    rescued_by: str = ""


@dataclass(frozen=True)
class Agreement:
    """What the relations say of a number that is not printed, in SI.

    `by_relation` has the interval that each allows on its own, empty ones left out; `common` the
    values that the largest agreeing set allows, and `members` the relations of that set. Where
    several sets are largest, the members are those in all of them.
    """

    unknown: Unknown
    by_relation: dict[str, Interval]
    common: Interval
    members: tuple[str, ...]

    @property
    def spread(self) -> float:
        """Largest less smallest central value of the relations, over their mean."""
        middles = [(low + high) / 2 for low, high in self.by_relation.values()]
        return (max(middles) - min(middles)) / (sum(middles) / len(middles))


def agreements(
    cells: Sheet, relations: Iterable[Relation], rule: RoundingRule = "nearest"
) -> dict[str, Agreement]:
    """Find, for each unknown by name, the largest set of relations that agree on one value."""
    groups: dict[Unknown, list[Relation]] = {}
    for relation in relations:
        if relation.unknown is not None:
            groups.setdefault(relation.unknown, []).append(relation)
    found = {}
    for unknown, group in groups.items():
        intervals = printed_intervals(cells, group, rule)
        allows = {r.name: own for r in group if (own := projection(r, intervals)) is not None}
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
    low, high = unknown.domain
    for name in shared:
        low, high = max(low, allows[name][0]), min(high, allows[name][1])
    return Agreement(unknown, allows, (low, high), tuple(n for n in allows if n in shared))


def contradicted(
    cells: Sheet, relations: Sequence[Relation], rule: RoundingRule = "nearest"
) -> frozenset[str]:
    """Return the names of the relations that cannot hold.

    A relation with an unknown cannot hold if it is outside the largest set that agrees on one
    value. Where several sets are largest, it cannot be said which is right, and the relations
    that are not in all of them count as contradicting.
    """
    shared = agreements(cells, relations, rule)
    intervals = printed_intervals(cells, relations, rule)

    def holds(relation: Relation) -> bool:
        if relation.kind == "print":
            return uniform(cells, relation)
        if relation.unknown is None:
            return contract(relation, intervals) is not None
        return relation.name in shared[relation.unknown.name].members

    return frozenset(relation.name for relation in relations if not holds(relation))


def uniform(cells: Sheet, relation: Relation) -> bool:
    """Tell whether a relation between last printed digits holds."""
    left, right = relation.sides({a: last_digit(cells[a]) for a in relation.addresses})
    return relation.missed_by(left, right) <= NOISE * max(abs(left), abs(right))


def by_value(relations: Iterable[Relation]) -> list[Relation]:
    """Return the relations between values, without those between last printed digits."""
    return [relation for relation in relations if relation.kind != "print"]


def examine(cells: Sheet, relations: Sequence[Relation]) -> list[Examined]:
    """Say of every relation, in order, whether it agrees, only through rounding, or contradicts."""
    wrong = contradicted(cells, relations)
    lifted = {rule: wrong - contradicted(cells, relations, rule) for rule in _OTHER_RULES}
    shared = agreements(cells, relations)
    findings = []
    for relation in relations:
        left, right = _sides(relation, cells, shared)
        rules = _rules(relation, cells, right)
        outcome: RelationOutcome = "contradicts"
        if relation.name not in wrong:
            plain = rules & _NEAREST or _agrees(relation, cells, left, right)
            outcome = "agrees" if plain else "agrees only through rounding"
        rescue = next((rule for rule, names in lifted.items() if relation.name in names), "")
        findings.append(Examined(relation, outcome, left, right, rules, rescue))
    return findings


def _sides(relation: Relation, cells: Sheet, shared: dict[str, Agreement]) -> tuple[float, float]:
    value = last_digit if relation.kind == "print" else lambda cell: cell.si
    values = {a: value(cells[a]) for a in relation.addresses}
    if relation.unknown is None:
        return relation.sides(values)
    agreement = shared[relation.unknown.name]
    if not agreement.members:
        return math.nan, math.nan
    return relation.sides(values, sum(agreement.common) / 2)


def _rules(relation: Relation, cells: Sheet, right: float) -> frozenset[str]:
    if relation.result is None or relation.kind == "print":
        return frozenset()
    printed = cells[relation.result]
    if printed.number.is_bound or printed.number.qualifier == "nominal":
        return frozenset()
    return rules_that_print(right / si_factor(printed.unit), printed.number)


def _agrees(relation: Relation, cells: Sheet, left: float, right: float) -> bool:
    """Tell whether the relation holds with the printed values inserted as they stand."""
    room = NOISE * max(abs(left), abs(right))
    if tolerance := relation.tolerance:
        room += tolerance.si if tolerance.unit else tolerance.si * abs(right)
    if relation.result is not None and cells[relation.result].number.qualifier == "about":
        low, high = allowed(cells[relation.result])
        room += (high - low) / 2
    return relation.missed_by(left, right) <= room


def rounding_votes(findings: Iterable[Examined]) -> dict[str, int]:
    """Count, over the results that tell them apart, how many each rounding rule prints.

    Results printed by all rules or by none are not counted.
    """
    telling = [f.rules for f in findings if f.rules and len(f.rules) < len(ROUNDINGS)]
    return {rule: sum(rule in rules for rules in telling) for rule in ROUNDINGS}
