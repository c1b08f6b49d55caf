"""The simulation under every reading: against the ledger's own, theory, and what is stored."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.stats import ks_2samp

import every_reading
import recompute
from parts import Store
from reproduce.judge import readings as judged
from reproduce.judge.ledger import build
from reproduce.papers.declare import LEAST_DRAWS, Reading
from reproduce.papers.niu2024 import readings, simulation
from reproduce.physics.optics import channel_centroids
from reproduce.physics.registration import calibrate, starting_values
from reproduce.printed.cells import find
from reproduce.printed.given import given

DOOR = given(readings.READS)
READINGS = readings.readings(DOOR)
LITERAL = READINGS.index(readings.literal(DOOR))


@pytest.fixture(scope="module")
def stored():
    return readings.stored()


@pytest.fixture(scope="module")
def drawn():
    return every_reading.simulate(DOOR, 400)


def printed_values():
    """Return the print, in the order of `ADDRESSES`, in rad and px."""
    return [find(address)[0].si for address in readings.ADDRESSES]


def place(**choices):
    """Return the place of the literal reading with some choices changed."""
    return READINGS.index(readings._Choices(**{**vars(READINGS[LITERAL]), **choices}))


def test_there_is_a_reading_for_every_combination_of_choices():
    assert len(set(READINGS)) == len(READINGS) == 9 * 2 * 2 * 3 * 2


def test_the_ledgers_readings_are_those_of_the_study(drawn):
    """The same law, though drawn apart and fitted by the paper's iteration."""
    results = {
        **simulation.calibrated_parameters(DOOR, 1500),
        **simulation.calibrated_translations(DOOR, 1500),
        **simulation.registration_rmse(DOOR, 1500),
    }
    choices = {
        "principal points of Table 1": ({}, "both axes"),
        "translations of Table 2": ({"shifts": "Table 2"}, "both axes"),
        "noise in all channels, (26)": ({}, "both axes"),
        "green without noise, (26)": ({"noisy": "red and blue"}, "both axes"),
        "ten draws averaged, (26)": ({"repeats": 10}, "both axes"),
        "noise in all channels, one axis": ({}, "one axis on average"),
        "shifts of Table 1, (26)": ({}, "both axes"),
        "shifts of Table 2, (26)": ({"shifts": "Table 2"}, "both axes"),
        "shifts of Table 2, one axis": ({"shifts": "Table 2"}, "one axis on average"),
    }
    among = {"shifts": "Table 2", "tests": "among the angles"}
    choices["shifts of Table 2, (26), tests among the angles"] = (among, "both axes")
    choices["shifts of Table 2, one axis, tests among the angles"] = (among, "one axis on average")
    for channel_place, channel in enumerate(simulation.REGISTERED):
        for cell_place, cell in enumerate(readings._CELLS):
            name = f"{cell}-{channel}" if cell.startswith("rmse") else f"{cell}.{channel}"
            result = results[name]
            literal = [Reading("principal points of Table 1", "", result)]
            for reading in getattr(result, "readings", literal):
                changed, axes = choices[reading.name]
                ours = every_reading.counted(drawn[place(**changed)], axes)
                found = ks_2samp(ours[:, channel_place, cell_place], reading.result.draws)
                assert found.pvalue > 1e-3, (name, reading.name)


def test_a_verdict_of_the_simulation_holds_under_every_reading_or_the_cell_is_blocked(stored):
    """All readings stored, with every way of counting axes: 864 for each cell."""
    agree = judged._resolved(stored.arrays["tails"], stored.arrays["law_tails"], 10_000) >= 0.01
    records = build(["niu2024/table-3", "niu2024/text-simulation"])
    for number, address in enumerate(readings.ADDRESSES):
        found = set(agree[..., number].ravel().tolist())
        verdict = {(True,): "consistent", (False,): "differs"}.get(tuple(found), "blocked")
        assert records.cell(address).verdict == verdict, address


