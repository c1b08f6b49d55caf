"""Registering anyone's points: five models, errors in both images, outliers.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); the leading axes are a batch of registrations. Models, parameters and their order are those
of `transforms`.

A robust fit finds wrong matches without drawing random samples. It starts from Siegel's repeated
median: every pair of points gives a scale and a rotation, each point keeps the median over its
partners, and the median over the points is taken. It tolerates almost half of the points being
wrong, and the same points always give the same answer. Biweights lead from there to the fit of the
majority; then each point is tested against the others, and what remains is plain least squares with
its plain errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics import validate
from reproduce.physics.registration._least_squares import (
    _MIRRORED,
    Problem,
    combined_residuals,
    from_similarity,
    information,
    local_matrix,
    mirror_limit,
    model_jacobian,
    prepare,
    solve,
    thinned,
)
from reproduce.physics.registration.transforms import (
    MODELS,
    Registration,
    _parameter_names,
    as_complex,
)
from reproduce.physics.validate import FloatArray

# Tukey's biweight with this constant is 95 % efficient for Gaussian residuals in one dimension, and
# 92.9 % for the length of a residual in two.
_TUKEY = 4.685
# The median length of a two-dimensional Gaussian residual, in standard deviations of a coordinate.
_MEDIAN_LENGTH = float(np.sqrt(2 * np.log(2)))
_ROUNDS = 30
# The start takes all pairs of so many points, spread evenly over the rows.
_PAIRED = 600
# So many points at most, spread as evenly, decide what fits; each other one is tested against them.
_SETTLED = 5_000
# The chance that any point of a field of right matches is taken for wrong.
_ALARM = 1e-3
# What is left of a residual that the fit follows wholly: that point cannot be tested.
_LEAST = 1e-9
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class RegistrationFit:
    """A fitted registration, its uncertainty and what it leaves over.

    Attributes
    ----------
    transform : Registration
        Can be applied, inverted and composed.
    residuals : ndarray, shape (..., n, 2)
        Target minus transformed source, in px.
    chi_square : ndarray, shape (...)
        Weighted sum of squared deviations, of both images where covariances are known.
    cofactor : ndarray, shape (..., p, p)
        Inverse normal matrix.
    weights : ndarray, shape (..., n)
        How much each point counted: those given, and zero where a robust fit left a point out.
    errors_known : bool
        Whether covariances of the points were given.
    """

    transform: Registration
    residuals: FloatArray
    chi_square: FloatArray
    cofactor: FloatArray
    weights: FloatArray
    errors_known: bool

    @property
    def model(self) -> str:
        """The model's name."""
        return self.transform.model

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return _parameter_names(self.model)

    @property
    def parameters(self) -> FloatArray:
        """Estimates, shape (..., p); angles in radians, shifts in px, the radial term in px^-2."""
        return self.transform.parameters

    @property
    def degrees_of_freedom(self) -> NDArray[np.int64]:
        """Two per point that counts, less the parameters."""
        return np.asarray(2 * np.count_nonzero(self.weights, axis=-1) - len(self.names))

    @property
    def _variance(self) -> FloatArray:
        """Of a coordinate of weight one, shape (...); NaN where no point is to spare."""
        if self.errors_known:
            return np.ones_like(self.chi_square)
        freedom = self.degrees_of_freedom
        return np.asarray(self.chi_square / np.where(freedom > 0, freedom, np.nan))

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the parameters, shape (..., p, p).

        From the points' covariances where these were given, otherwise from the scatter of the
        residuals of those points that count.

        Raises
        ------
        DegenerateGeometryError
            If the scatter is needed and the points are too few to show it.
        """
        if np.isnan(self._variance).any():
            raise validate.DegenerateGeometryError(
                f"covariance: expected more coordinates than the {len(self.names)} parameters, "
                "got none to spare; add points, or give their covariances"
            )
        return self._variance[..., None, None] * self.cofactor

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviations of the parameters, shape (..., p); NaN where no point is to spare."""
        variances = np.diagonal(self.cofactor, axis1=-2, axis2=-1)
        return np.sqrt(self._variance[..., None] * variances)

    def interval(self, level: float = 0.95) -> FloatArray:
        """Return the lowest and highest value of each parameter, shape (..., p, 2).

        By Student's t with the degrees of freedom, since the scatter of few points is itself
        uncertain; by the normal law where covariances were given. NaN where no point is to spare.

        Parameters
        ----------
        level : float
            How often such an interval holds the true value, between 0 and 1.
        """
        if not 0 < level < 1:
            raise ValueError(f"level: expected a share between 0 and 1, got {level!r}")
        from scipy.special import (
            ndtri,
            stdtrit,
        )  # only now: its import takes longer than most fits

        upper = 0.5 * (1 + level)
        freedom = np.maximum(self.degrees_of_freedom, 1)
        factor = (
            ndtri(upper) if self.errors_known else stdtrit(freedom, upper)[..., None]
        )
        half = factor * self.standard_errors
        return np.stack([self.parameters - half, self.parameters + half], axis=-1)

    def landed_covariance(
        self, points: ArrayLike, covariance: ArrayLike | None = None
    ) -> FloatArray:
        """Return the covariance of where source points land, shape (..., n, 2, 2), in px^2.

        Of the transform's own errors, and of the points' where these are given.

        Parameters
        ----------
        points : array_like, shape (..., n, 2)
            In the source, in px.
        covariance : array_like, shape (..., n, 2, 2), optional
            Of the points, in px^2; independent of the stars that were fitted.
        """
        places = validate.finite_array("points", points, shape=(None, 2))
        offsets = places - self.transform.pivot[..., None, :]
        rows = model_jacobian(self.model, self.parameters, offsets)
        landed = rows @ self.covariance[..., None, :, :] @ rows.mT
        if covariance is None:
            return landed
        carry = local_matrix(self.model, self.parameters, offsets)
        own = validate.finite_array("covariance", covariance, shape=(2, 2))
        return landed + carry @ own @ carry.mT


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
    ones as well. So a scale or an affine matrix is not drawn towards zero, as
    it is where errors of the source are ignored.

    A robust fit starts from medians, which tolerate almost half of the points being wrong, and
    leaves out each point that does not fit the others; nothing in it is random, and one field in a
    thousand loses a right match. How far a residual is, is counted in the standard deviations of
    its point, where covariances or weights say them.

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

    Raises
    ------
    ValueError
        If the counts differ, the model is unknown, or a covariance is not symmetric and positive.
    MirroredPointsError
        If the target mirrors the source and the model may not.
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
    known = {
        "source_covariance": source_covariance,
        "target_covariance": target_covariance,
    }
    problem = prepare(source, target, pivot, weights, model, **known)
    if robust:
        problem = problem.with_weights(_outlier_weights(problem))
    found = solve(problem)
    return RegistrationFit(
        Registration._unchecked(model, found.parameters, problem.pivot),
        found.residuals,
        found.chi_square,
        found.cofactor,
        problem.counts,
        problem.errors_known,
    )


