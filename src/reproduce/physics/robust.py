"""Finding wrong matches without drawing random samples.

The start is Siegel's repeated median: every pair of points gives a scale and a rotation, each point
keeps the median over its partners, and the median over the points is taken. It bears almost half of
the points being wrong, and the same points always give the same answer. Shapes, units and models
are those of `fit`.
"""

from __future__ import annotations

import numpy as np

from reproduce.physics.fit_problem import Problem
from reproduce.physics.fit_steps import from_similarity, solve, target_residuals
from reproduce.physics.similarity import as_complex, as_points
from reproduce.physics.validate import DegenerateGeometryError, FloatArray

# Tukey's biweight with this constant is 95 % efficient for Gaussian residuals.
TUKEY = 4.685
# The median length of a two-dimensional Gaussian residual, in standard deviations of a coordinate.
MEDIAN_LENGTH = float(np.sqrt(2 * np.log(2)))
ROUNDS = 30
LARGEST = 3000


def outlier_weights(problem: Problem) -> FloatArray:
    """Return weights from one for a good match down to zero for a wrong one.

    Parameters
    ----------
    problem : fit_problem.Problem
        Points, model, weights and covariances.

    Returns
    -------
    ndarray, shape (..., n)
        Tukey's biweights at the settled fit.

    Raises
    ------
    DegenerateGeometryError
        If fewer than three points are given, or half of them coincide.
    ValueError
        If there are too many points for all their pairs.
    """
    parameters = from_similarity(problem.model, repeated_median(problem))
    weights = _biweights(target_residuals(problem, parameters), problem.source)
    for _ in range(ROUNDS):
        solution = solve(problem.with_weights(weights))
        renewed = _biweights(solution.residuals, problem.source)
        settled = np.abs(renewed - weights).max() < 1e-9
        weights = renewed
        if settled:
            break
    return weights


def repeated_median(problem: Problem) -> FloatArray:
    """Return the similarity of the repeated median.

    Parameters
    ----------
    problem : fit_problem.Problem
        Points and pivot; weights of zero leave points out.

    Returns
    -------
    ndarray, shape (..., 4)
        (k, theta, shift x, shift y).

    Raises
    ------
    DegenerateGeometryError
        If fewer than three points are given, or half of them coincide.
    ValueError
        If there are too many points for all their pairs.

    Examples
    --------
    Six points moved by (3, 0), two of them wrongly matched.

    >>> from reproduce.physics.fit_problem import prepare
    >>> source = [[0, 0], [9, 0], [0, 9], [9, 9], [4, 7], [6, 2]]
    >>> target = [[3, 0], [12, 0], [3, 9], [12, 9], [70, 7], [6, 99]]
    >>> repeated_median(prepare(source, target, (0, 0), None, "similarity")) + 0.0
    array([ 1.,  0., -3.,  0.])
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


def _biweights(residuals: FloatArray, source: FloatArray) -> FloatArray:
    length = np.hypot(residuals[..., 0], residuals[..., 1])
    spread = np.median(length, axis=-1, keepdims=True) / MEDIAN_LENGTH
    # Exact matches have no spread but that of rounding.
    spread = np.maximum(spread, 1e-12 * (1 + np.abs(source).max()))
    inside = np.clip(1 - (length / (TUKEY * spread)) ** 2, 0, None)
    return np.asarray(inside**2)
