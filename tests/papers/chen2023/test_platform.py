"""The ground platform and its twin: rendered frames against the linear prediction of the ledger."""

import numpy as np
import pytest
from numpy.random import SeedSequence, default_rng
from scipy.stats import chi2

from reproduce.papers.catalogue import catalogue
from reproduce.papers.chen2023 import accuracy, effectiveness, platform_twin
from reproduce.papers.chen2023.platform import (
    SPOTS,
    angle_response,
    as_designed,
    designed_positions,
    scatter,
)
from reproduce.physics.attitude import (
    attitude,
    emitted_directions,
    laser_transform,
    misalignment,
    misalignment_angles,
    received_directions,
    scatter_of_averages,
)
from reproduce.printed.inputs import load_inputs

ARCSEC = np.pi / 180 / 3600
INPUTS = load_inputs(platform_twin.READS)
PRINTED = np.array(
    [[544.822, 435.751], [520.724, 459.788], [569.035, 459.876], [544.579, 483.940]]
)


def full_solution(spots):
    """Solve the misalignment with QUEST, nothing linearised."""
    tracker = ((511.5, 511.5), 13e-6, 60e-3)
    designed = np.array([[0, -11], [-11, 0], [11, 0], [0, 11]]) * 1e-3
    camera = emitted_directions(designed, 2.0)
    zero = laser_transform(camera, received_directions(PRINTED, *tracker))
    turned = misalignment(camera, received_directions(spots, *tracker), zero)
    return misalignment_angles(turned)[..., :2]


def test_each_laser_sits_at_the_corner_towards_its_spot():
    found = designed_positions(PRINTED, 22e-3)
    np.testing.assert_allclose(
        found, np.array([[0, -11], [-11, 0], [11, 0], [0, 11]]) * 1e-3, atol=1e-15
    )


def test_the_linear_response_is_that_of_the_full_solution():
    noise = np.random.default_rng(8).normal(0, 0.017, (800, 4, 2))
    linear = np.tensordot(noise, angle_response(INPUTS)[:2], axes=([1, 2], [1, 2]))
    full = full_solution(PRINTED + noise)
    # The error is of second order: noise times noise over the size of the cluster.
    np.testing.assert_allclose(linear, full, atol=2e-3 * full.std())


def test_the_tracker_points_through_the_middle_of_its_1024_pixels_numbered_from_zero():
    """At 512, half a pixel aside, the response to a spot differs by more than the tolerance."""
    step = 1e-3
    moves = step * np.eye(8).reshape(8, 4, 2)
    numeric = (full_solution(PRINTED + moves) - full_solution(PRINTED - moves)) / (
        2 * step
    )
    response = angle_response(INPUTS)[:2].reshape(2, 8).T
    np.testing.assert_allclose(
        response, numeric, rtol=0, atol=1e-6 * np.abs(numeric).max()
    )
    np.testing.assert_array_equal(as_designed(INPUTS).principal_point, [511.5, 511.5])


@pytest.fixture(scope="module")
def platform():
    return platform_twin.bench(INPUTS)


@pytest.fixture(scope="module")
def replicates(platform):
    """Sixty runs of both groups of 800 frames, every frame rendered."""
    return [platform.two_groups(800, default_rng([7, run])) for run in range(60)]


def test_the_mean_spots_are_the_printed_ones(replicates):
    """The window's bias is taken off the places and put back by the extraction."""
    found = np.mean([series.spots.mean(axis=(0, 1)) for series in replicates], axis=0)
    printed = INPUTS.array(SPOTS).reshape(-1, 2)
    np.testing.assert_allclose(found, printed, atol=5 * 0.017 / np.sqrt(60 * 1600))


def test_the_scatter_of_each_laser_is_that_of_table_3_on_average_of_x_and_y(replicates):
    found = np.mean(
        [series.spots.var(axis=1).mean(axis=-1) for series in replicates], axis=0
    )
    printed = np.stack([(scatter(INPUTS, g) ** 2).mean(axis=-1) for g in (1, 2)])
    np.testing.assert_allclose(found, printed, rtol=5 / np.sqrt(60 * 800))


def test_table_4_from_rendered_frames_is_that_of_the_linear_prediction(replicates):
    counts = [1, 16, 100]
    rendered = 3 * np.stack(
        [
            [
                scatter_of_averages(angles[:, :2].T, counts)
                for angles in (series.transform, series.misalignment)
            ]
            for series in replicates
        ]
    )
    linear = accuracy._simulated_accuracies(
        load_inputs(accuracy.READS), SeedSequence(5), 600, counts
    )
    # The twin spreads a laser's scatter evenly over x and y; the mean of both axes is common.
    ours, theirs = ((a**2).mean(axis=-2) for a in (rendered, linear))
    error = np.sqrt(ours.var(axis=0) / 60 + theirs.var(axis=0) / 600)
    assert (np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) < 4 * error).all()


