"""An item computed again under a reader's change."""

import itertools
from decimal import Decimal

import numpy as np
import pytest

import reproduce as rp
from reproduce.judge import rerun
from reproduce.judge.ledger import record_of
from reproduce.judge.readings import evaluate
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import changeable, computations
from reproduce.printed.cells import find
from reproduce.printed.quantity import si_value

NOISE = "niu2024/text-simulation#noise"
TABLE = "chen2023/table-5"


def cells(found):
    """Return the cells by name."""
    return {one.cell.name: one for one in found.cells}


def test_four_times_the_noise_widens_table_3_fourfold():
    """A value as printed changes no bit. The numbers of the ledger are stored."""
    found, before = (
        cells(rerun.Rerun("niu2024/table-3", {NOISE: f"{value} px"}))
        for value in (0.2, 0.05)
    )
    for name, one in before.items():
        width = np.diff(found[name].interval) / np.diff(one.interval)
        assert width.item() == pytest.approx(4, rel=2e-3), name
        assert found[name].value != found[name].unchanged
        assert one.value == one.unchanged
        stored = record_of(f"niu2024/table-3#{name}").computed
        assert one.value == pytest.approx(stored, rel=1e-13)


def test_recomputed_values_replace_printed_ones(monkeypatch):
    """The motion follows the position, the angle the motion, the difference both angles."""
    address = f"{TABLE}#2.position-x"
    change = {address: f"{find(address)[0].number.value + 10} um"}
    found = rerun.Rerun(TABLE, change)
    motion, reference, other = (
        cells(found)[name] for name in ("2.motion-x", "2.reference-y", "4.reference-x")
    )
    assert motion.value == pytest.approx(motion.unchanged + 10)
    ratio = motion.value / motion.unchanged
    assert reference.value / reference.unchanged == pytest.approx(ratio, rel=1e-4)
    assert other.value == other.unchanged
    assert {f"{TABLE}#2.motion-x", f"{TABLE}#2.reference-y"} <= set(found.replaced)
    untouched = {f"{TABLE}#2.motion-y", f"{TABLE}#3.motion-x", f"{TABLE}#4.motion-y"}
    assert not untouched & set(found.replaced)
    # An input that no change reaches stays as printed, for any rounding noise.
    made, noise = rerun._median, itertools.cycle((1.0, 1 + 4e-14))
    monkeypatch.setattr(rerun, "_median", lambda *args: made(*args) * next(noise))
    again = rerun.Rerun(TABLE, change)
    assert cells(again).keys() == cells(found).keys()
    assert set(again.replaced) == set(found.replaced)


def test_an_assumed_value_replaces_no_measurement():
    """The residuals of the laboratory are measured; their computed values are an example."""
    lab = "niu2024/text-experiment"
    for address, value in (
        ("table-4#radial-distortion.red", "3.42e-5 mm^-2"),
        ("text-optics#pixels-x", "2065 px"),
        ("text-simulation#noise", "0.06 px"),
    ):
        found = rerun.Rerun(lab, {f"niu2024/{address}": value}, replicates=50)
        for name, one in cells(found).items():
            if name.startswith("pointing-error"):
                assert one.value == one.unchanged, (address, name)
        assert not any("rmse-after" in name for name in found.replaced)
    assert f"{lab}#rmse-after-red-x" in changeable(f"{lab}#pointing-error-red-x")
    assert NOISE not in changeable(f"{lab}#pointing-error-red-x")


def test_inputs_of_an_item_and_of_a_cell_are_direct_or_through_other_items():
    inputs = changeable("chen2023/text-effectiveness")
    for cell in ("2.difference-x", "2.monitoring-x", "2.position-x"):
        assert f"{TABLE}#{cell}" in inputs
    whole, cell = (changeable(name) for name in (TABLE, f"{TABLE}#2.motion-x"))
    assert set(cell) < set(whole)
    names = {address.partition(".")[2] for address in cell}
    assert names == {"position-x", "position-y"}
    monitored = changeable(f"{TABLE}#2.monitoring-y")
    assert len(monitored) == len(set(monitored))
    assert changeable("niu2024/table-1#focal-length.red") == ()


def test_only_inputs_of_an_item_can_be_changed():
    for key in filter(computations, catalogue()):
        allowed = changeable(key)
        assert set(allowed) >= {
            cell.address
            for computation in computations(key)
            for pattern in computation.inputs
            for cell in find(pattern)
            if cell.is_number
        }
        with pytest.raises(ValueError, match=r"#matched-stars: ") as refused:
            rerun.Rerun(key, {"niu2024/text-context#matched-stars": "4"})
        named = str(refused.value).partition("such as ")[2].partition(". All")[0]
        assert set(named.split(", ")) <= set(allowed)
    for stray, first in (
        ("noise", "niu2024/text-simulation#noise"),
        ("niu2024/text-simulation#noize", "niu2024/text-simulation#noise"),
        ("focal-length", "niu2024/table-1#focal-length.red"),
    ):
        with pytest.raises(ValueError, match=rf"^{stray}: .* such as {first}"):
            rerun.Rerun("niu2024/table-3", {stray: "1"})


