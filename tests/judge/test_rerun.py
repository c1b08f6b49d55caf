"""An item computed again under a reader's change."""

import itertools

import numpy as np
import pytest

from reproduce.judge import rerun
from reproduce.judge.ledger import build
from reproduce.judge.readings import evaluate
from reproduce.judge.rerun import CannotChangeError
from reproduce.papers.catalogue import catalogue, changeable
from reproduce.papers.niu2024 import simulation
from reproduce.printed.cells import find
from reproduce.printed.inputs import load_inputs
from reproduce.printed.quantity import si_value

NOISE = "niu2024/text-simulation#noise"
TABLE = "chen2023/table-5"


def cells(found):
    """Return the cells by name."""
    return {one.cell.name: one for one in found.cells}


def test_four_times_the_noise_widens_table_3_fourfold():
    found = cells(rerun.rerun("niu2024/table-3", {NOISE: "0.2 px"}))
    before = cells(rerun.rerun("niu2024/table-3", {NOISE: "0.05 px"}))
    for name, one in found.items():
        width = np.diff(one.interval) / np.diff(before[name].interval)
        assert width.item() == pytest.approx(4, rel=2e-3), name
        assert one.value != one.unchanged


def test_the_print_itself_changes_nothing():
    """A value as printed changes no bit. The ledger's numbers are stored, from any processor."""
    found = cells(rerun.rerun("niu2024/table-3", {NOISE: "0.05 px"}))
    judged = build(["niu2024/table-3"])
    for name, one in found.items():
        assert one.value == one.unchanged
        stored = judged.cell(f"niu2024/table-3#{name}").computed
        assert one.value == pytest.approx(stored, rel=1e-13)


def test_recomputed_values_take_the_place_of_printed_ones():
    """The motion follows the position, the angle the motion, the difference both angles."""
    address = f"{TABLE}#2.position-x"
    printed = find(address)[0].number.value
    found = rerun.rerun(TABLE, {address: f"{printed + 10} um"})
    told = cells(found)
    assert told["2.motion-x"].value == pytest.approx(told["2.motion-x"].unchanged + 10)
    ratio = told["2.reference-y"].value / told["2.reference-y"].unchanged
    assert ratio == pytest.approx(
        told["2.motion-x"].value / told["2.motion-x"].unchanged, rel=1e-4
    )
    assert f"{TABLE}#2.motion-x" in found.replaced
    assert f"{TABLE}#2.reference-y" in found.replaced
    untouched = {f"{TABLE}#2.motion-y", f"{TABLE}#3.motion-x", f"{TABLE}#4.motion-y"}
    assert not untouched & set(found.replaced), (
        "no change reaches these: the print stands"
    )
    assert told["4.reference-x"].value == told["4.reference-x"].unchanged


def test_an_item_reads_through_other_items():
    reads = changeable("chen2023/text-effectiveness")
    assert f"{TABLE}#2.difference-x" in reads
    assert f"{TABLE}#2.monitoring-x" in reads, "through the difference"
    assert f"{TABLE}#2.position-x" in reads, "through motion, angle and difference"


def test_only_what_an_item_reads_can_be_changed():
    for key in (key for key, item in catalogue().items() if item.computations):
        allowed = changeable(key)
        assert set(allowed) >= {
            cell.address
            for computation in catalogue()[key].computations
            for pattern in computation.inputs
            for cell in find(pattern)
            if cell.is_number
        }
        with pytest.raises(CannotChangeError, match=rf"matched-stars.*{allowed[0]}"):
            rerun.rerun(key, {"niu2024/text-context#matched-stars": "4"})


@pytest.mark.parametrize(
    ("stray", "first"),
    [
        ("noise", "niu2024/text-simulation#noise"),
        ("niu2024/text-simulation#noize", "niu2024/text-simulation#noise"),
        ("focal-length", "niu2024/table-1#focal-length.red"),
    ],
)
def test_an_error_names_the_nearest_cells(stray, first):
    with pytest.raises(CannotChangeError, match=rf"^{stray}: .* such as {first}"):
        rerun.rerun("niu2024/table-3", {stray: "1"})


def test_a_cell_reads_what_its_own_computation_reads_directly_or_through_others():
    whole, cell = (changeable(name) for name in (TABLE, f"{TABLE}#2.motion-x"))
    assert set(cell) < set(whole)
    assert {address.partition(".")[2] for address in cell} == {
        "position-x",
        "position-y",
    }
    monitored = changeable(f"{TABLE}#2.monitoring-y")
    assert len(monitored) == len(set(monitored))
    assert changeable("niu2024/table-1#focal-length.red") == (), (
        "an input reads nothing"
    )


def test_seed_and_replicates_are_changes():
    first = rerun.rerun("niu2024/table-3", seed=7, replicates=500)
    again = rerun.rerun("niu2024/table-3", seed=7, replicates=500)
    other = rerun.rerun("niu2024/table-3", seed=8, replicates=500)
    assert first == again
    assert first.changes == {"seed": "7", "replicates": "500"}
    assert cells(first)["scale.red"].value != cells(other)["scale.red"].value


