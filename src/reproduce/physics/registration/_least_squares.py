"""Least squares for all models: the similarity in closed form, the others by Gauss-Newton.

Shapes, units and models are those of `fit` and `transforms`. Source points are x, target points y,
the transform f, its parameters u.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics import validate
from reproduce.physics.registration.transforms import (
    MODELS,
    ComplexArray,
    Registration,
    _linear_part,
    _parameter_names,
    as_complex,
    as_points,
)
from reproduce.physics.validate import FloatArray, Point, Points, Weights

# Relative rounding error of a sum of many numbers.
_ROUNDING_ERROR = 64 * float(np.finfo(np.float64).eps)
# Probability that noise only looks like a mirror image.
_MIRROR_PROBABILITY = 1e-6
_MIRRORED = (
    "target: expected no mirror image, got a mirror image of the source points. Replace x of one "
    "image by the width minus x (flip one axis), or fit the affine model"
)
_MAX_STEPS = 60
# Root mean square movement at which the iteration stops, in px.
_LAST_MOVEMENT = 1e-11
# Smallest eigenvalue of a normal matrix with unit diagonal.
_MIN_EIGENVALUE = 1e-13


def thinned(count: int, most: int) -> slice | NDArray[np.intp]:
    """Return at most `most` of `count` rows, spread evenly."""
    return slice(None) if count <= most else np.linspace(0, count - 1, most).astype(int)


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of a fit; parameters in the order of `transforms.MODELS`."""

    parameters: FloatArray  # (..., p)
    residuals: FloatArray  # (..., n, 2), target minus transformed source, in px
    chi_square: FloatArray  # (...), of both images if covariances are known
    cofactor: FloatArray  # (..., p, p), inverse of the sum of J^T W J
    points: FloatArray  # (..., n, 2), estimated true source points, in px


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
    source_covariance: FloatArray | None = None

    def rows(self, rows: Any) -> Problem:
        """Return the problem of some of the points."""
        error = self.source_covariance
        return replace(
            self,
            source=self.source[..., rows, :],
            target=self.target[..., rows, :],
            counts=self.counts[..., rows],
            target_covariance=self.target_covariance[..., rows, :, :],
            source_covariance=None if error is None else error[..., rows, :, :],
        )

    def transformed(self, parameters: FloatArray, points: FloatArray) -> FloatArray:
        """Return registered points, shape (..., n, 2), in px, for these parameters."""
        return Registration._unchecked(self.model, parameters, self.pivot)._apply(
            points
        )

    def with_weights(self, weights: FloatArray) -> Problem:
        """Return the same problem with its weights multiplied by `weights`."""
        return replace(self, counts=self.counts * weights)


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
    n = source.shape[-2]
    counts = validate.weights_for(weights, n)
    batch = np.broadcast_shapes(
        source.shape[:-2], target.shape[:-2], pivot.shape[:-1], counts.shape[:-1]
    )
    known = [
        None if one is None else _covariance(name, one, (*batch, n))
        for name, one in (
            ("source_covariance", source_covariance),
            ("target_covariance", target_covariance),
        )
    ]
    errors_known = any(one is not None for one in known)
    missing = np.broadcast_to((not errors_known) * np.eye(2), (*batch, n, 2, 2))
    return Problem(
        np.broadcast_to(source, (*batch, n, 2)),
        np.broadcast_to(target, (*batch, n, 2)),
        np.broadcast_to(pivot, (*batch, 2)),
        model,
        np.broadcast_to(counts, (*batch, n)),
        errors_known,
        missing if known[1] is None else known[1],
        known[0],
    )


