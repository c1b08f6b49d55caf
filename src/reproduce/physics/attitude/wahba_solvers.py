"""Four ways to the rotation that fits best.

Three start from the profile B = sum w t s^T of target directions t and source directions s; its
weights sum to one. Each returns the rotation A that maximises trace(A B^T), which is the one
that minimises ``sum w |t - A s|^2``, and the gap between the two largest eigenvalues of
Davenport's matrix K: half of it is the stiffness against turning about the worst axis, and
at zero that turn is free. They share nothing but B, so their agreement is evidence:

- `by_svd`: singular value decomposition (Markley 1988);
- `by_q_method`: the leading eigenvector of Davenport's matrix K;
- `by_quest`: Newton's iteration on the characteristic polynomial of K (Shuster and Oh 1981).

Each is accurate to a multiple of machine precision over the gap, with the weights summing to one:
60 times for SVD, 20 for the q-method, 15 for QUEST, with room for another random set. Where the
directions crowd about the axis of both frames, as spots do about a boresight, SVD loses next to
nothing. What is lost elsewhere is lost in rounding B, so SciPy's solver loses it too. QUEST needs
care to get there. The quaternion is taken from cofactors of K - lambda, because the matrix that the
textbook form inverts is singular at a half turn. And its polynomial has nearly a double root when
all directions are close together; expanded in powers of lambda it then loses half the digits of
the root. Two things keep them: the polynomial in Markley's form, whose three terms all vanish
with the gap, and half turns of both frames that first bring crowded or heavy directions to
the Z axis, where determinant and cofactors cancel nothing and the error is one of roll alone.
Where even that does not resolve the root, SVD takes over.

The fourth, `by_turning`, never forms B. Where the directions lie within an angle rho of each other,
what B knows of the turn about them is of the order rho squared beside entries of the order one, so
rounding in B alone turns the answer by about eps / rho^2, which is eps over the gap. The fourth
takes the misses themselves, target less rotated source, which are small and keep their digits, and
loses only eps / rho. It is slower, and it is the check on the others: it shares with them nothing
but the definition of the loss.

All take checked arrays: profiles of shape (..., 3, 3), or unit vectors and weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reproduce.physics.attitude.rotations import (
    _cofactors,
    _determinant,
    _rotation_from_quaternion,
    _rotation_from_vector,
)
from reproduce.physics.validate import FloatArray

# Newton halves the distance to a double root at each step: enough for all 52 bits.
_NEWTON_STEPS = 60
_ROUNDING = 2e-16
_MOST_BLUR = 100 * _ROUNDING
# Turning about the best axis alone gains in every step; near the top all three axes go together
# and each step squares what is left. Two or three dozen are enough from anywhere.
_TURNS = 100
_SMALL = 0.5
_EPSILON = float(np.finfo(np.float64).eps)
# The step after one as small as this is down to rounding.
_LAST = 1e-9

# Half turns about X, Y and Z; about one of them or none the rotation is below 120 degrees.
_HALF_TURNS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float64)


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


def by_q_method(profile: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the best rotation from the leading eigenvector of Davenport's matrix, as `by_svd`.

    Examples
    --------
    >>> rotation, gap = by_q_method(np.diag([0.5, 0.3, 0.2]))
    >>> bool(np.allclose(rotation, np.eye(3))), round(float(gap), 12)
    (True, 1.0)
    """
    values, vectors = np.linalg.eigh(_davenport_matrix(profile))
    return _rotation_from_quaternion(vectors[..., :, -1]), values[..., -1] - values[..., -2]


