"""Three ways from an attitude profile matrix to the rotation that fits best.

The profile B = sum w t s^T gathers target directions t and source directions s; its weights
sum to one. Each solver returns the rotation A that maximises trace(A B^T), which is the one
that minimises ``sum w |t - A s|^2``, and the gap between the two largest eigenvalues of
Davenport's matrix K: half of it is the stiffness against turning about the worst axis, and
at zero that turn is free. The solvers share nothing but B, so their agreement is evidence:

- `by_svd`: singular value decomposition (Markley 1988);
- `by_q_method`: the leading eigenvector of Davenport's matrix K;
- `by_quest`: Newton's iteration on the characteristic polynomial of K (Shuster and Oh 1981).

Each is accurate to a multiple of machine precision over the gap, with the weights summing to one:
60 times for SVD, 20 for the q-method, 15 for QUEST, with room for another random set. Where the
directions crowd about the axis of both frames, as spots do about a boresight, SVD loses next to
nothing. What is lost elsewhere is lost in rounding B, so SciPy's solver loses it too; see
`wahba_direct` for the way around. QUEST needs care to get there. The
quaternion is taken from cofactors of K - lambda, because the matrix that the textbook form
inverts is singular at a half turn. And its polynomial has nearly a double root when all
directions are close together; expanded in powers of lambda it then loses half the digits of
the root. Two things keep them: the polynomial in Markley's form, whose three terms all vanish
with the gap, and half turns of both frames that first bring crowded or heavy directions to
the Z axis, where determinant and cofactors cancel nothing and the error is one of roll alone.
Where even that does not resolve the root, SVD takes over.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reproduce.physics.attitude.rotations import (
    cofactors,
    determinant,
    rotation_from_quaternion,
    transpose,
)
from reproduce.physics.validate import FloatArray

IndexArray = NDArray[np.intp]

# Newton halves the distance to a double root at each step: enough for all 52 bits.
MOST_STEPS = 60
ROUNDING = 2e-16
MOST_BLUR = 100 * ROUNDING

# Half turns about X, Y and Z; about one of them or none the rotation is below 120 degrees.
HALF_TURNS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float64)


def by_svd(profile: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the best rotation by singular value decomposition.

    Parameters
    ----------
    profile : ndarray, shape (..., 3, 3)
        The attitude profile matrix B.

    Returns
    -------
    rotation : ndarray, shape (..., 3, 3)
        The rotation target_from_source.
    gap : ndarray, shape (...)
        The distance between the two largest eigenvalues of K.

    Examples
    --------
    >>> rotation, gap = by_svd(np.diag([0.5, 0.3, 0.2]))
    >>> bool(np.allclose(rotation, np.eye(3))), float(gap)
    (True, 1.0)
    """
    left, singular, right = np.linalg.svd(profile)
    # The third pair as cross products makes both factors proper rotations, which is the
    # determinant correction without a determinant.
    third_left = _cross(left[..., :, 0], left[..., :, 1])
    third_right = _cross(right[..., 0, :], right[..., 1, :])
    sign = np.einsum("...i,...i->...", third_left, left[..., :, 2])
    sign *= np.einsum("...i,...i->...", third_right, right[..., 2, :])
    left[..., :, 2], right[..., 2, :] = third_left, third_right
    rotation: FloatArray = left @ right
    gap: FloatArray = 2.0 * (singular[..., 1] + sign * singular[..., 2])
    return rotation, gap


