"""Rotation matrices and vectors against the matrix exponential and their limits."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.linalg import expm

from reproduce.physics.attitude import (
    rotation_from_vector,
    unit,
    vector_from_rotation,
)

RNG = default_rng(1)
VECTORS = np.concatenate(
    [
        RNG.uniform(-1.7, 1.7, (50, 3)),
        1e-9 * RNG.standard_normal((5, 3)),
        np.zeros((1, 3)),
        [[0, 0, np.pi], [np.pi - 1e-9, 0, 0], [0, 3.0, 0]],
    ]
)


def test_matrix_of_a_rotation_vector_is_the_exponential_of_its_cross_product():
    expected = expm(np.cross(np.eye(3), VECTORS[..., None, :]))
    assert_allclose(rotation_from_vector(VECTORS), expected, atol=3e-15)


def test_rotation_vector_comes_back_to_the_last_digits():
    usable = VECTORS[np.linalg.norm(VECTORS, axis=-1) < np.pi]
    back = vector_from_rotation(rotation_from_vector(usable))
    assert_allclose(back, usable, rtol=1e-12, atol=1e-15)


def test_vectors_that_are_read_only_and_a_batch_of_more_axes_are_accepted():
    batch = np.broadcast_to(VECTORS[:2], (4, 3, 2, 3))
    expected = np.broadcast_to(rotation_from_vector(VECTORS[:2]), (4, 3, 2, 3, 3))
    assert_allclose(rotation_from_vector(batch), expected, rtol=0)
    fixed = VECTORS[:2].copy()
    fixed.flags.writeable = False
    assert_allclose(rotation_from_vector(fixed), expected[0, 0], rtol=0)


def test_unit_vectors_of_any_length():
    for length in (1e-150, 1.0, 1e150):
        found = unit("v", [0, 3 * length, 4 * length])
        assert_allclose(found, [0, 0.6, 0.8], rtol=1e-15)


@pytest.mark.parametrize(
    ("function", "arguments", "name"),
    [
        (vector_from_rotation, (np.diag([-1, 1, 1]),), "rotation"),
        (unit, ("v", [[1, 0, 0], [0, 0, 0]]), r"v.* index \(1,\)"),
        (unit, ("v", [1e200, 0, 0]), "v"),
    ],
)
def test_bad_input_is_an_error(function, arguments, name):
    with pytest.raises(ValueError, match=name):
        function(*arguments)