def test_an_item_without_random_numbers_takes_no_seed_and_no_replicates():
    for name in ("seed", "replicates"):
        with pytest.raises(CannotChangeError, match=f"^{name}: .*table-2"):
            rerun.rerun("niu2024/table-2", **{name: 9})
        with pytest.raises(CannotChangeError, match=f"^{name}: "):
            rerun.rerun("niu2024/table-3", **{name: -1})


def test_a_seed_counts_where_random_numbers_are_drawn_between_a_change_and_an_item():
    """The text quotes Table IV, which is drawn again where its frames are changed."""
    key, frames = "chen2023/text-accuracy", "chen2023/text-accuracy#frames"
    single = "chen2023/table-4#1.transform-x"
    few = {"replicates": 50}
    found = [cells(rerun.rerun(key, {frames: "400"}, seed=s, **few)) for s in (7, 8)]
    assert found[0]["transform-single-x"].value != found[1]["transform-single-x"].value
    with pytest.raises(CannotChangeError, match=r"^seed: "):
        rerun.rerun(key, {single: "0.9″"}, seed=7)


OPEN = [key for key in catalogue() if rerun.options(key)]


@pytest.mark.parametrize("key", OPEN)
def test_a_rerun_with_options_is_judged_as_the_reading_of_the_ledger(key):
    """The last alternative of every option, computed and as it is stored."""
    options = rerun.options(key)
    assert all(name.isidentifier() for name in options), "keywords of Table.rerun"
    found = rerun.rerun(
        key, chosen={name: list(ways)[-1] for name, ways in options.items()}
    )
    assert found.is_reading
    for computation in catalogue()[key].computations:
        wanted = computation.with_options(found.options).literal
        place = computation.readings.index(wanted)
        stored = evaluate(computation)
        for name, readings in stored.cells.items():
            one, reading = cells(found)[name], readings[place]
            if one.verdict != "unpublished":
                assert one.verdict == reading.verdict, name
                assert one.value == pytest.approx(reading.computed, rel=1e-9), name
                assert one.interval == pytest.approx(reading.interval, rel=1e-9), name


def test_the_names_of_the_arrangements_are_those_that_have_the_printed_count():
    for name in simulation._OPTIONS["angles"]:
        assert len(simulation.arrangement(load_inputs(simulation.ANGLES), name)) == 137


def test_options_beside_a_change_carry_no_verdict():
    found = rerun.rerun(
        "niu2024/table-3", seed=7, replicates=50, chosen={"noise": "green"}
    )
    assert not found.is_reading
    assert not any(one.verdict for one in found.cells)


def test_rounding_noise_of_a_processor_replaces_nothing(monkeypatch):
    """An input that no change reaches stays as printed, for any rounding noise."""
    change = {f"{TABLE}#2.position-x": "0 um"}
    before = set(rerun.rerun(TABLE, change).replaced)
    made, noise = rerun._middle, itertools.cycle((1.0, 1 + 4e-14))
    monkeypatch.setattr(rerun, "_middle", lambda *inputs: made(*inputs) * next(noise))
    assert set(rerun.rerun(TABLE, change).replaced) == before != set()


def test_a_change_that_cannot_be_computed_is_named():
    for cell, value in (("test-points", "1041"), ("noise", "-1 px")):
        changes = {f"niu2024/text-simulation#{cell}": value}
        with pytest.raises(CannotChangeError, match=f"{cell}.*{value}"):
            rerun.rerun("niu2024/text-simulation", changes, replicates=5)


def test_values_that_do_not_fit_are_refused():
    for value in ("0.2", "0.2 mm", "0.2 parsec", "much", "", "1e999 px", "1.2.3 px"):
        with pytest.raises(CannotChangeError, match=f"{NOISE}: .*'{value}'"):
            rerun.rerun("niu2024/table-3", {NOISE: value})


def test_values_are_read_in_any_unit_of_their_kind():
    (focal,) = find("niu2024/table-1#focal-length.red")
    for value in ("60.1 mm", "0.0601 m", "60100 µm", "60100 um", "6.01e1mm", 60.1):
        assert si_value(focal, value) == pytest.approx(0.0601, rel=1e-12)
    (count,) = find("niu2024/text-simulation#angle-count")
    assert si_value(count, "12") == 12
    (angle,) = find("niu2024/table-2#rotation.red")
    assert si_value(angle, "−0.07°") == pytest.approx(np.radians(-0.07))
    (scale,) = find("niu2024/table-2#scale.red")
    assert si_value(scale, "99 %") == pytest.approx(0.99)
    for cell, value in ((count, "12.5"), (count, "-1"), (angle, "7 %")):
        with pytest.raises(ValueError, match=cell.name):
            si_value(cell, value)


def test_a_changed_value_is_exact():
    """It has no rounding interval: nothing was printed."""
    inputs = load_inputs(["niu2024/table-1#focal-length.red"]).changed(
        {
            "niu2024/table-1#focal-length.red": 0.03,
            "niu2024/table-1#focal-length.blue": 1.0,
        }
    )
    assert inputs["niu2024/table-1#focal-length.red"] == 0.03
    assert inputs.rounded() == []
    assert "niu2024/table-1#focal-length.blue" not in inputs.cells
    assert (
        inputs.shifted({"niu2024/table-1#focal-length.red": 1.0})[
            "niu2024/table-1#focal-length.red"
        ]
        == 0.03
    )
