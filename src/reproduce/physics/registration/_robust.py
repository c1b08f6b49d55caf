"""Finding wrong matches without drawing random samples.

The start is Siegel's repeated median: every pair of points gives a scale and a rotation, each point
keeps the median over its partners, and the median over the points is taken. It tolerates almost
half of the points being wrong, and the same points always give the same answer. Biweights lead from
there to the fit of the majority; then each point is tested against the others, and what remains is
plain least squares with its plain errors. Shapes, units and models are those of `fit`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reproduce.physics.registration.closed_form import (
    _CHANCE,
    _MIRRORED,
    Problem,
    _Solution,
    combined_residuals,
    from_similarity,
    information,
    local_matrix,
    model_jacobian,
    solve,
)
from reproduce.physics.registration.transforms import MODELS, as_complex, as_points
from reproduce.physics.validate import DegenerateGeometryError, FloatArray, MirroredPointsError

# Tukey's biweight with this constant is 95 % efficient for Gaussian residuals in one dimension, and
# 92.9 % for the length of a residual in two.
TUKEY = 4.685
# The median length of a two-dimensional Gaussian residual, in standard deviations of a coordinate.
MEDIAN_LENGTH = float(np.sqrt(2 * np.log(2)))
ROUNDS = 30
# The start takes all pairs of so many points, spread evenly over the rows.
PAIRED = 600
# The biweights settle on so many points at most, spread as evenly; each point is tested by itself.
SETTLED = 5_000
# The chance that any point of a field of right matches is taken for wrong.
ALARM = 1e-3
# Of the size of the field: a median residual below it is that of a fit, if not of a good one.
FITS = 0.01
# What is left of a residual that the fit follows wholly: that point cannot be tested.
LEAST = 1e-9
_TINY = float(np.finfo(float).tiny)


def outlier_weights(problem: Problem) -> FloatArray:
    """Return weights, (..., n): one for a right match, zero for a wrong one.

    A residual counts in standard deviations: those of the points' covariances where they are
    known, and times the root of the point's own weight. Only their ratios matter.
    """
    some = problem.thinned(SETTLED)
    closed = repeated_median(some)
    if problem.model != "affine":
        _refuse_mirrored(some, closed)
    kept = _majority(problem, some, from_similarity(problem.model, closed))
    for _ in range(ROUNDS):
        before, kept = kept, _fitting(problem, kept)
        if (kept == before).all():
            break
    return kept.astype(np.float64)


def _majority(problem: Problem, some: Problem, parameters: FloatArray) -> NDArray[np.bool_]:
    """Return the points that Tukey's biweights keep when they have settled on some, (..., n)."""
    lengths = _lengths(some, *_whitened(some, parameters, some.source))
    weights = _biweights(lengths)
    for _ in range(ROUNDS):
        found = solve(some.with_weights(weights))
        lengths = _lengths(some, *_whitened(some, found.parameters, found.points))
        before, weights = weights, _biweights(lengths)
        if np.abs(weights - before).max() < 1e-9:
            break
    if some is not problem:
        lengths = _lengths(problem, *_whitened(problem, found.parameters, problem.source))
        weights = _biweights(lengths)
    half = problem.source.shape[-2] // 2
    return (weights > 0) | (lengths <= np.partition(lengths, half)[..., half, None])


