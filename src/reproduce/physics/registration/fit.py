"""Registration of points: five models, errors in both images, wrong matches.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); the leading axes are a batch of registrations. Models, parameters and their order are those
of `transforms`.

A robust fit draws no random samples. It starts from Siegel's repeated median: every pair of points
gives a scale and a rotation, each point takes the median over its partners, and the median over the
points follows. This tolerates wrong matches of almost half of the points. The half of the points
closest to it is fitted. Then each point is tested against the others, until the same points remain.
The start is a similarity also for an affine model, or a mirror image: after a strong shear, fewer
wrong matches are tolerated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.registration._least_squares import (
    Problem,
    iterated,
    prepare,
    thinned,
)
from reproduce.physics.registration._similarity import (
    ComplexArray,
    as_complex,
    check_ratio,
    squared,
)
from reproduce.physics.registration.transforms import MODELS, Registration
from reproduce.physics.validate import (
    BoolArray,
    Flag,
    FloatArray,
    IntArray,
    Points,
    Size,
)

# Fewest points of a robust fit.
_MIN_STARS_ROBUST = 4
# Rounds of tests of all points, at most.
_MAX_ROUNDS = 30
# Number of points, spread evenly over the rows, that are tested against each other; and number of
# points of which all pairs give the start.
_MAX_TESTED = 5_000
_MAX_PAIRED = 600
# Probability that a robust fit leaves out any point of a field without wrong matches.
FALSE_ALARM_ROBUST = 1e-3
# Smallest variance of a residual, relative to the noise, if the fit follows the point, and rounding
# error of a residual, relative to the coordinates.
_MIN_VARIANCE, _ROUNDING = 1e-9, 1e-12
# Residuals below this fraction of the coordinates are rounding errors.
_EXACT_FRACTION = 1e-11


@dataclass(frozen=True, eq=False)
class RegistrationFit:
    """A fitted registration, its uncertainty and its residuals.

    Attributes
    ----------
    problem : Problem
        The points of the fit with their errors and weights.
    transform : Registration
        Can be applied and inverted.
    residuals : ndarray, shape (..., n, 2)
        Target minus transformed source, in px.
    chi_square : ndarray, shape (...)
        Weighted sum of squared deviations, of both images if covariances are known.
    cofactor : ndarray, shape (..., p, p)
        Inverse normal matrix.
    points : ndarray, shape (..., n, 2)
        Estimates of the true source points, in px.
    rejected : ndarray of bool, shape (..., n)
        Points that a robust fit left out.
    robust : bool
        Whether wrong matches were left out.
    systematic : float or ndarray, shape (2, 2)
        Covariance of the shift that the residuals do not show, in px^2.
    """

    problem: Problem
    transform: Registration
    residuals: FloatArray
    chi_square: FloatArray
    cofactor: FloatArray
    points: FloatArray
    rejected: BoolArray
    robust: bool = False
    systematic: FloatArray | float = 0.0

    @property
    def weights(self) -> FloatArray:
        """Relative weights of the points, zero if left out, shape (..., n)."""
        return self.problem.counts

    @property
    def errors_known(self) -> bool:
        """Whether covariances of the points were given."""
        return self.problem.errors_known

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return MODELS[self.transform.model]

    @property
    def parameters(self) -> FloatArray:
        """Estimates, shape (..., p); angles in radians, shifts in px, the radial term in px^-2."""
        return self.transform.parameters

    @cached_property
    def squares(self) -> FloatArray:
        """Squared lengths of the residuals, shape (..., n), in px^2."""
        return squared(as_complex(self.residuals))

    @cached_property
    def degrees_of_freedom(self) -> IntArray:
        """Two per point of weight above zero, minus the number of parameters."""
        return 2 * np.count_nonzero(self.weights, axis=-1) - len(self.names)

    @property
    def chi_square_range(self) -> tuple[float, float]:
        """Central 95 % of chi-square per degree of freedom if the errors are right."""
        from scipy.special import chdtri  # this import takes longer than a fit

        freedom = self.degrees_of_freedom
        low, high = (chdtri(freedom, [0.975, 0.025]) / freedom).tolist()
        return low, high

    @cached_property
    def is_exact(self) -> bool:
        """Whether the residuals of the stars of weight above zero are rounding errors."""
        largest = (self.squares * (self.weights > 0)).max()
        return bool(largest < (_EXACT_FRACTION * self.problem.reach) ** 2)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the parameters, shape (..., p, p).

        From the covariances of the points if they were given, otherwise from the scatter of the
        residuals of the points of weight above zero. It is NaN if no degree of freedom is left to
        estimate the scatter, or if the points fit exactly. The systematic covariance is added.
        """
        variance, freedom = np.ones_like(self.chi_square), self.degrees_of_freedom
        if not self.errors_known:
            is_known = (freedom > 0) & (not self.is_exact)
            variance = self.chi_square / np.where(is_known, freedom, np.nan)
        covariance = variance[..., None, None] * self.cofactor
        shift = slice(first := self.names.index("shift-x"), first + 2)
        covariance[..., shift, shift] += self.systematic
        return covariance

    @property
    def standard_errors(self) -> FloatArray:
        """Standard errors of the parameters, shape (..., p); NaN if unknown."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))

    @validate.checked
    def interval(self, level: Size = 0.95, further: int = 0) -> FloatArray:
        """Return the lowest and highest value of each parameter, shape (..., p, 2).

        The interval follows Student's t-distribution, because the scatter of few points is an
        estimate, or the normal distribution if covariances were given. It is NaN if the
        `covariance` is.

        Parameters
        ----------
        level : float
            Probability that such an interval contains the true value, between 0 and 1.
        further : int
            Number of further parameters that the residuals determine.
        """
        validate.valid("level", level, 0 < level < 1, "a probability between 0 and 1")
        from scipy.special import stdtrit  # this import takes longer than a fit

        freedom = np.where(self.errors_known, np.inf, self.degrees_of_freedom - further)
        half = stdtrit(freedom[..., None], 0.5 * (1 + level)) * self.standard_errors
        return np.stack([self.parameters - half, self.parameters + half], axis=-1)

    @validate.checked
    def prediction_covariance(self, points: Points) -> FloatArray:
        """Return the covariance of registered points due to the transform, (..., n, 2, 2), in px^2.

        Parameters
        ----------
        points : array_like, shape (..., n, 2)
            Source points without errors, in px.
        """
        rows = self.transform.jacobian(points)
        return rows @ self.covariance[..., None, :, :] @ rows.mT


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
    """Fit the transform that maps source points onto target points.

    The fit is weighted least squares, or maximum likelihood if covariances are given. If the source
    has errors, its true points are unknowns too, and chi-square includes their distance from the
    measured points. So a scale or an affine matrix is not biased towards zero.

    A robust fit starts from medians, which tolerate wrong matches of almost half of the points, and
    leaves out each point that does not fit the others. It draws no random samples. In one field of
    a thousand it leaves out a right match. A residual is compared with the standard deviation of
    its point, if covariances or weights are given.

    Parameters
    ----------
    source, target : array_like, shape (..., n, 2)
        The same n spots in both images, in px.
    pivot : array_like, shape (..., 2)
        Centre of rotation and scale, in px, such as the principal point of the source.
    weights : array_like, shape (..., n), optional
        Relative weights, such as inverse variances; zero drops a point. Default: one. With known
        covariances only zero or one.
    model : {"shift", "rigid", "similarity", "similarity+radial", "affine"}
        Model of `Registration`.
    source_covariance, target_covariance : array_like, shape (..., n, 2, 2), optional
        Known covariances of the points, in px^2. If only one is given, the other is zero.
    robust : bool
        Whether to exclude wrong matches.

    Returns
    -------
    RegistrationFit
        Transform, residuals and covariance of the parameters.

    Raises
    ------
    ValueError
        If the counts differ, the model is unknown, or a covariance is not symmetric and positive.
    MirroredPointsError
        If the target mirrors the source and the model is not affine.
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
    problem = prepare(
        source, target, pivot, weights, model, source_covariance, target_covariance
    )
    return fit_problem(problem, robust)