def test_the_closed_form_is_the_end_of_the_papers_iteration():
    """Also where the zero position is not among the angles."""
    few = every_reading.numbers(DOOR, 2)
    every = every_reading.simulate(DOOR, 2)
    names = [found.offset for found in simulation.candidates(DOOR)]
    for arrangement in (names.index("centred"), names.index("half a spacing along both")):
        table = simulation.candidates(DOOR)[arrangement].angles
        used = simulation.cameras(DOOR)
        true = channel_centroids(used, simulation.rotations(DOOR), table)
        measured = true + 0.05 * few.calibration
        at_zero = np.flatnonzero(np.isclose(table, 0).all(axis=1))
        principal = np.stack([camera.principal_point for camera in used])[:, None]
        zero = measured[:, :, at_zero] if len(at_zero) else principal + 0.05 * few.zero
        green, red = measured[:, 0], measured[:, 1]
        rows = np.isclose(table[:, 1], table[np.abs(table[:, 1]).argmin(), 1])
        start = starting_values(red[:, rows], green[:, rows], zero[:, 1, 0], zero[:, 0, 0])
        found = calibrate(red, green, zero[:, 1, 0], start).parameters
        closed = every[place(arrangement=arrangement), :, 0, :4]
        np.testing.assert_allclose(closed, found, rtol=0, atol=1e-8)


def test_replicates_depend_neither_on_how_many_nor_on_where_they_begin(drawn):
    np.testing.assert_array_equal(every_reading.simulate(DOOR, 2, first=7), drawn[:, 7:9])


def test_averages_of_ten_scatter_by_the_root_of_ten_less(drawn):
    ten = drawn[place(repeats=10)].std(axis=0)
    ratio = drawn[LITERAL].std(axis=0)[:, :4] / ten[:, :4]
    np.testing.assert_allclose(ratio, np.sqrt(10), rtol=1e-3)


@pytest.mark.parametrize("noisy", ["red and blue", "green"])
def test_noise_in_one_channel_scatters_by_the_root_of_two_less(drawn, noisy):
    one = drawn[place(noisy=noisy)].std(axis=0)
    ratio = drawn[LITERAL].std(axis=0)[:, :4] / one[:, :4]
    np.testing.assert_allclose(ratio, np.sqrt(2), rtol=0.15)


def test_noise_in_green_alone_moves_both_channels_alike_and_noise_in_the_others_neither(drawn):
    for noisy, expected in (("green", 1.0), ("every channel", 0.5), ("red and blue", 0.0)):
        red, blue = np.moveaxis(drawn[place(noisy=noisy)][:, :, :4], 1, 0)
        together = [np.corrcoef(r, b)[0, 1] for r, b in zip(red.T, blue.T, strict=True)]
        tolerance = 1e-4 if noisy == "green" else 5 / np.sqrt(len(red))
        np.testing.assert_allclose(together, expected, atol=tolerance, err_msg=noisy)


def test_what_green_alone_leaves_of_the_table_by_hand():
    """It is the noise of green, averaged: red and blue get the same shift, printed ones differ."""
    red, blue = every_reading.simulate(DOOR, 5)[place(noisy="green", shifts="Table 2")].swapaxes(
        0, 1
    )
    moved = [c[:, 2:4] - t for c, t in ((red, (0.3, 0.5)), (blue, (-0.4, -0.6)))]
    np.testing.assert_allclose(moved[0], moved[1], atol=5e-5)
    printed = np.array([[0.3012, 0.5024], [-0.4032, -0.5986]]) - [[0.3, 0.5], [-0.4, -0.6]]
    assert (np.abs(printed[0] - printed[1]) > 2 * 5e-5 + 5e-5).all()


def test_every_way_of_counting_the_axes():
    measured = np.array([[1.0, 2, 3, 4, 0.3, 0.4, 0.05, 0.12]])
    expected = {
        "both axes": (0.5, 0.13),
        "one axis on average": (0.5 / np.sqrt(2), 0.13 / np.sqrt(2)),
        "x alone": (0.3, 0.05),
        "y alone": (0.4, 0.12),
    }
    assert set(expected) == set(readings.COUNTED)
    for axes, residuals in expected.items():
        found = every_reading.counted(measured, axes)
        np.testing.assert_allclose(found[0], [1, 2, 3, 4, *residuals])