def _covariance(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Return checked covariances of the points, shape (..., n, 2, 2)."""
    matrices = validate.finite_array(name, value, shape=(2, 2))
    try:
        matrices = np.broadcast_to(matrices, (*shape, 2, 2))
    except ValueError as error:
        raise ValueError(
            f"{name}: expected one matrix or one for each of {shape[-1]} points, got shape "
            f"{matrices.shape}. Pass shape (2, 2) or (n, 2, 2)"
        ) from error
    asymmetry = np.abs(matrices - matrices.mT).max()
    if (
        asymmetry > 1e-12 * np.abs(matrices).max()
        or np.linalg.eigvalsh(matrices).min() <= 0
    ):
        raise ValueError(
            f"{name}: expected symmetric matrices with variances above zero, got another one. "
            "Leave it out for an image without errors"
        )
    return matrices


def solve(problem: Problem) -> Solution:
    """Return the parameters of the least chi-square, by Gauss-Newton steps.

    If the source has errors, its true points s are unknowns in addition to the parameters u.
    Chi-square is then the sum of (x - s)^T Cx^-1 (x - s) + (y - f(s; u))^T Cy^-1 (y - f(s; u)),
    and its minimum is the maximum of the likelihood. Each step eliminates the points one by one:
    with A = df/ds, e = y - f(s; u) - A (x - s) has the covariance Cy + A Cx A^T, the parameters
    follow from e by weighted least squares, and s = x + Cx A^T (Cy + A Cx A^T)^-1 e.

    The start is the closed form of a simpler model. Points that leave a parameter free raise
    `DegenerateGeometryError`. A similarity of points without known errors is that closed form.
    """
    if problem.model == "similarity" and not problem.errors_known:
        return _closed_similarity(problem)
    parameters, points = _starting_point(problem), problem.source
    limit = _LAST_MOVEMENT * (1 + np.abs(problem.target).max())
    flat = (*problem.source.shape[:-2], -1)
    for _ in range(_MAX_STEPS):
        offsets = points - problem.pivot[..., None, :]
        carry = _local_matrix(problem.model, parameters, offsets)
        weight = _information(problem, carry)
        combined = _combined_residuals(problem, parameters, points, carry)
        rows = model_jacobian(problem.model, parameters, offsets)
        weighted = problem.counts[..., None, None] * weight @ rows
        count = rows.shape[-1]
        step, cofactor = gauss_newton(
            rows.reshape(*flat, count),
            combined.reshape(flat),
            weighted.reshape(*flat, count),
        )
        moved = (rows @ step[..., None, :, None])[..., 0]
        combined = combined - moved
        before, points = points, _true_points(problem, carry, weight, combined)
        parameters = parameters + step
        largest = max(
            np.sqrt(np.square(one).mean(axis=(-2, -1))).max()
            for one in (moved, points - before)
        )
        if largest < limit:
            break
    else:
        raise validate.DegenerateGeometryError(
            f"target: expected a fit that converges within {_MAX_STEPS} steps, got a last step of "
            f"{largest:g} px. Check the matches, or fit a simpler model"
        )
    squares = np.vecdot(combined, (weight @ combined[..., None])[..., 0])
    return Solution(
        parameters,
        problem.target - problem.transformed(parameters, problem.source),
        np.asarray((problem.counts * squares).sum(axis=-1)),
        cofactor,
        points,
    )


def gauss_newton(
    rows: FloatArray, residuals: FloatArray, weighted: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the step (..., p) and the inverse normal matrix (..., p, p) of rows (..., m, p)."""
    normal = rows.mT @ weighted
    pull = (weighted.mT @ residuals[..., None])[..., 0]
    size = np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1))
    outer = size[..., :, None] * size[..., None, :]
    scaled = normal / np.where(outer > 0, outer, 1)
    # The columns of the scaled matrix have length one.
    if (
        not (size > 0).all()
        or (np.linalg.eigvalsh(scaled)[..., 0] < _MIN_EIGENVALUE).any()
    ):
        raise validate.DegenerateGeometryError(
            "points: expected points that fix every parameter of the model, got too few, "
            "coincident or collinear ones. Add points across the field, or fit a simpler model"
        )
    inverse = np.linalg.inv(scaled) / outer
    return (inverse @ pull[..., None])[..., 0], inverse


def _closed_similarity(problem: Problem) -> Solution:
    """Return the weighted least-squares similarity.

    The model (17), (18) is linear in k cos(theta), k sin(theta) and the shift, so its
    least-squares solution needs no iteration and no starting value.
    """
    weights, origin = problem.counts, as_complex(problem.pivot)
    total = weights.sum(axis=-1)
    # Sums of squares about the centroids lose no digits, wherever the pivot is.
    offsets, centroid = _centred(problem.source, weights)
    targets, target_centroid = _centred(problem.target, weights)
    weighted = weights * offsets
    spread = np.vecdot(offsets, weighted).real
    _check_spread("source", spread, total, centroid)
    # Displacements are small if both images are similar, so their sums keep their digits.
    moved, drift = _centred(problem.target - problem.source, weights)
    change = np.vecdot(weighted, moved) / spread
    factor = 1.0 + change
    _check_not_mirrored(offsets, targets, weights)
    _check_spread("target", _squared(factor) * spread, total, target_centroid)
    lever = centroid - origin
    shift, scale = change * lever - drift, np.abs(factor)
    residuals = moved - change[..., None] * offsets
    # Scale, rotation and the image of the centroid are uncorrelated. The shift depends on scale and
    # rotation through the lever from the pivot to the centroid.
    cofactor, lever = np.zeros((*scale.shape, 4, 4)), factor / scale * lever
    cofactor[..., 0, 0] = 1 / spread
    cofactor[..., 1, 1] = 1 / (spread * scale**2)
    cofactor[..., 0, 2:] = cofactor[..., 2:, 0] = as_points(lever / spread)
    cofactor[..., 1, 2:] = cofactor[..., 2:, 1] = as_points(
        1j * lever / (spread * scale)
    )
    cofactor[..., [2, 3], [2, 3]] = (1 / total + _squared(lever) / spread)[..., None]
    return Solution(
        np.stack([scale, np.angle(factor), shift.real, shift.imag], axis=-1),
        as_points(residuals),
        np.asarray((weights * _squared(residuals)).sum(axis=-1)),
        cofactor,
        problem.source,
    )


