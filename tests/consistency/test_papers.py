"""What the audit finds in the two papers, and that nothing it says rests on air."""

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

from reproduce.consistency.examine import contradicted, rounding_interval
from reproduce.consistency.report import audit_paper, register
from reproduce.printed.number import UNITS, si_factor

DATA = Path(__file__).parent.parent.parent / "data"
PAPERS = ("niu2024", "chen2023")
ERRATA = register((DATA / "errata.toml").read_text(encoding="utf-8"))
TABLE_V = "chen2023/table-5#"


@pytest.mark.parametrize("paper", PAPERS)
def test_every_agreement_has_a_witness(paper):
    """Some point of the box keeps the relation: both signs of the gap occur, or it is zero.

    The corners of the audit are compared with all corners, by plain floats.
    """
    audit = audit_paper(paper)
    for found in audit.findings:
        relation = found.relation
        if found.outcome == "contradicts" or relation.unknown is not None:
            continue
        if relation.kind == "print":  # of digits, not values: no box
            decimals = {audit.cells[a].number.exponent for a in relation.addresses}
            assert len(decimals) == 1, relation.name
            continue
        boxes = {a: box(audit.cells[a]) for a in relation.addresses}
        gaps = list(_gaps(relation, boxes))
        printed = relation.values({a: audit.cells[a].si for a in boxes})
        slack = 1e-9 * max(map(abs, printed))
        if relation.formula.sign == "=":
            assert min(gaps) <= slack, relation.name
            assert max(gaps) >= -slack, relation.name
        else:
            wanted = min(gaps) if relation.formula.sign == "<=" else -max(gaps)
            assert wanted <= slack, relation.name


@pytest.mark.parametrize("paper", PAPERS)
def test_no_contradiction_has_a_witness(paper):
    """At corners and at random points of the box, the gap has one sign."""
    audit, seen = audit_paper(paper), 0
    for found in audit.findings:
        relation = found.relation
        if (
            found.outcome != "contradicts"
            or relation.unknown
            or relation.kind == "print"
        ):
            continue
        boxes = {a: box(audit.cells[a]) for a in relation.addresses}
        generator, gaps = np.random.default_rng(1), list(_gaps(relation, boxes))
        for _ in range(500):
            gaps += _gaps(
                relation, {a: [generator.uniform(*box)] * 2 for a, box in boxes.items()}
            )
        sign = relation.formula.sign
        assert (sign != ">=" and min(gaps) > 0) or (sign != "<=" and max(gaps) < 0), (
            relation.name
        )
        seen += 1
    assert seen >= 8


def box(cell):
    """Return the values that a cell stands for, in SI."""
    return [si_factor(cell.unit) * end for end in rounding_interval(cell.number)]


def _gaps(relation, boxes):
    """Left less right at the middle and the corners of the box, with the tolerance either way."""
    addresses = list(boxes)
    middle = {a: sum(box) / 2 for a, box in boxes.items()}
    few = addresses[:9]
    corners = itertools.product((0, 1), repeat=len(few))
    corner_points = (
        {a: boxes[a][i] for a, i in zip(few, c, strict=True)} for c in corners
    )
    for moved in itertools.chain([{}], corner_points):
        at = middle | moved
        left, right, *_ = relation.values(at)
        room = abs(relation.tolerance.of(right)) if relation.tolerance else 0.0
        yield left - right - room
        yield left - right + room


@pytest.mark.parametrize("paper", PAPERS)
def test_every_common_value_of_an_unknown_is_kept_by_its_members(paper):
    audit = audit_paper(paper)
    for fixed in audit.unknowns.values():
        low, high = fixed.common
        assert low <= high
        for name in fixed.members:
            least, most = fixed.by_relation[name]
            assert least <= high
            assert low <= most
            assert finding(audit, name).relation.unknown.domain[0] <= low


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
    pairs = [
        [f"{TABLE_V}{s}.{column}-{a}" for a in "xy"]
        for s in "12345"
        for column in columns
    ]
    for x, y in (pair for pair in pairs if cells.keys() >= set(pair)):
        one, two = cells[x], cells[y]
        cells |= {
            x: replace(one, content=two.number, unit=two.unit),
            y: replace(two, content=one.number, unit=one.unit),
        }
    return cells


