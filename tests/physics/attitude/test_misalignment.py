"""Laser spots to misalignment: geometry, signs, frames, noise, and the relations (2) to (11)."""

import numpy as np
import pytest
from bench import LASERS, SPOTS, TRACKER
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from reproduce.physics.attitude import (
    Platform,
    emitted_directions,
    inertial_attitude,
    laser_transform,
    misalignment,
    misalignment_angles,
    misalignment_between,
    moved_laser_transform,
    received_directions,
    received_spots,
    stage_angles,
)

CAMERA_FOCAL_LENGTH = 2.107  # where a cross of 22 mm fits the printed spots

EMITTED = emitted_directions(LASERS, CAMERA_FOCAL_LENGTH)
RECEIVED = received_directions(SPOTS, **TRACKER)
ZERO = laser_transform(EMITTED, RECEIVED)


def turn(*angles):
    return Rotation.from_rotvec(angles).as_matrix()


# Directions, (2) and (3)


def test_spots_come_back_from_their_directions():
    assert_allclose(received_spots(7.0 * RECEIVED, **TRACKER), SPOTS, atol=1e-10)
    with pytest.raises(ValueError, match="directions: expected light from in front"):
        received_spots(-RECEIVED, **TRACKER)


# Misalignment and attitude, (6) to (9)

INSTALLED = turn(2.0, 0.1, -0.4)  # camera_zero_from_tracker
TURN = np.array([3e-5, -5e-5, 8e-5])
# The axes of the camera turn right-handed by TURN, and coordinates the other way.
MISALIGNMENT = turn(*-TURN)
FIXED_MIRRORS = turn(
    0.7, -1.1, 0.2
)  # what retroreflector and dichroic mirror do together


def test_the_relations_hold_together_for_a_camera_that_turns():
    tracker_from_now = (MISALIGNMENT @ INSTALLED).T
    transform_zero = FIXED_MIRRORS @ INSTALLED.T
    transform_now = FIXED_MIRRORS @ tracker_from_now
    assert_allclose(
        moved_laser_transform(transform_zero, MISALIGNMENT), transform_now, atol=1e-15
    )
    assert_allclose(
        misalignment_between(transform_now, transform_zero), MISALIGNMENT, atol=1e-15
    )
    direct = misalignment(EMITTED, EMITTED @ transform_now.T, transform_zero)
    assert_allclose(misalignment_angles(direct), TURN, atol=1e-12)
    tracker_attitude = turn(-0.2, 2.2, 0.9)
    found = inertial_attitude(direct, INSTALLED, tracker_attitude)
    assert_allclose(found, MISALIGNMENT @ INSTALLED @ tracker_attitude, atol=1e-12)


# Noise


@pytest.mark.parametrize("weights", [None, [1.0, 2.0, 0.5, 3.0], [1.0, 0.0, 1.0, 1.0]])
def test_the_jacobian_is_exact_where_the_fit_is_poor(weights):
    lasers = [(0, -0.2), (-0.3, 0), (0.3, 0.1), (0, 0.4)]
    platform = Platform(lasers, 1.0, 60e-3, 13e-6, TRACKER["principal_point"])
    zero = platform.transform(SPOTS, weights)
    steps = 0.02 * default_rng(3).standard_normal((5, 4, 2))
    ahead, behind = (
        platform.misalignment(moved, zero, weights)
        for moved in (SPOTS + steps, SPOTS - steps)
    )
    predicted = np.einsum("ink,bnk->bi", platform.response(SPOTS, weights), steps)
    assert_allclose(predicted, (ahead - behind) / 2, rtol=1e-5, atol=1e-9)


# The stage, (10)


def test_moved_lasers_look_like_a_turned_camera():
    shifts = 1e-6 * np.array([(20, 0), (0, 20), (-60, 35)])
    moved = emitted_directions(LASERS + shifts[:, np.newaxis, :], CAMERA_FOCAL_LENGTH)
    angles = misalignment_angles(misalignment(EMITTED, moved @ ZERO.T, ZERO))
    expected = stage_angles(shifts, CAMERA_FOCAL_LENGTH)
    # A shift is not quite a turn away from the boresight: 2.7e-5 of it at 5 mrad.
    assert_allclose(angles, expected, atol=3e-5 * np.abs(expected).max())
