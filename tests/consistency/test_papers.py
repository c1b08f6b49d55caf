"""Results of the audit of the two papers, and independent evidence for each of them."""

import functools
import itertools
import math
import operator
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pint
import pytest
from made_up import PINT, audited_table, finding, printed_cell

from reproduce.consistency.examine import OUTCOMES, contradicted, rounding_interval
from reproduce.consistency.report import audit_paper, register
from reproduce.printed.number import UNITS, si_factor

DATA = Path(__file__).parent.parent.parent / "data"
PAPERS = ("niu2024", "chen2023")
ERRATA = register((DATA / "errata.toml").read_text(encoding="utf-8"))
TABLE_V = "chen2023/table-5#"


def boxes_of(paper, kinds):
    """Yield relations with these outcomes and the intervals of their cells, in SI."""
    audit = audit_paper(paper)
    for found in audit.findings:
        relation = found.relation
        if found.outcome in kinds and not relation.unknown and relation.kind != "print":
            yield relation, {a: box(audit.cells[a]) for a in relation.addresses}


def box(cell):
    """Return the values that a cell stands for, in SI."""
    return [si_factor(cell.unit) * end for end in rounding_interval(cell.number)]


def gaps_at(relation, boxes):
    """Yield left minus right at the middle and corners, with the tolerance either way."""
    middle = {a: sum(ends) / 2 for a, ends in boxes.items()}
    few = list(boxes)[:9]
    corners = itertools.product(*(boxes[a] for a in few))
    for values in (tuple(middle[a] for a in few), *corners):
        left, right, *_ = relation.values(middle | dict(zip(few, values, strict=True)))
        room = abs(relation.tolerance.of(right)) if relation.tolerance else 0.0
        yield left - right - room
        yield left - right + room


@pytest.mark.parametrize("paper", PAPERS)
def test_every_agreement_has_a_point_and_no_contradiction_has_one(paper):
    """The gap has both signs, or is zero, in the box of an agreement, and otherwise one sign.

    The corners of the audit are compared with all corners, by plain floats.
    """
    for relation, boxes in boxes_of(paper, set(OUTCOMES) - {"contradicts"}):
        gaps, sign = list(gaps_at(relation, boxes)), relation.formula.sign
        slack = 1e-9 * max(
            map(abs, relation.values({a: b[0] for a, b in boxes.items()}))
        )
        assert sign == ">=" or min(gaps) <= slack, relation.name
        assert sign == "<=" or max(gaps) >= -slack, relation.name
    generator, count = np.random.default_rng(1), 0
    for relation, boxes in boxes_of(paper, {"contradicts"}):
        gaps, sign = list(gaps_at(relation, boxes)), relation.formula.sign
        for _ in range(500):
            points = {a: [generator.uniform(*ends)] * 2 for a, ends in boxes.items()}
            gaps += gaps_at(relation, points)
        above, below = min(gaps) > 0, max(gaps) < 0
        assert (sign != ">=" and above) or (sign != "<=" and below), relation.name
        count += 1
    assert count >= 8
    audit = audit_paper(paper)
    for fixed in audit.unknowns.values():
        low, high = fixed.common
        assert low <= high
        for least, most in map(fixed.by_relation.__getitem__, fixed.members):
            assert least <= high
            assert low <= most
    for found in (f for f in audit.findings if f.relation.kind == "print"):
        exponents = {audit.cells[a].number.exponent for a in found.relation.addresses}
        assert (found.outcome == "agrees") == (len(exponents) == 1)


def test_table_v_as_printed_has_no_common_focal_length():
    audit = audit_paper("chen2023")
    names = [n for n in audit.unknowns["f"].by_relation if n.startswith("reference")]
    middles = [sum(audit.unknowns["f"].by_relation[n]) / 2 for n in names]
    assert len(names) == 8
    assert all(finding(audit, n).outcome == "contradicts" for n in names)
    by_hand = [
        -audit.cells[f"{TABLE_V}{s}.motion-{a}"].si
        / math.tan(audit.cells[f"{TABLE_V}{s}.reference-{b}"].si)
        for a, b in ("xy", "yx")
        for s in "2345"
    ]
    assert sorted(middles) == pytest.approx(sorted(by_hand), rel=1e-6)
    assert 0.02 < (max(middles) - min(middles)) / min(middles) < 0.05


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
    relations = [found.relation for found in audit_paper("chen2023").read]
    again = audited_table("corrected", table_v(*columns), relations)
    names = {f.relation.name for f in again.findings if f.outcome == "contradicts"}
    differences = {f"difference-{s}-{a}" for s in "2345" for a in "xy"}
    assert names == (differences if columns == ["reference"] else set())
    low, high = again.unknowns["f"].common
    assert (high - low) / low == pytest.approx(2e-4, rel=0.2)


def test_the_corrected_motion_also_follows_from_the_positions():
    relations = [f.relation for f in audit_paper("chen2023").findings]
    assert "motion-4-y" not in contradicted(table_v(), relations)


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