@pytest.mark.parametrize(
    ("columns", "broken"),
    [
        (["position", "motion"], set()),
        (["reference"], {f"difference-{s}-{a}" for s in "2345" for a in "xy"}),
    ],
)
def test_one_digit_and_interchanged_columns_restore_table_v(columns, broken):
    """With the reference columns interchanged, the printed differences contradict instead."""
    relations = [found.relation for found in audit_paper("chen2023").read]
    again = audited_table("mended", table_v(*columns), relations)
    assert {
        f.relation.name for f in again.findings if f.outcome == "contradicts"
    } == broken
    low, high = again.unknowns["f"].common
    assert (high - low) / low == pytest.approx(2e-4, rel=0.2)


def test_the_corrected_motion_also_follows_from_the_positions_beside_it():
    audit = audit_paper("chen2023")
    (alone,) = (c for c in audit.conflicts if c.relations == ("motion-4-y",))
    assert set(alone.cells) == {
        f"{TABLE_V}{cell}" for cell in ("4.motion-y", "4.position-y", "1.position-y")
    }
    relations = [f.relation for f in audit.findings]
    assert "motion-4-y" not in contradicted(table_v(), relations)


@pytest.mark.parametrize("paper", PAPERS)
def test_equations_hold_or_are_mended(paper):
    for shown in audit_paper(paper).equations:
        assert shown.right == pytest.approx(shown.wanted, rel=1e-9, abs=1e-9), (
            shown.name
        )


def test_every_contradiction_and_every_failing_equation_has_one_erratum():
    for paper in PAPERS:
        audit = audit_paper(paper)
        ours = [entry for entry in ERRATA if entry.paper == paper]
        for found in audit.findings:
            holders = [entry.id for entry in ours if found in entry.findings(audit)]
            wanted = 1 if found.outcome == "contradicts" else 0
            assert len(holders) == wanted, (found.relation.name, holders)
        for shown in audit.equations:
            holders = [entry.id for entry in ours if shown.name in entry.equations]
            assert len(holders) == (0 if shown.holds else 1), shown.name


def test_every_erratum_has_evidence_and_a_name_of_its_own():
    assert len({entry.id for entry in ERRATA}) == len(ERRATA)
    for entry in ERRATA:
        audit = audit_paper(entry.paper)
        assert len(entry.demonstrations(audit)) == len(entry.equations), entry.id
        assert bool(entry.findings(audit)) == bool(entry.relations), entry.id
        assert entry.relations or entry.equations or entry.evidence, entry.id


def test_what_rests_on_a_supposition_of_ours_is_counted_nowhere_else():
    """A relation that supposes something, and all that would follow from it, stands apart."""
    for paper in PAPERS:
        audit = audit_paper(paper)
        ours = {f.relation.name for f in audit.supposed}
        assert len(audit.read) + len(ours) == len(audit.findings)
        assert sum(audit.tally().values()) == len(audit.read)
        blamed = {name for conflict in audit.conflicts for name in conflict.relations}
        assert not ours & blamed
        assert not {shown.name for shown in audit.failing if shown.assumption}
        for entry in (entry for entry in ERRATA if entry.paper == paper):
            resting = [f.relation.assumption for f in entry.findings(audit)]
            resting += [shown.assumption for shown in entry.demonstrations(audit)]
            if resting:
                assert set(resting) == {entry.assumption}, entry.id


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


def test_a_supposition_does_not_contradict():
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
    assert (plain.tally()["contradicts"], len(plain.conflicts)) == (1, 1)
    assert (supposed.tally()["contradicts"], len(supposed.conflicts)) == (0, 0)
    assert supposed.supposed[0].outcome == "contradicts"


def test_errata_that_rest_on_a_formula_of_the_machine_text_say_so():
    """A formula run as extracted, or words about one: an equation is named as the place."""
    for entry in ERRATA:
        if entry.paper == "chen2023" and entry.place.startswith("equation ("):
            assert entry.extraction, entry.id


def test_what_the_book_says_of_the_contradictions_of_niu2024():
    """Two contradictions: Table 2 against Table 1, and Table 3 against noise and residuals."""
    audit = audit_paper("niu2024")
    wrong = {f.relation.name for f in audit.read if f.outcome == "contradicts"}
    translations = {f"true-translation-{a}-{c}" for a in "xy" for c in ("red", "blue")}
    scales = {
        f"{name}-{c}" for name in ("solved-scale", "left-over") for c in ("red", "blue")
    }
    assert wrong == translations | scales
    joint = [set(c.relations) for c in audit.conflicts if not wrong & set(c.relations)]
    assert joint == []
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
