"""Examine the relations of a table: which agree, which only through rounding, which contradict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from reproduce.audit.quantity import (
    ROUNDINGS,
    Interval,
    Rule,
    Sheet,
    allowed,
    rules_that_print,
)
from reproduce.audit.relation import Relation, Unknown
from reproduce.audit.solve import possible, projection, propagate
from reproduce.printed.units import si_factor

Outcome = Literal["agrees", "agrees only through rounding", "contradicts"]
OUTCOMES: tuple[Outcome, ...] = ("agrees", "agrees only through rounding", "contradicts")
_NEAREST = frozenset({"half-up", "half-even"})
# Plain floating-point noise between the two sides of an equation without a printed result.
_NOISE = 1e-9


@dataclass(frozen=True)
class Finding:
    """What became of one relation.

    Parameters
    ----------
    relation : Relation
        The relation.
    outcome : str
        ``agrees``, ``agrees only through rounding`` or ``contradicts``.
    left, right : float or None
        Both sides with the printed values inserted, in SI; None with an unknown that nothing
        fixes.
    rules : frozenset of str
        The rounding rules that turn the right side into the printed result.
    rescued_by : str
        ``truncation`` or ``ceiling`` where that reading of all numbers lifts a contradiction.
    """

    relation: Relation
    outcome: Outcome
    left: float | None
    right: float | None
    rules: frozenset[str] = frozenset()
    rescued_by: str = ""

    @property
    def sides(self) -> tuple[float, float]:
        """Both sides; NaN where an unknown that nothing fixes leaves them open."""
        return (
            math.nan if self.left is None else self.left,
            math.nan if self.right is None else self.right,
        )


@dataclass(frozen=True)
class Fixed:
    """What the relations say of a number that is not printed.

    Parameters
    ----------
    unknown : Unknown
        The number.
    by_relation : dict
        Name of relation to the interval that it allows on its own, in SI; empty ones left out.
    common : tuple of float
        The values that the largest agreeing set of relations allows.
    members : tuple of str
        The relations of that set; where several sets are largest, those in all of them.
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


def boxes_of(cells: Sheet, relations: Iterable[Relation], rule: Rule) -> dict[str, Interval]:
    """Return the interval of print for every cell of some relations."""
    return {a: allowed(cells[a], rule) for r in relations for a in r.addresses}


def fix_unknowns(
    cells: Sheet, relations: Sequence[Relation], rule: Rule = "nearest"
) -> dict[str, Fixed]:
    """Find, for each unknown, the largest set of relations that agree on one value.

    Name of unknown to what the relations say of it.
    """
    groups: dict[str, list[Relation]] = {}
    for relation in relations:
        if relation.unknown is not None:
            groups.setdefault(relation.unknown.name, []).append(relation)
    fixed = {}
    for name, group in groups.items():
        boxes = boxes_of(cells, group, rule)
        allows = {r.name: found for r in group if (found := projection(r, boxes)) is not None}
        unknown = group[0].unknown
        if unknown is not None:
            fixed[name] = _largest_agreement(unknown, allows)
    return fixed


def _largest_agreement(unknown: Unknown, allows: dict[str, Interval]) -> Fixed:
    """Slide over the lower ends: one of them lies in each largest overlap."""
    overlaps = [
        frozenset(n for n, (low, high) in allows.items() if low <= start <= high)
        for start, _ in allows.values()
    ]
    size = max(map(len, overlaps), default=0)
    largest = [overlap for overlap in overlaps if len(overlap) == size]
    shared = frozenset.intersection(*largest) if largest else frozenset()
    factor = si_factor(unknown.unit)
    low, high = unknown.low * factor, unknown.high * factor
    for name in shared:
        low, high = max(low, allows[name][0]), min(high, allows[name][1])
    return Fixed(unknown, allows, (low, high), tuple(n for n in allows if n in shared))


def contradicted(
    cells: Sheet, relations: Sequence[Relation], rule: Rule = "nearest"
) -> frozenset[str]:
    """Return the names of the relations that cannot hold.

    A relation with an unknown cannot hold if it is outside the largest set that agrees on one
    value. Where several sets are largest, it cannot be said which is right, and the relations
    that are not in all of them count as contradicting.
    """
    fixed = fix_unknowns(cells, relations, rule)
    boxes = boxes_of(cells, relations, rule)
    wrong = set()
    for relation in relations:
        if relation.kind == "print":
            if not uniform(cells, relation):
                wrong.add(relation.name)
            continue
        if relation.unknown is None:
            if not possible(relation, boxes):
                wrong.add(relation.name)
            continue
        if relation.name not in fixed[relation.unknown.name].members:
            wrong.add(relation.name)
    return frozenset(wrong)