def test_results_that_depend_on_an_assumption_are_counted_separately():
    """A relation with an assumption, and its consequences."""
    for paper in PAPERS:
        audit = audit_paper(paper)
        assumed = {f.relation.name for f in audit.supposed}
        assert len(audit.read) + len(assumed) == len(audit.findings)
        assert sum(audit.tally().values()) == len(audit.read)
        assert not any(shown.assumption for shown in audit.failing)
        for entry in (entry for entry in ERRATA if entry.paper == paper):
            evidence = {f.relation.assumption for f in entry.findings(audit)}
            evidence |= {shown.assumption for shown in entry.demonstrations(audit)}
            assert evidence <= {entry.assumption}, entry.id


def test_the_contradictions_of_chen2023_are_one_digit_and_one_interchange():
    audit = audit_paper("chen2023")
    wrong = {f.relation.name for f in audit.read if f.outcome == "contradicts"}
    assert wrong == {
        "motion-4-y",
        *(f"reference-{s}-{p}" for s in "2345" for p in ("x-y", "y-x")),
    }
    assert [shown.name for shown in audit.failing] == ["stage-angle"]
    apart = {f.relation.name for f in audit.supposed if f.outcome == "contradicts"}
    assert "flight-ratio-ground" in apart
    assert "differences-together" in apart
    assert {"ramp-averaged", "pixel-angle-exact", "stars-against-limit"} <= apart
    assert len(apart) == 14


def test_a_relation_with_an_assumption_is_no_contradiction():
    cells = {a: printed_cell(a, t) for a, t in {"t#1.a": "1", "t#1.b": "3"}.items()}
    line = """[[relations.all]]
name = "alike"
formula = "a = b"
cells = "a=t#1.a b=t#1.b"
kind = "repeat"
source = "by name"
"""
    plain = audited_table("made up", cells, line)
    supposed = audited_table("made up", cells, line + 'assumption = "the two are one"')
    assert plain.tally()["contradicts"] == 1
    assert supposed.tally()["contradicts"] == 0
    assert supposed.supposed[0].outcome == "contradicts"


def test_errata_that_depend_on_an_extracted_formula_are_marked():
    """A formula run as extracted, or words about one: an equation is named as the place."""
    for entry in ERRATA:
        if entry.paper == "chen2023" and entry.place.startswith("equation ("):
            assert entry.extraction, entry.id


def test_the_contradictions_of_niu2024_are_two():
    """Two contradictions: Table 2 against Table 1, and Table 3 against noise and residuals."""
    audit = audit_paper("niu2024")
    wrong = {f.relation.name for f in audit.read if f.outcome == "contradicts"}
    translations = {f"true-translation-{a}-{c}" for a in "xy" for c in ("red", "blue")}
    scales = {
        f"{name}-{c}" for name in ("solved-scale", "left-over") for c in ("red", "blue")
    }
    assert wrong == translations | scales
    apart = {f.relation.name for f in audit.supposed if f.outcome == "contradicts"}
    assert {"before-after-red-x-y", "before-after-red-y-x", "scale-blue"} <= apart
    assert "scale-red" not in apart, "within the errors that the residuals allow"


def dimensions(relation, units):
    """Return the dimensions of both sides of a relation whose cells have some units."""
    registry = pint.application_registry

    def one(unit):
        return registry.Quantity(np.float64(1.0), PINT.get(unit, unit))

    def flat(parts):
        return [x for p in parts for x in (p if isinstance(p, list) else [p])]

    def total(*parts):
        return functools.reduce(operator.add, flat(parts))

    functions = {"sqrt": np.sqrt, "sin": np.sin, "tan": np.tan, "atan": np.arctan}
    functions |= {"sum": total, "mean": total, "count": lambda *parts: len(flat(parts))}
    functions |= {f.__name__: lambda *p, f=f: f(flat(p)) for f in (min, max)}
    functions["rms"] = lambda *parts: np.sqrt(total(*(x**2 for x in flat(parts))))
    functions["u"] = SimpleNamespace(**{unit: one(unit) for unit in UNITS})
    unknown = None if relation.unknown is None else one(relation.unknown.unit)
    scope = relation.scope({address: one(units[address]) for address in units}, unknown)
    with np.errstate(all="ignore"):  # ones may cancel, and only the dimension counts
        sides = relation.formula.values(functions | scope)[:2]
        return [registry.Quantity(side).dimensionality for side in sides]


@pytest.mark.parametrize("paper", PAPERS)
def test_the_papers_relations_have_their_dimensions(paper):
    cells = audit_paper(paper).cells
    for relation in (found.relation for found in audit_paper(paper).findings):
        left, right = dimensions(
            relation, {a: cells[a].unit for a in relation.addresses}
        )
        assert left == right, relation.name


def test_verdicts_name_known_errata_of_their_paper():
    content = tomllib.loads((DATA / "verdicts.toml").read_text(encoding="utf-8"))
    known = {entry.id for entry in ERRATA}
    named = [(e["erratum"], e["cells"]) for e in content["expect"] if "erratum" in e]
    assert named
    for erratum, cells in named:
        assert erratum in known
        assert all(cell.startswith(erratum.partition("-")[0]) for cell in cells)


def test_the_register_is_about_the_work_and_not_about_people():
    entries = [str(entry.model_dump()).lower() for entry in ERRATA]
    for word in ("prize", "biograph", "award", "professor", " et al", "author of"):
        assert not any(word in entry for entry in entries), word
