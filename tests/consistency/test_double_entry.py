"""Every deterministic number is entered twice, as a function and as a formula, and compared.

The ledger moves inputs to the corners of their rounding intervals, which gives the ends of a result
that is monotone in each input. Results at random points inside the rounding intervals must lie
between these ends.
"""

import functools
from pathlib import Path

import numpy as np
import pytest
from made_up import declared

from reproduce.consistency.report import audit_paper
from reproduce.judge._propagate import result_intervals
from reproduce.judge.ledger import build
from reproduce.judge.readings import evaluate
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import computation_for, computations, reproduces
from reproduce.printed.cells import PAPERS, find, library
from reproduce.printed.inputs import load_inputs
from reproduce.views._verdicts import choices_text

SHEET = {
    address: cell
    for paper in PAPERS
    for address, cell in audit_paper(paper).cells.items()
}
RELATIONS = [f.relation for paper in PAPERS for f in audit_paper(paper).findings]
OTHERS = declared((Path(__file__).parent / "second_entries.toml").read_text(), SHEET)
ENTRIES = {r.restates: r for r in (*RELATIONS, *OTHERS) if r.restates}


@functools.cache
def computed():
    """Every deterministic number by name and reading: its computation, and its interval."""
    found = {}
    for computation in (c for key in catalogue() for c in computations(key)):
        for choices in () if computation.replicates else distinct(computation):
            one = computation.with_options(choices)
            mark = f" ({choices_text(choices)})" if choices else ""
            intervals = result_intervals(one, load_inputs(one.inputs))
            for name, interval in intervals.items():
                if not library()[computation.key][name].unpublished:
                    found[f"{computation.key}#{name}{mark}"] = (one, interval[:2])
    return found


def distinct(computation):
    """Return the readings of a computation with different results."""
    evaluation, found = evaluate(computation), {}
    results = zip(*map(evaluation.results, evaluation.cells), strict=True)
    for result, reading in zip(results, computation.readings, strict=True):
        found.setdefault(result, reading)
    return list(found.values())


def results_in_box(computation, name, count=40):
    """Yield inputs at random points of their rounding intervals, and the number `name`.

    The first point is the printed one, and half of the others are corners.
    """
    rng, inputs = np.random.default_rng(3), load_inputs(computation.inputs)
    addresses, cell = inputs.rounded(), name.partition("#")[2]
    for i in range(count):
        points = rng.uniform(-1, 1, len(addresses)) * (i > 0)
        points = np.sign(points) if i % 2 else points
        shifted = inputs.shifted(dict(zip(addresses, points, strict=True)))
        yield shifted, computation(shifted)[cell.partition(" (")[0]]


def strays(computation, name, low, high):
    """Return the results in the box of all inputs that are outside of an interval."""
    room = 1e-11 * max(abs(low), abs(high)) + 1e-18
    values = (value for _, value in results_in_box(computation, name))
    return [value for value in values if not low - room <= value <= high + room]


def test_every_deterministic_number_has_one_second_entry():
    names = [r.restates for r in (*RELATIONS, *OTHERS) if r.restates]
    assert sorted(names) == sorted(computed())


def test_no_rounding_of_the_inputs_leads_outside_of_the_interval():
    for name, (computation, ends) in computed().items():
        assert strays(computation, name, *ends) == [], name


def test_the_two_entries_give_one_value_for_any_inputs():
    """As printed, and at points of the box of all inputs."""
    for name, (computation, _) in computed().items():
        relation = ENTRIES[name]
        for inputs, value in results_in_box(computation, name, 11):
            cells = {a: inputs[a] for a in relation.addresses if a in inputs.cells}
            assert set(relation.addresses) - set(cells) <= {relation.result}
            right = relation.values({relation.result: 0.0, **cells})[1]
            assert right == pytest.approx(value, rel=1e-11, abs=1e-18), name


def test_outcome_and_verdict_are_the_same():
    """A relation contradicts if the cell that it restates differs, and otherwise agrees."""
    keys = {name.partition("#")[0] for name in ENTRIES}
    records = {record.cell: record for record in build(keys).records}
    outcomes = {
        f.relation.restates: f.outcome for p in PAPERS for f in audit_paper(p).findings
    }
    seen = set()
    for name, outcome in outcomes.items():
        address, _, choices = name.partition(" (")
        if not name or address not in records:
            continue
        found = records[address]
        if choices:
            evaluation = evaluate(computation_for(address))
            texts = [f"{choices_text(one)})" for one in evaluation.computation.readings]
            found = evaluation.cells[address.partition("#")[2]][texts.index(choices)]
        verdict = "differs" if found.verdict == "differs" else "exact"
        assert (outcome == "contradicts") == (verdict == "differs"), name
        # The audit and the verdict use one word for agreement that rests on more than the digits.
        if outcome == "agrees only within a tolerance":
            assert "tolerance" in found.flags, name
        elif verdict == "exact" and "tolerance" not in found.flags:
            (cell,) = find(address)
            off = not cell.number.overlaps(found.computed, found.computed)
            assert (outcome == "agrees only through rounding") == off, name
        seen.add((outcome, verdict))
    assert len(seen) == 4


ADDRESS = "niu2024/table-1#focal-length.green"


@reproduces("niu2024/table-2", inputs=[ADDRESS])
def turning(inputs):
    """Smallest inside the rounding interval, between the printed value and the upper end."""
    return {"scale.red": (1e6 * (inputs[ADDRESS] / 0.025 - 1) - 1) ** 2}


def test_a_computation_that_is_not_monotone_is_seen():
    low, high, _ = result_intervals(turning, load_inputs(turning.inputs))["scale.red"]
    assert strays(turning, f"{turning.key}#scale.red", low, high)
