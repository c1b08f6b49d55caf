"""Rotations as matrices, vectors and quaternions, and the one that fits directions best.

A rotation matrix acts on columns: `R @ v`. A rotation vector points along the axis, its
length is the angle in radians, and a positive angle turns right-handed: about Z it carries
X towards Y. Quaternions hold the scalar last. Everything works over leading batch axes.

Wahba's problem asks which rotation best carries one set of directions onto another. Directions have
shape (..., n, 3): rows are observations, leading axes are a batch (frames, replicates), all solved
in one call. Rotations are named target first: the result `target_from_source` fits
`target = target_from_source @ source`.

Two solvers start from the profile B = sum w t s^T of target directions t and source directions s;
its weights sum to one. Each returns the rotation A that maximises trace(A B^T), which is the one
that minimises ``sum w |t - A s|^2``, and the gap between the two largest eigenvalues of Davenport's
matrix K: half of it is the stiffness against turning about the worst axis, and at zero that turn is
free. They share nothing but B, so their agreement is evidence:

- `by_svd`: singular value decomposition (Markley 1988);
- `by_quest`: Newton's iteration on the characteristic polynomial of K (Shuster and Oh 1981).

Each is accurate to a multiple of machine precision over the gap, 60 times for SVD and 15 for QUEST.
Where the directions crowd about the axis of both frames, as spots do about a boresight, they lose
next to nothing. QUEST needs care to get there. The quaternion is taken from cofactors of
K - lambda, because the matrix that the textbook form inverts is singular at a half turn. And its
polynomial has nearly a double root when all directions are close together; expanded in powers of
lambda it then loses half the digits of the root. Two things keep them: the polynomial in Markley's
form, whose three terms all vanish with the gap, and half turns of both frames that first bring
crowded or heavy directions to the Z axis, where determinant and cofactors cancel nothing and the
error is one of roll alone. Where even that does not resolve the root, SVD takes over.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.validate import (
    Direction,
    Directions,
    FloatArray,
    Rotation,
    Weights,
)

# Newton halves the distance to a double root at each step: enough for all 52 bits.
_NEWTON_STEPS = 60
_ROUNDING = 2e-16
_MOST_BLUR = 100 * _ROUNDING
# Relative eigenvalue gap below which rounding in the profile matrix alone turns the answer by a
# milliradian. It belongs to directions about a microradian apart, or to a share of the weights.
_SMALLEST_GAP = 1e-12

# Half turns about X, Y and Z; about one of them or none the rotation is below 120 degrees.
_HALF_TURNS = np.array(
    [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float64
)


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


@validate.checked
def attitude(
    target_vectors: Directions,
    source_vectors: Directions,
    weights: Weights = None,
    method: str = "quest",
) -> FloatArray:
    """Return the rotation that minimises ``sum w |target - rotation @ source|^2``.

    Parameters
    ----------
    target_vectors, source_vectors : array_like, shape (..., n, 3)
        The same directions seen in two frames; they count as unit vectors, whatever their
        length, but it may not be zero.
    weights : array_like, shape (..., n), optional
        Relative weights, such as inverse variances, not all zero; all one where none are given.
    method : {"quest", "svd"}
        The solver, `by_quest` or `by_svd`.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        target_from_source, a proper rotation.

    Raises
    ------
    DegenerateGeometryError
        If a rotation is left free: fewer than two directions of weight above zero that are
        not parallel, or a set that mirrors its partner.

    Examples
    --------
    Target axes that are turned so that what was X is now Y.

    >>> target_from_source = attitude([[0, 1, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, 1]])
    >>> np.allclose(target_from_source @ [1, 0, 0], [0, 1, 0])
    True
    """
    solvers = {"quest": by_quest, "svd": by_svd}
    if method not in solvers:
        raise ValueError(
            f"method: expected one of {sorted(solvers)}, got {method!r}; choose one"
        )
    target = _unit("target_vectors", target_vectors)
    source = _unit("source_vectors", source_vectors)
    kept = validate.weights_for(weights, target.shape[-2])
    share = (kept / kept.sum(axis=-1, keepdims=True))[..., np.newaxis]
    return _fixed(*solvers[method]((share * target).mT @ source))


_attitude = validate.kernel(attitude)


def mean_rotation(matrices: ArrayLike) -> FloatArray:
    """Return the rotation closest to several rotations, in the sum of squared differences.

    Parameters
    ----------
    matrices : array_like, shape (..., n, 3, 3)
        Rotations between the same two frames.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Their mean, a rotation again.

    Raises
    ------
    DegenerateGeometryError
        If the rotations cancel, such as the identity and half a turn.

    Examples
    --------
    >>> mean_rotation([np.eye(3), np.eye(3)]).diagonal()
    array([1., 1., 1.])
    """
    array = validate.rotations("matrices", matrices, shape=(None, 3, 3))
    return _fixed(*by_svd(array.mean(axis=-3)))


def _fixed(rotation: FloatArray, gap: FloatArray) -> FloatArray:
    """Return a rotation, and refuse it where the gap tells that a turn is free."""
    free = gap < _SMALLEST_GAP
    if free.any():
        first = tuple(int(i) for i in np.argwhere(free)[0])
        where = (
            f"in {int(free.sum())} of {free.size} sets, the first at index {first}, "
        )
        raise validate.DegenerateGeometryError(
            "expected directions that fix all three axes, got a set that leaves a rotation free "
            f"({where if free.ndim else ''}relative eigenvalue gap {gap[free].min():.1e}); add "
            "a direction that is not parallel to the others, with a weight above zero"
        )
    return rotation


def by_svd(profile: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the best rotation by singular value decomposition.

    Parameters
    ----------
    profile : ndarray, shape (..., 3, 3)
        The attitude profile matrix B.

    Returns
    -------
    rotation : ndarray, shape (..., 3, 3)
        target_from_source.
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
    third_left = np.cross(left[..., :, 0], left[..., :, 1])
    third_right = np.cross(right[..., 0, :], right[..., 1, :])
    sign = np.einsum("...i,...i->...", third_left, left[..., :, 2])
    sign *= np.einsum("...i,...i->...", third_right, right[..., 2, :])
    left[..., :, 2], right[..., 2, :] = third_left, third_right
    return left @ right, 2.0 * (singular[..., 1] + sign * singular[..., 2])


def by_quest(profile: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the best rotation by Newton's iteration on the polynomial of K, as `by_svd`.

    Where the iteration cannot tell the root from its neighbour (data close to mirror images of
    each other), the rotation is that of `by_svd`. The gap is a lower bound, sharp where it
    is small.

    Examples
    --------
    >>> rotation, gap = by_quest(np.diag([0.5, 0.3, 0.2]))
    >>> bool(np.allclose(rotation, np.eye(3))), round(float(gap), 12)
    (True, 0.56)
    """
    left, right = (
        _half_turn_to_z(_take(one, np.einsum("...ij,...ij->...i", one, one)))
        for one in (profile.mT, profile)
    )
    graded = left @ profile @ right
    root, gap, blur = _largest_root(graded)
    rotation = left @ _rotation_at(graded, root) @ right
    lost = blur > _MOST_BLUR
    if lost.any():
        rotation[lost], gap[lost] = by_svd(profile[lost])
    return rotation, gap


