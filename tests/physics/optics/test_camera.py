"""The camera against complex numbers."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose

from reproduce.physics.optics import (
    Camera,
    ideal_positions,
    image_points,
)

PITCH = 4e-6


def test_image_points_are_those_by_hand():
    """In complex numbers: projection, radial distortion, then a rotation of the detector."""
    rng = default_rng(4)
    stars = np.insert(rng.uniform(-0.15, 0.15, (40, 2)), 2, 1.0, axis=1)
    for focal, radial, theta in rng.uniform((0.019, 0, -1), (0.021, 50, 1), (5, 3)):
        x, y, z = stars.T
        ideal = focal * (x + 1j * y) / z
        bent = ideal * (1 + radial * np.abs(ideal) ** 2)
        expected = bent * np.exp(-1j * theta) / PITCH + (800 + 600j)
        channel = Camera(focal, (800.0, 600.0), radial, PITCH, theta)
        spots = image_points(rng.uniform(0.1, 9, (40, 1)) * stars, channel)
        assert_allclose(spots @ [1, 1j], expected, rtol=1e-13)
        assert_allclose(ideal_positions(stars, focal) @ [1, 1j], ideal, rtol=1e-13)