def _centred(
    points: FloatArray, weights: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    numbers = as_complex(points)
    centroid = (weights * numbers).sum(axis=-1) / weights.sum(axis=-1)
    return numbers - centroid[..., None], centroid


def _squared(numbers: ComplexArray) -> FloatArray:
    return numbers.real**2 + numbers.imag**2


def _check_spread(
    name: str, spread: FloatArray, total: FloatArray, centroid: ComplexArray
) -> None:
    # The rounding error of coincident points grows with their distance from the origin.
    if not (spread > total * _ROUNDING_ERROR**2 * _squared(centroid)).all():
        raise validate.DegenerateGeometryError(
            f"{name}: expected at least two different points of weight above zero, got one point "
            "or coincident points. Add points across the field, row by row in both images"
        )


def _check_not_mirrored(
    offsets: ComplexArray, targets: ComplexArray, weights: FloatArray
) -> None:
    """Raise `MirroredPointsError` if the target mirrors the source; both minus their means.

    The residual of a similarity of the mirrored source is then so much smaller than that of the
    source itself that chance does not explain it: for noise only, and a source that is its own
    mirror image, the ratio follows the F distribution. Two points are never a mirror image.
    """
    weighted = weights * targets
    along, across = (
        np.abs(np.vecdot(side, weighted)) for side in (offsets, offsets.conj())
    )
    suspect = across > along
    if not suspect.any():
        return
    spread, whole = (
        (weights * _squared(one)).sum(axis=-1) for one in (offsets, targets)
    )
    freedom = 2 * np.count_nonzero(weights, axis=-1) - 4
    # A rounding error counts as a residual.
    residual, mirrored = (
        whole - part**2 / spread + _ROUNDING_ERROR * whole for part in (along, across)
    )
    found = suspect & (freedom > 0) & (residual > mirror_limit(freedom) * mirrored)
    if found.any():
        where = f" (in {int(found.sum())} of {found.size} sets)" if found.ndim else ""
        raise validate.MirroredPointsError(_MIRRORED + where)


def mirror_limit(freedom: Any) -> FloatArray:
    """Return the largest ratio of the residuals of an image and its mirror image in noise."""
    from scipy.special import fdtri  # this import takes longer than most fits

    freedom = np.maximum(freedom, 1)
    return np.asarray(fdtri(freedom, freedom, 1 - _MIRROR_PROBABILITY))


def _starting_point(problem: Problem) -> FloatArray:
    """Return parameters near the minimum, shape (..., p), from a closed form."""
    if problem.model == "affine":  # linear: any start will do
        unit = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
        return np.broadcast_to(unit, (*problem.source.shape[:-2], 6))
    if problem.model == "shift":  # linear too, but must not mirror
        offsets, targets = (
            _centred(one, problem.counts)[0] for one in (problem.source, problem.target)
        )
        _check_not_mirrored(offsets, targets, problem.counts)
        return np.zeros(problem.pivot.shape)
    return from_similarity(problem.model, _closed_similarity(problem).parameters)


def from_similarity(model: str, closed: FloatArray) -> FloatArray:
    """Return the parameters of a model that match a similarity (..., 4), at least nearly."""
    if model == "affine":
        flat = _linear_part("similarity", closed).reshape(*closed.shape[:-1], 4)
        return np.concatenate([flat, closed[..., 2:]], axis=-1)
    if model == "similarity+radial":
        return np.concatenate([closed, np.zeros_like(closed[..., :1])], axis=-1)
    return closed[..., -len(MODELS[model]) :]


def _combined_residuals(
    problem: Problem, parameters: FloatArray, points: FloatArray, carry: FloatArray
) -> FloatArray:
    """Return y - f(s; u) - A (x - s), shape (..., n, 2), in px: the residuals of both images."""
    residuals = problem.target - problem.transformed(parameters, points)
    if problem.source_covariance is None:
        return residuals
    return residuals - (carry @ (problem.source - points)[..., None])[..., 0]


def _true_points(
    problem: Problem, carry: FloatArray, weight: FloatArray, combined: FloatArray
) -> FloatArray:
    """Return estimates of the true source points from combined residuals, (..., n, 2), in px."""
    if problem.source_covariance is None:
        return problem.source
    pulled = carry.mT @ (weight @ combined[..., None])
    return problem.source + (problem.source_covariance @ pulled)[..., 0]


def model_jacobian(
    model: str, parameters: FloatArray, offsets: FloatArray
) -> FloatArray:
    """Return the derivatives of points at offsets from the pivot, shape (..., n, 2, p).

    In px per unit of the parameter.
    """
    names = MODELS[model]
    batch = np.broadcast_shapes(parameters.shape[:-1], offsets.shape[:-2])
    rows = np.zeros((*batch, *offsets.shape[-2:], len(names)))
    start = names.index("shift-x")
    rows[..., 0, start] = rows[..., 1, start + 1] = -1
    if model == "affine":
        rows[..., 0, 0:2] = rows[..., 1, 2:4] = offsets
    if "rotation" not in names:
        return rows
    turn = names.index("rotation")
    turned = offsets @ _linear_part("rigid", parameters[..., turn : turn + 1]).mT
    if model != "rigid":
        scale = parameters[..., 0, None, None]
        if model == "similarity+radial":
            squared = np.square(offsets).sum(axis=-1, keepdims=True)
            rows[..., -1] = scale * turned * squared
            turned = turned * (1 + parameters[..., -1, None, None] * squared)
        rows[..., 0] = turned
        turned = scale * turned
    rows[..., 0, turn], rows[..., 1, turn] = -turned[..., 1], turned[..., 0]
    return rows


def _information(problem: Problem, carry: FloatArray) -> FloatArray:
    """Return the inverse covariance of each combined residual, shape (..., n, 2, 2), in px^-2.

    It does not include the weights. Unknown covariances give unit matrices.
    """
    if not problem.errors_known:
        return problem.target_covariance
    total = problem.target_covariance
    if problem.source_covariance is not None:
        total = total + carry @ problem.source_covariance @ carry.mT
    return np.asarray(np.linalg.inv(total), dtype=np.float64)


def _local_matrix(
    model: str, parameters: FloatArray, offsets: FloatArray
) -> FloatArray:
    """Return A, the derivative of registered points by source points, (..., n, 2, 2)."""
    matrix = _linear_part(model, parameters)[..., None, :, :]
    if model != "similarity+radial":
        return np.broadcast_to(matrix, (*offsets.shape, 2))
    c = parameters[..., -1][..., None, None, None]
    squared = np.square(offsets).sum(axis=-1)[..., None, None]
    bent = 2 * c * offsets[..., None] * offsets[..., None, :]
    return matrix @ ((1 + c * squared) * np.eye(2) + bent)


def residuals_at(
    problem: Problem, parameters: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return residuals, (m, n, 2) in px, and their inverse covariances, (..., n, 2, 2).

    At any parameters, shape (m, p), of one set of n points. The residual is target minus
    transformed source, and the inverse covariance that of `_information`.

    Examples
    --------
    >>> problem = prepare([[0, 0], [9, 0]], [[1, 0], [9, 1]], (0, 0))
    >>> residuals_at(problem, np.array([[1.0, 0.0, 0.0, 0.0]]))[0]
    array([[[1., 0.],
            [0., 1.]]])
    """
    points = np.broadcast_to(problem.source, (len(parameters), *problem.source.shape))
    carry = _local_matrix(problem.model, parameters, points - problem.pivot)
    return problem.target - problem.transformed(parameters, points), _information(
        problem, carry
    )


def whitened(
    problem: Problem, parameters: FloatArray, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return factors, (..., n, 2, 2), and the residuals that they scale to variance one."""
    carry = _local_matrix(
        problem.model, parameters, points - problem.pivot[..., None, :]
    )
    residuals = _combined_residuals(problem, parameters, points, carry)
    factor = _information(problem, carry)
    if problem.errors_known:
        factor = np.asarray(np.linalg.cholesky(factor).mT, dtype=np.float64)
    factor = np.sqrt(problem.counts)[..., None, None] * factor
    return factor, (factor @ residuals[..., None])[..., 0]