@pytest.mark.parametrize("axis", range(3))
def test_a_turn_is_measured_about_its_axis_with_its_sign_and_size(platform, axis):
    """Noise-free: the misfit of the designed lasers does not spoil the scale."""
    turn = np.zeros(3)
    turn[axis] = 8 * ARCSEC
    zero = platform.design.transform(platform.spots)
    spots = platform.rotated(turn)
    found = misalignment(platform.design.directions, platform.design.seen(spots), zero)
    np.testing.assert_allclose(misalignment_angles(found), turn, atol=1e-6 * ARCSEC)


@pytest.mark.parametrize(
    ("telescope", "diagonal", "scale"),
    [(2.0, 22.0, 0.950), (2.056, 22.0, 0.977), (2.056, 21.5, 1)],
)
def test_the_spots_fit_the_lasers_within_what_the_print_leaves_open(
    telescope, diagonal, scale
):
    """With the length that Table V implies, and the smallest diagonal that prints as 22 mm."""
    design = as_designed(INPUTS)
    lasers = designed_positions(design.spots, diagonal * 1e-3)
    seen, designed = design.seen(design.spots), emitted_directions(lasers, telescope)
    sizes = [np.linalg.norm(some - some.mean(axis=0)) for some in (seen, designed)]
    ratio = sizes[0] / sizes[1]
    assert ratio == pytest.approx(scale, abs=2e-3)
    misses = (seen - designed @ attitude(seen, designed).mT) * 60e-3 / 13e-6
    distance = np.sqrt(np.square(misses).sum() / 4)
    assert distance == pytest.approx(np.hypot(24.12 * (1 / ratio - 1), 0.10), abs=0.02)
    assert (distance < 0.12) == (scale == 1)


@pytest.fixture(scope="module")
def stage_test():
    """The test of Figure 10: times, reference and monitored angles."""
    return platform_twin.stage_test(
        load_inputs(catalogue()["chen2023/fig-10b"].draw.inputs)
    )


def test_the_ride_follows_the_reference_one_average_later(stage_test):
    _, reference, monitored = stage_test
    each = 400
    for state in range(5):
        settled = slice(state * each + 100, (state + 1) * each)
        away = monitored[settled] - reference[settled]
        assert np.abs(away).max() < 0.25 * ARCSEC
    # The last state by hand: 79.88 um along X turns about Y, 79.91 um along Y about X, at 2 m.
    by_hand = -np.arctan2([79.91e-6, 79.88e-6], 2.0)
    np.testing.assert_allclose(reference[-1], by_hand, rtol=1e-9)
    just_moved = monitored[each + 10] - reference[each + 10]
    assert (np.abs(just_moved) > 1.5 * ARCSEC).all(), "an average lags behind a jump"


def test_the_twin_monitors_states_as_the_ledger_predicts(stage_test):
    """Means over a state, from rendered frames, less the reference: within the predicted noise."""
    monitored = stage_test[2]
    inputs = load_inputs(effectiveness.monitored_angle.inputs)
    errors = effectiveness._monitoring_errors(inputs, default_rng(5), 4000)
    for state in (2, 3, 4, 5):
        for index, axis in enumerate("yx"):  # the motion along Y turns about X
            motion = inputs[f"chen2023/table-5#{state}.motion-{axis}"]
            last = monitored[state * 400 - 1, index]
            draws = -np.arctan(motion / 2.0) + errors[:, state - 2, index]
            # The last average holds a quarter of the state's frames.
            assert abs(last - draws.mean()) < 4 * 2 * draws.std()


def test_photons_cannot_make_x_and_y_of_a_spot_differ_as_printed(replicates):
    """Laser 4 of the first group scatters less along x, by more than 800 frames allow."""
    printed = scatter(INPUTS, 1)[3]
    ratios = [one.spots[0, :, 3].std(axis=0) for one in replicates]
    ratio = np.array([along_x / along_y for along_x, along_y in ratios])
    assert abs(printed[0] / printed[1] - ratio.mean()) > 3 * ratio.std()


def test_noise_explains_the_calibrated_directions_and_not_the_designed_ones(
    platform, replicates
):
    """Shuster's test: the loss of n directions over the variance is chi-square of 2n - 3."""
    noise = np.sqrt((scatter(INPUTS, 2) ** 2).mean(axis=-1)) * 13e-6 / 60e-3
    design, (first, second) = platform.design, replicates[0].spots
    found, zero = design.seen(second), first.mean(axis=0)
    aside = zero + 0.1 * np.eye(4, 2)  # one laser, a tenth of a pixel
    refused = []
    for directions in (design.directions, design.seen(aside), design.seen(zero)):
        rotation = attitude(found, directions, np.full(found.shape[:-1], noise**-2.0))
        misses = np.square(found - directions @ rotation.mT).sum(axis=-1) / noise**2
        refused.append((misses.sum(axis=-1) > chi2(5).ppf(0.99)).mean())
    assert refused[:2] == [1.0, 1.0]
    assert refused[2] < 0.025
