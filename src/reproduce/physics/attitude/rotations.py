"""Rotations as matrices, vectors and quaternions.

A rotation matrix acts on columns: `R @ v`. A rotation vector points along the axis, its
length is the angle in radians, and a positive angle turns right-handed: about Z it carries
X towards Y. Quaternions hold the scalar last. Everything works over leading batch axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.validate import Direction, FloatArray, Rotation


def unit(name: str, vectors: ArrayLike) -> FloatArray:
    """Return vectors of any length as unit vectors.

    Parameters
    ----------
    name : str
        What the caller calls the vectors; it opens the error message.
    vectors : array_like, shape (..., 3)
        Directions, in any unit and frame, of any length but zero.

    Returns
    -------
    ndarray, shape (..., 3)

    Examples
    --------
    >>> unit("axis", [0, 0, 2])
    array([0., 0., 1.])
    """
    return _unit(name, validate.finite_array(name, vectors, shape=(3,)))


@validate.checked
def cross_matrix(vectors: Direction) -> FloatArray:
    """Return the matrices [v×], shape (..., 3, 3), of vectors v (...): [v×] u = v × u.

    Examples
    --------
    >>> cross_matrix([1, 0, 0]) @ [0, 1, 0]
    array([0., 0., 1.])
    """
    result = np.zeros((*vectors.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[..., k, j] = vectors[..., i]
        result[..., j, k] = -vectors[..., i]
    return result


_cross_matrix = validate.kernel(cross_matrix)


@validate.checked
def rotation_from_vector(rotation_vector: Direction) -> FloatArray:
    """Return the rotation matrix of a rotation vector.

    Parameters
    ----------
    rotation_vector : array_like, shape (..., 3)
        Axis times angle, in radians, right-handed.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        The matrix that turns a column vector by this angle.

    Examples
    --------
    A quarter turn about Z carries X to Y.

    >>> R = rotation_from_vector([0, 0, np.pi / 2])
    >>> np.allclose(R @ [1, 0, 0], [0, 1, 0])
    True
    """
    square = np.einsum("...i,...i->...", rotation_vector, rotation_vector)
    angle = np.sqrt(square)[..., np.newaxis, np.newaxis]
    generator = _cross_matrix(rotation_vector)
    # numpy.sinc is sin(pi x) / (pi x): no division by a vanishing angle.
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.eye(3) + first * generator + second * (generator @ generator)


_rotation_from_vector = validate.kernel(rotation_from_vector)


@validate.checked
def vector_from_rotation(rotation: Rotation) -> FloatArray:
    """Return the rotation vector of a rotation by less than half a turn.

    Parameters
    ----------
    rotation : array_like, shape (..., 3, 3)
        Proper rotations. Close to half a turn the sign of the axis is lost to rounding.

    Returns
    -------
    ndarray, shape (..., 3)
        Axis times angle, in radians, right-handed.

    Raises
    ------
    ValueError
        If a matrix turns by more than 179.9 degrees.

    Examples
    --------
    >>> vector_from_rotation([[0, -1, 0], [1, 0, 0], [0, 0, 1]]) / np.pi
    array([0. , 0. , 0.5])
    """
    twist = 0.5 * _axial(rotation)
    sine = np.sqrt(np.einsum("...i,...i->...", twist, twist))
    cosine = 0.5 * (np.einsum("...ii->...", rotation) - 1.0)
    angle = np.arctan2(sine, cosine)
    if (angle > np.radians(179.9)).any():
        raise ValueError(
            f"rotation: expected turns below 179.9 deg, got {np.degrees(angle.max()):.4g} deg; "
            "the axis of a half turn has no sign, use a quaternion instead"
        )
    return twist * (1.0 / np.sinc(angle / np.pi))[..., np.newaxis]


_vector_from_rotation = validate.kernel(vector_from_rotation)


def _unit(name: str, vectors: FloatArray) -> FloatArray:
    length = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., np.newaxis]
    usable = (length > 0) & np.isfinite(length)
    if not usable.all():
        first = tuple(int(i) for i in np.argwhere(~usable[..., 0])[0])
        raise ValueError(
            f"{name}: expected a length above zero, got {float(length[(*first, 0)]):g} at index "
            f"{first}; remove this row, or give it weight zero and any direction"
        )
    return vectors / length


def _axial(matrix: FloatArray) -> FloatArray:
    """Return the antisymmetric part of a matrix as a vector: of a profile, sum w s × t."""
    result = np.empty(matrix.shape[:-1])
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[..., i] = matrix[..., k, j] - matrix[..., j, k]
    return result


def _cofactors(matrices: FloatArray) -> FloatArray:
    """Return cofactors, the adjugate transposed, of 3 × 3 matrices, singular ones too."""
    result = np.empty_like(matrices)
    for i in range(3):
        one, two = matrices[..., (i + 1) % 3, :], matrices[..., (i + 2) % 3, :]
        for j in range(3):
            k, m = (j + 1) % 3, (j + 2) % 3
            result[..., i, j] = one[..., k] * two[..., m] - one[..., m] * two[..., k]
    return result


def _rotation_from_quaternion(quaternion: FloatArray) -> FloatArray:
    """Return the rotation of (sin(a/2) n, cos(a/2)), of any length but zero: by a about n."""
    length = np.einsum("...i,...i->...", quaternion, quaternion)
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    result = np.empty((*quaternion.shape[:-1], 3, 3))
    result[..., 0, 0] = w * w + x * x - y * y - z * z
    result[..., 1, 1] = w * w - x * x + y * y - z * z
    result[..., 2, 2] = w * w - x * x - y * y + z * z
    for i, j, (p, q, r) in ((0, 1, (x, y, z)), (1, 2, (y, z, x)), (2, 0, (z, x, y))):
        result[..., i, j] = 2.0 * (p * q - r * w)
        result[..., j, i] = 2.0 * (p * q + r * w)
    result /= length[..., np.newaxis, np.newaxis]
    return result
