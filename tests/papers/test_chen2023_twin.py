"""The twin of the ground platform: rendered frames against the linear prediction of the ledger."""

import numpy as np
import pytest
from numpy.random import SeedSequence, default_rng

from reproduce.papers.chen2023 import (
    accuracy,
    figures_monitoring,
    lasers,
    stage,
    twin,
    twin_study,
)
from reproduce.physics.averaging import scatter_of_averages
from reproduce.physics.misalignment import misalignment, misalignment_angles
from reproduce.printed.given import given

ARCSEC = np.pi / 180 / 3600
DOOR = given(twin.READS)


@pytest.fixture(scope="module")
def platform():
    return twin.bench(DOOR)


@pytest.fixture(scope="module")
def replicates(platform):
    """Sixty runs of both groups of 800 frames, every frame rendered."""
    return [twin.two_groups(platform, 800, default_rng([7, run])) for run in range(60)]


def test_the_mean_spots_are_the_printed_ones(replicates):
    """The window's bias is taken off the places and put back by the extraction."""
    found = np.mean([series.spots.mean(axis=(0, 1)) for series in replicates], axis=0)
    printed = DOOR.array(lasers.SPOTS).reshape(-1, 2)
    np.testing.assert_allclose(found, printed, atol=5 * 0.017 / np.sqrt(60 * 1600))


def test_the_scatter_of_each_laser_is_that_of_table_3_on_average_of_x_and_y(replicates):
    found = np.mean([series.spots.var(axis=1).mean(axis=-1) for series in replicates], axis=0)
    printed = np.stack([(lasers.scatter(DOOR, g) ** 2).mean(axis=-1) for g in (1, 2)])
    np.testing.assert_allclose(found, printed, rtol=5 / np.sqrt(60 * 800))


def test_photons_cannot_make_x_and_y_of_a_spot_differ_as_printed(replicates):
    """Laser 4 of the first group scatters less along x, by more than 800 frames allow."""
    printed = lasers.scatter(DOOR, 1)[3]
    ratios = [s.spots[0, :, 3].std(axis=0) for s in replicates]
    ratio = np.array([one[0] / one[1] for one in ratios])
    assert abs(printed[0] / printed[1] - ratio.mean()) > 3 * ratio.std()


def test_table_4_from_rendered_frames_is_that_of_the_linear_prediction(replicates):
    counts = [1, 16, 100]
    rendered = 3 * np.stack(
        [
            [
                scatter_of_averages(angles[:, :2], counts, axis=0)
                for angles in (series.transform, series.misalignment)
            ]
            for series in replicates
        ]
    )
    linear = accuracy.simulated_accuracies(given(accuracy.READS), SeedSequence(5), 600, counts)
    # The twin spreads a laser's scatter evenly over x and y; the mean of both axes is common.
    ours, theirs = ((a**2).mean(axis=-1) for a in (rendered, linear))
    error = np.sqrt(ours.var(axis=0) / 60 + theirs.var(axis=0) / 600)
    assert (np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) < 4 * error).all()


def test_errors_are_white(replicates):
    """Neighbouring frames share nothing, so their correlation is noise."""
    series = np.stack([s.misalignment[:, 0] for s in replicates])
    lagged = np.mean(series[:, 1:] * series[:, :-1]) / series.var()
    assert abs(lagged) < 4 / np.sqrt(series.size)


def test_the_roll_is_known_two_hundred_times_worse(replicates):
    spread = np.mean([s.misalignment.std(axis=0) for s in replicates], axis=0)
    pixel = np.arctan2(13e-6, 60e-3)
    radius = np.linalg.norm(DOOR.array(lasers.SPOTS).reshape(-1, 2).std(axis=0))
    # A turn about Z moves a spot by the angle times its distance from the middle.
    expected = spread[:2].mean() / (radius * pixel)
    assert spread[2] == pytest.approx(expected, rel=0.05)
    assert 150 < spread[2] / spread[:2].mean() < 250


@pytest.mark.parametrize("axis", range(3))
def test_a_turn_is_measured_about_its_axis_with_its_sign_and_size(platform, axis):
    """Noise-free: the misfit of the designed lasers does not spoil the scale."""
    turn = np.zeros(3)
    turn[axis] = 8 * ARCSEC
    zero = platform.transform(platform.spots)
    spots = platform.turned(turn)
    found = misalignment(platform.camera_directions, platform.directions(spots), zero)
    np.testing.assert_allclose(misalignment_angles(found), turn, atol=1e-6 * ARCSEC)


