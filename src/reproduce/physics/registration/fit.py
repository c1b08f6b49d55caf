"""Registering anyone's points: five models, errors in both images, outliers.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); the leading axes are a batch of registrations. Models, parameters and their order are those
of `transforms`. Source points are x, target points y, the transform f, its parameters u.

A single similarity is solved on plain complex numbers, batches of them in closed form, all else by
Gauss-Newton steps. A robust fit starts from Siegel's repeated median: every pair of points gives a
scale and a rotation, each point keeps the median over its partners, and the median over the points
is taken. It tolerates almost half of the points being wrong, and nothing in it is random.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import fdtri

from reproduce.physics.registration.similarity import (
    CHANCE,
    MIRRORED,
    ROUNDING,
    SimilarityFit,
    as_complex,
    as_points,
    fit_similarity,
    paired_points,
    refuse_mirrored,
)
from reproduce.physics.registration.transforms import (
    MODELS,
    Registration,
    linear_part,
    parameter_names,
)
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    MirroredPointsError,
    common_batch,
    finite_array,
    number_array,
    weights_for,
)


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
        What was made least.
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
        As for `fit_registration`.

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


def single_similarity(source: ArrayLike, target: ArrayLike, pivot: FloatArray) -> Solution | None:
    """Return the least-squares similarity of one set of points, or None where a check is due.

    Parameters
    ----------
    source, target : array_like, shape (n, 2)
        The same spots in both images, in px.
    pivot : ndarray, shape (2,)
        In px.

    Returns
    -------
    fit_problem.Solution or None
        Parameters (k, theta, shift x, shift y), residuals, chi-square, cofactor.

    Examples
    --------
    >>> found = single_similarity([[0, 0], [1, 0]], [[3, 0], [5, 0]], np.zeros(2))
    >>> found.parameters + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    rows, landed = _complex("source", source), _complex("target", target)
    if rows is None or landed is None or rows.size != landed.size or pivot.shape != (2,):
        return None
    count = rows.size
    centre = complex(np.add.reduce(rows)) / count
    target_centre = complex(np.add.reduce(landed)) / count
    offsets, targets = rows - centre, landed - target_centre
    spread = float(np.vdot(offsets, offsets).real)
    if not spread > count * ROUNDING**2 * abs(centre) ** 2:
        return None
    factor = complex(np.vdot(offsets, targets)) / spread
    if abs(complex(np.dot(offsets, targets))) > abs(factor) * spread:
        return None  # perhaps a mirror image
    # Products overflow to infinity, where the power of a float would raise an error.
    size = abs(factor) * abs(factor) * spread
    if not count * ROUNDING**2 * abs(target_centre) * abs(target_centre) < size < np.inf:
        return None
    origin = complex(pivot[0], pivot[1])
    shift = factor * (centre - origin) + (origin - target_centre)
    if not cmath.isfinite(shift):
        return None
    left = targets - factor * offsets
    scale, turn = abs(factor), cmath.phase(factor)
    return Solution(
        np.array([scale, turn, shift.real, shift.imag]),
        left[:, None].view(np.float64),
        np.asarray(np.vdot(left, left).real),
        _cofactor(factor / scale * (centre - origin), spread, scale, count),
        rows[:, None].view(np.float64),
    )


def _complex(
    name: str, points: ArrayLike
) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]] | None:
    array = points if isinstance(points, np.ndarray) else number_array(name, points)
    if array.dtype != np.float64 or array.ndim != 2 or array.shape[1] != 2 or len(array) < 2:
        return None
    if not array.flags.c_contiguous:
        return None
    return array.view(np.complex128)[:, 0]


def _cofactor(lever: complex, spread: float, scale: float, count: int) -> FloatArray:
    """Return the inverse normal matrix; `registration.SimilarityFit.cofactor` says why."""
    across, along = lever.real / spread, lever.imag / spread
    variance = 1 / count + abs(lever) ** 2 / spread
    by_scale, by_turn = 1 / spread, 1 / (spread * scale**2)
    return np.array(
        [
            [by_scale, 0.0, across, along],
            [0.0, by_turn, -along / scale, across / scale],
            [across, -along / scale, variance, 0.0],
            [along, across / scale, 0.0, variance],
        ]
    )


STEPS = 60
MOVEMENT = 1e-11  # px, root mean square: far below what a centroid can mean
DEPENDENT = 1e-13


