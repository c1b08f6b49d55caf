"""Rotations as matrices and vectors, and the best rotation between sets of directions.

A rotation matrix acts on columns: `R @ v`. A rotation vector is along the axis, its length is the
angle in radians, and a positive angle is right-handed: about Z it rotates X towards Y. Leading axes
are a batch.

Wahba's problem is to find the best rotation from one set of directions to another. Directions
have shape (..., n, 3): rows are observations. Rotations are named target first: the result
`target_from_source` fits `target = target_from_source @ source`.

The solution maximises trace(A B^T), where the profile B = sum w t s^T contains the target
directions t and the source directions s, with weights of sum 1. `attitude` computes it from the
singular values of B (Markley 1988), with an error of about 60 times machine precision over the gap
between the two largest eigenvalues of Davenport's matrix K. `quest` computes the eigenvector of K
(Shuster and Oh 1981), for comparison. Half the gap is the stiffness against a rotation about the
worst axis.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation as SciPyRotation

from reproduce.physics.validate import (
    DegenerateGeometryError,
    Direction,
    Directions,
    FloatArray,
    Rotation,
    Weights,
    checked,
    finite_array,
    positive,
    rotations,
    weights_for,
)

_Rotations = Annotated[Any, (None, 3, 3), rotations]
# Relative gap below which rounding rotates the result by a milliradian: that of directions about a
# microradian apart, or of a weight of this fraction.
_MIN_EIGENVALUE_GAP = 1e-12


def unit(name: str, vectors: ArrayLike) -> FloatArray:
    """Return vectors of any length as unit vectors.

    Parameters
    ----------
    name : str
        Name of the argument, the first word of an error message.
    vectors : array_like, shape (..., 3)
        Directions, in any unit and frame, of any length but zero.

    Returns
    -------
    ndarray, shape (..., 3)
        Unit vectors.

    Examples
    --------
    >>> unit("axis", [0, 0, 2])
    array([0., 0., 1.])
    """
    array = finite_array(name, vectors, shape=(3,))
    lengths = np.sqrt(np.einsum("...i,...i->...", array, array))
    return array / positive(f"{name} (length)", lengths)[..., None]


@checked
def rotation_from_vector(rotation_vector: Direction) -> FloatArray:
    """Return the rotation matrix of a rotation vector.

    Parameters
    ----------
    rotation_vector : array_like, shape (..., 3)
        Axis times angle, in radians, right-handed.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Matrix that rotates a column vector by this angle.

    Examples
    --------
    A rotation by 90 deg about Z takes X to Y.

    >>> R = rotation_from_vector([0, 0, np.pi / 2])
    >>> np.allclose(R @ [1, 0, 0], [0, 1, 0])
    True
    """
    # A batch of more axes needs SciPy 1.17, and SciPy rejects arrays that are read-only.
    flat = SciPyRotation.from_rotvec(np.array(rotation_vector).reshape(-1, 3))
    return flat.as_matrix().reshape(*rotation_vector.shape, 3)


@checked
def vector_from_rotation(rotation: Rotation) -> FloatArray:
    """Return the rotation vector of a rotation, of at most 180 deg.

    Parameters
    ----------
    rotation : array_like, shape (..., 3, 3)
        Proper rotations. Close to 180 deg, rounding errors determine the sign of the axis.

    Returns
    -------
    ndarray, shape (..., 3)
        Axis times angle, in radians, right-handed.

    Examples
    --------
    >>> vector_from_rotation([[0, -1, 0], [1, 0, 0], [0, 0, 1]]) / np.pi
    array([0. , 0. , 0.5])
    """
    vectors = SciPyRotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec()
    return vectors.reshape(rotation.shape[:-1])


@checked
def attitude(
    target_vectors: Directions, source_vectors: Directions, weights: Weights = None
) -> FloatArray:
    """Return the rotation that minimises ``sum w |target - rotation @ source|^2``.

    Parameters
    ----------
    target_vectors, source_vectors : array_like, shape (..., n, 3)
        The same directions in two frames, of any length but zero.
    weights : array_like, shape (..., n), optional
        Relative weights, such as inverse variances, not all zero. Default: all 1.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        target_from_source, a proper rotation.

    Raises
    ------
    DegenerateGeometryError
        If the directions do not determine a rotation: fewer than two directions of weight above
        zero that are not parallel, or a mirror image.

    Examples
    --------
    A rotation that takes X to Y.

    >>> target_from_source = attitude([[0, 1, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, 1]])
    >>> np.allclose(target_from_source @ [1, 0, 0], [0, 1, 0])
    True
    """
    return _nearest_rotation(_profile(target_vectors, source_vectors, weights))


@checked
def quest(
    target_vectors: Directions, source_vectors: Directions, weights: Weights = None
) -> FloatArray:
    """Return the rotation of `attitude` by QUEST, the solver of chen2023.

    Newton's iteration finds the largest eigenvalue of Davenport's matrix from its
    characteristic polynomial, and cofactors give its eigenvector, a quaternion. The
    usual form by an inverse fails for 180 deg. The numerical error is larger than
    the error of `attitude`, about the square of the inverse gap times machine precision.

    Parameters
    ----------
    target_vectors, source_vectors : array_like, shape (n, 3)
        The same directions in two frames, of any length but zero.
    weights : array_like, shape (n,), optional
        Relative weights, such as inverse variances, not all zero. Default: all 1.

    Returns
    -------
    ndarray, shape (3, 3)
        target_from_source, a proper rotation.

    Raises
    ------
    DegenerateGeometryError
        As in `attitude`.

    Examples
    --------
    >>> target_from_source = quest([[0, 1, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, 1]])
    >>> np.allclose(target_from_source @ [1, 0, 0], [0, 1, 0])
    True
    """
    from scipy.optimize import newton  # slow to import

    profile = _profile(target_vectors, source_vectors, weights)
    _nearest_rotation(profile)  # raises an error if a rotation is free
    trace, twist = np.trace(profile), (profile.T - profile)[[1, 2, 0], [2, 0, 1]]
    upper = profile + profile.T - trace * np.eye(3)
    davenport = np.block([[upper, twist[:, None]], [twist, trace]])
    cubic = -8.0 * np.linalg.det(profile), -2.0 * np.square(profile).sum(), 0.0, 1.0
    characteristic = Polynomial([np.linalg.det(davenport), *cubic])
    # The sum of the weights is an upper bound, from which the iteration converges quadratically.
    root = newton(characteristic, 1.0, characteristic.deriv())
    # By the theorem of Cayley and Hamilton, the polynomial without this root is the matrix of
    # cofactors. Each row is the quaternion, of length zero for some rows.
    others = characteristic // Polynomial([-root, 1.0])
    terms = [
        coefficient * np.linalg.matrix_power(davenport, power)
        for power, coefficient in enumerate(others.coef)
    ]
    cofactors = np.sum(terms, axis=0)
    quaternion = max(cofactors, key=np.linalg.norm)
    return SciPyRotation.from_quat(quaternion).as_matrix()


@checked
def mean_rotation(matrices: _Rotations) -> FloatArray:
    """Return the rotation closest to several rotations, in the sum of squared differences.

    Parameters
    ----------
    matrices : array_like, shape (..., n, 3, 3)
        Rotations between the same two frames.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Mean rotation.

    Raises
    ------
    DegenerateGeometryError
        If the rotations cancel, such as the identity and a rotation by 180 deg.

    Examples
    --------
    >>> mean_rotation([np.eye(3), np.eye(3)]).diagonal()
    array([1., 1., 1.])
    """
    return _nearest_rotation(matrices.mean(axis=-3))


def _profile(
    target_vectors: ArrayLike, source_vectors: ArrayLike, weights: FloatArray | None
) -> FloatArray:
    """Return the attitude profile matrices, with weights of sum 1."""
    source = unit("source_vectors", source_vectors)
    relative = weights_for(weights, source.shape[-2])
    fraction = (relative / relative.sum(axis=-1, keepdims=True))[..., None]
    return (fraction * unit("target_vectors", target_vectors)).mT @ source


def _nearest_rotation(profile: FloatArray) -> FloatArray:
    """Return the rotation A of largest trace(A B^T); raise an error if it is not unique."""
    left, singular, right = np.linalg.svd(profile)
    # A rotation, also if a reflection would fit better.
    sign = np.sign(np.linalg.det(left @ right))
    left[..., 2] *= sign[..., None]
    gap = 2.0 * (singular[..., 1] + sign * singular[..., 2])
    if (gap < _MIN_EIGENVALUE_GAP).any():
        raise DegenerateGeometryError(
            "directions: expected sets that determine all three axes, got a gap of "
            f"{gap.min():.1e} for the set of index {np.argmin(gap)}. Add a direction that is not "
            "parallel to the others, with a weight above zero"
        )
    return left @ right
