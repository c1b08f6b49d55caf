"""Tests of mirrors and retro-reflectors against identities and a root finder."""

from itertools import permutations

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from reproduce.physics.attitude import rotation_from_vector
from reproduce.physics.raytrace import (
    fold_mirror_tilt,
    mirror_train,
    reflected_by_cone,
    reflection,
)
from reproduce.physics.validate import DegenerateGeometryError

RNG = default_rng(4)
# Three mutually perpendicular mirrors evenly around Z.
CORNER = np.array([[2, 0, 2**0.5], [-1, 3**0.5, 2**0.5], [-1, -(3**0.5), 2**0.5]])


def test_a_corner_cube_returns_every_direction_however_it_turns():
    for order in permutations(range(3)):
        turned = CORNER[[*order]] @ rotation_from_vector(RNG.normal(size=3))
        assert_allclose(mirror_train(turned), -np.eye(3), atol=1e-12)


def test_the_order_of_a_train_is_that_of_the_light():
    first, second = RNG.normal(size=(2, 3))
    expected = reflection(second) @ reflection(first)
    assert_allclose(mirror_train([first, second]), expected, atol=1e-15)


def test_a_cone_against_a_root_finder_and_a_numerical_normal():
    """The surface as an implicit function, its gradient by differences: no formula in common."""

    def surface(place):
        return np.hypot(*place[:2]) + place[2]

    starts = RNG.uniform([-0.6, -0.1, -1.0], [-0.1, 0.1, -1.0], (20, 3))
    ways = RNG.uniform([-0.01, -0.01, 1.0], [0.01, 0.01, 1.0], (20, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    found = reflected_by_cone(starts, ways)
    for place, way, expected in zip(starts, ways, found, strict=True):
        for far in (1.2, 1.5):
            length = brentq(
                lambda t, p=place, w=way: surface(p + t * w), 1e-3, far, xtol=1e-15
            )
            place = place + length * way
            steps = 1e-6 * np.eye(3)
            slope = [surface(place + e) - surface(place - e) for e in steps]
            normal = np.array(slope) / np.linalg.norm(slope)
            way = way - 2 * (way @ normal) * normal
        assert_allclose(way, expected, atol=1e-9)


def test_bad_light_is_an_error():
    for angle in (0.0, -0.1, 4.0, np.nan):
        with pytest.raises(ValueError, match="boresight_angle"):
            fold_mirror_tilt(angle)
    with pytest.raises(ValueError, match="normal"):
        reflection([0.0, 0.0, 0.0])
    with pytest.raises(DegenerateGeometryError, match="rays"):
        reflected_by_cone(np.array([0.1, 0, -1.0]), np.array([0, 0, -1.0]))