def solve(problem: Problem, start: FloatArray | None = None) -> Solution:
    """Find the parameters that make chi-square least, by Gauss-Newton steps.

    Where the source has errors, its true points s are unknowns beside the parameters u. Chi-square
    is then the sum of (x - s)^T Cx^-1 (x - s) + (y - f(s; u))^T Cy^-1 (y - f(s; u)), and its least
    value is the maximum of the likelihood. In each step the points are eliminated one by one: with
    A = df/ds, e = y - f(s; u) - A (x - s) has the covariance Cy + A Cx A^T, the parameters follow
    from e by weighted least squares, and s = x + Cx A^T (Cy + A Cx A^T)^-1 e from what is left.

    Parameters
    ----------
    problem : Problem
        From `prepare`.
    start : ndarray, shape (..., p), optional
        Where to begin; the closed form of a simpler model by default.

    Returns
    -------
    Solution
        The minimum.

    Raises
    ------
    DegenerateGeometryError
        If the points do not fix every parameter, or the steps do not settle.
    """
    parameters = starting_point(problem) if start is None else start
    points = problem.source
    limit = MOVEMENT * (1 + np.abs(problem.target).max())
    for _ in range(STEPS):
        carry = local_matrix(problem, parameters, points)
        weight = information(problem, carry)
        left = combined_residuals(problem, parameters, points, carry)
        rows = model_jacobian(problem, parameters, points)
        step, cofactor = _step(rows, _weighted(problem, weight), left)
        moved = (rows @ step[..., None, :, None])[..., 0]
        renewed = true_points(problem, carry, weight, left - moved)
        largest = np.maximum(_length(moved), _length(renewed - points)).max()
        parameters, points = parameters + step, renewed
        if largest < limit:
            break
    else:
        raise DegenerateGeometryError(
            f"expected the fit to settle within {STEPS} steps, got a last step of "
            f"{float(largest):g} px; check the matches, or fit a simpler model"
        )
    carry = local_matrix(problem, parameters, points)
    left = combined_residuals(problem, parameters, points, carry)
    weight = _weighted(problem, information(problem, carry))
    chi_square = np.asarray((left * (weight @ left[..., None])[..., 0]).sum(axis=(-2, -1)))
    return Solution(parameters, target_residuals(problem, parameters), chi_square, cofactor, points)


def starting_point(problem: Problem) -> FloatArray:
    """Return parameters near the minimum, shape (..., p), from a closed form."""
    source, target, pivot = problem.source, problem.target, problem.pivot
    if problem.model == "shift":
        weights = np.ones(source.shape[:-1]) if problem.weights is None else problem.weights
        shares = (weights / weights.sum(axis=-1)[..., None])[..., None]
        offsets, targets = (
            as_complex(side - (shares * side).sum(axis=-2, keepdims=True))
            for side in (source, target)
        )
        refuse_mirrored(offsets, targets, problem.weights)
        return np.asarray(((source - target) * shares).sum(axis=-2))
    if problem.model == "affine":  # which may mirror, and is linear: any start will do
        return np.broadcast_to([1.0, 0.0, 0.0, 1.0, 0.0, 0.0], (*source.shape[:-2], 6))
    closed = fit_similarity(source, target, pivot, problem.weights).parameters
    return from_similarity(problem.model, closed)


def from_similarity(model: str, closed: FloatArray) -> FloatArray:
    """Return a model's parameters that do what a similarity (..., 4) does, or nearly so."""
    if model == "rigid":
        return closed[..., 1:]
    if model == "shift":
        return closed[..., 2:]
    if model == "similarity+radial":
        return np.concatenate([closed, np.zeros_like(closed[..., :1])], axis=-1)
    if model == "affine":
        matrix = linear_part("similarity", closed)
        flat = matrix.reshape(*matrix.shape[:-2], 4)
        return np.concatenate([flat, closed[..., 2:]], axis=-1)
    return closed


def target_residuals(problem: Problem, parameters: FloatArray) -> FloatArray:
    """Return target minus transformed source, shape (..., n, 2), in px."""
    transform = Registration(problem.model, parameters, problem.pivot)
    return problem.target - transform.apply(problem.source)


def combined_residuals(
    problem: Problem, parameters: FloatArray, points: FloatArray, carry: FloatArray
) -> FloatArray:
    """Return y - f(s; u) - A (x - s), shape (..., n, 2), in px: what both images leave over.

    Without errors in the source the points s are the source, and this is target minus transformed
    source.
    """
    transform = Registration(problem.model, parameters, problem.pivot)
    left = problem.target - transform.apply(points)
    if problem.source_covariance is None:
        return left
    return np.asarray(left - (carry @ (problem.source - points)[..., None])[..., 0])