def _largest_root(profile: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the largest eigenvalue of K without forming it, its gap, and its blur by rounding.

    Newton's iteration on ``(x^2 - |B|^2)^2 - 8 x det B - 4 |cof B|^2``, which rises and is
    convex beyond its largest root, so from above every step falls short of the root: the sum of
    the singular values of B, the last with the sign of det B. The blur is infinite where the
    iteration has not ended.
    """
    minors = _cofactors(profile)
    volume = 8.0 * np.einsum("...i,...i->...", profile[..., 0, :], minors[..., 0, :])
    square = np.einsum("...ij,...ij->...", profile, profile)
    constant = 4.0 * np.einsum("...ij,...ij->...", minors, minors)
    root = np.ones_like(square)
    for _ in range(_NEWTON_STEPS):
        excess = root * root - square
        slope = 4.0 * root * excess - volume
        value = excess * excess - root * volume - constant
        # A step upwards can only be rounding at the root: stay.
        step = np.maximum(value, 0.0) / np.where(slope > 0, slope, np.inf)
        root -= step
        if (step <= _ROUNDING).all():
            break
    terms = excess * (excess + 4.0 * root * root) + root * np.abs(volume) + constant
    blur = _ROUNDING * terms / np.where(slope > 0, slope, _ROUNDING)
    blur = np.where(step > _MOST_BLUR, np.inf, blur)
    # The slope is the product of the distances to the other three roots, two of them 2 at most.
    return root, np.asarray(slope / 4.0), blur


def _rotation_at(profile: FloatArray, root: FloatArray) -> FloatArray:
    """Return the rotation of the eigenvector of K at `root`, from cofactors of K - root."""
    # Of Shuster's sequential rotations take the one whose quaternion has the largest scalar.
    turned = profile[..., np.newaxis, :, :] * _HALF_TURNS[:, np.newaxis, :]
    block = -(turned + turned.mT)
    trace = np.einsum("...ii->...", turned)
    for i in range(3):
        block[..., i, i] += root[..., np.newaxis] + trace
    minors = _cofactors(block)
    scalar = np.einsum("...i,...i->...", block[..., 0, :], minors[..., 0, :])
    vector = np.einsum("...ij,...j->...i", minors, _axial(turned))
    quaternion = _take(
        np.concatenate([vector, scalar[..., np.newaxis]], axis=-1), scalar
    )
    # With two equal roots all cofactors vanish; the caller refuses that, here it is no error.
    quaternion[..., 3] = np.where(quaternion[..., 3] > 0, quaternion[..., 3], 1.0)
    return (
        _rotation_from_quaternion(quaternion)
        * _HALF_TURNS[scalar.argmax(axis=-1), np.newaxis]
    )


def _half_turn_to_z(vector: FloatArray) -> FloatArray:
    """Return half turns that carry each vector onto the Z axis, up or down."""
    length = np.sqrt(np.einsum("...i,...i->...", vector, vector))
    axis = vector / np.where(length > 0, length, 1.0)[..., np.newaxis]
    # The bisector of the vector and the nearer end of Z: a sum that does not cancel.
    axis[..., 2] += np.where(axis[..., 2] < 0, -1.0, 1.0)
    square = np.einsum("...i,...i->...", axis, axis)
    outer = axis[..., :, np.newaxis] * axis[..., np.newaxis, :]
    return (2.0 / square)[..., np.newaxis, np.newaxis] * outer - np.eye(3)


def _take(rows: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the row of the largest weight of each matrix in the batch."""
    index = weights.argmax(axis=-1)[..., np.newaxis, np.newaxis]
    return np.take_along_axis(rows, index, axis=-2)[..., 0, :]
