"""Rotation matrices, vectors and quaternions against SciPy and their limits."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reproduce.physics.attitude import (
    cross_matrix,
    rotation_from_vector,
    unit,
    vector_from_rotation,
)
from reproduce.physics.attitude.rotations import _cofactors, _rotation_from_quaternion
from reproduce.physics.validate import rotations

RNG = np.random.default_rng(1)
VECTORS = np.concatenate(
    [
        RNG.uniform(-1.7, 1.7, (50, 3)),
        1e-9 * RNG.standard_normal((5, 3)),
        np.zeros((1, 3)),
        [[0, 0, np.pi], [np.pi - 1e-9, 0, 0], [0, 3.0, 0]],
    ]
)


def test_matrix_of_a_rotation_vector_agrees_with_scipy():
    expected = Rotation.from_rotvec(VECTORS).as_matrix()
    np.testing.assert_allclose(rotation_from_vector(VECTORS), expected, atol=3e-15)


def test_rotation_vector_comes_back_to_the_last_digits():
    usable = VECTORS[np.linalg.norm(VECTORS, axis=-1) < 3.1]
    back = vector_from_rotation(rotation_from_vector(usable))
    np.testing.assert_allclose(back, usable, rtol=1e-12, atol=1e-15)


def test_quaternion_has_its_scalar_last():
    quaternions = 7.0 * RNG.standard_normal((40, 4))
    expected = Rotation.from_quat(quaternions).as_matrix()
    np.testing.assert_allclose(
        _rotation_from_quaternion(quaternions), expected, atol=1e-15
    )
    np.testing.assert_allclose(
        _rotation_from_quaternion(np.array([0, 0, 0, -2.0])), np.eye(3)
    )


def test_cross_matrix_is_the_cross_product():
    one, two = RNG.standard_normal((2, 20, 3))
    np.testing.assert_allclose(
        np.einsum("bij,bj->bi", cross_matrix(one), two), np.cross(one, two), atol=1e-15
    )


def test_cofactors_agree_with_linear_algebra():
    matrices = RNG.standard_normal((30, 3, 3))
    det = np.linalg.det(matrices)
    expected = det[:, None, None] * np.swapaxes(np.linalg.inv(matrices), -1, -2)
    np.testing.assert_allclose(_cofactors(matrices), expected, rtol=1e-9, atol=1e-12)


def test_cofactors_of_a_singular_matrix_need_no_inverse():
    rank_two = np.outer([1, 2, 0], [0, 1, 1]) + np.outer([0, 1, 1], [1, 0, 0])
    np.testing.assert_allclose(rank_two @ _cofactors(rank_two).T, 0, atol=1e-15)
    assert np.abs(_cofactors(rank_two)).max() > 0.5


@pytest.mark.parametrize("length", [1e-150, 1.0, 1e150])
def test_unit_vectors_of_any_length(length):
    np.testing.assert_allclose(
        unit("v", [0, 3 * length, 4 * length]), [0, 0.6, 0.8], rtol=1e-15
    )


def test_what_is_no_rotation_is_refused():
    with pytest.raises(
        ValueError, match="R: expected rotation matrices, got one whose rows"
    ):
        rotations("R", 1.001 * np.eye(3))
    with pytest.raises(
        ValueError, match="R: expected rotation matrices, got a reflection"
    ):
        rotations("R", np.diag([1, 1, -1]))
    with pytest.raises(
        ValueError, match=r"expected turns below 179.9 deg, got 180 deg"
    ):
        vector_from_rotation(np.diag([-1, -1, 1]))
    with pytest.raises(ValueError, match=r"got 0 at index \(1,\)"):
        unit("v", [[1, 0, 0], [0, 0, 0]])
    with pytest.raises(ValueError, match=r"got inf at index \(\)"):
        unit("v", [1e200, 0, 0])