def by_q_method(profile: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the best rotation from the leading eigenvector of Davenport's matrix.

    Parameters
    ----------
    profile : ndarray, shape (..., 3, 3)
        The attitude profile matrix B.

    Returns
    -------
    rotation : ndarray, shape (..., 3, 3)
        The rotation target_from_source.
    gap : ndarray, shape (...)
        The distance between the two largest eigenvalues of K.

    Examples
    --------
    >>> rotation, gap = by_q_method(np.diag([0.5, 0.3, 0.2]))
    >>> bool(np.allclose(rotation, np.eye(3))), round(float(gap), 12)
    (True, 1.0)
    """
    values, vectors = np.linalg.eigh(davenport_matrix(profile))
    return rotation_from_quaternion(vectors[..., :, -1]), values[..., -1] - values[..., -2]


def by_quest(profile: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the best rotation by Newton's iteration on the characteristic polynomial.

    Parameters
    ----------
    profile : ndarray, shape (..., 3, 3)
        The attitude profile matrix B.

    Returns
    -------
    rotation : ndarray, shape (..., 3, 3)
        The rotation target_from_source. Where Newton's iteration cannot tell the root from
        its neighbour (data close to mirror images of each other), that of `by_svd`.
    gap : ndarray, shape (...)
        The distance between the two largest eigenvalues of K.

    Examples
    --------
    >>> rotation, gap = by_quest(np.diag([0.5, 0.3, 0.2]))
    >>> bool(np.allclose(rotation, np.eye(3))), round(float(gap), 12)
    (True, 1.0)
    """
    columns = np.einsum("...ij,...ij->...j", profile, profile).argmax(axis=-1)
    rows = np.einsum("...ij,...ij->...i", profile, profile).argmax(axis=-1)
    left = _half_turn_to_z(_take(transpose(profile), columns))
    right = _half_turn_to_z(_take(profile, rows))
    graded = left @ profile @ right
    root, gap, blur = largest_root(graded)
    rotation = left @ _rotation_at(graded, root) @ right
    lost = blur > MOST_BLUR
    if lost.any():
        rotation[lost], gap[lost] = by_svd(profile[lost])
    return rotation, gap


def davenport_matrix(profile: FloatArray) -> FloatArray:
    """Return Davenport's matrix K: the gain trace(A B^T) as a form in the quaternion of A.

    Parameters
    ----------
    profile : ndarray, shape (..., 3, 3)
        The attitude profile matrix B.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Symmetric, with trace zero; the scalar of the quaternion is last.

    Examples
    --------
    >>> np.linalg.eigvalsh(davenport_matrix(np.diag([3.0, 2.0, 1.0])))
    array([-4., -2.,  0.,  6.])
    """
    trace = np.einsum("...ii->...", profile)
    result = np.empty((*profile.shape[:-2], 4, 4))
    result[..., :3, :3] = profile + transpose(profile)
    for i in range(3):
        result[..., i, i] -= trace
    result[..., :3, 3] = result[..., 3, :3] = _axial(profile)
    result[..., 3, 3] = trace
    return result


def largest_root(profile: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the largest eigenvalue of Davenport's matrix without forming the matrix.

    Newton's iteration on ``(x^2 - |B|^2)^2 - 8 x det B - 4 |cof B|^2``, which rises and is
    convex beyond its largest root, so from above every step falls short of the root.

    Parameters
    ----------
    profile : ndarray, shape (..., 3, 3)
        The attitude profile matrix B.

    Returns
    -------
    root : ndarray, shape (...)
        The eigenvalue: the sum of the singular values, the last with the sign of det B.
    gap : ndarray, shape (...)
        Its distance from the next eigenvalue.
    blur : ndarray, shape (...)
        How far rounding in the polynomial can move the root; infinite where the iteration
        has not ended.

    Examples
    --------
    >>> root, gap, _ = largest_root(np.diag([0.5, 0.25, 0.25]))
    >>> float(root), round(float(gap), 12)
    (1.0, 1.0)
    """
    minors = cofactors(profile)
    volume = 8.0 * determinant(profile)
    square = np.einsum("...ij,...ij->...", profile, profile)
    constant = 4.0 * np.einsum("...ij,...ij->...", minors, minors)
    root = np.ones_like(square)
    for _ in range(MOST_STEPS):
        excess = root * root - square
        slope = 4.0 * root * excess - volume
        value = excess * excess - root * volume - constant
        # A step upwards can only be rounding at the root: stay.
        step = np.maximum(value, 0.0) / np.where(slope > 0, slope, np.inf)
        root -= step
        if (step <= ROUNDING).all():
            break
    terms = excess * (excess + 4.0 * root * root) + root * np.abs(volume) + constant
    blur = ROUNDING * terms / np.where(slope > 0, slope, ROUNDING)
    unfinished = step > MOST_BLUR
    return root, _gap_at(root, square, volume / 8.0), np.where(unfinished, np.inf, blur)


def _gap_at(root: FloatArray, square: FloatArray, volume: FloatArray) -> FloatArray:
    """Return twice the least eigenvalue of the stiffness trace(A B^T) - A B^T.

    Its characteristic polynomial follows from three invariants of B, and the cosine formula
    solves that. It is sharp where it matters, at a least eigenvalue well below the others.
    """
    pairs = 0.5 * (root * root - square)
    mean = root * (2.0 / 3.0)
    second, third = square + 3.0 * pairs, root * pairs - volume
    width = np.maximum(mean * mean - second / 3.0, 0.0)
    skew = mean * (second - 2.0 * mean * mean) - third
    scale = 2.0 * width * np.sqrt(width)
    cosine = np.clip(skew / np.where(scale > 0, scale, 1.0), -1.0, 1.0)
    least = mean - 2.0 * np.sqrt(width) * np.cos(np.arccos(cosine) / 3.0)
    return np.asarray(2.0 * least)


def _rotation_at(profile: FloatArray, root: FloatArray) -> FloatArray:
    """Return the rotation of the eigenvector of K at `root`, from cofactors of K - root."""
    # Of Shuster's sequential rotations take the one whose quaternion has the largest scalar.
    turns = HALF_TURNS[largest_component(profile, root)]
    turned = profile * turns[..., np.newaxis, :]
    trace = np.einsum("...ii->...", turned)
    block = -(turned + transpose(turned))
    for i in range(3):
        block[..., i, i] += root + trace
    minors = cofactors(block)
    quaternion = np.empty((*root.shape, 4))
    quaternion[..., :3] = np.einsum("...ij,...j->...i", minors, _axial(turned))
    scalar = np.einsum("...i,...i->...", block[..., 0, :], minors[..., 0, :])
    # With two equal roots all cofactors vanish; the caller refuses that, here it is no error.
    quaternion[..., 3] = np.where(scalar > 0, scalar, 1.0)
    return rotation_from_quaternion(quaternion) * turns[..., np.newaxis, :]


def largest_component(profile: FloatArray, root: FloatArray) -> IndexArray:
    """Return which component of the quaternion is the largest.

    Parameters
    ----------
    profile : ndarray, shape (..., 3, 3)
        The attitude profile matrix B.
    root : ndarray, shape (...)
        The largest eigenvalue of Davenport's matrix.

    Returns
    -------
    ndarray of int, shape (...)
        0 for the scalar, 1, 2, 3 for X, Y, Z: the half turn closest to the rotation.

    Examples
    --------
    >>> int(largest_component(np.diag([-0.2, -0.3, 0.5]), np.array(1.0)))
    3
    """
    matrix = davenport_matrix(profile)
    for i in range(4):
        matrix[..., i, i] -= root
    squares = np.empty((*root.shape, 4))
    for component, (i, j, k) in enumerate(((0, 1, 2), (1, 2, 3), (0, 2, 3), (0, 1, 3))):
        squares[..., component] = -_principal_minor(matrix, i, j, k)
    return np.asarray(squares.argmax(axis=-1))


def _principal_minor(symmetric: FloatArray, i: int, j: int, k: int) -> FloatArray:
    one, two, three = (symmetric[..., n, n] for n in (i, j, k))
    ij, jk, ki = symmetric[..., i, j], symmetric[..., j, k], symmetric[..., k, i]
    result: FloatArray = one * (two * three - jk * jk) - ij * (ij * three - jk * ki)
    return result + ki * (ij * jk - two * ki)


def _axial(profile: FloatArray) -> FloatArray:
    """Return sum w s × t, the antisymmetric part of the profile as a vector."""
    result = np.empty(profile.shape[:-1])
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[..., i] = profile[..., k, j] - profile[..., j, k]
    return result


def _half_turn_to_z(vector: FloatArray) -> FloatArray:
    """Return half turns that carry each vector onto the Z axis, up or down."""
    length = np.sqrt(np.einsum("...i,...i->...", vector, vector))
    axis = vector / np.where(length > 0, length, 1.0)[..., np.newaxis]
    # The bisector of the vector and the nearer end of Z: a sum that does not cancel.
    axis[..., 2] += np.where(axis[..., 2] < 0, -1.0, 1.0)
    square = np.einsum("...i,...i->...", axis, axis)
    outer = axis[..., :, np.newaxis] * axis[..., np.newaxis, :]
    result: FloatArray = (2.0 / square)[..., np.newaxis, np.newaxis] * outer - np.eye(3)
    return result


def _take(rows: FloatArray, index: IndexArray) -> FloatArray:
    """Return row `index` of each matrix in the batch."""
    return np.take_along_axis(rows, index[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]


def _cross(one: FloatArray, two: FloatArray) -> FloatArray:
    result = np.empty_like(one)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[..., i] = one[..., j] * two[..., k] - one[..., k] * two[..., j]
    return result