@validate.checked
def fit_problem(problem: Problem, robust: Flag = False) -> RegistrationFit:
    """Fit the transform of checked points, as in `fit_registration`.

    Parameters
    ----------
    problem : Problem
        Points with their errors, the pivot and the model, from `prepare`.
    robust : bool
        Whether to exclude wrong matches.

    Returns
    -------
    RegistrationFit
        Transform, residuals and covariance of the parameters.

    Raises
    ------
    MirroredPointsError, DegenerateGeometryError
        As in `fit_registration`.

    Examples
    --------
    >>> fit_problem(prepare([[0, 0], [1, 0]], [[3, 0], [5, 0]], (0, 0))).parameters + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    used = _right_matches(problem) if robust else np.True_
    return _solved(problem, used, robust)


def _solved(
    problem: Problem, used: np.bool_ | BoolArray, robust: bool = False
) -> RegistrationFit:
    """Return the fit of the used points."""
    rejected = (problem.counts > 0) & ~used
    problem = replace(problem, counts=problem.counts * used)
    if problem.model == "similarity" and not problem.errors_known:
        parameters, residuals, cofactor = problem.closed()
        points = problem.source
        chi_square = np.vecdot(problem.counts, squared(as_complex(residuals)))
    else:
        parameters, residuals, chi_square, cofactor, points = iterated(problem)
    return RegistrationFit(
        problem,
        problem.transform(parameters),
        residuals,
        chi_square,
        cofactor,
        points,
        rejected,
        robust,
    )


def _whitened(
    problem: Problem, parameters: FloatArray, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return factors, (..., n, 2, 2), and the residuals that they scale to variance one."""
    residuals, factor, _ = problem.linearized(parameters, points)
    if problem.errors_known:
        factor = np.asarray(np.linalg.cholesky(factor).mT, dtype=np.float64)
    factor = np.sqrt(problem.counts)[..., None, None] * factor
    return factor, (factor @ residuals[..., None])[..., 0]


