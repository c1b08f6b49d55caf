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

_ROUNDING = 64 * float(np.finfo(np.float64).eps)
# How often noise alone may be taken for a mirror image.
_CHANCE = 1e-6
_MIRRORED = (
    "the target points are a mirror image of the source points, as behind a mirror or with a "
    "reversed readout; flip one axis of one of the two: take the width less x in place of x, or "
    "fit the affine model, which may mirror"
)
_STEPS = 60
_MOVEMENT = 1e-11  # px, root mean square: far below what a centroid can mean
_DEPENDENT = 1e-13


def thinned(count: int, most: int) -> slice | NDArray[np.intp]:
    """Return so many of `count` rows at most, spread evenly."""
    return slice(None) if count <= most else np.linspace(0, count - 1, most).astype(int)


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a fit ended; parameters in the order of `transforms.MODELS`."""

    parameters: FloatArray  # (..., p)
    residuals: FloatArray  # (..., n, 2), target minus transformed source, in px
    chi_square: FloatArray  # (...), of both images where covariances are known
    cofactor: FloatArray  # (..., p, p), the inverse of the sum of J^T W J
    points: FloatArray  # (..., n, 2), where the source points truly are, in px


@dataclass(frozen=True, eq=False)
class Problem:
    """What is fitted to what, checked; all arrays carry the full batch shape."""

    source: FloatArray  # (..., n, 2), in px
    target: FloatArray
    pivot: FloatArray  # (..., 2), in px
    model: str  # a key of `MODELS`
    weights: FloatArray | None = None  # (..., n); None where every point counts alike
    source_covariance: FloatArray | None = None  # (..., n, 2, 2), in px^2
    target_covariance: FloatArray | None = None

    @property
    def errors_known(self) -> bool:
        """Whether the covariance of either image is known."""
        return self.source_covariance is not None or self.target_covariance is not None

    @property
    def counts(self) -> FloatArray:
        """How much each point counts, shape (..., n)."""
        return np.ones(self.source.shape[:-1]) if self.weights is None else self.weights

    def of(self, rows: NDArray[np.intp]) -> Problem:
        """Return the problem of some of the points."""
        axes = {"source": -2, "target": -2, "weights": -1}
        axes |= {"source_covariance": -3, "target_covariance": -3}
        every = ((name, getattr(self, name), axis) for name, axis in axes.items())
        some: Any = {
            name: np.take(a, rows, axis=axis)
            for name, a, axis in every
            if a is not None
        }
        return replace(self, **some)

    def transformed(self, parameters: FloatArray, points: FloatArray) -> FloatArray:
        """Return points, shape (..., n, 2) in px, laid over the target with these parameters."""
        return Registration._unchecked(self.model, parameters, self.pivot)._apply(
            points
        )

    def with_weights(self, weights: FloatArray) -> Problem:
        """Return the same problem with these weights times its own."""
        return replace(self, weights=self.counts * weights)


@validate.checked
def prepare(
    source: Points,
    target: Points,
    pivot: Point,
    weights: Weights = None,
    model: str = "similarity",
    **covariances: ArrayLike | None,
) -> Problem:
    """Check the arguments, those of `fit_registration`, and bring them to one batch shape.

    Examples
    --------
    >>> prepare([[0, 0], [9, 0]], [[1, 0], [9, 1]], (0, 0)).counts
    array([1., 1.])
    """
    _parameter_names(model)
    n = source.shape[-2]
    kept = None if weights is None else validate.weights_for(weights, n)
    shapes = () if kept is None else kept.shape[:-1]
    batch = np.broadcast_shapes(
        source.shape[:-2], target.shape[:-2], pivot.shape[:-1], shapes
    )
    return Problem(
        np.broadcast_to(source, (*batch, n, 2)),
        np.broadcast_to(target, (*batch, n, 2)),
        np.broadcast_to(pivot, (*batch, 2)),
        model,
        None if kept is None else np.broadcast_to(kept, (*batch, n)),
        **{
            k: _covariance(k, v, (*batch, n))
            for k, v in covariances.items()
            if v is not None
        },
    )


def _covariance(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Check covariances of the points, and bring them to shape (..., n, 2, 2)."""
    matrices = validate.finite_array(name, value, shape=(2, 2))
    try:
        matrices = np.broadcast_to(matrices, (*shape, 2, 2))
    except ValueError as error:
        raise ValueError(
            f"{name}: expected one matrix or one for each of {shape[-1]} points, got shape "
            f"{matrices.shape}; give shape (2, 2) or (n, 2, 2)"
        ) from error
    lopsided = np.abs(matrices - matrices.mT).max()
    positive = (np.linalg.eigvalsh(matrices)[..., 0] > 0).all()
    if lopsided > 1e-12 * np.abs(matrices).max() or not positive:
        raise ValueError(
            f"{name}: expected symmetric matrices with variances above zero, got one that is not; "
            "leave it out for an image without errors"
        )
    return matrices


