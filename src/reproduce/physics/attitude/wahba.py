"""Wahba's problem: the rotation that best carries one set of directions onto another.

Directions have shape (..., n, 3): rows are observations, leading axes are a batch (frames,
replicates), all solved in one call. Rotations are named target first: the result
`target_from_source` fits `target = target_from_source @ source`.

Whether an attitude is believable says Shuster's TASTE test (`taste`). In the measurement model of
QUEST each direction errs by sigma about each axis across it, with a normal law. Then the loss of
the best rotation, weighted by 1/sigma^2, follows the chi-square law with 2n - 3 degrees of freedom:
two for each direction, less the three of the rotation. A larger loss tells of a wrong
identification, of a direction that is not where it is said to be, or of a sigma that is too small.
Shuster's TASTE is this loss; his factor of two stands in his definition of the loss, which halves
it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics.attitude import wahba_solvers
from reproduce.physics.attitude.rotations import _unit
from reproduce.physics.validate import (
    DegenerateGeometryError,
    Directions,
    FloatArray,
    Positive,
    Weights,
    checked,
    common_batch,
    rotations,
    weights_for,
)

# From the profile matrix; "direct" takes the directions themselves.
_SOLVERS = {
    "svd": wahba_solvers.by_svd,
    "q-method": wahba_solvers.by_q_method,
    "quest": wahba_solvers.by_quest,
}
METHODS = (*_SOLVERS, "direct")

# Relative eigenvalue gap below which rounding in the profile matrix alone turns the answer by a
# milliradian. It belongs to directions about a microradian apart, or to a share of the weights.
_SMALLEST_GAP = 1e-12
# For the direct solver, which knows what rounding does to its answer: radians.
_LARGEST_BLUR = 1e-3
# How far weights may be from inverse variances, relative, and still count as proportional.
_ALIKE = 1e-6


@dataclass(frozen=True, eq=False)
class WahbaSolution:
    """The best rotation and what is known about it.

    Attributes
    ----------
    rotation : ndarray, shape (..., 3, 3)
        target_from_source.
    loss : ndarray, shape (...)
        ``sum w |target - rotation @ source|^2`` over unit vectors.
    eigenvalue_gap : ndarray, shape (...)
        Distance between the two largest eigenvalues of Davenport's matrix, in the unit of
        the weights. Zero means that one rotation is free.
    weights : ndarray, shape (..., n)
        The weights used.
    """

    rotation: FloatArray
    loss: FloatArray
    eigenvalue_gap: FloatArray
    weights: FloatArray


@checked
def attitude(
    target_vectors: Directions,
    source_vectors: Directions,
    weights: Weights = None,
    method: str = "direct",
) -> FloatArray:
    """Return the rotation that minimises ``sum w |target - rotation @ source|^2``.

    Parameters
    ----------
    target_vectors, source_vectors : array_like, shape (..., n, 3)
        The same directions seen in two frames; they count as unit vectors, whatever their
        length, but it may not be zero.
    weights : array_like, shape (..., n), optional
        Relative weights, such as inverse variances, not all zero; all one where none are given.
    method : {"direct", "svd", "q-method", "quest"}
        The solver. "direct" keeps to a few roundings over the root of the eigenvalue gap, also
        where the weights differ by 24 decades. The others lose a few roundings over the gap
        itself, up to a milliradian before they refuse, and are several times as fast; "quest" is
        the fastest over many frames.

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
    kept = weights_for(weights, target_vectors.shape[-2])
    return _rotation(target_vectors, source_vectors, kept, method)


@checked
def solve(
    target_vectors: Directions,
    source_vectors: Directions,
    weights: Weights = None,
    method: str = "direct",
) -> WahbaSolution:
    """Return the best rotation with its loss, its eigenvalue gap and its weights.

    Arguments and errors are those of `attitude`.

    Returns
    -------
    WahbaSolution

    Examples
    --------
    >>> solution = solve(np.eye(3), np.eye(3), weights=[1, 2, 3])
    >>> float(solution.loss), round(float(solution.eigenvalue_gap), 12)
    (0.0, 6.0)
    """
    target, source = (
        _unit("target_vectors", target_vectors),
        _unit("source_vectors", source_vectors),
    )
    kept = weights_for(weights, target.shape[-2])
    total = kept.sum(axis=-1)
    rotation, gap = _best(target, source, kept / total[..., np.newaxis], method)
    share = kept / total[..., np.newaxis]
    misses = target - source @ rotation.mT
    loss = total * np.einsum("...n,...ni,...ni->...", share, misses, misses)
    return WahbaSolution(rotation, loss, total * gap, kept)


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
    array = rotations("matrices", matrices, shape=(None, 3, 3))
    mean, gap = wahba_solvers.by_svd(array.mean(axis=-3))
    _refuse_free_rotation(gap, gap < _SMALLEST_GAP)
    return mean