def _right_matches(problem: Problem) -> BoolArray:
    """Return the points that fit each other, shape (..., n)."""
    rows = thinned(problem.source.shape[-2], _MAX_TESTED)
    part = problem.rows(rows)
    weighted = part.counts > 0
    count = weighted.sum(axis=-1).min()
    # Fewer points would fit a model exactly.
    half = (len(MODELS[part.model]) + 1) // 2
    needed = max(_MIN_STARS_ROBUST, half + 2)
    if count < needed:
        raise validate.DegenerateGeometryError(
            f"source: expected {needed} or more points for a robust fit, got {count}. "
            "Add points, or pass robust=False"
        )
    source, target = (
        np.where(weighted, as_complex(points), np.nan)
        for points in (part.source, part.target)
    )
    squares, mirrored = (
        _median_squares(image, target) for image in (source, source.conj())
    )
    middle, other = _median(squares), _median(mirrored)
    if part.model == "affine":  # it may contain a mirror image
        squares = np.where((other < middle)[..., None], mirrored, squares)
    else:
        check_ratio(2 * part.source.shape[-2] - 4, middle, other)
    least = np.sort(squares)[..., half]
    right = squares <= np.maximum(_median(squares), least)[..., None]
    for _ in range(_MAX_ROUNDS):
        before, right = right, _fitting(part, right)
        if (right == before).all():
            break
    used = np.zeros(problem.counts.shape, dtype=bool)
    used[..., rows] = right
    return _fitting(problem, used)


def _fitting(problem: Problem, used: BoolArray) -> BoolArray:
    """Return the points that fit the used ones, (..., n).

    The squared residual of a point over its expected variance, divided by two variances of the
    other points, follows the F distribution with 2 and their degrees of freedom.
    """
    fit = _solved(problem, used)
    factor, residuals = _whitened(problem, fit.parameters, fit.points)
    rows = factor @ fit.transform.jacobian(fit.points)
    leverage = rows @ fit.cofactor[..., None, :, :] @ rows.mT
    # The fit follows a used point by its leverage, but no other point.
    sign = np.where(used, -1.0, 1.0)[..., None, None]
    expected = (1 + _MIN_VARIANCE) * np.eye(2) + sign * leverage
    scaled = np.linalg.solve(expected, residuals[..., None])[..., 0]
    square = np.maximum(np.vecdot(residuals, scaled), 0)
    freedom = fit.degrees_of_freedom[..., None] - 2 * used
    total = (used * np.vecdot(residuals, residuals)).sum(axis=-1, keepdims=True)
    # Residuals of exact matches are rounding errors.
    rounding = _ROUNDING * (1 + problem.reach) * np.abs(factor).max(axis=(-2, -1))
    smallest = np.maximum(freedom, 1) * (rounding**2 + np.finfo(float).tiny)
    ratio = square / np.maximum(total - used * square, smallest)
    count = np.count_nonzero(problem.counts, axis=-1, keepdims=True)
    # The logarithm of the probability of a right match.
    accepted = -0.5 * freedom * np.log1p(ratio) > np.log(FALSE_ALARM_ROBUST / count)
    return np.where(freedom > 0, accepted, used)


def _median_squares(source: ComplexArray, target: ComplexArray) -> FloatArray:
    """Return squared residuals of the similarity of the repeated median, shape (..., n).

    They are NaN for points that are NaN. If half of the points are in one place, an error is
    raised.
    """
    part = thinned(source.shape[-1], _MAX_PAIRED)
    between, across = (
        image[..., part, None] - image[..., None, part] for image in (source, target)
    )
    between[between == 0] = np.nan
    with np.errstate(invalid="ignore"):
        ratio = across / between
    # A point without partners has no median and is left out of the next one.
    real, imaginary = (_median(_median(axis)) for axis in (ratio.real, ratio.imag))
    factor = real + 1j * imaginary
    if not (np.isfinite(factor) & (factor != 0)).all():
        raise validate.DegenerateGeometryError(
            "source: expected points apart from each other, got half of them or more in one "
            "place. Check the matches"
        )
    moved = target - factor[..., None] * source
    x, y = (axis - _median(axis)[..., None] for axis in (moved.real, moved.imag))
    return np.square(x) + np.square(y)


def _median(values: FloatArray) -> FloatArray:
    """Return the upper medians along the last axis without NaN; NumPy is slower by rows."""
    ordered = np.sort(values, axis=-1)  # NaN come last
    middle = np.isfinite(ordered).sum(axis=-1, keepdims=True) // 2
    return np.take_along_axis(ordered, middle, axis=-1)[..., 0]
