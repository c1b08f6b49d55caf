"""Every deterministic number is entered twice, as a function and as a formula, and compared.

The ledger moves inputs to the corners of their rounding intervals, which gives the ends of a result
that is monotone in each input. The audit encloses the formula, whatever its shape. Where both give
one interval, the corners are the ends, and no rounding of the inputs leads outside.
"""

import functools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up import declared

from reproduce.audit.intervals import EVERYTHING, _narrowed, printed_intervals
from reproduce.audit.report import audit_paper
from reproduce.judge.ledger import build
from reproduce.judge.readings import evaluate
from reproduce.judge.rerun import maker
from reproduce.judge.verdicts import result_intervals
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import reproduces, unpublished
from reproduce.printed.cells import PAPERS, find
from reproduce.printed.given import given
from reproduce.printed.number import PrintedNumber, si_factor
from reproduce.views.verdicts import choices_text

SHEET = {address: cell for paper in PAPERS for address, cell in audit_paper(paper).cells.items()}
RELATIONS = [f.relation for paper in PAPERS for f in audit_paper(paper).findings]
OTHERS = declared((Path(__file__).parent / "second_entries.toml").read_text(), SHEET)
ENTRIES = {r.restates: r for r in (*RELATIONS, *OTHERS) if r.restates}


def enclosure(relation, cells):
    """Enclose, in SI, what the right side gives for its result, whatever the rounding."""
    inputs = printed_intervals(cells, [relation]) | {relation.result: EVERYTHING}
    return _narrowed(relation, tuple(inputs.values()))[relation.addresses.index(relation.result)]


@functools.cache
def computed():
    """Every deterministic number by name and reading: its computation, and its interval."""
    found = {}
    for computation in (one for item in catalogue().values() for one in item.computations):
        for choices in () if computation.replicates else distinct(computation):
            one = computation.under(choices)
            mark = f" ({choices_text(choices)})" if choices else ""
            for name, interval in result_intervals(one, given(one.given)).items():
                if not unpublished(computation.key, name):
                    found[f"{computation.key}#{name}{mark}"] = (one, interval[:2])
    return found


def distinct(computation):
    """Return the readings of a computation, of those with equal results the first."""
    found = evaluate(computation)
    groups = np.stack([found.groups(name).ravel() for name in found.cells])
    return [computation.readings[i] for i in np.unique(groups, axis=1, return_index=True)[1]]


def value_of(computation, door, name):
    """Return the value of a number by its name, without the reading."""
    return computation(door)[name.partition("#")[2].partition(" (")[0]]


def enclosed(relation):
    """Enclose a formula; one that names `first` twice, at both ends of the interval of that cell.

    (position - first) / (last - first) is monotone in `first`: its derivative has the sign of
    position - last, which is never zero, and neither is last - first.
    """
    if not relation.name.startswith("exchanged-y"):
        return enclosure(relation, SHEET)
    first, last, position = (relation.binding[name] for name in ("first", "last", "position"))
    intervals = printed_intervals(SHEET, [relation])
    for one, two in ((position, last), (first, last)):
        assert intervals[one][1] < intervals[two][0] or intervals[two][1] < intervals[one][0]
    assert SHEET[first].unit == "um"
    ends = []
    for end in intervals[first]:
        number = PrintedNumber(repr(end / si_factor("um")), exact=True)
        ends.append(enclosure(relation, SHEET | {first: replace(SHEET[first], content=number)}))
    return min(low for low, _ in ends), max(high for _, high in ends)


def disagreement(relation, enclosed, interval):
    """Say how a formula's interval differs from that of the computation; empty if it does not."""
    if enclosed == pytest.approx(interval, rel=0, abs=1e-9 * max(map(abs, (*enclosed, *interval)))):
        return ""
    return (
        f"{relation.name} ({relation.formula.text}) gives {enclosed}, the computation of "
        f"{relation.restates} {interval}, in SI: one of them is wrong, or not monotone"
    )


def test_every_deterministic_number_has_one_second_entry():
    names = [r.restates for r in (*RELATIONS, *OTHERS) if r.restates]
    assert sorted(names) == sorted(computed())


@pytest.mark.parametrize("name", sorted(computed()))
def test_the_two_entries_give_one_interval(name):
    _, interval = computed()[name]
    assert disagreement(ENTRIES[name], enclosed(ENTRIES[name]), interval) == ""


