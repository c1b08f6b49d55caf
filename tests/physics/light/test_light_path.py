"""The traced light path against products of reflections, and the claims of the paper."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from reproduce.physics.attitude import (
    attitude,
    emitted_directions,
    laser_transform,
    misalignment,
    misalignment_angles,
    received_directions,
    received_spots,
    rotation_from_vector,
)
from reproduce.physics.light import (
    RETROREFLECTORS,
    Cone,
    LightPath,
    Mirrors,
    mirror_train,
    reflection,
)
from reproduce.physics.validate import DegenerateGeometryError

CAMERA, TRACKER, BETWEEN = 2.0, 0.06, np.radians(120.0)
LASERS = 11e-3 * np.array([[0, -1], [-1, 0], [1, 0], [0, 1.0]])
APERTURE = 0.1 * np.array(
    [[np.cos(a), np.sin(a)] for a in np.arange(24) * np.pi / 12 + 0.05]
)
KINDS = tuple(RETROREFLECTORS)
PLANE = KINDS[:2]
TURN = 1e-4


class Bent(LightPath):
    """A path whose dichroic mirror a test replaces."""


def path(kind, **changes):
    return replace(
        LightPath(CAMERA, TRACKER, BETWEEN, RETROREFLECTORS[kind]), **changes
    )


def turned(kind, turn):
    still = path(kind)
    return replace(still, retroreflector=replace(still.retroreflector, turn=turn))


def centres(light, lasers=LASERS):
    return light.spots(lasers, APERTURE).mean(axis=1)


def directions(spots):
    return received_directions(spots, (0.0, 0.0), 1.0, TRACKER)


def mirrored(kind):
    """Laser directions as a rotation can carry them: a third reflection mirrors the pattern."""
    flip = np.array([1.0, 1.0 if kind == "two mirrors at a right angle" else -1.0])
    return emitted_directions(LASERS * flip, CAMERA)


@pytest.mark.parametrize("kind", PLANE)
def test_rays_in_space_do_what_the_product_of_reflections_says(kind):
    light = path(kind)
    going = (
        emitted_directions(LASERS, CAMERA)
        @ mirror_train(light.retroreflector.normals).T
    )
    coming = going @ reflection(light.fold.normals[0]).T
    expected = received_spots(
        -coming @ rotation_from_vector([BETWEEN, 0, 0]), (0.0, 0.0), 1.0, TRACKER
    )
    found = light.spots(LASERS, APERTURE)
    np.testing.assert_allclose(
        found, np.broadcast_to(expected[:, None], found.shape), atol=1e-15
    )


@pytest.mark.parametrize("kind", KINDS)
def test_the_beam_comes_back_beside_the_camera_and_meets_the_dichroic_mirror(kind):
    light = path(kind)
    lens = np.column_stack([APERTURE, np.zeros(len(APERTURE))])
    out = np.broadcast_to([0.0, 0.0, 1.0], lens.shape)
    places, ways = light.fold.send(*light.retroreflector.send(lens, out))
    np.testing.assert_allclose(places.mean(axis=0), [1.0, 0.0, 0.0], atol=1e-3)
    # Down the tracker's boresight, which stands 120 degrees off the camera's.
    boresight = rotation_from_vector([BETWEEN, 0, 0])[:, 2]
    np.testing.assert_allclose(
        ways, np.broadcast_to(-boresight, ways.shape), atol=1e-12
    )
    assert np.degrees(np.arccos(boresight[2])) == pytest.approx(120.0)


def test_the_dichroic_mirror_stands_at_thirty_degrees_to_the_plate_of_the_tracker():
    normal = path("corner cube").fold.normals[0]
    boresight = rotation_from_vector([BETWEEN, 0, 0])[:, 2]
    assert np.degrees(np.arccos(abs(normal @ boresight))) == pytest.approx(30.0)


@pytest.mark.parametrize("kind", KINDS)
def test_what_part_of_the_lens_is_lit_matters_only_to_a_cone(kind):
    spots = path(kind).spots(LASERS, APERTURE)
    blur = np.linalg.norm(spots - spots.mean(axis=1, keepdims=True), axis=-1).max()
    if kind == "conical mirror":
        assert 1e-9 < blur < 13e-6
    else:
        assert blur < 1e-15


@pytest.mark.parametrize("kind", KINDS)
def test_moving_the_retroreflector_moves_no_spot_but_a_cones(kind):
    still = path(kind)
    point = np.add(still.retroreflector.point, [1e-3, -2e-3, 3e-3])
    moved = replace(still, retroreflector=replace(still.retroreflector, point=point))
    shift = np.abs(centres(moved) - centres(still)).max()
    assert shift < (1e-7 if kind == "conical mirror" else 1e-15)


@pytest.mark.parametrize("axis", range(3))
def test_a_corner_cube_may_turn_about_every_axis(axis):
    moved = turned("corner cube", 0.05 * np.eye(3)[axis])
    np.testing.assert_allclose(centres(moved), centres(path("corner cube")), atol=1e-15)


def feigned(light, still, kind):
    """Angles of the camera that the tracker believes, from the spots alone."""
    camera = mirrored(kind)
    zero = laser_transform(camera, directions(centres(still)))
    return misalignment_angles(misalignment(camera, directions(centres(light)), zero))


@pytest.mark.parametrize(
    ("axis", "expected"),
    [(0, [2.0, 0.0, 0.0]), (1, [0.0, 0.0, 0.0]), (2, [0.0, 0.0, 2.0])],
)
def test_two_mirrors_feign_twice_their_turn_except_about_their_edge(axis, expected):
    kind = "two mirrors at a right angle"
    found = feigned(turned(kind, TURN * np.eye(3)[axis]), path(kind), kind) / TURN
    np.testing.assert_allclose(np.abs(found), expected, atol=2e-4)


@pytest.mark.parametrize("kind", PLANE)
@pytest.mark.parametrize("axis", range(3))
def test_a_turn_of_the_camera_is_seen_in_full(kind, axis):
    turn = TURN * np.eye(3)[axis]
    found = feigned(path(kind, camera_turn=turn), path(kind), kind)
    np.testing.assert_allclose(np.abs(found), np.abs(turn), atol=1e-4 * TURN)


def test_through_a_cone_a_tilt_feigns_a_roll():
    """The beam stands beside the tip along X. Of second order in the field, and so a false roll."""
    kind = "conical mirror"
    by_camera, by_cone = (
        np.array([feigned(light, path(kind), kind) for light in lights]) / TURN
        for lights in (
            [path(kind, camera_turn=TURN * unit) for unit in np.eye(3)],
            [turned(kind, TURN * unit) for unit in np.eye(3)],
        )
    )
    np.testing.assert_allclose(np.abs(by_camera[:, :2]), np.eye(3)[:, :2], atol=2e-4)
    assert 3.5 < by_camera[0, 2] < 4.5
    np.testing.assert_allclose(by_camera[1:, 2], [0.0, -1.0], atol=1e-3)
    np.testing.assert_allclose(np.abs(by_cone[:, :2]), 0.0, atol=3e-4)
    np.testing.assert_allclose(by_cone[:, 2], [-by_camera[0, 2], 0.0, 0.0], atol=1e-3)


def test_a_cone_against_a_root_finder_and_a_numerical_normal():
    """The surface as an implicit function, its gradient by differences: no formula in common."""
    tip, step = np.array([0.5, 0.0, 1.0]), 1e-6

    def surface(place):
        x, y, z = place - tip
        return np.hypot(x, y) + z

    rng = np.random.default_rng(5)
    starts = np.column_stack([rng.uniform(-0.1, 0.1, (20, 2)), np.zeros(20)])
    ways = np.column_stack([rng.uniform(-0.01, 0.01, (20, 2)), np.ones(20)])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    _, found = Cone(tip).send(starts, ways)
    for place, way, expected in zip(starts, ways, found, strict=True):
        for far in (1.2, 1.5):
            length = brentq(
                lambda t, p=place, w=way: surface(p + t * w), 1e-3, far, xtol=1e-15
            )
            place = place + length * way
            slope = [surface(place + e) - surface(place - e) for e in step * np.eye(3)]
            normal = np.array(slope) / np.linalg.norm(slope)
            way = way - 2 * (way @ normal) * normal
        np.testing.assert_allclose(way, expected, atol=1e-9)


def test_with_two_mirrors_the_sign_is_right_too():
    """No image is mirrored here, so the measured angles are those of the camera, sign and all."""
    kind = "two mirrors at a right angle"
    turn = TURN * np.array([0.3, -0.7, 0.5])
    found = feigned(path(kind, camera_turn=turn), path(kind), kind)
    np.testing.assert_allclose(found, turn, atol=1e-4 * TURN)


@pytest.mark.parametrize("kind", KINDS)
def test_only_two_mirrors_and_the_dichroic_one_carry_the_lasers_by_a_rotation(kind):
    """A corner cube, and a cone to first order, turn every direction round: a mirror image."""
    lasers = LASERS * np.array([[1.0], [1.0], [1.0], [0.4]])
    spots = directions(centres(path(kind), lasers))
    size = (lasers**2).sum() / CAMERA**2
    losses = []
    for flip in ([1.0, 1.0], [1.0, -1.0]):
        sent = emitted_directions(lasers * flip, CAMERA)
        losses.append(np.square(spots - sent @ attitude(spots, sent).T).sum() / size)
    fits, misses = losses if kind == "two mirrors at a right angle" else losses[::-1]
    assert fits < 1e-4
    assert misses > 0.1


def test_a_mirrored_square_leaves_the_roll_free():
    """The misses of a square against its mirror image are the same at every roll."""
    with pytest.raises(DegenerateGeometryError, match="leaves a rotation free"):
        laser_transform(
            emitted_directions(LASERS, CAMERA), directions(centres(path(KINDS[0])))
        )


@pytest.mark.parametrize("kind", KINDS)
def test_a_shift_of_a_laser_shrinks_by_the_ratio_of_the_focal_lengths(kind):
    shift = np.array([1e-6, 2e-6])
    moved = centres(path(kind), LASERS + shift) - centres(path(kind))
    sizes = np.linalg.norm(moved, axis=-1)
    tolerance = 0.03 if kind == "conical mirror" else 1e-4
    np.testing.assert_allclose(
        np.linalg.norm(shift) / sizes, CAMERA / TRACKER, rtol=tolerance
    )


@pytest.mark.parametrize(
    ("axis", "expected"),
    # Its edge-on axis, the one across the plane of the light, and its normal.
    [("in", np.sqrt(3.0)), ("across", 2.0), ("normal", 0.0)],
)
def test_a_turn_of_the_dichroic_mirror_is_taken_for_one_of_the_camera(
    monkeypatch, axis, expected
):
    kind = "corner cube"
    normal = path(kind).fold.normals[0]
    axes = {
        "across": np.eye(3)[0],
        "normal": normal,
        "in": np.cross(np.eye(3)[0], normal),
    }
    turned_mirror = replace(path(kind).fold, turn=TURN * axes[axis])
    monkeypatch.setattr(Bent, "fold", turned_mirror, raising=False)
    bent = Bent(CAMERA, TRACKER, BETWEEN, RETROREFLECTORS[kind])
    found = feigned(bent, path(kind), kind) / TURN
    assert np.linalg.norm(found[:2]) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("angle", np.radians([60.0, 90.0, 150.0]))
def test_other_boresights_are_folded_as_well(angle):
    light = LightPath(CAMERA, TRACKER, angle, RETROREFLECTORS["corner cube"])
    np.testing.assert_allclose(centres(light, np.zeros((1, 2))), 0.0, atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
def test_light_and_retroreflector_that_turn_together_stay_together(kind):
    """One-sidedly for each axis: a turn of the mirrors is right-handed about their point."""
    still = path(kind).retroreflector
    rng = np.random.default_rng(8)
    starts = np.column_stack([rng.uniform(-0.1, 0.1, (20, 2)), np.zeros(20)])
    ways = np.column_stack([rng.uniform(-0.02, 0.02, (20, 2)), np.ones(20)])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    places, gone = still.send(starts, ways)
    for turn in (
        0.05 * np.eye(3)[0],
        -0.04 * np.eye(3)[1],
        np.array([0.02, 0.03, 0.3]),
    ):
        rotation = rotation_from_vector(turn)
        about = still.point + (starts - still.point) @ rotation.T
        found = replace(still, turn=turn).send(about, ways @ rotation.T)
        np.testing.assert_allclose(found[1], gone @ rotation.T, atol=1e-12)
        expected = still.point + (places - still.point) @ rotation.T
        np.testing.assert_allclose(found[0], expected, atol=1e-12)


def test_a_ray_that_misses_is_refused():
    mirrors = Mirrors(np.zeros(3), np.array([[0, 0, 1.0]]))
    with pytest.raises(DegenerateGeometryError, match="misses"):
        mirrors.send(np.array([0, 0, 1.0]), np.array([0, 0, 1.0]))
    with pytest.raises(DegenerateGeometryError, match="tip"):
        Cone(np.array([0, 0, 1.0])).send(np.zeros(3), np.array([0, 0, 1.0]))
