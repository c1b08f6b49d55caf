"""The camera and its pixel angles against closed forms and limits."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose

from reproduce.physics.optics import (
    Camera,
    ideal_positions,
    image_points,
)

PITCH = 4e-6


def directions(count=40, seed=1):
    slopes = default_rng(seed).uniform(-0.15, 0.15, (count, 2))
    return np.concatenate([slopes, np.ones((count, 1))], axis=-1)


def camera(**changes):
    values = {
        "focal_length": 20e-3,
        "principal_point": (800.0, 600.0),
        "radial_distortion": 40.0,
        "pixel_pitch": PITCH,
    }
    return Camera(**values | changes)


def test_image_points_are_those_by_hand():
    """In complex numbers: projection, radial distortion, then a rotation of the detector."""
    rng, stars = default_rng(4), directions()
    for focal, radial, theta in rng.uniform((0.019, 0, -1), (0.021, 50, 1), (5, 3)):
        x, y, z = stars.T
        ideal = focal * (x + 1j * y) / z
        bent = ideal * (1 + radial * np.abs(ideal) ** 2)
        expected = bent * np.exp(-1j * theta) / PITCH + (800 + 600j)
        channel = camera(focal_length=focal, radial_distortion=radial)
        spots = image_points(rng.uniform(0.1, 9, (40, 1)) * stars, channel, theta)
        assert_allclose(spots @ [1, 1j], expected, rtol=1e-13)
        assert_allclose(ideal_positions(stars, focal) @ [1, 1j], ideal, rtol=1e-13)
