"""The rotary table against SciPy's rotations, and the channels that image its star."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from reproduce.physics.optics import (
    Camera,
    channel_centroids,
    rotary_matrix,
    rotary_matrix_printed,
    starlight,
)
from reproduce.physics.registration import fit_registration, similarity_between

EXTERNAL, MIDDLE = default_rng(1).uniform(-1.2, 1.2, (2, 20))
CAMERAS = [
    Camera(focal, point, 0.0, 4e-6, rotation)
    for focal, point, rotation in (
        (25.1e-3, (1034.0, 774.0), 0.002),
        (25.0e-3, (1032.0, 772.0), 0.0),
        (24.9e-3, (1031.0, 770.0), -0.001),
    )
]
ANGLES = default_rng(1).uniform(-0.1, 0.1, (4, 30, 2))


def test_matrix_agrees_with_scipy():
    # Both frames are passive rotations: SciPy's active ones by the opposite angle.
    about_x = Rotation.from_euler("x", -EXTERNAL[:, None])
    expected = (about_x * Rotation.from_euler("y", -MIDDLE[:, None])).as_matrix()
    assert_allclose(rotary_matrix(EXTERNAL, MIDDLE), expected, atol=5e-16)
    grid = rotary_matrix(EXTERNAL[:, None], MIDDLE[:4])
    assert_array_equal(grid[3, 2], rotary_matrix(EXTERNAL[3], MIDDLE[2]))


def test_printed_matrix_is_no_rotation_but_has_the_same_starlight():
    printed = rotary_matrix_printed(EXTERNAL, MIDDLE)
    assert_allclose(np.linalg.det(printed), np.cos(2 * MIDDLE), atol=1e-14)
    first_times_third = (printed[:, :, 0] * printed[:, :, 2]).sum(axis=-1)
    assert_allclose(first_times_third, -np.sin(2 * MIDDLE), atol=1e-15)
    assert_array_equal(printed[..., 2], starlight(EXTERNAL, MIDDLE))
    plain = rotary_matrix(EXTERNAL, 0.0)
    assert_array_equal(rotary_matrix_printed(EXTERNAL, 0.0), plain)


def test_channels_register_onto_the_reference():
    centroids = channel_centroids(CAMERAS, ANGLES[0])
    for i in (0, 2):
        expected = similarity_between(CAMERAS[i], CAMERAS[1])
        pivot = CAMERAS[i].principal_point
        fit = fit_registration(centroids[i], centroids[1], pivot)
        assert_allclose(fit.parameters, expected.parameters, atol=1e-10)
