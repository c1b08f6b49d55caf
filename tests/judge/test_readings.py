"""Readings: every combination of the options, the short summary of them, and the stored ones."""

import functools
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import recompute
from reproduce.judge import ledger, readings
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Alternative, computations, item_text, reproduces
from reproduce.papers.niu2024 import simulation
from reproduce.printed.cells import library
from reproduce.printed.inputs import load_inputs
from reproduce.printed.number import PrintedNumber
from reproduce.views._verdicts import deciding

TABLE, CELL = "niu2024/table-2", "scale.red"  # prints 0.9976
OPTIONS = {
    name: {way: Alternative(text=way, place="nowhere") for way in ways}
    for name, ways in {
        "a": ("one", "two"),
        "b": ("x", "y", "z"),
        "c": ("p", "q"),
    }.items()
}
STALE = "run again: python tools/evidence/recompute.py readings"


def made_up(value):
    """Return a computation with three options whose result is a function of the first two."""

    @reproduces(TABLE, cells=[CELL], options=OPTIONS)
    def computation(inputs, *, a, b, c):
        return {CELL: value(a, b)}

    return computation


def judged(computation):
    """Return the summary and the record of the made-up cell."""
    found = readings.evaluate(computation)
    return found.summary(CELL), ledger._results(found, library()[TABLE])[CELL]


def conditional(a, b):
    """The second option counts under one alternative of the first; the third never does."""
    return 0.99761 if a == "one" else {"x": 0.99762, "y": 0.5, "z": 0.6}[b]


def test_every_combination_is_evaluated():
    @reproduces(TABLE, cells=[CELL], options=OPTIONS)
    def computation(inputs, *, a, b, c):
        return {CELL: float(every.index((a, b, c)))}

    every = list(product(*OPTIONS.values()))
    found = readings.evaluate(computation).cells[CELL]
    assert [one.computed for one in found] == list(range(len(every)))
    assert [tuple(one.values()) for one in computation.readings] == every


def test_the_readings_of_an_item_are_the_product_of_the_options_in_its_data():
    for key in (key for key in catalogue() if item_text(key).options):
        for computation in computations(key):
            counts = [len(item_text(key).options[name]) for name in computation.options]
            lacking = computation.function.__name__ == "last_reference_angle"
            assert lacking or len(computation.readings) == np.prod(counts)
            names = {tuple(one.items()) for one in computation.readings}
            assert len(names) == len(computation.readings)
            assert computation.readings[0] == computation.literal


def test_readings_with_one_result_are_one_reading_with_the_choices_that_count():
    found = readings.evaluate(made_up(conditional)).distinct(CELL)
    assert [(one.choices, one.computed) for one in found] == [
        ({"a": "one"}, 0.99761),
        ({"a": "two", "b": "x"}, 0.99762),
        ({"a": "two", "b": "y"}, 0.5),
        ({"a": "two", "b": "z"}, 0.6),
    ]


def test_a_cell_that_agrees_with_some_readings_is_ambiguous():
    summary, record = judged(made_up(conditional))
    assert (summary.count, summary.agreeing) == (4, 2)
    assert summary.decided_by == ("a", "b")
    assert summary.agrees_if == ({"a": "one"}, {"b": "x"})
    assert summary.never == {}
    assert summary.closest.choices == {"a": "one"}
    assert (record.verdict, record.flags, record.share) == ("ambiguous", (), None)
    assert record.readings == summary
    assert (
        record.why == "depends on a, b: the printed number agrees with 2 of 4 readings"
    )


def test_the_smallest_set_of_options_that_decides_is_named():
    """The first option moves the result and decides nothing."""
    summary, _ = judged(
        made_up(lambda a, b: (0.9976 if b == "y" else 0.5) + 1e-5 * (a == "two"))
    )
    assert (summary.count, summary.agreeing) == (4, 2)
    assert summary.decided_by == ("b",)
    assert summary.agrees_if == ({"b": "y"},)
    assert summary.never == {"b": ("x", "z")}
    # A comma joins the choices of one reading.
    assert deciding(summary).endswith("Always with b=y. Never with b=x; or b=z")
    full = summary.model_copy(update={"agrees_if": summary.agrees_if * 4})
    assert "b=y (at most four choices are listed). Never" in deciding(full)


def test_readings_with_equal_verdicts_leave_the_verdict():
    every = {name: tuple(ways) for name, ways in OPTIONS.items()}
    for middle, verdict in ((0.9976, "exact"), (0.5, "differs")):
        value = functools.partial(lambda m, a, b: m + 1e-5 * (a == "two"), middle)
        summary, record = judged(made_up(value))
        agrees = verdict == "exact"
        assert record.verdict == verdict
        assert (summary.count, summary.agreeing) == (2, 2 * agrees)
        assert summary.decided_by == ()
        assert summary.agrees_if == (({},) if agrees else ())
        assert summary.never == ({} if agrees else every)
    summary, record = judged(made_up(lambda a, b: 0.9976))
    assert summary.count == 1
    assert (record.verdict, record.readings) == ("exact", None)