def solve(problem: Problem) -> Solution:
    """Find the parameters that make chi-square least, by Gauss-Newton steps.

    Where the source has errors, its true points s are unknowns beside the parameters u. Chi-square
    is then the sum of (x - s)^T Cx^-1 (x - s) + (y - f(s; u))^T Cy^-1 (y - f(s; u)), and its least
    value is the maximum of the likelihood. In each step the points are eliminated one by one: with
    A = df/ds, e = y - f(s; u) - A (x - s) has the covariance Cy + A Cx A^T, the parameters follow
    from e by weighted least squares, and s = x + Cx A^T (Cy + A Cx A^T)^-1 e from what is left.

    It starts from the closed form of a simpler model, and refuses points that leave a parameter
    free. A similarity of points without known errors is that closed form.
    """
    if problem.model == "similarity" and not problem.errors_known:
        return _closed_similarity(problem)
    parameters, points = _starting_point(problem), problem.source
    limit = _MOVEMENT * (1 + np.abs(problem.target).max())
    flat = (*problem.source.shape[:-2], -1)
    for _ in range(_STEPS):
        carry = local_matrix(
            problem.model, parameters, points - problem.pivot[..., None, :]
        )
        weight = information(problem, carry)
        left = combined_residuals(problem, parameters, points, carry)
        rows = model_jacobian(
            problem.model, parameters, points - problem.pivot[..., None, :]
        )
        weighted = problem.counts[..., None, None] * weight @ rows
        count = rows.shape[-1]
        step, cofactor = gauss_newton(
            rows.reshape(*flat, count),
            left.reshape(flat),
            weighted.reshape(*flat, count),
        )
        moved = (rows @ step[..., None, :, None])[..., 0]
        renewed = _true_points(problem, carry, weight, left - moved)
        largest = np.maximum(_length(moved), _length(renewed - points)).max()
        parameters, points = parameters + step, renewed
        if largest < limit:
            break
    else:
        raise validate.DegenerateGeometryError(
            f"expected the fit to settle within {_STEPS} steps, got a last step of "
            f"{float(largest):g} px; check the matches, or fit a simpler model"
        )
    carry = local_matrix(
        problem.model, parameters, points - problem.pivot[..., None, :]
    )
    left = combined_residuals(problem, parameters, points, carry)
    weighted = information(problem, carry) @ left[..., None]
    chi_square = (problem.counts * (left * weighted[..., 0]).sum(axis=-1)).sum(axis=-1)
    residuals = problem.target - problem.transformed(parameters, problem.source)
    return Solution(parameters, residuals, np.asarray(chi_square), cofactor, points)


