"""The ground platform and its twin: rendered frames against the linear prediction of the ledger."""

import numpy as np
import pytest
from bench import ARCSEC, LASERS, TRACKER
from bench import SPOTS as PRINTED
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import chi2

from reproduce.papers.chen2023 import accuracy, platform_twin
from reproduce.papers.chen2023.platform import (
    DIAGONAL,
    SPOTS,
    as_designed,
    scatter,
)
from reproduce.papers.declare import drawing
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

INPUTS = load_inputs(platform_twin.INPUTS)


def full_solution(spots):
    """Solve the misalignment with QUEST, nothing linearised."""
    camera = emitted_directions(LASERS, 2.0)
    zero = laser_transform(camera, received_directions(PRINTED, **TRACKER))
    turned = misalignment(camera, received_directions(spots, **TRACKER), zero)
    return misalignment_angles(turned)[..., :2]


def test_the_tracker_points_through_the_middle_of_its_1024_pixels_numbered_from_zero():
    """At 512, half a pixel aside, the response to a spot differs by more than the tolerance."""
    step = 1e-3
    moves = step * np.eye(8).reshape(8, 4, 2)
    numeric = (full_solution(PRINTED + moves) - full_solution(PRINTED - moves)) / (
        2 * step
    )
    design = as_designed(INPUTS)
    response = design.response(design.spots)[:2].reshape(2, 8).T
    assert_allclose(response, numeric, rtol=0, atol=1e-6 * np.abs(numeric).max())
    assert_array_equal(design.principal_point, [511.5, 511.5])


@pytest.fixture(scope="module")
def platform():
    return platform_twin.SimulatedBench(INPUTS)


@pytest.fixture(scope="module")
def replicates(platform):
    """Sixty runs of both groups of 800 frames, every frame rendered."""
    return [platform.two_groups(800, default_rng([7, run])) for run in range(60)]


def test_table_4_from_rendered_frames_is_that_of_the_linear_prediction(replicates):
    counts = [1, 16, 100]
    rendered = 3 * np.stack(
        [
            [scatter_of_averages(angles[:, :2].T, counts) for angles in groups]
            for _, groups in replicates
        ]
    )
    predicted = accuracy.frame_averaging(load_inputs(accuracy.INPUTS), 600)
    columns = [
        [[predicted[f"{count}.{matrix}-{axis}"] for count in counts] for axis in "xy"]
        for matrix in ("transform", "misalignment")
    ]
    linear = np.moveaxis(columns, -1, 0)
    # The twin spreads a laser's scatter evenly over x and y; the mean of both axes is common.
    ours, theirs = ((a**2).mean(axis=-2) for a in (rendered, linear))
    error = np.sqrt(ours.var(axis=0) / 60 + theirs.var(axis=0) / 600)
    assert (np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) < 4 * error).all()


@pytest.fixture(scope="module")
def stage_test():
    """The test of Figure 10: times, reference and monitored angles."""
    return platform_twin._stage_test(load_inputs(drawing("chen2023/fig-10b").inputs))


def test_the_ride_follows_the_reference_one_average_later(stage_test):
    _, reference, monitored = stage_test
    each = 400
    for state in range(5):
        settled = slice(state * each + 100, (state + 1) * each)
        away = monitored[settled] - reference[settled]
        assert np.abs(away).max() < 0.25 * ARCSEC
    # The last state by hand: 79.88 um along X turns about Y, 79.91 um along Y about X, at 2 m.
    by_hand = -np.arctan2([79.91e-6, 79.88e-6], 2.0)
    assert_allclose(reference[-1], by_hand, rtol=1e-9)
    just_moved = monitored[each + 10] - reference[each + 10]
    assert (np.abs(just_moved) > 1.5 * ARCSEC).all(), "an average lags behind a jump"