STORED = recompute.stored_computations()


@pytest.mark.parametrize("name", STORED)
def test_three_readings_of_a_stored_computation_are_computed_again(name):
    computation = STORED[name]
    every = computation.readings
    places = np.random.default_rng(len(every)).choice(
        range(1, len(every)), 3, replace=False
    )
    again = recompute.packed(
        readings.evaluate_readings(computation, [every[i] for i in places])
    )
    stored, _ = readings._study()
    assert set(again) == {cell for cell in stored if cell.startswith(f"{name}:")}
    for cell, array in again.items():
        # A processor may count one replicate more among those as far out as the printed table.
        count = 2 / computation.replicates if cell.endswith(":joint") else 0.0
        np.testing.assert_allclose(array, stored[cell][places], rtol=1e-9, atol=count)


CAMERA = simulation.calibrated_parameters


def test_changed_options_inputs_and_results_make_the_stored_readings_stale(monkeypatch):
    """The literal reading is computed anew and compared."""
    again, before = readings.evaluate.__wrapped__, readings.fingerprint(CAMERA)
    fewer = {**CAMERA.options, "repeats": {"one": CAMERA.options["repeats"]["one"]}}
    square = CAMERA.options["angles"]["square"]
    moved = square.model_copy(update={"text": "quincunx"})
    angles = {**CAMERA.options["angles"], "square": moved}
    for options in (fewer, {**CAMERA.options, "angles": angles}):
        with pytest.raises(ValueError, match=f"other inputs or options; {STALE}"):
            again(replace(CAMERA, options=options))
    inputs = load_inputs(CAMERA.inputs)
    noise = replace(inputs.cells[simulation.NOISE], content=PrintedNumber("0.06"))
    with monkeypatch.context() as patched:
        moved = replace(inputs, cells={**inputs.cells, simulation.NOISE: noise})
        patched.setattr(readings, "load_inputs", lambda _: moved)
        assert readings.fingerprint(CAMERA) != before
        with pytest.raises(ValueError, match=STALE):
            again(CAMERA)
    (arrays, note), name = readings._study(), f"{CAMERA.name}:scale.red"
    changed = {**arrays, name: arrays[name] * (1 + 1e-5)}
    monkeypatch.setattr(readings, "_study", lambda: (changed, note))
    with pytest.raises(ValueError, match=rf"table-3#scale\.red is .*{STALE}$"):
        again(CAMERA)


def test_a_reading_that_agrees_weakly_is_farther_than_one_without_a_flag():
    found = readings.evaluate(made_up(lambda a, b: 0.99761))
    plain, *_ = found.cells[CELL]
    weak = plain.model_copy(update={"flags": ("rounding",), "computed": 0.9976})
    assert found._closeness(CELL, plain) > found._closeness(CELL, weak)


def test_reasons_of_ambiguous_cells_are_those_of_their_readings():
    optimum, accuracy = (
        agreeing("chen2023/text-resolution", name)[0]
        for name in ("optimum", "optimum-accuracy")
    )
    three = [(one["radius"], one["noise"], one["light"]) for one in optimum]
    assert {one[:2] for one in three} == {("one-over-e", "photon"), ("half", "read")}
    both = [one for one in optimum if one in accuracy]
    assert {(one["radius"], one["noise"]) for one in both} == {("half", "read")}
    assert {one["light"] for one in both} == {"brighter"}
    assert "sigma" not in {one["radius"] for one in [*optimum, *accuracy]}
    reason = ledger.expected("chen2023/text-resolution#optimum").reason
    assert "only with one half, read noise and the larger flux" in reason
    _, others = agreeing("niu2024/table-3", "translation-x.blue")
    excepted = {
        (one["angles"], one["repeats"])
        for one in others
        if one["translations"] == "table-2"
    }
    assert excepted == {("hexagonal-from-corner", "ten")}
    reason = ledger.expected("niu2024/table-3#translation-x.blue").reason
    assert "except in x of blue" in reason
    one_noise = {"noise": "red-and-blue", "repeats": "one", "rmse": "both"}
    one_noise |= {"tests": "angles", "parameters": "fitted"}
    key, shared = "niu2024/text-simulation", []
    for name in ("rmse-after-red", "rmse-after-blue"):
        found = agreeing(key, name)[0]
        shared.append({o["angles"] for o in found if o.items() >= one_noise.items()})
    assert shared[0] - shared[1] == {"rectangle"}
    assert "except with the arrangement" in ledger.expected(f"{key}#{name}").reason


def agreeing(key, name):
    """Return the readings with which a cell agrees, and the others."""
    (computation,) = (one for one in computations(key) if one.makes(name))
    cells = readings.evaluate(computation).cells[name]
    found = list(zip(computation.readings, cells, strict=True))
    return [
        [choices for choices, one in found if one.agrees is yes]
        for yes in (True, False)
    ]