def _outlier_weights(problem: Problem) -> FloatArray:
    """Return weights, (..., n): one for a right match, zero for a wrong one.

    A residual counts in standard deviations: those of the points' covariances where they are
    known, and times the root of the point's own weight. Only their ratios matter.
    """
    n = problem.source.shape[-2]
    some = (
        problem
        if n <= _SETTLED
        else problem.of(np.linspace(0, n - 1, _SETTLED).astype(int))
    )
    closed = _repeated_median(some)
    if some.model != "affine":
        _refuse_mirrored(some, closed)
    kept = _majority(some, from_similarity(some.model, closed))
    for _ in range(_ROUNDS):
        before, kept = kept, _fitting(some, kept)
        if (kept == before).all():
            break
    if some is not problem:
        kept = _fits_others(problem, some, kept)
    return kept.astype(np.float64)


def _fits_others(
    problem: Problem, some: Problem, kept: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which points of a large problem fit those of a part of it that are kept, (..., n).

    As `_fitting`, but for leverage, of which a point has next to none on so many others.
    """
    found = solve(some.with_weights(kept.astype(np.float64)))
    own = np.where(
        kept[..., None], _whitened(some, found.parameters, found.points)[1], 0
    )
    freedom = 2 * (kept & (some.counts > 0)).sum(axis=-1) - len(MODELS[some.model])
    factor, residuals = _whitened(problem, found.parameters, problem.source)
    rest = np.square(own).sum(axis=(-2, -1))[..., None] / freedom[..., None]
    rest = np.maximum(np.maximum(rest, _rounding(problem, factor) ** 2), _TINY)
    square = np.square(residuals).sum(axis=-1) / (freedom[..., None] * rest)
    alarm = np.log(_ALARM / (problem.counts > 0).sum(axis=-1, keepdims=True))
    return np.asarray(-0.5 * freedom[..., None] * np.log1p(square) > alarm)


def _majority(problem: Problem, parameters: FloatArray) -> NDArray[np.bool_]:
    """Return the points that Tukey's biweights keep when they have settled, (..., n)."""
    points, before = problem.source, np.full(problem.counts.shape, np.inf)
    for _ in range(_ROUNDS):
        lengths = _lengths(problem, *_whitened(problem, parameters, points))
        weights = np.clip(1 - (lengths / _TUKEY) ** 2, 0, None) ** 2
        if np.abs(weights - before).max() < 1e-9:
            break
        found = solve(problem.with_weights(weights))
        parameters, points, before = found.parameters, found.points, weights
    half = problem.source.shape[-2] // 2
    return (weights > 0) | (lengths <= np.partition(lengths, half)[..., half, None])


def _fitting(problem: Problem, kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which points fit those that are kept, (..., n).

    The square of a point's residual over its expected share, two variances of the others, follows
    the F law with 2 and the others' degrees of freedom, whose tail is a power.
    """
    found = solve(problem.with_weights(kept.astype(np.float64)))
    factor, residuals = _whitened(problem, found.parameters, found.points)
    offsets = found.points - problem.pivot[..., None, :]
    rows = factor @ model_jacobian(problem.model, found.parameters, offsets)
    leverage = rows @ found.cofactor[..., None, :, :] @ rows.mT
    # A point that is kept has drawn the fit to itself by its leverage; another has not.
    share = (1 + _LEAST) * np.eye(2) + np.where(kept, -1.0, 1.0)[
        ..., None, None
    ] * leverage
    square = (residuals * np.linalg.solve(share, residuals[..., None])[..., 0]).sum(
        axis=-1
    )
    chi_square = np.where(kept[..., None], residuals**2, 0).sum(axis=(-2, -1))[
        ..., None
    ]
    own = problem.counts > 0
    count = 2 * (kept & own).sum(axis=-1, keepdims=True) - len(MODELS[problem.model])
    freedom = count - 2 * kept
    least = freedom * _rounding(problem, factor) ** 2
    rest = np.maximum(chi_square - np.where(kept, square, 0), np.maximum(least, _TINY))
    beyond = -0.5 * freedom * np.log1p(square / rest)
    alarm = np.log(_ALARM / own.sum(axis=-1, keepdims=True))
    return np.asarray(np.where(freedom > 0, beyond > alarm, kept))


def _repeated_median(problem: Problem) -> FloatArray:
    """Return the similarity of the repeated median, shape (..., 4); weights of zero drop points.

    Fewer than four points, or half of them in one place, are refused.
    """
    n = problem.source.shape[-2]
    if n < 4:
        raise validate.DegenerateGeometryError(
            f"expected four or more points for a robust fit, got {n}: of so few none can be told "
            "to be wrong; add points, or fit without"
        )
    some = thinned(n, _PAIRED)
    source, target = (
        as_complex(p[..., some, :]) for p in (problem.source, problem.target)
    )
    counts = problem.counts[..., some] > 0
    between = source[..., :, None] - source[..., None, :]
    across = target[..., :, None] - target[..., None, :]
    apart = (np.abs(between) > 0) & counts[..., None, :] & counts[..., :, None]
    ratio = np.where(apart, across / np.where(apart, between, 1), np.nan)
    # A point without partners has no median; it is left out of the next one.
    real, imaginary = (_median(_median(part)) for part in (ratio.real, ratio.imag))
    factor = real + 1j * imaginary
    if not (np.isfinite(factor) & (np.abs(factor) > 0)).all():
        raise validate.DegenerateGeometryError(
            "expected points that are apart from each other, got half of them or more in one "
            "place; check the matches"
        )
    pivot = as_complex(problem.pivot)
    source, target = as_complex(problem.source), as_complex(problem.target)
    landed = target - factor[..., None] * (source - pivot[..., None])
    landed = np.where(problem.counts > 0, landed, np.nan)
    origin = np.nanmedian(landed.real, axis=-1) + 1j * np.nanmedian(
        landed.imag, axis=-1
    )
    return _similarity(factor, pivot - origin)


def _similarity(
    factor: NDArray[np.complex128], shift: NDArray[np.complex128]
) -> FloatArray:
    """Return scale, rotation and shifts, shape (..., 4), of complex factors and shifts."""
    return np.stack([np.abs(factor), np.angle(factor), shift.real, shift.imag], axis=-1)


def _median(values: FloatArray) -> FloatArray:
    """Return the medians along the last axis but for NaN; faster than NumPy's, row by row."""
    ordered = np.sort(values, axis=-1)  # NaN come last
    count = np.isfinite(ordered).sum(axis=-1, keepdims=True)
    middle = np.concatenate([np.maximum(count - 1, 0), count], axis=-1) // 2
    return np.asarray(np.take_along_axis(ordered, middle, axis=-1).mean(axis=-1))


def _refuse_mirrored(problem: Problem, closed: FloatArray) -> None:
    """Refuse a mirror image, wrong matches or not: by medians of what two similarities leave."""
    flip = np.array([-1.0, 1.0])
    across = replace(problem, source=problem.source * flip, pivot=problem.pivot * flip)
    median = _median_length(problem, closed)
    mirrored = _median_length(across, _repeated_median(across))
    if (
        median <= mirrored
    ).all():  # the limit is above one: most fits need no law for it
        return
    if (
        median > np.sqrt(mirror_limit(2 * problem.source.shape[-2] - 4)) * mirrored
    ).any():
        raise validate.MirroredPointsError(_MIRRORED)


def _median_length(problem: Problem, closed: FloatArray) -> FloatArray:
    # Of the similarity, whatever the model of the problem.
    landed = replace(problem, model="similarity").transformed(closed, problem.source)
    return np.median(_norm(problem.target - landed), axis=-1)


def _whitened(
    problem: Problem, parameters: FloatArray, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what makes residuals of variance one, (..., n, 2, 2), and the residuals so made."""
    carry = local_matrix(
        problem.model, parameters, points - problem.pivot[..., None, :]
    )
    left = combined_residuals(problem, parameters, points, carry)
    factor = information(problem, carry)
    if problem.errors_known:
        factor = np.asarray(np.linalg.cholesky(factor).mT, dtype=np.float64)
    factor = np.sqrt(problem.counts)[..., None, None] * factor
    return factor, (factor @ left[..., None])[..., 0]


def _lengths(problem: Problem, factor: FloatArray, residuals: FloatArray) -> FloatArray:
    """Return the lengths of whitened residuals over their spread, shape (..., n)."""
    length = _norm(residuals)
    kept = problem.counts > 0
    median = np.nanmedian(np.where(kept, length, np.nan), axis=-1, keepdims=True)
    # Residuals are smaller than errors, because the parameters follow the errors.
    count = 2 * kept.sum(axis=-1, keepdims=True)
    freedom = np.maximum(count - len(MODELS[problem.model]), 1)
    spread = median / _MEDIAN_LENGTH * np.sqrt(count / freedom)
    return length / np.maximum(np.maximum(spread, _rounding(problem, factor)), _TINY)


def _rounding(problem: Problem, factor: FloatArray) -> FloatArray:
    """Return the spread of exact matches, (..., n), which is that of rounding."""
    reach = np.abs(problem.source).max() + np.abs(problem.target).max()
    return np.asarray(1e-12 * (1 + reach) * np.abs(factor).max(axis=(-2, -1)))


def _norm(vectors: FloatArray) -> FloatArray:
    return np.hypot(vectors[..., 0], vectors[..., 1])
