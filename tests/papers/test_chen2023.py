"""The instrument of chen2023 against answers that do not come from it."""

import numpy as np
import pytest

from reproduce.papers.chen2023 import accuracy, lasers, posteriors, stage
from reproduce.physics.averaging import attitude_accuracy
from reproduce.physics.lasers import emitted_directions, received_directions
from reproduce.physics.misalignment import (
    laser_transform,
    misalignment,
    misalignment_angles,
)
from reproduce.printed.given import given

ARCSEC = np.pi / 180 / 3600
DOOR = given(accuracy.READS)
SPOTS = np.array([[544.822, 435.751], [520.724, 459.788], [569.035, 459.876], [544.579, 483.940]])


@pytest.fixture(scope="module")
def predicted():
    return accuracy.frame_averaging(DOOR, 400)


def full_solution(spots):
    """Solve the misalignment with QUEST, nothing linearised."""
    tracker = ((511.5, 511.5), 13e-6, 60e-3)
    designed = np.array([[0, -11], [-11, 0], [11, 0], [0, 11]]) * 1e-3
    camera = emitted_directions(designed, 2.0)
    zero = laser_transform(camera, received_directions(SPOTS, *tracker))
    turned = misalignment(camera, received_directions(spots, *tracker), zero)
    return misalignment_angles(turned)[..., :2]


def test_each_laser_sits_at_the_corner_towards_its_spot():
    found = lasers.designed_positions(SPOTS, 22e-3)
    np.testing.assert_allclose(
        found, np.array([[0, -11], [-11, 0], [11, 0], [0, 11]]) * 1e-3, atol=1e-15
    )


def test_the_linear_response_is_that_of_the_full_solution():
    noise = np.random.default_rng(8).normal(0, 0.017, (800, 4, 2))
    linear = np.tensordot(noise, lasers.angle_response(DOOR), axes=([1, 2], [1, 2]))
    full = full_solution(SPOTS + noise)
    # The error is of second order: noise times noise over the size of the cluster.
    np.testing.assert_allclose(linear, full, atol=2e-3 * full.std())


def test_the_tracker_points_through_the_middle_of_its_1024_pixels_numbered_from_zero():
    """At 512, half a pixel aside, the response to a spot differs by more than the tolerance."""
    step = 1e-3
    moves = step * np.eye(8).reshape(8, 4, 2)
    numeric = (full_solution(SPOTS + moves) - full_solution(SPOTS - moves)) / (2 * step)
    response = lasers.angle_response(DOOR).reshape(2, 8).T
    np.testing.assert_allclose(response, numeric, rtol=0, atol=1e-6 * np.abs(numeric).max())
    np.testing.assert_array_equal(posteriors.platform(DOOR).principal_point, [511.5, 511.5])


def test_a_single_frame_agrees_with_the_papers_formula(predicted):
    """(11) with the mean scatter of Table III, per axis: about X the error is that along Y."""
    pixel = np.arctan2(13e-6, 60e-3)
    for group, matrix in ((1, "transform"), (2, "misalignment")):
        scatter = lasers.scatter(DOOR, group)
        for axis, across in (("x", 1), ("y", 0)):
            delta = 3 * np.sqrt((scatter[:, across] ** 2).mean())
            formula = float(attitude_accuracy(delta, 4, pixel))
            draws = predicted[f"1.{matrix}-{axis}"].draws
            assert np.median(draws) == pytest.approx(formula, rel=0.02)


def test_averages_fall_with_the_root_of_their_length(predicted):
    single = np.median(predicted["1.transform-x"].draws)
    for count in (4, 16, 25):
        average = np.median(predicted[f"{count}.transform-x"].draws)
        assert average == pytest.approx(single / np.sqrt(count), rel=0.04)


def test_long_averages_are_uncertain_by_themselves(predicted):
    """Few averages over 100 of 800 frames are independent: scatter of the scatter."""
    for count, low, high in ((1, 0.02, 0.03), (49, 0.12, 0.19), (100, 0.17, 0.28)):
        draws = predicted[f"{count}.transform-x"].draws
        assert low < draws.std() / draws.mean() < high


def test_averages_of_the_same_frames_are_correlated(predicted):
    near = [predicted[f"{count}.transform-x"].draws for count in (49, 100)]
    assert np.corrcoef(near)[0, 1] > 0.6


def test_the_zero_state_is_shared_by_all_monitored_angles():
    found = stage.monitored_angle(given(stage.monitored_angle.given), 4000)
    one, two = (found[f"{state}.monitoring-x"].draws for state in (2, 3))
    assert np.corrcoef(one, two)[0, 1] == pytest.approx(0.5, abs=0.05)
    scatter = np.sqrt((lasers.scatter(DOOR, 2)[:, 1] ** 2).mean())
    expected = np.sqrt(2) * scatter / 2 / 20 * np.arctan2(13e-6, 60e-3)
    assert one.std() == pytest.approx(expected, rel=0.05)


def test_the_reference_angle_by_hand():
    """20.27 um at 2 m is 2.0905 arcsec; the paper prints 2.006."""
    found = stage.reference_angle(given(stage.reference_angle.given))
    assert found["2.reference-y"] / ARCSEC == pytest.approx(-2.09049, abs=1e-5)


def test_one_focal_length_fits_once_the_columns_are_interchanged():
    """What the reason for the verdicts says, from the printed numbers alone."""
    printed = given(["chen2023/table-5"])

    def column(name):
        return np.array([printed[f"chen2023/table-5#{s}.{name}"] for s in (2, 3, 4, 5)])

    motion_y = column("motion-y")
    motion_y[2] = (
        printed["chen2023/table-5#4.position-y"] - printed["chen2023/table-5#1.position-y"]
    )
    as_printed = np.r_[
        column("motion-x") / np.tan(-column("reference-y")),
        motion_y / np.tan(-column("reference-x")),
    ]
    interchanged = np.r_[
        column("motion-x") / np.tan(-column("reference-x")),
        motion_y / np.tan(-column("reference-y")),
    ]
    assert np.ptp(as_printed) / as_printed.mean() > 0.02
    assert np.ptp(interchanged) / interchanged.mean() < 0.0005
    assert 2.05 < interchanged.mean() < 2.06