def by_quest(profile: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the best rotation by Newton's iteration on the polynomial of K, as `by_svd`.

    Where the iteration cannot tell the root from its neighbour (data close to mirror images of
    each other), the rotation is that of `by_svd`.

    Examples
    --------
    >>> rotation, gap = by_quest(np.diag([0.5, 0.3, 0.2]))
    >>> bool(np.allclose(rotation, np.eye(3))), round(float(gap), 12)
    (True, 1.0)
    """
    columns = np.einsum("...ij,...ij->...j", profile, profile).argmax(axis=-1)
    rows = np.einsum("...ij,...ij->...i", profile, profile).argmax(axis=-1)
    left = _half_turn_to_z(_take(profile.mT, columns))
    right = _half_turn_to_z(_take(profile, rows))
    graded = left @ profile @ right
    root, gap, blur = _largest_root(graded)
    rotation = left @ _rotation_at(graded, root) @ right
    lost = blur > _MOST_BLUR
    if lost.any():
        rotation[lost], gap[lost] = by_svd(profile[lost])
    return rotation, gap


def _davenport_matrix(profile: FloatArray) -> FloatArray:
    """Return K, (..., 4, 4): the gain trace(A B^T) as a form in A's quaternion, scalar last."""
    trace = np.einsum("...ii->...", profile)
    result = np.empty((*profile.shape[:-2], 4, 4))
    result[..., :3, :3] = profile + profile.mT
    for i in range(3):
        result[..., i, i] -= trace
    result[..., :3, 3] = result[..., 3, :3] = _axial(profile)
    result[..., 3, 3] = trace
    return result


def _largest_root(profile: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the largest eigenvalue of K without forming it, its gap, and its blur by rounding.

    Newton's iteration on ``(x^2 - |B|^2)^2 - 8 x det B - 4 |cof B|^2``, which rises and is
    convex beyond its largest root, so from above every step falls short of the root: the sum of
    the singular values of B, the last with the sign of det B. The blur is infinite where the
    iteration has not ended.
    """
    minors = _cofactors(profile)
    volume = 8.0 * _determinant(profile)
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
    unfinished = step > _MOST_BLUR
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
    turns = _HALF_TURNS[_largest_component(profile, root)]
    turned = profile * turns[..., np.newaxis, :]
    trace = np.einsum("...ii->...", turned)
    block = -(turned + turned.mT)
    for i in range(3):
        block[..., i, i] += root + trace
    minors = _cofactors(block)
    quaternion = np.empty((*root.shape, 4))
    quaternion[..., :3] = np.einsum("...ij,...j->...i", minors, _axial(turned))
    scalar = np.einsum("...i,...i->...", block[..., 0, :], minors[..., 0, :])
    # With two equal roots all cofactors vanish; the caller refuses that, here it is no error.
    quaternion[..., 3] = np.where(scalar > 0, scalar, 1.0)
    return _rotation_from_quaternion(quaternion) * turns[..., np.newaxis, :]


def _largest_component(profile: FloatArray, root: FloatArray) -> NDArray[np.intp]:
    """Return which component of the quaternion is the largest: 0 the scalar, 1 to 3 X, Y, Z."""
    matrix = _davenport_matrix(profile)
    for i in range(4):
        matrix[..., i, i] -= root
    squares = np.empty((*root.shape, 4))
    for component, (i, j, k) in enumerate(((0, 1, 2), (1, 2, 3), (0, 2, 3), (0, 1, 3))):
        squares[..., component] = -_principal_minor(matrix, i, j, k)
    return squares.argmax(axis=-1)


def _principal_minor(symmetric: FloatArray, i: int, j: int, k: int) -> FloatArray:
    one, two, three = (symmetric[..., n, n] for n in (i, j, k))
    ij, jk, ki = symmetric[..., i, j], symmetric[..., j, k], symmetric[..., k, i]
    return one * (two * three - jk * jk) - ij * (ij * three - jk * ki) + ki * (ij * jk - two * ki)


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
    return (2.0 / square)[..., np.newaxis, np.newaxis] * outer - np.eye(3)


def _take(rows: FloatArray, index: NDArray[np.intp]) -> FloatArray:
    """Return row `index` of each matrix in the batch."""
    return np.take_along_axis(rows, index[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]


def by_turning(
    target: FloatArray, source: FloatArray, share: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the best rotation by turning until no torque of the misses is left.

    About an axis, the gain ``sum w t . A s`` is a constant plus h cos(phi) + tau sin(phi), with
    the torque tau = ``sum w A s x (t - A s)`` and the stiffness h along that axis, so its best
    angle is atan2(tau, h): Newton's step where that is small, and the way out of a saddle or a
    minimum where h is negative.

    Parameters
    ----------
    target, source : ndarray, shape (..., n, 3)
        Unit vectors; row i of both is the same direction.
    share : ndarray, shape (..., n)
        Weights that sum to one.

    Returns
    -------
    rotation : ndarray, shape (..., 3, 3)
        The rotation target_from_source.
    gap : ndarray, shape (...)
        The distance between the two largest eigenvalues of Davenport's matrix.
    blur : ndarray, shape (...)
        About how far rounding alone may turn the answer about its softest axis, in radians.

    Examples
    --------
    >>> rotation, gap, _ = by_turning(np.eye(3), np.eye(3), np.array([0.5, 0.3, 0.2]))
    >>> bool(np.allclose(rotation, np.eye(3))), round(float(gap), 12)
    (True, 1.0)
    """
    batch = np.broadcast_shapes(target.shape[:-2], source.shape[:-2], share.shape[:-1])
    share = np.broadcast_to(share, (*batch, share.shape[-1]))
    target, source = (np.broadcast_to(rows, (*share.shape, 3)) for rows in (target, source))
    rotation = _from_two(target, source, share)
    for _ in range(_TURNS):
        stiffness, axes, torque = _pull(target, source @ rotation.mT, share)
        angles = np.arctan2(torque, stiffness)
        gain = np.hypot(torque, stiffness) - stiffness
        best = gain == gain.max(axis=-1, keepdims=True)
        far = np.abs(angles).max(axis=-1, keepdims=True) > _SMALL
        angles = np.where(far & ~best, 0.0, angles)
        rotation = _rotation_from_vector(np.einsum("...ij,...j->...i", axes, angles)) @ rotation
        if np.abs(angles).max() < _LAST:
            break
    rows = source @ rotation.mT
    stiffness, axes, _ = _pull(target, rows, share)
    softest = stiffness[..., 0]
    # Either side's levers: one alone that lies along the axis leaves the turn about it free.
    lever = sum(np.linalg.norm(np.cross(side, axes[..., np.newaxis, :, 0]), axis=-1)
                for side in (rows, target))  # fmt: skip
    torque = _EPSILON * (share * (lever + _EPSILON)).sum(axis=-1)
    blur = np.where(softest > 0, torque / np.where(softest > 0, softest, 1.0), np.inf)
    return rotation, 2.0 * softest, blur


def _pull(
    target: FloatArray, rows: FloatArray, share: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the stiffness along its own axes, the softest first, those axes and the torque."""
    weighted = share[..., np.newaxis] * rows
    torque = np.cross(weighted, target - rows).sum(axis=-2)
    product = weighted.mT @ target
    trace = np.einsum("...ii->...", product)[..., np.newaxis, np.newaxis]
    _, axes = np.linalg.eigh(trace * np.eye(3) - 0.5 * (product + product.mT))
    # An eigenvalue has lost its digits where all rows are near its axis; levers keep theirs.
    levers = (np.cross(side[..., np.newaxis, :], axes.mT[..., np.newaxis, :, :])
              for side in (weighted, target))  # fmt: skip
    values = np.einsum("...njk,...njk->...j", *levers)
    return values, axes, np.einsum("...ji,...j->...i", axes, torque)


def _from_two(target: FloatArray, source: FloatArray, share: FloatArray) -> FloatArray:
    """Return the rotation of the heaviest direction and the one that holds best against it."""
    first = share.argmax(axis=-1)
    lever = np.cross(_take(source, first)[..., np.newaxis, :], source)
    second = (share * np.einsum("...ni,...ni->...n", lever, lever)).argmax(axis=-1)
    frames = [_frame(_take(rows, first), _take(rows, second)) for rows in (target, source)]
    return frames[0] @ frames[1].mT


def _frame(one: FloatArray, two: FloatArray) -> FloatArray:
    """Return axes along one direction and across a second one; any such axes if they are parallel.

    Parallel directions leave the answer free, which the caller refuses once it knows the gap.
    """
    across = np.cross(one, two)
    spare = np.cross(one, np.eye(3)[np.abs(one).argmin(axis=-1)])
    parallel = np.einsum("...i,...i->...", across, across) < np.finfo(float).eps ** 2
    across = np.where(parallel[..., np.newaxis], spare, across)
    across = across / np.linalg.norm(across, axis=-1, keepdims=True)
    return np.stack([one, across, np.cross(one, across)], axis=-1)