def true_points(
    problem: Problem, carry: FloatArray, weight: FloatArray, left: FloatArray
) -> FloatArray:
    """Return where the source points truly are, as far as `left` tells, (..., n, 2), in px."""
    if problem.source_covariance is None:
        return problem.source
    pulled = np.swapaxes(carry, -1, -2) @ (weight @ left[..., None])
    return np.asarray(problem.source + (problem.source_covariance @ pulled)[..., 0])


def model_jacobian(problem: Problem, parameters: FloatArray, points: FloatArray) -> FloatArray:
    """Return the derivatives of transformed points by the parameters, (..., n, 2, p)."""
    q = points - problem.pivot[..., None, :]
    names = MODELS[problem.model]
    rows = np.zeros((*q.shape, len(names)))
    start = names.index("shift x")
    rows[..., 0, start] = rows[..., 1, start + 1] = -1
    if problem.model == "affine":
        rows[..., 0, 0:2] = rows[..., 1, 2:4] = q
        return rows
    if problem.model == "shift":
        return rows
    turned = q @ np.swapaxes(linear_part(problem.model, parameters), -1, -2)
    if problem.model == "similarity+radial":
        squared = np.square(q).sum(axis=-1, keepdims=True)
        rows[..., -1] = turned * squared
        turned = turned * (1 + parameters[..., -1][..., None, None] * squared)
    if problem.model != "rigid":
        rows[..., 0] = turned / parameters[..., 0][..., None, None]
    turn = names.index("rotation")
    rows[..., 0, turn], rows[..., 1, turn] = -turned[..., 1], turned[..., 0]
    return rows


def information(problem: Problem, carry: FloatArray) -> FloatArray:
    """Return the inverse covariance of each combined residual, shape (..., n, 2, 2).

    In px^-2 where covariances are known, else the unit matrix; weights are left aside.
    """
    if not problem.errors_known:
        return np.broadcast_to(np.eye(2), (*problem.source.shape, 2))
    total = np.zeros((*problem.source.shape, 2))
    if problem.target_covariance is not None:
        total = total + problem.target_covariance
    if problem.source_covariance is not None:
        total = total + carry @ problem.source_covariance @ np.swapaxes(carry, -1, -2)
    return np.linalg.inv(total)


def local_matrix(problem: Problem, parameters: FloatArray, points: FloatArray) -> FloatArray:
    """Return A, how transformed points move with the points, shape (..., n, 2, 2)."""
    matrix = linear_part(problem.model, parameters)[..., None, :, :]
    if problem.model != "similarity+radial":
        return np.broadcast_to(matrix, (*points.shape, 2))
    q = points - problem.pivot[..., None, :]
    c = parameters[..., -1][..., None, None, None]
    squared = np.square(q).sum(axis=-1)[..., None, None]
    return np.asarray(
        matrix @ ((1 + c * squared) * np.eye(2) + 2 * c * q[..., None] * q[..., None, :])
    )


def _weighted(problem: Problem, information: FloatArray) -> FloatArray:
    if problem.weights is None:
        return information
    return problem.weights[..., None, None] * information


def _length(movement: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.square(movement).mean(axis=(-2, -1))))