def test_the_translations_of_table_2_come_out_where_they_go_in(drawn):
    found = drawn[place(shifts="Table 2"), :, :, 2:4]
    expected = [[0.3, 0.5], [-0.4, -0.6]]
    assert (np.abs(found.mean(axis=0) - expected) < 5 * found.std(axis=0) / 20).all()


def test_test_points_among_the_angles_are_never_drawn_twice():
    chosen = every_reading.numbers(DOOR, 30).chosen
    assert chosen.shape == (30, 52)
    assert all(len(set(row)) == 52 for row in chosen.tolist())
    assert chosen.min() >= 0
    assert chosen.max() <= 136
    assert len(np.unique(chosen)) == 137


def test_the_stored_replicates_are_recomputed(stored):
    np.testing.assert_allclose(
        every_reading.simulate(DOOR, 3), stored.arrays["first"][:, :3], atol=1e-9
    )


def test_the_stored_tails_are_those_of_a_small_run(stored, drawn):
    wanted = [LITERAL, place(shifts="Table 2"), place(shifts="Table 2", tests="among the angles")]
    found = recompute.stacked(map(recompute.compare, drawn[wanted]))
    tails = stored.arrays["tails"][wanted]
    error = 2 * np.sqrt(tails / 2 * (1 - tails / 2) / drawn.shape[1]) + 3 / drawn.shape[1]
    assert (np.abs(found["tails"] - tails) < 5 * error).all()
    # A standard deviation from 400 draws is good to 3.5 %. (The powers of the residuals are not,
    # far out; the stored ones come from 25 times as many draws.)
    parameters = list(judged.GROUPS).index("Table 3")
    distance = stored.arrays["distance"][wanted][..., parameters]
    np.testing.assert_allclose(found["distance"][..., parameters], distance, rtol=5 * 0.035)


def test_the_law_of_the_draws_agrees_with_their_count(stored):
    """For every reading and cell whose tail holds two hundred draws or more."""
    tails, law = stored.arrays["tails"], 10 ** stored.arrays["law_tails"]
    many = tails * 10_000 > 200
    assert many.sum() > 4000
    # The count has its luck; the law, of a shape that is nearly but not quite Gaussian, its error.
    luck = np.sqrt(2 * tails / 10_000)
    assert (np.abs(law - tails) < 5 * luck + 0.1 * tails)[many].all()
    few = ~many & (tails * 10_000 > LEAST_DRAWS)
    assert few.sum() > 50
    assert (np.abs(np.log10(law / np.maximum(tails, 1e-9))) < 0.5)[few].all()


def test_where_counting_ends_the_law_takes_over(stored):
    """No probability below what the draws can tell is left at their floor."""
    for counted, law in (("tails", "law_tails"), ("joint", "law_joint")):
        arrays = stored.arrays[counted], stored.arrays[law]
        found = judged._resolved(*arrays, 10_000)
        beyond = arrays[0] * 10_000 < LEAST_DRAWS
        np.testing.assert_array_equal(found[beyond], 10.0 ** arrays[1][beyond])
        np.testing.assert_array_equal(found[~beyond], arrays[0][~beyond])
    assert stored.arrays["law_joint"][..., -1].max() < -30, "no reading explains all cells"


def test_no_reading_makes_the_printed_scales_likely(stored):
    """By hand: the scale's error is noise over the root of the spots' squared distances."""
    tails = judged._resolved(stored.arrays["tails"], stored.arrays["law_tails"], 10_000)
    assert tails[..., judged._SCALE].max() < 1e-12
    reach = np.square(simulation.literal(DOOR).angles * 25e-3 / 3.45e-6).sum()
    sd = 0.05 * np.sqrt(2) / np.sqrt(reach)
    assert 15 * sd < 0.9976 - 0.9973 - 0.00005


