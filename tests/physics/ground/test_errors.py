"""The imaging model (1) at the horizon, and with the misalignment of (7)."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from reproduce.physics.attitude import misalignment_in_tracker
from reproduce.physics.ground import (
    EARTH_RADIUS,
    image_vectors,
    imaged_position,
)

DOWN = np.array(
    [[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]
)  # earth_from_camera above (1, 0, 0)
SATELLITE = np.array([EARTH_RADIUS + 500e3, 0, 0])


def distance_to_ground(origin, directions):
    """Return the distance to the ground of the imaging model along Earth-fixed lines of sight."""
    against = -np.asarray(directions, dtype=float)[..., np.newaxis, :]
    found = imaged_position(against, origin, np.eye(3))[..., 0, :]
    return np.linalg.norm(found - origin, axis=-1)


def test_grazing_lines_meet_the_horizon_just_or_not():
    satellite = np.array([7.0e6, 0, 0])
    dip = np.arcsin(EARTH_RADIUS / 7.0e6)
    just = [-np.cos(dip - 1e-7), np.sin(dip - 1e-7), 0]
    past = [-np.cos(dip + 1e-7), np.sin(dip + 1e-7), 0]
    horizon = np.sqrt(7.0e6**2 - EARTH_RADIUS**2)
    assert distance_to_ground(satellite, just) == pytest.approx(horizon, rel=1e-3)
    with pytest.raises(ValueError, match=r"vectors: .* 0 of them in the opp"):
        distance_to_ground(satellite, past)


def test_the_opposite_direction_is_an_error():
    with pytest.raises(ValueError, match=r"vectors: .* 1 of them in the opp"):
        distance_to_ground(SATELLITE, [1, 0, 0])
    with pytest.raises(ValueError, match="satellite"):
        distance_to_ground([6e6, 0, 0], [-1, 0, 0])


def test_principal_point_and_distortion_shift_the_image():
    plain = image_vectors([[0.0, 0.0]], 2.0)
    assert_allclose(
        image_vectors([[0.013, 0.024]], 2.0, (0.01, 0.02), [(0.003, 0.004)]),
        plain,
        atol=1e-17,
    )


def test_the_misalignment_of_7_in_the_place_of_r_u_doubles_the_error():
    # The camera turns about its X axis; the tracker is mounted so that its X axis is the same.
    turned = 5e-5
    tracker_from_camera = Rotation.from_rotvec([2.0, 0, 0]).as_matrix()
    misaligned = Rotation.from_rotvec(
        [-turned, 0, 0]
    ).as_matrix()  # camera_now_from_zero
    earth_from_tracker = DOWN @ tracker_from_camera.T
    vectors = image_vectors([[0.0, 0.0]], 10.0)

    def seen(tracker_misalignment):
        chain = earth_from_tracker @ tracker_misalignment @ tracker_from_camera
        return imaged_position(vectors, SATELLITE, chain)[0]

    truth = imaged_position(
        vectors, SATELLITE, DOWN @ Rotation.from_rotvec([turned, 0, 0]).as_matrix()
    )[0]
    right = seen(misalignment_in_tracker(misaligned, tracker_from_camera))
    assert_allclose(right, truth, atol=1e-6)
    uncorrected, wrong = seen(np.eye(3)), seen(misaligned)
    assert np.linalg.norm(uncorrected - truth) == pytest.approx(
        500e3 * turned, rel=1e-3
    )
    assert np.linalg.norm(wrong - truth) == pytest.approx(2 * 500e3 * turned, rel=1e-3)