def test_seed_and_replicates_are_changes():
    first, again, other = (
        rerun.Rerun("niu2024/table-3", seed=seed, replicates=50) for seed in (7, 7, 8)
    )
    assert first.cells == again.cells
    assert first.changes == {"seed": "7", "replicates": "50"}
    assert cells(first)["scale.red"].value != cells(other)["scale.red"].value
    for name in ("seed", "replicates"):
        for key, value, error in (
            ("niu2024/table-2", 9, ValueError),
            ("niu2024/table-3", -1, ValueError),
            ("niu2024/table-3", True, TypeError),
        ):
            with pytest.raises(error, match=f"^{name}: "):
                rerun.Rerun(key, **{name: value})


def test_a_row_keeps_its_name_if_its_heading_is_changed():
    key = "chen2023/table-4"
    found = cells(rerun.Rerun(key, {f"{key}#25.frames": "49"}, replicates=50))
    assert found["25.transform-x"].value == found["49.transform-x"].value


def test_a_seed_counts_if_random_numbers_are_drawn_between_a_change_and_an_item():
    """The text quotes Table IV, which is drawn again if its frames are changed."""
    key, frames = "chen2023/text-accuracy", {"chen2023/text-accuracy#frames": "400"}
    first, other = (
        cells(rerun.Rerun(key, frames, seed=seed, replicates=50))["transform-single-x"]
        for seed in (7, 8)
    )
    assert first.value != other.value
    with pytest.raises(ValueError, match=r"^seed: "):
        rerun.Rerun(key, {"chen2023/table-4#1.transform-x": "0.9″"}, seed=7)


@pytest.mark.parametrize("key", [key for key in catalogue() if rerun.options(key)])
def test_a_rerun_with_options_is_the_reading_of_the_ledger(key):
    """The last alternative of every option, computed and as it is stored."""
    options = rerun.options(key)
    assert all(name.isidentifier() for name in options), "keywords of Table.rerun"
    chosen = {name: list(ways)[-1] for name, ways in options.items()}
    found = rerun.Rerun(key, chosen=chosen)
    assert found.is_reading
    for computation in computations(key):
        literal = computation.with_options(found.options).literal
        place = computation.readings.index(literal)
        for name, readings in evaluate(computation).cells.items():
            one, reading = cells(found)[name], readings[place]
            if one.verdict != "unpublished":
                assert one.verdict == reading.verdict, name
                assert one.value == pytest.approx(reading.computed, rel=1e-9), name
                assert one.interval == pytest.approx(reading.interval, rel=1e-9), name


def test_options_with_a_change_have_no_verdict():
    chosen = {"noise": "green"}
    found = rerun.Rerun("niu2024/table-3", seed=7, replicates=50, chosen=chosen)
    assert not found.is_reading
    assert not any(one.verdict for one in found.cells)
    unchanged = repr(rp.table("niu2024/table-2").rerun())
    assert "with no change: the printed inputs, without a verdict." in unchanged


def test_changes_that_do_not_fit_are_named():
    for cell, value in (("test-points", "1041"), ("noise", "-1 px")):
        changes = {f"niu2024/text-simulation#{cell}": value}
        with pytest.raises(ValueError, match=f"{cell}.*{value}"):
            cells(rerun.Rerun("niu2024/text-simulation", changes, replicates=5))
    window = "chen2023/text-resolution#window-x"
    with pytest.raises(ValueError, match=rf"{window}: expected a whole .* 5\.4"):
        cells(rerun.Rerun("chen2023/text-resolution", {window: "5.4 px"}, replicates=5))
    for value in ("0.2", "0.2 mm", "0.2 parsec", "much", "", "1e999 px", "1.2.3 px"):
        with pytest.raises(ValueError, match=f"{NOISE}: .*'{value}'"):
            rerun.Rerun("niu2024/table-3", {NOISE: value})


def test_changes_that_are_no_mapping_of_addresses_are_named():
    views = rp.table("niu2024/table-3"), rp.figure("niu2024/fig-4")
    for view, changes in itertools.product(views, ("x", {5: "1"})):
        with pytest.raises(TypeError, match=r"^changes: "):
            view.rerun(changes)
    with pytest.raises(ValueError, match="which has none"):
        rp.table("niu2024/table-1").rerun({"a": "1"})
    for choice in ("x", ["green"]):
        with pytest.raises(ValueError, match=r"^noise: "):
            views[0].rerun(noise=choice)


def test_values_have_any_unit_of_their_kind():
    focal, count, angle, scale = (
        find(f"niu2024/{address}")[0]
        for address in (
            "table-1#focal-length.red",
            "text-simulation#angle-count",
            "table-2#rotation.red",
            "table-2#scale.red",
        )
    )
    texts = "60.1 mm", "0.0601 m", "60100 µm", "60100 μm", "60100 um", "6.01e1mm"
    for value in (*texts, 60.1, np.float32(60.1), Decimal("60.1")):
        assert si_value(focal, value) == pytest.approx(0.0601, rel=1e-12)
    assert si_value(focal, np.int64(60)) == pytest.approx(0.06)
    assert (si_value(count, "0"), si_value(count, "12")) == (0, 12)
    assert si_value(angle, "−0.07°") == pytest.approx(np.radians(-0.07))
    assert si_value(scale, "99 %") == pytest.approx(0.99)
    for cell, value in ((count, "12.5"), (count, "-1"), (angle, "7 %")):
        with pytest.raises(ValueError, match=cell.name):
            si_value(cell, value)
