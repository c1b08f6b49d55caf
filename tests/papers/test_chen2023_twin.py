"""The twin of the ground platform: rendered frames against the linear prediction of the ledger."""

import numpy as np
import pytest
from numpy.random import SeedSequence, default_rng
from scipy.stats import ks_2samp

from reproduce.papers.chen2023 import (
    accuracy,
    figures_monitoring,
    floors,
    lasers,
    stage,
    twin,
    twin_study,
)
from reproduce.physics.attitude.averaging import scatter_of_averages
from reproduce.physics.attitude.misalignment import misalignment, misalignment_angles
from reproduce.printed.given import given

ARCSEC = np.pi / 180 / 3600
DOOR = given(twin.READS)
COUNTS = [1, 4, 16, 25, 49, 100]


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


def test_the_spots_fit_the_lasers_within_what_the_print_leaves_open():
    """Similar triangles: 48.25 px behind 60 mm against the diagonal behind the telescope."""
    rows = [[float(value) for value in row[1:]] for row in twin_study.misfit().rows]
    across = 48.25 * 13e-6 / 60e-3
    scales = [across / (22e-3 / f) for f in (2.0, 2.056)] + [across / (21.5e-3 / 2.056)]
    assert [row[0] for row in rows] == pytest.approx(scales, abs=2e-3)
    radius = 48.25 / 2
    for (scale, distance, _), whole in zip(rows, scales, strict=True):
        assert distance == pytest.approx(np.hypot(radius * (1 / whole - 1), 0.10), abs=0.02), scale
    assert rows[2][1] < 0.12
    assert rows[2][2] == pytest.approx(rows[2][1] * 13e-6 / 60e-3 * 2056, abs=0.006)


def test_the_ride_follows_the_reference_one_average_later():
    content = figures_monitoring.ride(given(figures_monitoring.STAGE_READS))
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
    content = figures_monitoring.ride(given(figures_monitoring.STAGE_READS))
    door = given(stage.monitored_angle.given)
    errors = stage.monitoring_errors(door, np.random.SeedSequence(5), 4000)
    for state in (2, 3, 4, 5):
        for index, axis in enumerate("yx"):  # the motion along Y turns about X
            motion = door[f"{stage.TABLE}#{state}.motion-{axis}"]
            last = content.monitored[state * 400 - 1, index]
            draws = -np.arctan(motion / 2.0) + errors[:, state - 2, index]
            # The last average holds a quarter of the state's frames.
            assert abs(last - draws.mean()) < 4 * 2 * draws.std()


@pytest.fixture(scope="module")
def tables():
    """Tables IV without floors, shape (replicates, columns, counts)."""
    door = given(accuracy.READS)
    drawn = accuracy.simulated_accuracies(door, SeedSequence(9), 800, COUNTS)
    return drawn.transpose(0, 1, 3, 2).reshape(len(drawn), 4, len(COUNTS))


def test_a_floor_is_found_in_the_column_that_has_one_and_in_no_other(tables):
    floor = 0.3 * ARCSEC
    raised = tables[0].copy()
    raised[2] = np.hypot(raised[2], floor)
    found = floors.fit(raised, tables[1:], 0.01 * ARCSEC)
    assert found.among[2] < 0.01
    assert found.anywhere < 0.01
    assert found.without < 0.01
    assert found.floors[2] == pytest.approx(floor, rel=0.3)
    assert found.upper[2] > floor
    others = [0, 1, 3]
    assert (found.single[others] > 0.02).all()
    assert (found.upper[others] < floor).all()


def test_fresh_tables_without_floors_prefer_them_as_strongly_as_the_others(tables):
    """So a probability among the replicates that made the law is one for a table that did not."""
    model = floors.joint_model(tables[200:], 0.01 * ARCSEC)
    fresh, used = (floors.preferences(some, model) for some in (tables[:200], tables[200:]))
    assert ks_2samp(fresh[0], used[0]).pvalue > 1e-3
    assert (fresh[1] >= -1e-9).all()
    for column in range(5):
        assert ks_2samp(fresh[1][:, column], used[1][:, column]).pvalue > 1e-3


