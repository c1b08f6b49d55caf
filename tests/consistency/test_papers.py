"""Results of the audit of the two papers, and independent evidence for each of them."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pint
import pytest
from made_up import PINT, audited_table, printed_cell

from reproduce.consistency._relation import _SCOPE
from reproduce.consistency.examine import _agreements, _contradicted, _rounding_interval
from reproduce.consistency.report import audit_paper
from reproduce.judge.ledger import frozen
from reproduce.printed.cells import PAPERS
from reproduce.printed.number import UNITS, si_factor
from reproduce.views.consistency import errata_register

ERRATA = errata_register()
TABLE_V = "chen2023/table-5#"


def box(cell):
    """Return the values that a cell stands for, in SI."""
    return [si_factor(cell.unit) * end for end in _rounding_interval(cell.number)]


def points(boxes, generator):
    """Yield values of cells: corners of the first nine intervals, and points inside of all."""
    middle = {a: sum(ends) / 2 for a, ends in boxes.items()}
    few = list(boxes)[:9]
    for corner in itertools.product(*(boxes[a] for a in few)):
        yield middle | dict(zip(few, corner, strict=True))
    for one in generator.uniform(*np.transpose([*boxes.values()]), (100, len(boxes))):
        yield dict(zip(boxes, one, strict=True))


@pytest.mark.parametrize("paper", PAPERS)
def test_every_agreement_has_a_point_and_no_contradiction_has_one(paper):
    """The gap of both sides has both signs, or is zero, in the box of an agreement only."""
    audit, generator, contradictions = audit_paper(paper), np.random.default_rng(1), 0
    for found in audit.findings:
        relation, sign = found.relation, found.relation.formula.sign
        if relation.unknown or relation.kind == "print":
            continue
        boxes, gaps = {a: box(audit.cells[a]) for a in relation.addresses}, []
        for values in points(boxes, generator):
            left, right, *_ = relation.values(values)
            room = abs(relation.tolerance.of(right)) if relation.tolerance else 0.0
            gaps += [left - right - room, left - right + room]
        slack = 1e-9 * max(abs(left), abs(right))
        possible = (sign == ">=" or min(gaps) <= slack) and (
            sign == "<=" or max(gaps) >= -slack
        )
        assert possible == (found.outcome != "contradicts"), relation.name
        contradictions += not possible
    assert contradictions >= 8


def table_v(*columns):
    """The cells of chen2023 with the digit of state 4 corrected, and X and Y of columns swapped."""
    cells = dict(audit_paper("chen2023").cells)
    cells[f"{TABLE_V}4.motion-y"] = printed_cell(f"{TABLE_V}4.motion-y", "60.36", "um")
    for state, column in itertools.product("12345", columns):
        x, y = (f"{TABLE_V}{state}.{column}-{a}" for a in "xy")
        if x in cells and y in cells:
            one, two = cells[x], cells[y]
            cells[x] = replace(one, content=two.number, unit=two.unit)
            cells[y] = replace(two, content=one.number, unit=one.unit)
    return cells


@pytest.mark.parametrize("columns", [["position", "motion"], ["reference"]])
def test_one_digit_and_interchanged_columns_restore_table_v(columns):
    """With the reference columns interchanged, the printed differences contradict instead."""
    every = (found.relation for found in audit_paper("chen2023").findings)
    relations = [relation for relation in every if not relation.assumption]
    cells = table_v(*columns)
    again = audited_table("corrected", cells, relations)
    names = {f.relation.name for f in again.findings if f.outcome == "contradicts"}
    differences = {f"difference-{s}-{a}" for s in "2345" for a in "xy"}
    assert names == (differences if columns == ["reference"] else set())
    low, high = _agreements(cells, relations)["f"].common
    assert (high - low) / low == pytest.approx(2e-4, rel=0.2)


def test_the_corrected_motion_also_follows_from_the_positions():
    relations = [f.relation for f in audit_paper("chen2023").findings]
    assert "motion-4-y" not in _contradicted(table_v(), relations)


def test_every_contradiction_and_every_failing_equation_has_one_erratum():
    """The form of this package gives the result that the printed form should give."""
    assert len({entry.id for entry in ERRATA}) == len(ERRATA)
    for paper in PAPERS:
        audit = audit_paper(paper)
        entries = [entry for entry in ERRATA if entry.paper == paper]
        named = [name for entry in entries for name in entry.equations]
        shown = [f.relation.name for e in entries for f in e.findings(audit)]
        wrong = [f.relation.name for f in audit.findings if f.outcome == "contradicts"]
        assert sorted(shown) == sorted(wrong)
        assert sorted(named) == sorted(e.name for e in audit.equations if not e.holds)
        for equation in audit.equations:
            expected = pytest.approx(equation.wanted, rel=1e-9, abs=1e-9)
            assert equation.right == expected, equation.name
        for entry in entries:
            assert bool(entry.findings(audit)) == bool(entry.relations), entry.id
            assert entry.relations or entry.equations or entry.evidence, entry.id


def test_an_erratum_has_the_assumption_of_its_evidence():
    """A relation with an assumption, and its consequences."""
    for entry in ERRATA:
        audit = audit_paper(entry.paper)
        evidence = {f.relation.assumption for f in entry.findings(audit)}
        shown = (e for e in audit.equations if e.name in entry.equations)
        evidence |= {equation.assumption for equation in shown}
        assert evidence <= {entry.assumption}, entry.id


def test_errata_that_depend_on_an_extracted_formula_are_marked():
    """A formula run as extracted, or words about one: an equation is named as the place."""
    for entry in ERRATA:
        if entry.paper == "chen2023" and entry.place.startswith("equation ("):
            assert entry.extraction, entry.id


BASES = {"[length]": 3.0, "[time]": 1.7, "[printing_unit]": 0.6, "[temperature]": 2.3}


def scaled(unit):
    """Return how often a unit contains itself if the base units are changed."""
    quantity = pint.application_registry.Quantity(1.0, PINT.get(unit, unit))
    powers = quantity.dimensionality.items()
    return math.prod(BASES.get(base, 1.0) ** power for base, power in powers)


@pytest.mark.parametrize("paper", PAPERS)
def test_the_papers_relations_have_their_dimensions(paper, monkeypatch):
    """Both sides change by one factor with the base units."""
    audit, factors = audit_paper(paper), {unit: scaled(unit) for unit in UNITS}
    units = SimpleNamespace(**{u: si_factor(u) * one for u, one in factors.items()})
    for relation in (found.relation for found in audit.findings):
        cells = {a: audit.cells[a] for a in relation.addresses}
        plain = {a: 1.1 + 0.1 * i for i, a in enumerate(cells)}
        moved = {a: plain[a] * factors[cells[a].unit] for a in cells}
        unknown = relation.unknown and factors[relation.unknown.unit]
        one = relation.values(plain, 1.0)[:2]
        with monkeypatch.context() as patched:
            patched.setitem(_SCOPE, "u", units)
            other = relation.values(moved, unknown)
        crossed = pytest.approx(other[1] * one[0], rel=1e-9)
        assert other[0] * one[1] == crossed, relation.name


def test_verdicts_name_known_errata_of_their_paper():
    known = {entry.id for entry in ERRATA}
    named = {(one.erratum, cell) for cell, one in frozen().items() if one.erratum}
    assert named
    for erratum, cell in named:
        assert erratum in known
        assert cell.startswith(erratum.partition("-")[0])
