"""A direct way to the rotation that fits best: turn until the misses pull no more.

The solvers of `wahba_solvers` gather all directions in the profile matrix B first. Where the
directions lie within an angle rho of each other, what B knows of the turn about them is of the
order rho squared beside entries of the order one, so rounding in B alone turns the answer by
about eps / rho^2, which is eps over the eigenvalue gap. No solver that starts from B can do better.

This one never forms B. It takes the misses themselves, target less rotated source, which are small
and keep their digits, and loses only eps / rho. It is slower, and it is the check on the others:
it shares with them nothing but the definition of the loss.
"""

from __future__ import annotations

import numpy as np

from reproduce.physics.attitude.rotations import rotation_from_vector, transpose
from reproduce.physics.validate import FloatArray

# Turning about the best axis alone gains in every step; near the top all three axes go together
# and each step squares what is left. Two or three dozen are enough from anywhere.
MOST_STEPS = 100
SMALL = 0.5
ROUNDING = float(np.finfo(np.float64).eps)
# The step after one as small as this is down to rounding.
LAST = 1e-9


def by_turning(
    target: FloatArray, source: FloatArray, share: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the best rotation by turning until the misses pull no more.

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
    target, source, share = _alike(target, source, share)
    rotation = _from_two(target, source, share)
    for _ in range(MOST_STEPS):
        stiffness, axes, torque = _pull(target, source @ transpose(rotation), share)
        angles = np.arctan2(torque, stiffness)
        gain = np.hypot(torque, stiffness) - stiffness
        best = gain == gain.max(axis=-1, keepdims=True)
        far = np.abs(angles).max(axis=-1, keepdims=True) > SMALL
        angles = np.where(far & ~best, 0.0, angles)
        rotation = rotation_from_vector(np.einsum("...ij,...j->...i", axes, angles)) @ rotation
        if np.abs(angles).max() < LAST:
            break
    rows = source @ transpose(rotation)
    stiffness, axes, _ = _pull(target, rows, share)
    softest = stiffness[..., 0]
    # Either side's levers: one alone that lies along the axis leaves the turn about it free.
    lever = sum(np.linalg.norm(np.cross(side, axes[..., np.newaxis, :, 0]), axis=-1)
                for side in (rows, target))  # fmt: skip
    torque = ROUNDING * (share * (lever + ROUNDING)).sum(axis=-1)
    blur = np.where(softest > 0, torque / np.where(softest > 0, softest, 1.0), np.inf)
    return rotation, np.asarray(2.0 * softest), blur


def _pull(
    target: FloatArray, rows: FloatArray, share: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the stiffness along its own axes, the softest first, those axes and the torque."""
    weighted = share[..., np.newaxis] * rows
    torque = np.cross(weighted, target - rows).sum(axis=-2)
    product = transpose(weighted) @ target
    trace = np.einsum("...ii->...", product)[..., np.newaxis, np.newaxis]
    _, axes = np.linalg.eigh(trace * np.eye(3) - 0.5 * (product + transpose(product)))
    # An eigenvalue has lost its digits where all rows are near its axis; levers keep theirs.
    levers = (np.cross(side[..., np.newaxis, :], np.swapaxes(axes, -1, -2)[..., np.newaxis, :, :])
              for side in (weighted, target))  # fmt: skip
    values = np.einsum("...njk,...njk->...j", *levers)
    return values, axes, np.einsum("...ji,...j->...i", axes, torque)


def _from_two(target: FloatArray, source: FloatArray, share: FloatArray) -> FloatArray:
    """Return the rotation of the heaviest direction and the one that holds best against it."""
    first = share.argmax(axis=-1)
    lever = np.cross(_row(source, first)[..., np.newaxis, :], source)
    second = (share * np.einsum("...ni,...ni->...n", lever, lever)).argmax(axis=-1)
    frames = [_frame(_row(rows, first), _row(rows, second)) for rows in (target, source)]
    return frames[0] @ transpose(frames[1])


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


def _row(rows: FloatArray, index: np.ndarray) -> FloatArray:
    result: FloatArray = np.take_along_axis(rows, index[..., np.newaxis, np.newaxis], axis=-2)
    return result[..., 0, :]


def _alike(
    target: FloatArray, source: FloatArray, share: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return all three with the same batch shape."""
    batch = np.broadcast_shapes(target.shape[:-2], source.shape[:-2], share.shape[:-1])
    count = share.shape[-1]
    return (
        np.broadcast_to(target, (*batch, count, 3)),
        np.broadcast_to(source, (*batch, count, 3)),
        np.broadcast_to(share, (*batch, count)),
    )
