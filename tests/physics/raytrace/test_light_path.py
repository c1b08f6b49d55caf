"""The path from the lasers to the tracker against closed forms, and the claims of the paper."""

from dataclasses import replace

import numpy as np
import pytest
from bench import LASERS
from numpy.testing import assert_allclose

from reproduce.physics.attitude import (
    Platform,
    emitted_directions,
    laser_transform,
    misalignment,
    misalignment_angles,
    received_directions,
    rotation_from_vector,
)
from reproduce.physics.raytrace import (
    RETROREFLECTORS,
    fold_mirror,
    reflection,
    traced_spots,
)

CAMERA, TRACKER, BETWEEN = 2.0, 0.06, np.radians(120.0)
APERTURE = 0.1 * np.array(
    [[np.cos(a), np.sin(a)] for a in np.arange(24) * np.pi / 12 + 0.05]
)
CORNER, ROOF, CONE = RETROREFLECTORS
TURN = 1e-4
PITCH = 13e-6
PLATFORM = Platform(LASERS, CAMERA, TRACKER, PITCH, (0, 0))


def traced(kind, platform=PLATFORM, angle=BETWEEN, **turns):
    return traced_spots(platform, angle, RETROREFLECTORS[kind], APERTURE, **turns)


def directions(spots):
    return received_directions(spots.mean(axis=1), (0.0, 0.0), PITCH, TRACKER)


def feigned(kind, **turns):
    """Return the angles of the camera that the tracker derives from the spots."""
    # A third reflection mirrors the pattern.
    flip = np.array([1.0, 1.0 if kind == ROOF else -1.0])
    camera = emitted_directions(LASERS * flip, CAMERA)
    zero = laser_transform(camera, directions(traced(kind)))
    seen = directions(traced(kind, **turns))
    return misalignment_angles(misalignment(camera, seen, zero))


def test_the_dichroic_mirror_folds_the_returned_light_onto_the_boresight():
    centred = replace(PLATFORM, lasers=LASERS - LASERS[0])
    for angle in np.radians([60.0, 90.0, 120.0, 150.0]):
        boresight = rotation_from_vector([angle, 0, 0])[:, 2]
        folded = reflection(fold_mirror(angle)) @ [0, 0, -1.0]
        assert_allclose(folded, -boresight, atol=1e-12)
        spots = PITCH * traced(CORNER, centred, angle)[0]
        assert_allclose(spots, 0.0, atol=1e-15)
    normal = fold_mirror(BETWEEN)
    boresight = rotation_from_vector([BETWEEN, 0, 0])[:, 2]
    assert np.degrees(np.arccos(abs(normal @ boresight))) == pytest.approx(30.0)


@pytest.mark.parametrize("kind", RETROREFLECTORS)
def test_the_lit_part_of_the_lens_matters_only_to_a_cone(kind):
    spots = PITCH * traced(kind)
    blur = np.linalg.norm(spots - spots.mean(axis=1, keepdims=True), axis=-1).max()
    assert 1e-9 < blur < 13e-6 if kind == CONE else blur < 1e-15


@pytest.mark.parametrize(
    ("kind", "expected"),
    [(CORNER, np.zeros((3, 3))), (ROOF, np.diag([2.0, 0.0, 2.0]))],
)
def test_turns_of_the_retroreflector_that_mimic_turns_of_the_camera(kind, expected):
    found = [feigned(kind, turn=turn) for turn in TURN * np.eye(3)]
    assert_allclose(np.abs(found) / TURN, expected, atol=2e-4)


@pytest.mark.parametrize("kind", [CORNER, ROOF])
def test_a_turn_of_the_camera_is_seen_in_full(kind):
    for turn in TURN * np.eye(3):
        found = feigned(kind, camera_turn=turn)
        assert_allclose(np.abs(found), turn, atol=1e-4 * TURN)
    # Two mirrors do not mirror the image, so the signs are right too.
    turn = TURN * np.array([0.3, -0.7, 0.5])
    found = feigned(ROOF, camera_turn=turn)
    assert_allclose(found, turn, atol=1e-4 * TURN)


def test_through_a_cone_a_tilt_mimics_a_roll():
    """The beam misses the tip along X. The effect is of second order: a false roll."""
    by_camera, by_cone = (
        np.array([feigned(CONE, **{name: t}) for t in TURN * np.eye(3)])
        for name in ("camera_turn", "turn")
    )
    by_camera, by_cone = by_camera / TURN, by_cone / TURN
    assert_allclose(np.abs(by_camera[:, :2]), np.eye(3)[:, :2], atol=2e-4)
    assert 3.5 < by_camera[0, 2] < 4.5
    assert_allclose(by_camera[1:, 2], [0.0, -1.0], atol=1e-3)
    assert_allclose(np.abs(by_cone[:, :2]), 0.0, atol=3e-4)
    assert_allclose(by_cone[:, 2], [-by_camera[0, 2], 0.0, 0.0], atol=1e-3)