def test_what_the_book_says_of_the_closest_readings(stored):
    """They leave the two scales outside, and no other cell by itself."""
    outside = judged._resolved(stored.arrays["tails"], stored.arrays["law_tails"], 10_000) < 0.01
    closest = outside.sum(axis=-1) == outside.sum(axis=-1).min()
    np.testing.assert_array_equal(outside[closest], np.broadcast_to(judged._SCALE, (4, 12)))
    groups = list(judged.GROUPS)
    residuals = stored.arrays["law_joint"][..., groups.index("residuals")]
    assert residuals[closest].max() < -12, "but the residuals are not there together"


def test_red_residuals_exceed_blue_ones_before_registration_and_do_not_in_print(stored, drawn):
    """On the same stars, in all readings with the translations of Table 2 and the RMSE of y."""
    for kind in readings.TESTS:
        before = drawn[place(shifts="Table 2", tests=kind)][..., 5]
        assert (before[:, 0] > before[:, 1]).mean() > 0.99
    printed = [find(f"niu2024/text-simulation#rmse-before-{c}")[0] for c in ("red", "blue")]
    assert printed[0].number.value < printed[1].number.value


def test_correction_for_many_readings():
    np.testing.assert_allclose(judged._corrected(np.array([0.001, 0.9]), 288), [0.288, 1.0])


def test_every_reading_has_its_row_and_every_cell_its_probability(stored):
    table = judged._probabilities()
    assert len(table) == len(READINGS) * len(readings.COUNTED)
    assert table["Angles"].nunique() == 9
    first = table.iloc[0]
    assert (first["Angles"], first["RMSE of"]) == (
        simulation.literal(DOOR).name,
        readings.COUNTED[0],
    )
    labels = [f"{n}, {c}" for c in ("red", "blue") for n in ("k", "θ", "Δx", "Δy")]
    tails = judged._resolved(stored.arrays["tails"], stored.arrays["law_tails"])
    places = [0, 1, 2, 3, 6, 7, 8, 9]
    np.testing.assert_array_equal(table[labels], tails.reshape(-1, 12)[:, places])
    assert (table["Cells outside"] == (tails < 0.01).sum(axis=-1).ravel()).all()
    assert (table["p, all, corrected"] <= 864 * table["p, all"]).all()


def test_the_bound_of_corrected_probabilities_is_that_of_the_law_times_the_readings():
    tried = len(READINGS) * len(readings.COUNTED)
    assert np.ceil(np.log10(tried)) == np.log10(judged._LEAST_CORRECTED / judged._LEAST)


def test_the_closest_readings_stand_with_their_distance(stored):
    table = judged._closest()
    assert list(table["Reading"])[:2] == ["the literal one", "fewest cells outside"]
    assert len(table) == 2 + len(judged.GROUPS)
    distances = table[[f"Distance, {group} (σ)" for group in judged.GROUPS]].to_numpy()
    assert (distances[:, -1] >= distances.max(axis=1)).all(), "farther out than any part"
    assert table["Cells outside"].min() == table["Cells outside"][1]
    for row, group in enumerate(judged.GROUPS, start=2):
        nearest = stored.arrays["distance"][..., row - 2].min()
        assert table[f"Distance, {group} (σ)"][row] == nearest


def test_draws_are_the_same_on_any_executor_and_go_on_after_a_stop(tmp_path, monkeypatch):
    monkeypatch.setattr(every_reading, "CHUNK", 1)
    store = Store(tmp_path, {"replicates": 4})
    with ThreadPoolExecutor(2) as pool:
        drawn = recompute.all_draws(4, pool, store)
    np.testing.assert_array_equal(drawn, every_reading.simulate(DOOR, 4))
    assert len(list(tmp_path.glob("part-*.npz"))) == 4
    (tmp_path / "part-2.npz").unlink()
    np.testing.assert_array_equal(recompute.all_draws(4, None, store), drawn)