def test_the_joint_law_with_floors_is_that_of_tables_with_floors(tables):
    """Means, spreads and covariance of logarithms, against floors put under the replicates."""
    model = floors.joint_model(tables, 0.0)
    place = 40
    under = np.log(np.hypot(tables, model.floors[:, place][:, np.newaxis])).reshape(800, -1)
    np.testing.assert_allclose(under.mean(axis=0), model.means[:, place].ravel(), atol=1e-12)
    size = len(COUNTS) * 4
    covariance = np.linalg.inv(model.weight.reshape(size, size))
    spreads = model.spreads[:, place].ravel()
    found = np.cov(under.T)
    scale = np.sqrt(np.outer(found.diagonal(), found.diagonal()))
    assert (np.abs(covariance * np.outer(spreads, spreads) - found) < 0.08 * scale).all()


def test_the_four_columns_know_nothing_of_each_other_and_the_rows_much(tables):
    """So the joint fit is nearly four fits; averages of the same frames are another matter."""
    together = np.corrcoef(np.log(tables).reshape(800, -1).T).reshape(4, 6, 4, 6)
    for one in range(4):
        for other in range(one):
            assert np.abs(together[one, :, other]).max() < 4.5 / np.sqrt(800)
        assert together[one, 4, one, 5] > 0.6


def test_table_4_as_printed_needs_no_floor():
    found = floors.printed_fit()
    assert found.without > 0.05
    assert found.anywhere > 0.05
    assert (found.among > 0.05).all()


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


def test_the_taste_test_believes_the_calibrated_directions_and_not_the_designed_ones(platform):
    rows = {row[0]: [float(v.rstrip("%")) for v in row[1:]] for row in twin_study.believable().rows}
    designed, shrunk, calibrated, aside = rows.values()
    # Two pixels of freedom per spot: the misfit in units of the scatter, plus the freedom.
    misfit = twin.misfit(platform)["residual"]
    scatter = np.sqrt((lasers.scatter(DOOR, 2) ** 2).mean())
    assert designed[0] == pytest.approx(4 * (misfit / scatter) ** 2 + 4.35, rel=0.08)
    assert [row[2] for row in (designed, shrunk, aside)] == [100.0, 100.0, 100.0]
    assert calibrated[0] == pytest.approx(calibrated[1], rel=0.1)
    assert calibrated[2] < 2.5
    assert calibrated[3] > 0.01


def test_other_sensors_with_the_scatter_of_table_3_make_the_same_angles():
    study = twin_study.sensors()
    rows = {row[0]: np.array(row[1:], float) for row in study.rows}
    printed = 3 * np.sqrt(np.mean([(lasers.scatter(DOOR, group) ** 2).mean() for group in (1, 2)]))
    fitted = [rows[name] for name in twin_study.SENSORS]
    for row in fitted:
        assert row[1] == pytest.approx(printed, rel=0.02)
        assert row[2] == pytest.approx(fitted[0][2], rel=0.04)
    assert fitted[0][0] < fitted[1][0] < fitted[2][0], "more noise asks for more light"
    full = rows["pixels full at half the brightest"]
    assert full[0] == fitted[0][0]
    assert full[1] > 1.05 * printed
    assert full[2] > 1.05 * fitted[0][2]


def test_the_sensor_in_the_bench_rounds_and_clips(platform):
    sensor = twin_study.SENSORS["read noise, dark charge, twelve bits"]
    noisy = twin.bench(DOOR, sensor)
    found = twin.centroids(noisy, noisy.spots, noisy.light[0], 400, default_rng(3))
    printed = DOOR.array(lasers.SPOTS).reshape(-1, 2)
    # The mean is that of the ideal sensor: dark charge and offset are taken off.
    np.testing.assert_allclose(found.mean(axis=0), printed, atol=6 * 0.018 / np.sqrt(400))
    assert (noisy.light > platform.light).all()
