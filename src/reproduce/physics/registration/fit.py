"""Registering anyone's points: five models, errors in both images, outliers.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); the leading axes are a batch of registrations. Models, parameters and their order are those
of `transforms`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics.registration._robust import outlier_weights
from reproduce.physics.registration.closed_form import (
    _checked,
    _closed_similarity,
    _single,
    _Solution,
    prepare,
    solve,
)
from reproduce.physics.registration.transforms import Registration, _parameter_names
from reproduce.physics.validate import DegenerateGeometryError, FloatArray, number_array


@dataclass(frozen=True, eq=False)
class RegistrationFit:
    """A fitted registration, its uncertainty and what it leaves over.

    Attributes
    ----------
    transform : Registration
        Can be applied, undone, inverted and composed.
    residuals : ndarray, shape (..., n, 2)
        Target minus transformed source, in px.
    chi_square : ndarray, shape (...)
        Weighted sum of squared deviations, of both images where covariances are known.
    cofactor : ndarray, shape (..., p, p)
        Inverse normal matrix.
    weights : ndarray, shape (..., n), or None
        How much each point counted: those given, and zero where a robust fit left a point out.
    errors_known : bool
        Whether covariances of the points were given.
    """

    transform: Registration
    residuals: FloatArray
    chi_square: FloatArray
    cofactor: FloatArray
    weights: FloatArray | None
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
        count = self.parameters.shape[-1]
        if self.weights is not None:
            return np.asarray(2 * np.count_nonzero(self.weights, axis=-1) - count)
        return np.asarray(2 * self.residuals.shape[-2] - count)

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
        if self.errors_known:
            return self.cofactor
        freedom = self.degrees_of_freedom
        if (freedom <= 0).any():
            raise DegenerateGeometryError(
                f"covariance: expected more coordinates than the {len(self.names)} parameters, "
                "got none to spare; add points, or give their covariances"
            )
        return (self.chi_square / freedom)[..., None, None] * self.cofactor

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviations of the parameters, shape (..., p); NaN where no point is to spare."""
        if self.errors_known:
            return np.sqrt(np.diagonal(self.cofactor, axis1=-2, axis2=-1))
        freedom = np.where(self.degrees_of_freedom > 0, self.degrees_of_freedom, np.nan)
        variances = np.diagonal(self.cofactor, axis1=-2, axis2=-1)
        return np.sqrt((self.chi_square / freedom)[..., None] * variances)

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
        from scipy.special import ndtri, stdtrit  # only now: its import takes longer than most fits

        upper = 0.5 * (1 + level)
        freedom = np.maximum(self.degrees_of_freedom, 1)
        factor = ndtri(upper) if self.errors_known else stdtrit(freedom, upper)[..., None]
        half = factor * self.standard_errors
        return np.stack([self.parameters - half, self.parameters + half], axis=-1)


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
    _parameter_names(model)
    plain = source_covariance is None and target_covariance is None and not robust
    if model == "similarity" and plain:
        origin, kept = number_array("pivot", pivot), None
        found = _single(source, target, origin) if weights is None else None
        if found is None:
            first, second, origin, kept = _checked(source, target, pivot, weights)
            found = _closed_similarity(first, second, origin, kept)
        return _fit(model, found, origin, kept, False)
    problem = prepare(source, target, pivot, weights, model)
    problem = problem.with_covariances(source_covariance, target_covariance)
    weighted = problem.with_weights(outlier_weights(problem)) if robust else problem
    solution = solve(weighted)
    return _fit(model, solution, problem.pivot, weighted.weights, problem.errors_known)


def _fit(model: str, found: _Solution, pivot: FloatArray, *others: Any) -> RegistrationFit:
    transform = Registration._unchecked(model, found.parameters, pivot)
    return RegistrationFit(transform, found.residuals, found.chi_square, found.cofactor, *others)