@dataclass(frozen=True, eq=False)
class Taste:
    """The statistic, its degrees of freedom, and how often chance exceeds it.

    Attributes
    ----------
    statistic : ndarray, shape (...)
        ``sum |target - rotation @ source|^2 / sigma^2``.
    freedom : ndarray of float, shape (...)
        2n - 3, with n the directions of weight above zero.
    probability : ndarray, shape (...)
        Of a statistic at least as large under the measurement model: uniform from 0 to 1 if the
        model holds, near 0 if it does not.
    """

    statistic: FloatArray
    freedom: FloatArray
    probability: FloatArray


@checked
def taste(solution: WahbaSolution, sigma: Positive) -> Taste:
    """Return the TASTE test of a solution of Wahba's problem.

    Parameters
    ----------
    solution : WahbaSolution
        From `solve`, with weights in proportion to 1/sigma^2 or zero; equal weights for equal
        sigma.
    sigma : array_like, scalar or shape (..., n)
        1 sigma error of each direction about each axis across it, in radians, above zero; errors
        of target and source added in quadrature.

    Returns
    -------
    Taste
        Of each set of the batch.

    Examples
    --------
    Two directions that are one sigma too far apart share it; half of its square is left.

    >>> excess = 1e-4
    >>> found = solve([[1, 0, 0], [-np.sin(excess), np.cos(excess), 0]], np.eye(3)[:2])
    >>> check = taste(found, sigma=1e-4)
    >>> round(float(check.statistic), 6), float(check.freedom), round(float(check.probability), 4)
    (0.5, 1.0, 0.4795)
    """
    weights = solution.weights
    if sigma.ndim and sigma.shape[-1] != weights.shape[-1]:
        raise ValueError(
            f"sigma: expected one value or shape (..., {weights.shape[-1]}), one for each "
            f"direction, got {sigma.shape}; give the error of every direction"
        )
    # A scalar belongs to every direction.
    inverse = np.broadcast_to(sigma**-2.0, np.broadcast_shapes(sigma.shape, weights.shape[-1:]))
    common_batch(solution=solution.loss.shape, weights=weights.shape[:-1], sigma=inverse.shape[:-1])
    used = weights > 0
    # The factor from the weights used to inverse variances, the same for all directions.
    factor = np.where(used, inverse, 0.0).sum(axis=-1) / weights.sum(axis=-1)
    wrong = np.abs(factor[..., np.newaxis] * weights - inverse) > _ALIKE * inverse
    if (wrong & used).any():
        raise ValueError(
            "weights: expected inverse variances 1/sigma^2, up to one common factor, got others; "
            "solve with weights=sigma**-2 before asking for the test"
        )
    from scipy.special import chdtrc  # only now: its import takes longer than most solutions

    statistic = np.asarray(factor * solution.loss)
    freedom = np.broadcast_to(2.0 * used.sum(axis=-1) - 3.0, statistic.shape)
    return Taste(statistic, freedom, np.asarray(chdtrc(freedom, statistic)))


def _rotation(
    target: FloatArray, source: FloatArray, weights: FloatArray, method: str = "direct"
) -> FloatArray:
    """Return what `attitude` does, from directions of any length that are checked already."""
    share = weights / weights.sum(axis=-1, keepdims=True)
    target, source = _unit("target_vectors", target), _unit("source_vectors", source)
    rotation, _ = _best(target, source, share, method)
    return rotation


def _best(
    target: FloatArray, source: FloatArray, share: FloatArray, method: str
) -> tuple[FloatArray, FloatArray]:
    """Return rotation and gap from unit vectors and weights that sum to one."""
    if method not in METHODS:
        raise ValueError(f"method: expected one of {sorted(METHODS)}, got {method!r}; choose one")
    if method == "direct":
        rotation, gap, blur = wahba_solvers.by_turning(target, source, share)
        _refuse_free_rotation(gap, blur > _LARGEST_BLUR)
    else:
        rotation, gap = _SOLVERS[method]((share[..., np.newaxis] * target).mT @ source)
        _refuse_free_rotation(gap, gap < _SMALLEST_GAP)
    return rotation, gap


def _refuse_free_rotation(gap: FloatArray, free: NDArray[np.bool_]) -> None:
    if free.any():
        first = tuple(int(i) for i in np.argwhere(free)[0])
        where = f"in {int(free.sum())} of {free.size} sets, the first at index {first}, "
        raise DegenerateGeometryError(
            "expected directions that fix all three axes, got a set that leaves a rotation free "
            f"({where if free.ndim else ''}relative eigenvalue gap {gap[free].min():.1e}); add "
            "a direction that is not parallel to the others, with a weight above zero"
        )
