"""The simulation under every reading: against the ledger's own, theory, and what is stored."""

import numpy as np
import pytest
from scipy.stats import ks_2samp

from reproduce.judge import readings as judged
from reproduce.papers.niu2024 import angles, simulation, study
from reproduce.physics.bounds import registration_bound
from reproduce.physics.calibration import calibrate
from reproduce.physics.similarity import similarity_between
from reproduce.physics.simulate import channel_centroids
from reproduce.physics.starting import starting_values
from reproduce.printed.given import given
from reproduce.store import studies

DOOR = given(study.READS)
READINGS = study.readings(DOOR)
LITERAL = READINGS.index(study.literal(DOOR))


@pytest.fixture(scope="module")
def stored():
    return studies.read("niu2024-readings")


@pytest.fixture(scope="module")
def drawn():
    return study.simulate(DOOR, 400)


def place(**choices):
    """Return the place of the literal reading with some choices changed."""
    return READINGS.index(study.Reading(**{**vars(READINGS[LITERAL]), **choices}))


def test_there_is_a_reading_for_every_combination_of_choices():
    assert len(set(READINGS)) == len(READINGS) == 9 * 2 * 2 * 2 * 2


def test_the_literal_reading_is_the_ledgers(drawn):
    parameters = simulation.calibrated_parameters(DOOR, 1500)
    residuals = simulation.registration_rmse(given(simulation.registration_rmse.given), 1500)
    for channel_place, channel in enumerate(simulation.REGISTERED):
        for cell_place, cell in enumerate(study.CELLS):
            name = f"{cell}-{channel}" if cell.startswith("rmse") else f"{cell}.{channel}"
            ledgers = (residuals if cell.startswith("rmse") else parameters)[name].draws
            found = ks_2samp(drawn[LITERAL, :, channel_place, cell_place], ledgers)
            assert found.pvalue > 1e-3, name


def test_the_closed_form_is_the_end_of_the_papers_iteration():
    """Also where the zero position is not among the angles."""
    few = study.numbers(DOOR, 2)
    every = study.simulate(DOOR, 2)
    names = [found.offset for found in angles.candidates(DOOR)]
    for arrangement in (names.index("centred"), names.index("half a spacing along both")):
        table = angles.candidates(DOOR)[arrangement].angles
        used = study.cameras(DOOR, "Table 1")
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
    np.testing.assert_array_equal(study.simulate(DOOR, 2, first=7), drawn[:, 7:9])


def test_averages_of_ten_scatter_by_the_root_of_ten_less(drawn):
    ten = drawn[place(repeats=10)].std(axis=0)
    ratio = drawn[LITERAL].std(axis=0)[:, :4] / ten[:, :4]
    np.testing.assert_allclose(ratio, np.sqrt(10), rtol=1e-3)


def test_noise_in_one_channel_scatters_by_the_root_of_two_less(drawn):
    one = drawn[place(noisy="red and blue")].std(axis=0)
    ratio = drawn[LITERAL].std(axis=0)[:, :4] / one[:, :4]
    np.testing.assert_allclose(ratio, np.sqrt(2), rtol=0.15)


def test_the_translations_of_table_2_come_out_where_they_go_in(drawn):
    found = drawn[place(shifts="Table 2"), :, :, 2:4]
    expected = [[0.3, 0.5], [-0.4, -0.6]]
    assert (np.abs(found.mean(axis=0) - expected) < 5 * found.std(axis=0) / 20).all()


def test_test_points_among_the_angles_are_never_drawn_twice():
    chosen = study.numbers(DOOR, 30).chosen
    assert chosen.shape == (30, 52)
    assert all(len(set(row)) == 52 for row in chosen.tolist())
    assert chosen.min() >= 0
    assert chosen.max() <= 136
    assert len(np.unique(chosen)) == 137


def test_the_stored_replicates_are_recomputed(stored):
    np.testing.assert_allclose(study.simulate(DOOR, 3), stored.arrays["first"][:, :3], atol=1e-9)


def test_the_stored_moments_are_those_of_a_small_run(stored, drawn):
    count = drawn.shape[1]
    mean, sd = stored.arrays["mean"], stored.arrays["sd"]
    assert (np.abs(drawn.mean(axis=1) - mean) < 5.5 * sd / np.sqrt(count)).all()
    np.testing.assert_allclose(drawn.std(axis=1), sd, rtol=5.5 / np.sqrt(2 * count))
    middle = stored.arrays["quantiles"][:, 2]
    below = (drawn < middle[:, None]).mean(axis=1)
    assert (np.abs(below - 0.5) < 5.5 * 0.5 / np.sqrt(count)).all()


def test_the_stored_tails_are_those_of_a_small_run(stored, drawn):
    wanted = [LITERAL, place(shifts="Table 2"), place(shifts="Table 2", tests="among the angles")]
    found = judged.compare(drawn[wanted])
    tails = stored.arrays["tails"][wanted]
    error = 2 * np.sqrt(tails / 2 * (1 - tails / 2) / drawn.shape[1]) + 3 / drawn.shape[1]
    assert (np.abs(found.tails - tails) < 5 * error).all()


def test_the_scheme_reaches_the_cramer_rao_bound(stored):
    """Within what 10,000 replicates can tell, for both channels and all parameters."""
    used = study.cameras(DOOR, "Table 1")
    turns = simulation.rotations(DOOR)
    true = channel_centroids(used, turns, angles.literal(DOOR).angles)
    for position in (1, 2):
        truth = similarity_between(used[position], turns[position], used[0])
        bound = registration_bound(true[position], truth, 0.05, 0.05).diagonal()
        variance = stored.arrays["sd"][LITERAL, position - 1, :4] ** 2
        np.testing.assert_allclose(variance / bound, 1, atol=5 * np.sqrt(2 / 10_000))


def test_no_reading_makes_the_printed_scales_likely(stored):
    """By hand: the scale's error is noise over the root of the spots' squared distances."""
    scales = [i for i, name in enumerate(judged.ADDRESSES) if "#scale" in name]
    assert stored.arrays["tails"][..., scales].max() < 0.01
    reach = np.square(angles.literal(DOOR).angles * 25e-3 / 3.45e-6).sum()
    sd = 0.05 * np.sqrt(2) / np.sqrt(reach)
    assert 15 * sd < 0.9976 - 0.9973 - 0.00005


def test_what_the_book_says_of_the_closest_readings(stored):
    """Which cells the readings closest to the print leave outside."""
    outside = stored.arrays["tails"] < 0.01
    closest = outside[outside.sum(axis=-1) == outside.sum(axis=-1).min()]
    for i, address in enumerate(judged.ADDRESSES):
        if "#scale" in address:
            assert closest[:, i].all()
        elif "before" not in address:
            assert not closest[:, i].any(), address
    before = [i for i, address in enumerate(judged.ADDRESSES) if "before" in address]
    assert outside[..., before].any(axis=-1).all(), "one of the two is always out"


def test_correction_for_many_readings():
    np.testing.assert_allclose(judged.corrected(np.array([0.001, 0.9]), 288), [0.288, 1.0])


def test_unknown_shifts_are_refused():
    with pytest.raises(ValueError, match="Table 2"):
        study.cameras(DOOR, "Table 3")
