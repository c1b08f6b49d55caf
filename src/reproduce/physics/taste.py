"""Is an attitude believable? The TASTE test of Shuster, on what Wahba's problem leaves over.

In the measurement model of QUEST each direction errs by sigma about each axis across it, with a
normal law. Then the loss of the best rotation, weighted by 1/sigma^2, follows the chi-square law
with 2n - 3 degrees of freedom: two for each direction, less the three of the rotation. A larger
loss tells of a wrong identification, of a direction that is not where it is said to be, or of a
sigma that is too small. Shuster's TASTE is this loss; his factor of two stands in his definition
of the loss, which halves it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from reproduce.physics.validate import FloatArray, common_batch, positive
from reproduce.physics.wahba import WahbaSolution

# How far weights may be from inverse variances, relative, and still count as proportional.
ALIKE = 1e-6


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

    Examples
    --------
    >>> Taste(np.array(1.0), np.array(1.0), np.array(0.32)).freedom
    array(1.)
    """

    statistic: FloatArray
    freedom: FloatArray
    probability: FloatArray


def taste(solution: WahbaSolution, sigma: ArrayLike) -> Taste:
    """Return the TASTE test of a solution of Wahba's problem.

    Parameters
    ----------
    solution : WahbaSolution
        From `wahba.solve`, with weights in proportion to 1/sigma^2 or zero; equal weights for
        equal sigma.
    sigma : array_like, scalar or shape (..., n)
        1 sigma error of each direction about each axis across it, in radians; errors of target
        and source added in quadrature. Above zero.

    Returns
    -------
    Taste
        Statistic, degrees of freedom and probability, for each set of the batch.

    Raises
    ------
    ValueError
        If sigma is not above zero, its shape does not fit, or the weights are not in proportion
        to 1/sigma^2: the loss then follows another law.

    Examples
    --------
    Two directions that are one sigma too far apart share it; half of its square is left.

    >>> from reproduce.physics.wahba import solve
    >>> excess = 1e-4
    >>> found = solve([[1, 0, 0], [-np.sin(excess), np.cos(excess), 0]], np.eye(3)[:2])
    >>> check = taste(found, sigma=1e-4)
    >>> round(float(check.statistic), 6), float(check.freedom), round(float(check.probability), 4)
    (0.5, 1.0, 0.4795)
    """
    error = positive("sigma", sigma)
    weights = solution.weights
    if error.ndim and error.shape[-1] != weights.shape[-1]:
        raise ValueError(
            f"sigma: expected one value or shape (..., {weights.shape[-1]}), one for each "
            f"direction, got {error.shape}; give the error of every direction"
        )
    # A scalar belongs to every direction.
    inverse = np.broadcast_to(error**-2.0, np.broadcast_shapes(error.shape, weights.shape[-1:]))
    common_batch(solution=solution.loss.shape, weights=weights.shape[:-1], sigma=inverse.shape[:-1])
    used = weights > 0
    # The factor from the weights used to inverse variances, the same for all directions.
    factor = np.where(used, inverse, 0.0).sum(axis=-1) / weights.sum(axis=-1)
    wrong = np.abs(factor[..., np.newaxis] * weights - inverse) > ALIKE * inverse
    if (wrong & used).any():
        raise ValueError(
            "weights: expected inverse variances 1/sigma^2, up to one common factor, got others; "
            "solve with weights=sigma**-2 before asking for the test"
        )
    statistic = np.asarray(factor * solution.loss)
    freedom = np.broadcast_to(2.0 * used.sum(axis=-1) - 3.0, statistic.shape)
    return Taste(statistic, freedom, np.asarray(chdtrc(freedom, statistic)))