@pytest.mark.parametrize("name", sorted(computed()))
def test_the_two_entries_give_one_value_wherever_the_inputs_lie(name):
    """As printed, and at random points of the box of all inputs."""
    computation, _ = computed()[name]
    relation = ENTRIES[name]
    rng = np.random.default_rng(3)
    door = given(computation.given)
    moved = [cell.address for cell in door.numbers()]
    for size in (0.0, *[1.0] * 10):
        shifted = door.shifted({address: size * rng.uniform(-1, 1) for address in moved})
        inputs = {a: shifted[a] for a in relation.addresses if a in door.cells}
        assert set(relation.addresses) - set(inputs) <= {relation.result}
        right = relation.sides({relation.result: 0.0, **inputs})[1]
        value = value_of(computation, shifted, name)
        assert right == pytest.approx(value, rel=1e-11, abs=1e-18)


def test_every_relation_that_restates_a_computed_number_says_so():
    """One solved for a computed cell, from what its computation reads, with the same value."""
    for relation in RELATIONS:
        ours = [name for name in computed() if name.partition(" (")[0] == relation.result]
        for name in ours if relation.kind != "print" and relation.unknown is None else ():
            computation, _ = computed()[name]
            door = given(computation.given)
            value = value_of(computation, door, name)
            read = set(relation.addresses) - {relation.result} <= set(door.cells)
            right = relation.sides({a: SHEET[a].si for a in relation.addresses})[1]
            if read and right == pytest.approx(value, rel=1e-9):
                assert relation.restates in ours, relation.name


def test_outcome_and_verdict_are_the_same():
    """A relation contradicts where the cell that it restates differs, and agrees where it does."""
    keys = {name.partition("#")[0] for name in ENTRIES}
    records = {record.cell: record for record in build(keys).records}
    outcomes = {f.relation.restates: f.outcome for p in PAPERS for f in audit_paper(p).findings}
    seen = set()
    for name, outcome in outcomes.items():
        address, _, choices = name.partition(" (")
        if not name or address not in records:
            continue
        found = records[address]
        if choices:
            evaluation = evaluate(maker(address))
            texts = [f"{choices_text(one)})" for one in evaluation.computation.readings]
            found = evaluation.cells[address.partition("#")[2]][texts.index(choices)]
        verdict = "differs" if found.verdict == "differs" else "exact"
        assert (outcome == "contradicts") == (verdict == "differs"), name
        # The audit and the verdict use one word for agreement that rests on more than the digits.
        if outcome == "agrees only within a tolerance":
            assert "tolerance" in found.flags, name
        elif verdict == "exact" and "tolerance" not in found.flags:
            (cell,) = find(address)
            off = not cell.number.meets(found.computed, found.computed)
            assert (outcome == "agrees only through rounding") == off, name
        seen.add((outcome, verdict))
    assert len(seen) == 4


ADDRESS = "niu2024/table-1#focal-length.green"


@reproduces("niu2024/table-2", given=[ADDRESS])
def turning(door):
    """Has its least value, nought, in the middle of the box, where no corner is."""
    return {"scale.red": ((door[ADDRESS] - 0.025) / 0.025) ** 2}


def test_a_computation_that_is_not_monotone_is_seen():
    text = """
    [[relations.made_up]]
    name = "turning"
    formula = "scale = ((green - 25 * u.mm) / (25 * u.mm)) ** 2"
    cells = "scale=niu2024/table-2#scale.red green=niu2024/table-1#focal-length.green"
    restates = "niu2024/table-2#scale.red"
    kind = "equation"
    source = "made up"
    """
    (relation,) = declared(text, SHEET)
    corners = result_intervals(turning, given(turning.given))["scale.red"][:2]
    found = disagreement(relation, enclosure(relation, SHEET), corners)
    assert found.startswith("turning (scale = ")
    assert "the computation of niu2024/table-2#scale.red" in found
    assert "not monotone" in found


def test_restating_relations_are_counted_apart():
    for paper in PAPERS:
        audit = audit_paper(paper)
        own, again = (audit.tally(restating=chosen) for chosen in (False, True))
        assert {o: own[o] + again[o] for o in own} == audit.tally()
        assert sum(again.values()) > 0
        cells = [f.relation.restates for f in audit.read if f.relation.restates]
        assert sum(again.values()) == len(cells)
        assert len(set(cells)) == len(cells)