def _step(
    rows: FloatArray, weight: FloatArray, residuals: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the Gauss-Newton step (..., p) and the inverse normal matrix (..., p, p)."""
    weighted = weight @ rows
    normal = np.einsum("...nij,...nik->...jk", rows, weighted)
    pull = np.einsum("...nij,...ni->...j", weighted, residuals)
    size = np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1))
    if not (size > 0).all():
        _refuse_free()
    # With columns of length one the smallest eigenvalue says how near to dependent they are.
    scaled = normal / (size[..., :, None] * size[..., None, :])
    if (np.linalg.eigvalsh(scaled)[..., 0] < DEPENDENT).any():
        _refuse_free()
    inverse = np.linalg.inv(scaled) / (size[..., :, None] * size[..., None, :])
    return (inverse @ pull[..., None])[..., 0], inverse


def _refuse_free() -> None:
    raise DegenerateGeometryError(
        "expected points that fix every parameter of the model, got too few, coincident or aligned "
        "ones; add spots across the field, or fit a simpler model"
    )


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
    """Return weights from one for a good match down to zero for a wrong one.

    A residual counts in standard deviations: those of the points' covariances where they are
    known, and times the root of the point's own weight. All are scaled so that their median is
    that of Gaussian residuals.

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


def sandwich(problem: Problem, solution: Solution) -> FloatArray:
    """Return the covariance of the parameters of a robust fit.

    The fit is a root of ``sum J^T psi`` with psi = w e, the weighted residual. Its covariance is
    A^-1 (sum J^T psi psi^T J) A^-1 with A = ``sum J^T (d psi / d e) J``: as a residual grows its
    weight falls, so psi grows less than e. The inverse normal matrix, which takes the weights as
    fixed, is too small.

    Parameters
    ----------
    problem : fit_problem.Problem
        With the weights that were given, not those that were found.
    solution : fit_problem.Solution
        The robust fit.

    Returns
    -------
    ndarray, shape (..., p, p)
        In the order of the parameters.
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
    return np.asarray(covariance / (size[..., :, None] * size[..., None, :]))


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

    >>> from reproduce.physics.registration.fit import prepare
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


def _refuse_mirrored(problem: Problem, closed: FloatArray) -> None:
    """Refuse a mirror image, wrong matches or not: by medians of what two similarities leave."""
    flip = np.array([-1.0, 1.0])
    across = replace(problem, source=problem.source * flip, pivot=problem.pivot * flip)
    median = _median_length(problem, closed)
    # Fields with a good fit, most of all, need no second one.
    size = np.median(_norm(problem.target - problem.target.mean(axis=-2, keepdims=True)), axis=-1)
    if not (median > FITS * size).any():
        return
    freedom = 2 * problem.source.shape[-2] - 4
    limit = np.sqrt(fdtri(freedom, freedom, 1 - CHANCE))
    if (median > limit * _median_length(across, repeated_median(across))).any():
        raise MirroredPointsError(MIRRORED)


def _median_length(problem: Problem, closed: FloatArray) -> FloatArray:
    transform = Registration("similarity", closed, problem.pivot)
    return np.asarray(np.median(_norm(problem.target - transform.apply(problem.source)), axis=-1))


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
    factor = np.swapaxes(np.linalg.cholesky(information(problem, carry)), -1, -2)
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
    return np.asarray(length / np.maximum(np.maximum(spread, rounding), np.finfo(float).tiny))


def _norm(vectors: FloatArray) -> FloatArray:
    return np.hypot(vectors[..., 0], vectors[..., 1])


def _biweights(lengths: FloatArray) -> FloatArray:
    return np.asarray(np.clip(1 - (lengths / TUKEY) ** 2, 0, None) ** 2)


@dataclass(frozen=True, eq=False)
class RegistrationFit:
    """A fitted registration, its uncertainty and what it leaves over.

    Attributes
    ----------
    transform : Registration
        Can be applied, undone, inverted and composed.
    residuals : ndarray, shape (..., n, 2)
        Target minus transformed source, in px.
    weights : ndarray, shape (..., n), or None
        How much each point counted: those given, times those that a robust fit found.
    errors_known : bool
        Whether covariances of the points were given.
    """

    transform: Registration
    residuals: FloatArray
    weights: FloatArray | None
    errors_known: bool
    _solution: Solution | SimilarityFit
    _sandwich: FloatArray | None = None

    @property
    def model(self) -> str:
        """The model's name."""
        return self.transform.model

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return parameter_names(self.model)

    @property
    def parameters(self) -> FloatArray:
        """Estimates, shape (..., p); angles in radians, shifts in px, the radial term in px^-2."""
        return self.transform.parameters

    @property
    def chi_square(self) -> FloatArray:
        """Weighted sum of squared deviations, of both images where covariances are known."""
        return self._solution.chi_square

    @property
    def degrees_of_freedom(self) -> NDArray[np.int64]:
        """Two per point that counts, less the parameters."""
        count = self.parameters.shape[-1]
        if self.weights is not None:
            return np.asarray(2 * np.count_nonzero(self.weights, axis=-1) - count)
        return np.asarray(2 * self.residuals.shape[-2] - count)

    @property
    def cofactor(self) -> FloatArray:
        """Inverse normal matrix, shape (..., p, p)."""
        return self._solution.cofactor

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the parameters, shape (..., p, p).

        From the points' covariances where these were given, otherwise from the scatter of the
        residuals. Of a robust fit, always from their scatter: the sandwich form of an M-estimator
        (`sandwich`). One standard deviation and 1.96 of them then cover 0.68 and 0.95 to
        within 0.02 from 83 points on, with up to a fifth of them wrong; 0.68 to 0.70 and 0.93 to
        0.94 for 20 points, 0.65 to 0.68 and 0.89 to 0.92 for 10.

        Raises
        ------
        DegenerateGeometryError
            If the scatter is needed and the points are too few to show it.
        """
        if self.errors_known and self._sandwich is None:
            return self.cofactor
        freedom = self.degrees_of_freedom
        if (freedom <= 0).any():
            raise DegenerateGeometryError(
                f"covariance: expected more coordinates than the {len(self.names)} parameters, "
                "got none to spare; add points, or give their covariances"
            )
        if self._sandwich is not None:
            return self._sandwich
        return np.asarray((self.chi_square / freedom)[..., None, None] * self.cofactor)


def fit_registration(
    source: ArrayLike,
    target: ArrayLike,
    pivot: ArrayLike,
    weights: ArrayLike | None = None,
    model: str = "similarity",
    *,
    source_covariance: ArrayLike | None = None,
    target_covariance: ArrayLike | None = None,
    robust: bool = False,
) -> RegistrationFit:
    """Fit the transform that lays source points over target points.

    By weighted least squares; with covariances, by maximum likelihood. Where the source has errors
    its true points are then unknowns too, and chi-square counts how far they lie from the measured
    ones as well (`solve`). So a scale or an affine matrix is not drawn towards zero, as
    it is where errors of the source are ignored.

    A robust fit starts from medians, which tolerate almost half of the points being wrong, and then
    gives far residuals less and at last no weight; nothing in it is random. How far a residual is,
    is counted in the standard deviations of its point, where covariances or weights say them.

    Parameters
    ----------
    source, target : array_like, shape (..., n, 2)
        The same n spots in both images, in px.
    pivot : array_like, shape (..., 2)
        The point turned and scaled about, in px: the source's principal point, for one.
    weights : array_like, shape (..., n), optional
        Relative weights, inverse variances for one; zero drops a point. One by default.
    model : {"shift", "rigid", "similarity", "similarity+radial", "affine"}
        What the transform may do.
    source_covariance, target_covariance : array_like, shape (..., n, 2, 2), optional
        Known covariances of the points, in px^2; a missing one counts as zero beside the other.
    robust : bool
        Whether to guard against wrong matches.

    Returns
    -------
    RegistrationFit
        Parameters, covariance, residuals, chi-square and the transform.

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape, a weight is negative, the model is
        unknown, or a covariance is not symmetric and positive.
    DegenerateGeometryError
        If the points do not fix every parameter of the model.

    Examples
    --------
    >>> fit = fit_registration([[0, 0], [1, 0]], [[3, 0], [5, 0]], pivot=(0, 0))
    >>> fit.parameters + 0.0
    array([ 2.,  0., -3.,  0.])
    >>> fit.transform.apply([[2, 0]])
    array([[7., 0.]])
    """
    parameter_names(model)
    plain = source_covariance is None and target_covariance is None and not robust
    if model == "similarity" and plain:
        return _closed_form(source, target, pivot, weights)
    problem = prepare(source, target, pivot, weights, model)
    problem = problem.with_covariances(source_covariance, target_covariance)
    if not robust:
        return _result(problem, solve(problem))
    weighted = problem.with_weights(outlier_weights(problem))
    solution = solve(weighted)
    return _result(weighted, solution, sandwich(problem, solution))


def _closed_form(
    source: ArrayLike, target: ArrayLike, pivot: ArrayLike, weights: ArrayLike | None
) -> RegistrationFit:
    if weights is None:
        origin = number_array("pivot", pivot)
        single = single_similarity(source, target, origin)
        if single is not None:
            transform = Registration.unchecked("similarity", single.parameters, origin)
            return RegistrationFit(transform, single.residuals, None, False, single)
    fit = fit_similarity(source, target, pivot, weights)
    transform = Registration("similarity", fit.parameters, fit.similarity.pivot)
    return RegistrationFit(transform, fit.residuals, fit.weights, False, fit)


def _result(
    problem: Problem, solution: Solution, covariance: FloatArray | None = None
) -> RegistrationFit:
    transform = Registration(problem.model, solution.parameters, problem.pivot)
    return RegistrationFit(
        transform, solution.residuals, problem.weights, problem.errors_known, solution, covariance
    )
