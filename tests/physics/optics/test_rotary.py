"""The rotary table against SciPy's rotations."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from reproduce.physics.optics import (
    rotary_matrix,
    rotary_matrix_printed,
    starlight,
)

EXTERNAL, MIDDLE = default_rng(1).uniform(-1.2, 1.2, (2, 20))


def test_matrix_agrees_with_scipy():
    # Both frames are passive rotations: SciPy's active ones by the opposite angle.
    about_x = Rotation.from_euler("x", -EXTERNAL[:, None])
    expected = (about_x * Rotation.from_euler("y", -MIDDLE[:, None])).as_matrix()
    assert_allclose(rotary_matrix(EXTERNAL, MIDDLE), expected, atol=5e-16)
    grid = rotary_matrix(EXTERNAL[:, None], MIDDLE[:4])
    assert_array_equal(grid[3, 2], rotary_matrix(EXTERNAL[3], MIDDLE[2]))


def test_printed_matrix_is_no_rotation_but_has_the_same_starlight():
    printed = rotary_matrix_printed(EXTERNAL, MIDDLE)
    first_times_third = (printed[:, :, 0] * printed[:, :, 2]).sum(axis=-1)
    assert_allclose(first_times_third, -np.sin(2 * MIDDLE), atol=1e-15)
    assert_array_equal(printed[..., 2], starlight(EXTERNAL, MIDDLE))
    plain = rotary_matrix(EXTERNAL, 0.0)
    assert_array_equal(rotary_matrix_printed(EXTERNAL, 0.0), plain)