def _fitting(problem: Problem, kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which points fit those that are kept, (..., n).

    The square of a point's residual over its expected share, two variances of the others, follows
    the F law with 2 and the others' degrees of freedom, whose tail is a power.
    """
    found = solve(problem.with_weights(kept.astype(np.float64)))
    factor, residuals = _whitened(problem, found.parameters, found.points)
    square = _tested(problem, kept, factor, residuals, found)
    chi_square = np.where(kept[..., None], residuals**2, 0).sum(axis=(-2, -1))[..., None]
    own = np.ones(kept.shape, bool) if problem.weights is None else problem.weights > 0
    count = 2 * (kept & own).sum(axis=-1, keepdims=True) - len(MODELS[problem.model])
    freedom = count - 2 * kept
    least = freedom * _rounding(problem, factor) ** 2
    rest = np.maximum(chi_square - np.where(kept, square, 0), np.maximum(least, _TINY))
    beyond = -0.5 * freedom * np.log1p(square / rest)
    alarm = np.log(ALARM / own.sum(axis=-1, keepdims=True))
    return np.asarray(np.where(freedom > 0, beyond > alarm, kept))


def _tested(
    problem: Problem,
    kept: NDArray[np.bool_],
    factor: FloatArray,
    residuals: FloatArray,
    found: _Solution,
) -> FloatArray:
    """Return the squares of whitened residuals over their expected share, (..., n).

    A point that is kept has drawn the fit to itself by its leverage; another has not.
    """
    sign = np.where(kept, -1.0, 1.0)
    if problem.model == "similarity" and not problem.errors_known:
        own = np.ones(kept.shape) if problem.weights is None else problem.weights
        leverage = own * _leverage(as_complex(problem.source), own * kept)
        return np.square(residuals).sum(axis=-1) / (1 + LEAST + sign * leverage)
    rows = factor @ model_jacobian(problem, found.parameters, found.points)
    # With columns of length one the matrix can be inverted whatever the units.
    rows = rows / np.sqrt(np.square(rows).sum(axis=(-3, -2)))[..., None, None, :]
    counted = np.where(kept[..., None, None], rows, 0)
    normal = np.einsum("...nij,...nik->...jk", counted, counted)
    leverage = rows @ np.linalg.inv(normal)[..., None, :, :] @ rows.mT
    spread = (1 + LEAST) * np.eye(2) + sign[..., None, None] * leverage
    solved = np.linalg.solve(spread, residuals[..., None])[..., 0]
    return np.asarray((residuals * solved).sum(axis=-1))


def _leverage(points: NDArray[np.complex128], weights: FloatArray) -> FloatArray:
    """Return the leverage of a point of weight one on a similarity, for both axes alike."""
    total = weights.sum(axis=-1, keepdims=True)
    offsets = points - (weights * points).sum(axis=-1, keepdims=True) / total
    squares = np.square(np.abs(offsets))
    return 1 / total + squares / (weights * squares).sum(axis=-1, keepdims=True)


def repeated_median(problem: Problem) -> FloatArray:
    """Return the similarity of the repeated median, shape (..., 4); weights of zero drop points.

    Fewer than four points, or half of them in one place, are refused.
    """
    n = problem.source.shape[-2]
    if n < 4:
        raise DegenerateGeometryError(
            f"expected four or more points for a robust fit, got {n}: of so few none can be told "
            "to be wrong; add points, or fit without"
        )
    some = np.linspace(0, n - 1, min(n, PAIRED)).astype(int)
    source, target = (
        as_complex(problem.source[..., some, :]),
        as_complex(problem.target[..., some, :]),
    )
    between = source[..., :, None] - source[..., None, :]
    across = target[..., :, None] - target[..., None, :]
    apart = np.abs(between) > 0
    ratio = np.where(apart, across / np.where(apart, between, 1), np.nan)
    if problem.weights is not None:
        counts = problem.weights[..., some] > 0
        ratio = np.where(counts[..., None, :] & counts[..., :, None], ratio, np.nan)
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
    factor = information(problem, carry)
    if problem.errors_known:
        factor = np.asarray(np.linalg.cholesky(factor).mT, dtype=np.float64)
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
    return length / np.maximum(np.maximum(spread, _rounding(problem, factor)), _TINY)


def _rounding(problem: Problem, factor: FloatArray) -> FloatArray:
    """Return the spread of exact matches, (..., n), which is that of rounding."""
    # Without known errors a factor is so many times the unit matrix.
    largest = np.abs(factor).max(axis=(-2, -1)) if problem.errors_known else factor[..., 0, 0]
    return np.asarray(1e-12 * (1 + problem.reach) * largest)


def _norm(vectors: FloatArray) -> FloatArray:
    return np.hypot(vectors[..., 0], vectors[..., 1])


def _biweights(lengths: FloatArray) -> FloatArray:
    return np.clip(1 - (lengths / TUKEY) ** 2, 0, None) ** 2
