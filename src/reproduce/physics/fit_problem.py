"""What a registration fit is given and what it finds, checked and brought to one batch shape.

Shapes, units and models are those of `fit` and `transforms`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.registration import paired_points
from reproduce.physics.validate import FloatArray, common_batch, finite_array, weights_for


@dataclass(frozen=True, eq=False)
class Problem:
    """What is fitted to what, checked; all arrays carry the full batch shape.

    Attributes
    ----------
    source, target : ndarray, shape (..., n, 2)
        In px.
    pivot : ndarray, shape (..., 2)
        In px.
    model : str
        A key of `MODELS`.
    weights : ndarray, shape (..., n), or None
        None where every point counts alike.
    source_covariance, target_covariance : ndarray, shape (..., n, 2, 2), or None
        In px^2.
    """

    source: FloatArray
    target: FloatArray
    pivot: FloatArray
    model: str
    weights: FloatArray | None = None
    source_covariance: FloatArray | None = None
    target_covariance: FloatArray | None = None

    @property
    def errors_known(self) -> bool:
        """Whether the covariance of either image is known."""
        return self.source_covariance is not None or self.target_covariance is not None

    def with_weights(self, weights: FloatArray) -> Problem:
        """Return the same problem with these weights times its own."""
        own = 1.0 if self.weights is None else self.weights
        return replace(self, weights=own * weights)

    def with_covariances(self, source: ArrayLike | None, target: ArrayLike | None) -> Problem:
        """Return the same problem with checked covariances, shape (..., n, 2, 2) in px^2."""
        n, batch = self.source.shape[-2], self.source.shape[:-2]
        checked: list[FloatArray | None] = []
        for name, value in (("source_covariance", source), ("target_covariance", target)):
            if value is None:
                checked.append(None)
                continue
            matrices = finite_array(name, value, shape=(2, 2))
            try:
                matrices = np.broadcast_to(matrices, (*batch, n, 2, 2))
            except ValueError as error:
                raise ValueError(
                    f"{name}: expected one matrix or one for each of {n} points, got shape "
                    f"{matrices.shape}; give shape (2, 2) or (n, 2, 2)"
                ) from error
            _refuse_no_covariance(name, matrices)
            checked.append(matrices)
        return replace(self, source_covariance=checked[0], target_covariance=checked[1])


@dataclass(frozen=True, eq=False)
class Solution:
    """Where the iteration ended.

    Attributes
    ----------
    parameters : ndarray, shape (..., p)
        In the order of `MODELS`.
    residuals : ndarray, shape (..., n, 2)
        Target minus transformed source, in px.
    chi_square : ndarray, shape (...)
        What was made least, see `fit_steps`.
    cofactor : ndarray, shape (..., p, p)
        Inverse of the sum of J^T W J.
    points : ndarray, shape (..., n, 2)
        Where the source points truly are, as far as their errors are known, in px.
    """

    parameters: FloatArray
    residuals: FloatArray
    chi_square: FloatArray
    cofactor: FloatArray
    points: FloatArray


def prepare(
    source: ArrayLike, target: ArrayLike, pivot: ArrayLike, weights: ArrayLike | None, model: str
) -> Problem:
    """Check the points and bring them to one batch shape.

    Parameters
    ----------
    source, target, pivot, weights, model
        As for `fit.fit_registration`.

    Returns
    -------
    Problem
        Without covariances.

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape, or a weight is negative.
    """
    source, target = paired_points(source, target)
    pivot = finite_array("pivot", pivot, shape=(2,))
    n = source.shape[-2]
    checked = None if weights is None else weights_for(weights, n)
    batch = common_batch(
        source=source.shape[:-2],
        target=target.shape[:-2],
        pivot=pivot.shape[:-1],
        weights=() if checked is None else checked.shape[:-1],
    )
    return Problem(
        np.broadcast_to(source, (*batch, n, 2)),
        np.broadcast_to(target, (*batch, n, 2)),
        np.broadcast_to(pivot, (*batch, 2)),
        model,
        None if checked is None else np.broadcast_to(checked, (*batch, n)),
    )


def _refuse_no_covariance(name: str, matrices: FloatArray) -> None:
    lopsided = np.abs(matrices - np.swapaxes(matrices, -1, -2)).max()
    positive = (np.linalg.eigvalsh(matrices)[..., 0] > 0).all()
    if lopsided > 1e-12 * np.abs(matrices).max() or not positive:
        raise ValueError(
            f"{name}: expected symmetric matrices with variances above zero, got one that is not; "
            "leave it out for an image without errors"
        )