def gauss_newton(
    rows: FloatArray, residuals: FloatArray, weighted: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the step (..., p) and the inverse normal matrix (..., p, p) of rows (..., m, p)."""
    normal = rows.mT @ weighted
    pull = (weighted.mT @ residuals[..., None])[..., 0]
    size = np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1))
    outer = size[..., :, None] * size[..., None, :]
    scaled = normal / np.where(outer > 0, outer, 1)
    # With columns of length one the smallest eigenvalue says how near to dependent they are.
    if not (size > 0).all() or (np.linalg.eigvalsh(scaled)[..., 0] < _DEPENDENT).any():
        raise validate.DegenerateGeometryError(
            "expected points that fix every parameter of the model, got too few, coincident or "
            "aligned ones; add spots across the field, or fit a simpler model"
        )
    inverse = np.linalg.inv(scaled) / outer
    return (inverse @ pull[..., None])[..., 0], inverse


def _closed_similarity(problem: Problem) -> Solution:
    """Return the weighted least-squares similarity.

    The model (17), (18) is linear in k cos(theta), k sin(theta) and the shift, so its
    least-squares solution needs no iteration and no starting value. Points that mirror each
    other or leave the scale free or zero are refused.
    """
    weights, origin = problem.counts, as_complex(problem.pivot)
    total = weights.sum(axis=-1)
    # Sums of squares about the centroids lose no digits, wherever the pivot lies.
    offsets, centroid = _centred(problem.source, weights)
    targets, target_centroid = _centred(problem.target, weights)
    weighted = weights * offsets
    spread = np.vecdot(offsets, weighted).real
    _refuse_vanished("source", spread, total, centroid)
    # What each point is moved is small where two images are alike: its sums keep their digits.
    moved, drift = _centred(problem.target - problem.source, weights)
    change = np.vecdot(weighted, moved) / spread
    factor = 1.0 + change
    _refuse_mirrored(offsets, targets, weights)
    _refuse_vanished("target", _squared(factor) * spread, total, target_centroid)
    shift = change * (centroid - origin) - drift
    scale = np.abs(factor)
    left = moved - change[..., None] * offsets
    return Solution(
        np.stack([scale, np.angle(factor), shift.real, shift.imag], axis=-1),
        as_points(left),
        np.asarray((weights * _squared(left)).sum(axis=-1)),
        _cofactors(factor / scale * (centroid - origin), spread, scale, total),
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


def _refuse_vanished(
    name: str, spread: FloatArray, total: FloatArray, centroid: ComplexArray
) -> None:
    # What rounding leaves of coincident points grows with their distance from the origin.
    if not (spread > total * _ROUNDING**2 * _squared(centroid)).all():
        raise validate.DegenerateGeometryError(
            f"{name}: expected at least two different points of weight above zero whose pattern "
            "fixes scale and rotation, got one point or coincident points; add "
            "spots across the field of view and pair them row by row"
        )


def _refuse_mirrored(
    offsets: ComplexArray, targets: ComplexArray, weights: FloatArray
) -> None:
    """Refuse target points that are a mirror image of the source points; all less their means.

    They are if a similarity of the mirrored source leaves so much less than one of the source
    itself that chance does not explain it: for noise alone, and a source that is its own mirror
    image, the ratio of what the two leave follows the F law. Two points never tell.
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
    # What is lost in rounding counts as left over.
    left, mirrored = (
        whole - part**2 / spread + _ROUNDING * whole for part in (along, across)
    )
    found = suspect & (freedom > 0) & (left > mirror_limit(freedom) * mirrored)
    if found.any():
        where = f"in {int(found.sum())} of {found.size} sets: " if found.ndim else ""
        raise validate.MirroredPointsError(where + _MIRRORED)


def mirror_limit(freedom: Any) -> FloatArray:
    """Return how many times as much noise alone leaves of a right image as of its mirror image."""
    from scipy.special import fdtri  # only now: its import takes longer than most fits

    freedom = np.maximum(freedom, 1)
    return np.asarray(fdtri(freedom, freedom, 1 - _CHANCE))


def _cofactors(
    lever: ComplexArray, spread: FloatArray, scale: FloatArray, total: FloatArray
) -> FloatArray:
    # Scale, rotation and the image of the centroid are uncorrelated; the shift picks up scale
    # and rotation through the lever from the pivot to the centroid.
    matrix = np.zeros((*lever.shape, 4, 4))
    matrix[..., 0, 0] = 1 / spread
    matrix[..., 1, 1] = 1 / (spread * scale**2)
    matrix[..., 0, 2:] = matrix[..., 2:, 0] = as_points(lever / spread)
    matrix[..., 1, 2:] = matrix[..., 2:, 1] = as_points(1j * lever / (spread * scale))
    matrix[..., 2, 2] = matrix[..., 3, 3] = 1 / total + _squared(lever) / spread
    return matrix


def _starting_point(problem: Problem) -> FloatArray:
    """Return parameters near the minimum, shape (..., p), from a closed form."""
    if problem.model == "shift":
        offsets, centroid = _centred(problem.source, problem.counts)
        targets, target_centroid = _centred(problem.target, problem.counts)
        _refuse_mirrored(offsets, targets, problem.counts)
        return as_points(centroid - target_centroid)
    if problem.model == "affine":  # which may mirror, and is linear: any start will do
        unit = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
        return np.broadcast_to(unit, (*problem.source.shape[:-2], 6))
    return from_similarity(problem.model, _closed_similarity(problem).parameters)


def from_similarity(model: str, closed: FloatArray) -> FloatArray:
    """Return a model's parameters that do what a similarity (..., 4) does, or nearly so."""
    if model == "similarity+radial":
        return np.concatenate([closed, np.zeros_like(closed[..., :1])], axis=-1)
    if model == "affine":
        flat = _linear_part("similarity", closed).reshape(*closed.shape[:-1], 4)
        return np.concatenate([flat, closed[..., 2:]], axis=-1)
    return closed[..., -len(MODELS[model]) :]


def combined_residuals(
    problem: Problem, parameters: FloatArray, points: FloatArray, carry: FloatArray
) -> FloatArray:
    """Return y - f(s; u) - A (x - s), shape (..., n, 2), in px: what both images leave over."""
    left = problem.target - problem.transformed(parameters, points)
    if problem.source_covariance is None:
        return left
    return left - (carry @ (problem.source - points)[..., None])[..., 0]


def _true_points(
    problem: Problem, carry: FloatArray, weight: FloatArray, left: FloatArray
) -> FloatArray:
    """Return where the source points truly are, as far as `left` tells, (..., n, 2), in px."""
    if problem.source_covariance is None:
        return problem.source
    pulled = carry.mT @ (weight @ left[..., None])
    return problem.source + (problem.source_covariance @ pulled)[..., 0]


def model_jacobian(
    model: str, parameters: FloatArray, offsets: FloatArray
) -> FloatArray:
    """Return the derivatives by the parameters of points at offsets from the pivot, (..., n, 2, p).

    In px per unit of the parameter.
    """
    names = MODELS[model]
    batch = np.broadcast_shapes(parameters.shape[:-1], offsets.shape[:-2])
    rows = np.zeros((*batch, *offsets.shape[-2:], len(names)))
    start = names.index("shift-x")
    rows[..., 0, start] = rows[..., 1, start + 1] = -1
    if model == "affine":
        rows[..., 0, 0:2] = rows[..., 1, 2:4] = offsets
        return rows
    if model == "shift":
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
        total = total + carry @ problem.source_covariance @ carry.mT
    return np.linalg.inv(total)


def local_matrix(model: str, parameters: FloatArray, offsets: FloatArray) -> FloatArray:
    """Return A, how transformed points at offsets from the pivot move with them, (..., n, 2, 2)."""
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
    transformed source, and the inverse covariance that of `information`.

    Examples
    --------
    >>> problem = prepare([[0, 0], [9, 0]], [[1, 0], [9, 1]], (0, 0))
    >>> residuals_at(problem, np.array([[1.0, 0.0, 0.0, 0.0]]))[0]
    array([[[1., 0.],
            [0., 1.]]])
    """
    points = np.broadcast_to(problem.source, (len(parameters), *problem.source.shape))
    carry = local_matrix(problem.model, parameters, points - problem.pivot)
    return problem.target - problem.transformed(parameters, points), information(
        problem, carry
    )


def _length(movement: FloatArray) -> FloatArray:
    return np.sqrt(np.square(movement).mean(axis=(-2, -1)))