def test_photons_cannot_make_x_and_y_of_a_spot_differ_as_printed(replicates):
    """Laser 4 of the first group scatters less along x, by more than 800 frames allow."""
    printed = scatter(INPUTS, 1)[3]
    ratios = [spots[0, :, 3].std(axis=0) for spots, _ in replicates]
    ratio = np.array([along_x / along_y for along_x, along_y in ratios])
    assert abs(printed[0] / printed[1] - ratio.mean()) > 3 * ratio.std()


def test_the_spots_have_the_printed_means_and_scatters(replicates):
    """The window's bias is subtracted from the positions and restored by the extraction."""
    spots = np.stack([spots for spots, _ in replicates])
    printed = INPUTS.array(SPOTS).reshape(-1, 2)
    tolerance = 5 * 0.017 / np.sqrt(60 * 1600)
    assert_allclose(spots.mean(axis=(0, 1, 2)), printed, atol=tolerance)
    variances = spots.var(axis=2).mean(axis=(0, -1))
    expected = [(scatter(INPUTS, group) ** 2).mean(axis=-1) for group in (1, 2)]
    assert_allclose(variances, expected, rtol=5 / np.sqrt(60 * 800))


def test_a_rotation_is_measured_about_its_axis_with_its_sign_and_size(platform):
    """Without noise: the misfit of the designed lasers does not change the scale.

    The rounding of a unit vector moves an angle by the inverse of the stiffness, which is smallest
    about the boresight: the mean square of the distances of the lasers from it.
    """
    zero = platform.design.transform(platform.spots)
    stiffness = (platform.design.directions[:, :2] ** 2).sum(axis=1).mean()
    rounding = 4 * np.finfo(float).eps / stiffness
    assert rounding < 1e-6 * 8 * ARCSEC
    for rotation in 8 * ARCSEC * np.eye(3):
        seen = platform.design.seen(platform.rotated(rotation))
        moved = misalignment(platform.design.directions, seen, zero)
        angles = misalignment_angles(moved)
        assert_allclose(angles, rotation, atol=rounding)


def test_the_spots_fit_the_lasers_within_the_rounding_of_lengths():
    """With the length that Table V implies, and the smallest diagonal that rounds to 22 mm."""
    design = as_designed(INPUTS)
    seen = design.seen(design.spots)
    for telescope, diagonal, scale in (
        (2.0, 22e-3, 0.950),
        (2.056, 22e-3, 0.977),
        (2.056, 21.5e-3, 1),
    ):
        points = as_designed(INPUTS.changed({DIAGONAL: diagonal})).lasers
        designed = emitted_directions(points, telescope)
        sizes = [np.linalg.norm(one - one.mean(axis=0)) for one in (seen, designed)]
        ratio = sizes[0] / sizes[1]
        assert ratio == pytest.approx(scale, abs=2e-3)
        misses = (seen - designed @ attitude(seen, designed).mT) * 60e-3 / 13e-6
        distance = np.sqrt(np.square(misses).sum() / 4)
        expected = np.hypot(24.12 * (1 / ratio - 1), 0.10)
        assert distance == pytest.approx(expected, abs=0.02)
        assert (distance < 0.12) == (scale == 1)


def test_noise_explains_the_calibrated_directions_and_not_the_designed_ones(
    platform, replicates
):
    """Shuster's test: the loss of n directions over the variance is chi-square of 2n - 3."""
    noise = np.sqrt((scatter(INPUTS, 2) ** 2).mean(axis=-1)) * 13e-6 / 60e-3
    design, (first, second) = platform.design, replicates[0][0]
    seen, zero = design.seen(second), first.mean(axis=0)
    displaced = zero + 0.1 * np.eye(4, 2)  # one laser, by a tenth of a pixel
    rejected = []
    for directions in (design.directions, design.seen(displaced), design.seen(zero)):
        rotation = attitude(seen, directions, np.full(seen.shape[:-1], noise**-2.0))
        losses = np.square(seen - directions @ rotation.mT).sum(axis=-1) / noise**2
        rejected.append((losses.sum(axis=-1) > chi2(5).ppf(0.99)).mean())
    assert rejected[:2] == [1.0, 1.0]
    assert rejected[2] < 0.025