def test_the_designed_pattern_is_a_twentieth_too_large():
    found = twin.misfit(twin.bench(DOOR))
    spots = DOOR.array(lasers.SPOTS).reshape(-1, 2)
    pairs = ((spots[2, 0] - spots[1, 0]) + (spots[3, 1] - spots[0, 1])) / 2 * 13e-6 / 60e-3
    assert found["scale"] == pytest.approx(pairs / (22e-3 / 2.0), rel=1e-3)
    offsets = np.linalg.norm(spots - spots.mean(axis=0), axis=1).mean()
    assert found["residual"] == pytest.approx(offsets * (1 / found["scale"] - 1), rel=0.02)
    assert found["after_scale"] < 0.1 * found["residual"]


def test_the_ride_follows_the_reference_one_average_later():
    content = figures_monitoring.ride()
    each = 400
    for state in range(5):
        settled = slice(state * each + 100, (state + 1) * each)
        away = content.monitored[settled] - content.reference[settled]
        assert np.abs(away).max() < 0.25 * ARCSEC
    # The last state by hand: 79.88 um along X turns about Y, 79.91 um along Y about X, at 2 m.
    by_hand = -np.arctan2([79.91e-6, 79.88e-6], 2.0)
    np.testing.assert_allclose(content.reference[-1], by_hand, rtol=1e-9)
    just_moved = content.monitored[each + 10] - content.reference[each + 10]
    assert (np.abs(just_moved) > 1.5 * ARCSEC).all(), "an average lags behind a jump"


def test_the_twin_monitors_states_as_the_ledger_predicts():
    """Means over a state, from rendered frames, less the reference: within the predicted noise."""
    content = figures_monitoring.ride()
    found = stage.monitored_angle(given(stage.monitored_angle.given), 4000)
    for state in (2, 3, 4, 5):
        for index, axis in enumerate("xy"):
            last = content.monitored[state * 400 - 1, index]
            draws = found[f"{state}.monitoring-{axis}"].draws
            # The last average holds a quarter of the state's frames.
            assert abs(last - draws.mean()) < 4 * 2 * draws.std()


def test_floors_are_found_where_there_are_any():
    """The fit itself: noise with a floor put under it, and noise without."""
    counts = [1, 4, 16, 25, 49, 100]
    door = given(accuracy.READS)
    noise = accuracy.simulated_accuracies(door, SeedSequence(9), 600, counts)[:, 0, :, 0]
    digit = 0.01 * ARCSEC
    bare = twin_study.fit_floor(noise[0], noise[1:], digit)
    floor = 0.3 * ARCSEC
    raised = twin_study.fit_floor(np.hypot(noise[0], floor), noise[1:], digit)
    assert bare.probability > 0.05
    assert raised.probability < 0.01
    assert abs(bare.floor) < 0.12 * ARCSEC
    assert raised.upper > 0.15 * ARCSEC


def test_a_common_length_is_found_with_the_shared_zero_in_its_covariance():
    rng = np.random.default_rng(2)
    motions, length, sigma = np.array([20e-6, 40e-6, 60e-6, 80e-6]), 2.056, 0.02 * ARCSEC
    fits = []
    for _ in range(2000):
        states = rng.normal(0, sigma, 5)
        fits.append(
            twin_study.common_length(motions, -motions / length + states[1:] - states[0], sigma)
        )
    lengths = np.array([fit.length for fit in fits])
    assert lengths.mean() == pytest.approx(length, abs=4 * lengths.std() / np.sqrt(2000))
    assert lengths.std() == pytest.approx(fits[0].error, rel=0.08)
    assert np.mean([fit.chi_square for fit in fits]) == pytest.approx(3.0, rel=0.08)


def test_table_5_says_one_focal_length_when_the_columns_are_exchanged():
    rows = [row for row in twin_study.focal_lengths().rows if "state" in row[0]]
    own = np.array([float(row[1].split()[0]) for row in rows])
    other = np.array([float(row[2].split()[0]) for row in rows])
    half = np.array([float(row[2].split()[-1]) for row in rows])
    assert np.ptp(own) > 50
    assert np.ptp(other) < 1
    assert (np.abs(other - np.median(other)) <= half).all()
