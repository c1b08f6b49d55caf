"""Finding wrong matches without drawing random samples.

The start is Siegel's repeated median: every pair of points gives a scale and a rotation, each point
keeps the median over its partners, and the median over the points is taken. It tolerates almost
half of the points being wrong, and the same points always give the same answer. Shapes, units and
models are those of `fit`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reproduce.physics.registration._steps import (
    Problem,
    combined_residuals,
    from_similarity,
    information,
    local_matrix,
    model_jacobian,
    solve,
)
from reproduce.physics.registration.closed_form import _CHANCE, _MIRRORED, _Solution
from reproduce.physics.registration.transforms import MODELS, as_complex, as_points
from reproduce.physics.validate import DegenerateGeometryError, FloatArray, MirroredPointsError

__all__ = ["TUKEY", "outlier_weights", "repeated_median", "sandwich"]

# Tukey's biweight with this constant is 95 % efficient for Gaussian residuals in one dimension, and
# 92.9 % for the length of a residual in two.
TUKEY = 4.685
# The median length of a two-dimensional Gaussian residual, in standard deviations of a coordinate.
MEDIAN_LENGTH = float(np.sqrt(2 * np.log(2)))
ROUNDS = 30
LARGEST = 3000
# Of the size of the field: a median residual below it is that of a fit, if not of a good one.
FITS = 0.01
# What is left of a residual that the fit follows; where it is less, it tells nothing of the error.
LEAST = 0.1


def outlier_weights(problem: Problem) -> FloatArray:
    """Return weights, (..., n), from one for a good match down to zero for a wrong one.

    They are Tukey's biweights at the settled fit. A residual counts in standard deviations: those
    of the points' covariances where they are known, and times the root of the point's own weight.
    All are scaled so that their median is that of Gaussian residuals.
    """
    closed = repeated_median(problem)
    if problem.model != "affine":
        _refuse_mirrored(problem, closed)
    parameters = from_similarity(problem.model, closed)
    weights = _biweights(_lengths(problem, *_whitened(problem, parameters, problem.source)))
    for _ in range(ROUNDS):
        found = solve(problem.with_weights(weights))
        renewed = _biweights(_lengths(problem, *_whitened(problem, found.parameters, found.points)))
        settled = np.abs(renewed - weights).max() < 1e-9
        weights = renewed
        if settled:
            break
    return weights


def sandwich(problem: Problem, solution: _Solution) -> FloatArray:
    """Return the covariance of the parameters of a robust fit, shape (..., p, p).

    The problem has the weights that were given, not those that were found. The fit is a root of
    ``sum J^T psi`` with psi = w e, the weighted residual. Its covariance is
    A^-1 (sum J^T psi psi^T J) A^-1 with A = ``sum J^T (d psi / d e) J``: as a residual grows its
    weight falls, so psi grows less than e. The inverse normal matrix, which takes the weights as
    fixed, is too small.
    """
    factor, residuals = _whitened(problem, solution.parameters, solution.points)
    rows = factor @ model_jacobian(problem, solution.parameters, solution.points)
    # With columns of length one the matrices can be inverted whatever the units.
    size = np.sqrt(np.square(rows).sum(axis=(-3, -2)))
    rows = rows / size[..., None, None, :]
    lengths = _lengths(problem, factor, residuals)
    weights = _biweights(lengths)
    # The biweight's derivative, times the length.
    fall = -4 * np.sqrt(weights) * (lengths / TUKEY) ** 2
    along = residuals / np.maximum(_norm(residuals), np.finfo(float).tiny)[..., None]
    slope = weights[..., None, None] * np.eye(2)
    slope = slope + fall[..., None, None] * along[..., :, None] * along[..., None, :]
    inverse = np.linalg.inv(np.einsum("...nij,...nil,...nlk->...jk", rows, slope, rows))
    leverage = weights * np.einsum("...nij,...jk,...nik->...n", rows, inverse, rows) / 2
    psi = (weights / np.sqrt(np.maximum(1 - leverage, LEAST)))[..., None] * residuals
    pulls = np.einsum("...nij,...ni->...nj", rows, psi)
    covariance = inverse @ np.einsum("...nj,...nk->...jk", pulls, pulls) @ inverse
    return covariance / (size[..., :, None] * size[..., None, :])


def repeated_median(problem: Problem) -> FloatArray:
    """Return the similarity of the repeated median, shape (..., 4); weights of zero drop points.

    Fewer than three points, half of them in one place, or too many for all pairs are refused.
    """
    source, target = as_complex(problem.source), as_complex(problem.target)
    n = source.shape[-1]
    if n < 3:
        raise DegenerateGeometryError(
            f"expected three or more points for a robust fit, got {n}; with two none can be wrong"
        )
    if n > LARGEST:
        raise ValueError(
            f"expected at most {LARGEST} points for a robust fit, got {n}; fit a part of them first"
        )
    between = source[..., :, None] - source[..., None, :]
    across = target[..., :, None] - target[..., None, :]
    apart = np.abs(between) > 0
    ratio = np.where(apart, across / np.where(apart, between, 1), np.nan)
    if problem.weights is not None:
        ratio = np.where((problem.weights > 0)[..., None, :], ratio, np.nan)
        ratio = np.where((problem.weights > 0)[..., :, None], ratio, np.nan)
    return _median_similarity(problem, ratio)


def _refuse_mirrored(problem: Problem, closed: FloatArray) -> None:
    """Refuse a mirror image, wrong matches or not: by medians of what two similarities leave."""
    flip = np.array([-1.0, 1.0])
    across = replace(problem, source=problem.source * flip, pivot=problem.pivot * flip)
    median = _median_length(problem, closed)
    # Fields with a good fit, most of all, need no second one.
    size = np.median(_norm(problem.target - problem.target.mean(axis=-2, keepdims=True)), axis=-1)
    if not (median > FITS * size).any():
        return
    from scipy.special import fdtri  # only now: its import takes longer than most fits

    freedom = 2 * problem.source.shape[-2] - 4
    limit = np.sqrt(fdtri(freedom, freedom, 1 - _CHANCE))
    if (median > limit * _median_length(across, repeated_median(across))).any():
        raise MirroredPointsError(_MIRRORED)


def _median_length(problem: Problem, closed: FloatArray) -> FloatArray:
    # Of the similarity, whatever the model of the problem.
    landed = replace(problem, model="similarity").transformed(closed, problem.source)
    return np.median(_norm(problem.target - landed), axis=-1)


def _median_similarity(problem: Problem, ratio: np.ndarray) -> FloatArray:
    import warnings

    source, target = as_complex(problem.source), as_complex(problem.target)
    with warnings.catch_warnings():
        # A point without partners has no median; it is left out of the next one.
        warnings.simplefilter("ignore", RuntimeWarning)
        each = [np.nanmedian(part, axis=-1) for part in (ratio.real, ratio.imag)]
        real, imaginary = (np.nanmedian(part, axis=-1) for part in each)
    factor = real + 1j * imaginary
    if not (np.isfinite(factor) & (np.abs(factor) > 0)).all():
        raise DegenerateGeometryError(
            "expected points that are apart from each other, got half of them or more in one "
            "place; check the matches"
        )
    pivot = as_complex(problem.pivot)
    landed = target - factor[..., None] * (source - pivot[..., None])
    if problem.weights is not None:
        landed = np.where(problem.weights > 0, landed, np.nan)
    origin = np.nanmedian(landed.real, axis=-1) + 1j * np.nanmedian(landed.imag, axis=-1)
    shift = as_points(pivot - origin)
    columns = (np.abs(factor), np.angle(factor), shift[..., 0], shift[..., 1])
    return np.stack(columns, axis=-1)


def _whitened(
    problem: Problem, parameters: FloatArray, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what makes residuals of variance one, (..., n, 2, 2), and the residuals so made."""
    carry = local_matrix(problem, parameters, points)
    left = combined_residuals(problem, parameters, points, carry)
    factor = np.asarray(np.linalg.cholesky(information(problem, carry)).mT, dtype=np.float64)
    if problem.weights is not None:
        factor = np.sqrt(problem.weights)[..., None, None] * factor
    return factor, (factor @ left[..., None])[..., 0]


def _lengths(problem: Problem, factor: FloatArray, residuals: FloatArray) -> FloatArray:
    """Return the lengths of whitened residuals over their spread, shape (..., n)."""
    length = _norm(residuals)
    kept = np.ones(length.shape, bool) if problem.weights is None else problem.weights > 0
    median = np.nanmedian(np.where(kept, length, np.nan), axis=-1, keepdims=True)
    # Residuals are smaller than errors, because the parameters follow the errors.
    count = 2 * kept.sum(axis=-1, keepdims=True)
    freedom = np.maximum(count - len(MODELS[problem.model]), 1)
    spread = median / MEDIAN_LENGTH * np.sqrt(count / freedom)
    # Exact matches have no spread but that of rounding.
    rounding = 1e-12 * (1 + np.abs(problem.source).max()) * np.abs(factor).max(axis=(-2, -1))
    return length / np.maximum(np.maximum(spread, rounding), np.finfo(float).tiny)


def _norm(vectors: FloatArray) -> FloatArray:
    return np.hypot(vectors[..., 0], vectors[..., 1])


def _biweights(lengths: FloatArray) -> FloatArray:
    return np.clip(1 - (lengths / TUKEY) ** 2, 0, None) ** 2
