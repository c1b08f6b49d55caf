"""Least squares for all models and known errors, by Gauss-Newton steps.

Shapes, units and models are those of `fit` and `transforms`. In comments, x is a source point, y a
target point, f the transform and u its parameters.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.registration._similarity import closed_similarity
from reproduce.physics.registration.transforms import (
    MODELS,
    Registration,
    _parameter_names,
)
from reproduce.physics.validate import FloatArray, IntArray, Point, Points, Weights

_MAX_STEPS = 60
# Root mean square movement at which the iteration stops, in px.
_LAST_MOVEMENT = 1e-11
# Smallest eigenvalue of a normal matrix with unit diagonal.
_MIN_EIGENVALUE = 1e-13


def thinned(count: int, limit: int) -> slice | IntArray:
    """Return at most `limit` of `count` rows, spread evenly."""
    return (
        slice(None) if count <= limit else np.linspace(0, count - 1, limit).astype(int)
    )


@dataclass(frozen=True, eq=False)
class Problem:
    """Points of a fit with their errors; all arrays have the full batch shape."""

    source: FloatArray  # (..., n, 2), in px
    target: FloatArray
    pivot: FloatArray  # (..., 2), in px
    model: str  # a key of `MODELS`
    counts: FloatArray  # (..., n), relative weights
    errors_known: bool  # whether the covariance of either image is given
    target_covariance: FloatArray  # (..., n, 2, 2), in px^2; unit matrices if unknown
    source_covariance: FloatArray  # zero if unknown

    def rows(self, rows: Any) -> Problem:
        """Return the problem of a part of the points."""
        return replace(
            self,
            source=self.source[..., rows, :],
            target=self.target[..., rows, :],
            counts=self.counts[..., rows],
            target_covariance=self.target_covariance[..., rows, :, :],
            source_covariance=self.source_covariance[..., rows, :, :],
        )

    @property
    def reach(self) -> float:
        """Largest coordinate of the points and the pivot, in px."""
        images = self.source, self.target, self.pivot
        return float(max(np.abs(points).max() for points in images))

    def closed(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the similarity of the points, as in `closed_similarity`."""
        return closed_similarity(self.source, self.target, self.pivot, self.counts)

    def transform(self, parameters: FloatArray) -> Registration:
        """Return the transform of these parameters, shape (..., p)."""
        return Registration(self.model, parameters, self.pivot)

    def linearized(
        self, parameters: FloatArray, points: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the fit linearized at estimates s of the true source points.

        Returns
        -------
        residuals : ndarray, shape (..., n, 2)
            Residual of both images, e = y - f(s; u) - A (x - s), in px.
        information : ndarray, shape (..., n, 2, 2)
            Inverse covariance of e without the weights, in px^-2; unit matrices if unknown.
        carry : ndarray, shape (..., n, 2, 2)
            A, the derivative of registered points by source points.
        """
        transform = self.transform(parameters)
        residuals = self.target - transform.apply(points)
        carry = transform.derivative(points)
        if not self.errors_known:  # the points are those of the source
            return residuals, self.target_covariance, carry
        moved = (carry @ (self.source - points)[..., None])[..., 0]
        total = self.target_covariance + carry @ self.source_covariance @ carry.mT
        return residuals - moved, np.asarray(np.linalg.inv(total), np.float64), carry


@validate.checked
def prepare(
    source: Points,
    target: Points,
    pivot: Point,
    weights: Weights = None,
    model: str = "similarity",
    source_covariance: ArrayLike | None = None,
    target_covariance: ArrayLike | None = None,
) -> Problem:
    """Check the arguments, those of `fit_registration`, and return them in one batch shape.

    Examples
    --------
    >>> prepare([[0, 0], [9, 0]], [[1, 0], [9, 1]], (0, 0)).counts
    array([1., 1.])
    """
    _parameter_names(model)
    counts = validate.weights_for(weights, source.shape[-2])
    errors_known = source_covariance is not None or target_covariance is not None
    # A larger weight would be a smaller error.
    right = np.isin(counts, (0, 1)) | (not errors_known)
    validate.valid("weights", counts, right, "0 or 1, because errors are weights")
    source, target, pivots, weights = np.broadcast_arrays(
        source, target, pivot[..., None, :], counts[..., None]
    )
    shape = (*source.shape, 2)
    return Problem(
        source,
        target,
        pivots[..., 0, :],
        model,
        weights[..., 0],
        errors_known,
        _covariance("target_covariance", target_covariance, shape, not errors_known),
        _covariance("source_covariance", source_covariance, shape, 0.0),
    )


def _covariance(
    name: str, value: ArrayLike | None, shape: tuple[int, ...], variance: float
) -> FloatArray:
    """Return checked covariances of the points, shape (..., n, 2, 2), by default of a variance."""
    if value is None:
        return np.broadcast_to(variance * np.eye(2), shape)
    matrices = validate.finite_array(name, value, shape=(2, 2))
    asymmetry = np.abs(matrices - matrices.mT).max()
    if (
        asymmetry > 1e-12 * np.abs(matrices).max()
        or np.linalg.eigvalsh(matrices).min() <= 0
    ):
        raise ValueError(
            f"{name}: expected symmetric matrices with variances above zero, got another matrix. "
            "Leave it out for an image without errors"
        )
    try:
        return np.broadcast_to(matrices, shape)
    except ValueError as error:
        raise ValueError(
            f"{name}: expected one matrix or one for each of {shape[-3]} points, got shape "
            f"{matrices.shape}. Pass shape (2, 2) or (n, 2, 2)"
        ) from error


def gauss_newton(
    rows: FloatArray,
    residuals: FloatArray,
    weighted: FloatArray,
    smallest: float = _MIN_EIGENVALUE,
) -> tuple[FloatArray, FloatArray]:
    """Return the step (..., p) and the inverse normal matrix (..., p, p) of rows (..., m, p)."""
    normal = rows.mT @ weighted
    length = np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1))
    outer = length[..., :, None] * length[..., None, :]
    # The columns of the scaled matrix have length one.
    scaled = normal / np.where(outer > 0, outer, 1)
    if not (np.linalg.eigvalsh(scaled)[..., 0] > smallest).all():
        raise validate.DegenerateGeometryError(
            "points: expected points that fix every parameter of the model, got too few, "
            "coincident or collinear ones. Add points across the field, or fit a simpler model"
        )
    inverse = np.linalg.inv(scaled) / outer
    step = inverse @ (weighted.mT @ residuals[..., None])
    return step[..., 0], inverse


def iterated(problem: Problem) -> tuple[FloatArray, ...]:
    """Return parameters, residuals, chi-square, cofactor and true source points of the best fit.

    Gauss-Newton steps begin at the closed form of a simpler model. If the source has errors, its
    true points s are unknowns in addition to the parameters u. Chi-square is then the sum of
    (x - s)^T Cx^-1 (x - s) and (y - f(s; u))^T Cy^-1 (y - f(s; u)), and its minimum is the maximum
    of the likelihood. Each step eliminates the points one by one: the residual e of
    `Problem.linearized` has the covariance Cy + A Cx A^T, the parameters follow from e by weighted
    least squares, and s = x + Cx A^T (Cy + A Cx A^T)^-1 e.
    """
    parameters, points = _starting_point(problem), problem.source
    limit = _LAST_MOVEMENT * (1 + problem.reach)
    flat = (*problem.source.shape[:-2], -1)
    for _ in range(_MAX_STEPS):
        residuals, information, carry = problem.linearized(parameters, points)
        rows = problem.transform(parameters).jacobian(points)
        weighted = problem.counts[..., None, None] * information @ rows
        count = rows.shape[-1]
        step, cofactor = gauss_newton(
            rows.reshape(*flat, count),
            residuals.reshape(flat),
            weighted.reshape(*flat, count),
        )
        moved = rows @ step[..., None, :, None]
        pulled = information @ (residuals[..., None] - moved)
        before, parameters = points, parameters + step
        shift = problem.source_covariance @ carry.mT @ pulled
        points = problem.source + shift[..., 0]
        movements = np.square([moved[..., 0], points - before]).mean(axis=(-2, -1))
        if movements.max() < limit**2:
            break
    else:
        raise validate.DegenerateGeometryError(
            f"target: expected a fit that converges within {_MAX_STEPS} steps, got none. Check "
            "the matches, or fit a simpler model"
        )
    residuals = residuals - moved[..., 0]
    chi_square = (problem.counts * np.vecdot(residuals, pulled[..., 0])).sum(axis=-1)
    residuals = problem.target - problem.transform(parameters).apply(problem.source)
    return parameters, residuals, chi_square, cofactor, points


def _starting_point(problem: Problem) -> FloatArray:
    """Return parameters near the minimum, shape (..., p), from a closed form.

    A linear model needs none: its identity is suitable.
    """
    count = len(MODELS[problem.model])
    start = np.zeros((*problem.pivot.shape[:-1], count))
    if problem.model == "affine":
        start[..., [0, 3]] = 1.0
        return start
    # Coincident points determine a shift.
    with suppress(validate.DegenerateGeometryError):
        start[..., :4] = problem.closed()[0][..., -count:]
    return start