def uniform(cells: Sheet, relation: Relation) -> bool:
    """Tell whether a relation between last printed digits holds."""
    left, right = relation.sides({a: cells[a].last_digit for a in relation.addresses})
    return _short(relation, left, right) <= _NOISE * max(abs(left), abs(right))


def by_value(relations: Iterable[Relation]) -> list[Relation]:
    """Return the relations between values, without those between last printed digits."""
    return [relation for relation in relations if relation.kind != "print"]


def examine(cells: Sheet, relations: Sequence[Relation]) -> list[Finding]:
    """Say of every relation whether it agrees, agrees only through rounding, or contradicts.

    One for each relation, in their order.
    """
    wrong = contradicted(cells, relations)
    lifted = {rule: wrong - contradicted(cells, relations, rule) for rule in _other_rules()}
    fixed = fix_unknowns(cells, relations)
    findings = []
    for relation in relations:
        left, right = _sides(relation, cells, fixed)
        rules = _rules(relation, cells, right)
        outcome: Outcome = "contradicts"
        if relation.name not in wrong:
            plain = _agrees(relation, cells, left, right, rules)
            outcome = "agrees" if plain else "agrees only through rounding"
        rescue = next((r for r, names in lifted.items() if relation.name in names), "")
        findings.append(Finding(relation, outcome, left, right, rules, rescue))
    return findings


def _other_rules() -> tuple[Rule, ...]:
    return "truncation", "ceiling"


def _sides(
    relation: Relation, cells: Sheet, fixed: dict[str, Fixed]
) -> tuple[float | None, float | None]:
    printing = relation.kind == "print"
    values = {a: cells[a].last_digit if printing else cells[a].si for a in relation.addresses}
    if relation.unknown is None:
        return relation.sides(values)
    about = fixed[relation.unknown.name]
    if not about.members:
        return None, None
    return relation.sides(values, sum(about.common) / 2)


def _rules(relation: Relation, cells: Sheet, right: float | None) -> frozenset[str]:
    if relation.result is None or right is None or relation.kind == "print":
        return frozenset()
    printed = cells[relation.result]
    if printed.number.is_bound or printed.number.qualifier == "nominal":
        return frozenset()
    return rules_that_print(right / si_factor(printed.unit), printed.number)


def _agrees(
    relation: Relation,
    cells: Sheet,
    left: float | None,
    right: float | None,
    rules: frozenset[str],
) -> bool:
    """Tell whether the relation holds with the printed values inserted as they stand."""
    if left is None or right is None:
        return False
    if rules & _NEAREST:
        return True
    noise = _NOISE * max(abs(left), abs(right))
    room = noise
    if relation.tolerance is not None:
        tolerance = relation.tolerance
        room += tolerance.absolute if tolerance.unit else tolerance.size * abs(right)
    if relation.result is not None and cells[relation.result].number.qualifier == "about":
        low, high = allowed(cells[relation.result])
        room += (high - low) / 2
    return _short(relation, left, right) <= room


def _short(relation: Relation, left: float, right: float) -> float:
    """Return by how much two sides miss the relation; at most zero where they keep it."""
    missed = {"=": abs(left - right), "<=": left - right, ">=": right - left}
    return missed[relation.formula.sign]


def jointly_contradicted(cells: Sheet, relations: Sequence[Relation]) -> bool:
    """Tell whether relations that hold one by one cannot hold together."""
    wrong = contradicted(cells, relations)
    kept = [relation for relation in by_value(relations) if relation.name not in wrong]
    return propagate(kept, boxes_of(cells, kept, "nearest")) is None


def rounding_votes(findings: Iterable[Finding]) -> dict[str, int]:
    """Count, over the results that tell them apart, how many each rounding rule prints.

    Rule to count; results printed by all rules or by none are not counted.
    """
    telling = [f.rules for f in findings if f.rules and len(f.rules) < len(ROUNDINGS)]
    return {rule: sum(rule in rules for rules in telling) for rule in ROUNDINGS}
