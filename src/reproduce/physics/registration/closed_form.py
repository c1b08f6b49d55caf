"""The least-squares similarity in closed form, and how far two sets of points lie apart.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); the leading axes are a batch. Parameters are in the order scale k, rotation theta (radians),
shift x, shift y (px).

The steps of a registration fit: what it is given, its Jacobian, Gauss-Newton to the minimum.

Shapes, units and models are those of `fit` and `transforms`. Source points are x, target points y,
the transform f, its parameters u.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.registration.transforms import (
    MODELS,
    ComplexArray,
    Registration,
    _linear_part,
    as_complex,
    as_points,
)
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    MirroredPointsError,
    Point,
    Points,
    Weights,
    checked,
    finite_array,
    number_array,
    weights_for,
)

_ROUNDING = 64 * float(np.finfo(np.float64).eps)
# How often noise alone may be taken for a mirror image.
_CHANCE = 1e-6
_MIRRORED = (
    "the target points are a mirror image of the source points, as behind a mirror or with a "
    "reversed readout; flip one axis of one of the two: take the width less x in place of x, or "
    "fit the affine model, which may mirror"
)


@dataclass(frozen=True, eq=False)
class _Solution:
    """Where a fit ended; parameters in the order of `transforms.MODELS`."""

    parameters: FloatArray  # (..., p)
    residuals: FloatArray  # (..., n, 2), target minus transformed source, in px
    chi_square: FloatArray  # (...), of both images where covariances are known
    cofactor: FloatArray  # (..., p, p), the inverse of the sum of J^T W J
    points: FloatArray  # (..., n, 2), where the source points truly are, in px


def _closed_similarity(
    source: FloatArray, target: FloatArray, pivot: FloatArray, weights: FloatArray | None = None
) -> _Solution:
    """Return the weighted least-squares similarity of checked points.

    The model (17), (18) is linear in k cos(theta), k sin(theta) and the shift, so its
    least-squares solution needs no iteration and no starting value. Points that mirror each
    other or leave the scale free or zero are refused.
    """
    total = _total(weights, source.shape[-2])
    # Sums of squares about the centroids lose no digits, wherever the pivot lies.
    offsets, centroid = _centred(as_complex(source), weights, total)
    targets, target_centroid = _centred(as_complex(target), weights, total)
    row = (offsets if weights is None else weights * offsets).conj()[..., None, :]
    spread = (row @ offsets[..., None])[..., 0, 0].real
    _refuse_vanished("source", spread, total, centroid)
    factor = (row @ targets[..., None])[..., 0, 0] / spread
    _refuse_mirrored(offsets, targets, weights)
    _refuse_vanished("target", _squared(factor) * spread, total, target_centroid)
    origin = as_complex(pivot)
    shift = factor * (centroid - origin) + (origin - target_centroid)
    scale, turn = np.abs(factor), np.arctan2(factor.imag, factor.real)
    columns = np.broadcast_arrays(scale, turn, shift.real, shift.imag)
    left = targets - factor[..., None] * offsets
    squares = _squared(left) if weights is None else weights * _squared(left)
    return _Solution(
        np.stack(columns, axis=-1),
        as_points(left),
        np.asarray(squares.sum(axis=-1)),
        _cofactors(factor / scale * (centroid - origin), spread, scale, total),
        source,
    )


def _refuse_mirrored(
    offsets: ComplexArray, targets: ComplexArray, weights: FloatArray | None
) -> None:
    """Refuse target points that are a mirror image of the source points; all less their means.

    They are if a similarity of the mirrored source leaves so much less than one of the source
    itself that chance does not explain it: for noise alone, and a source that is its own mirror
    image, the ratio of what the two leave follows the F law. Two points never tell.
    """
    weighted = targets if weights is None else weights * targets
    along, across = (np.abs((side * weighted).sum(axis=-1)) for side in (offsets.conj(), offsets))
    suspect = across > along
    if not suspect.any():
        return
    from scipy.special import fdtri  # only now: its import takes longer than most fits

    size = np.ones(offsets.shape) if weights is None else weights
    spread = (size * _squared(offsets)).sum(axis=-1)
    whole = (size * _squared(targets)).sum(axis=-1)
    freedom = 2 * np.count_nonzero(size, axis=-1) - 4
    limit = fdtri(np.maximum(freedom, 1), np.maximum(freedom, 1), 1 - _CHANCE)
    # What is lost in rounding counts as left over.
    left, mirrored = (whole - part**2 / spread + _ROUNDING * whole for part in (along, across))
    found = suspect & (freedom > 0) & (left > limit * mirrored)
    if found.any():
        where = f"in {int(found.sum())} of {found.size} sets: " if found.ndim else ""
        raise MirroredPointsError(where + _MIRRORED)


def rmse(points: ArrayLike, reference: ArrayLike) -> FloatArray:
    """Root mean square distance between two sets of points: one number for both axes.

    Implements: niu2024 (26).

    Arguments and errors are those of `rmse_per_axis`.

    Returns
    -------
    ndarray, shape (...)
        In px. Noise of standard deviation s per coordinate in one set gives s * sqrt(2).

    Examples
    --------
    >>> float(rmse([[3, 4]], [[0, 0]]))
    5.0
    """
    return np.asarray(np.sqrt(np.square(rmse_per_axis(points, reference)).sum(axis=-1)))


@checked
def rmse_per_axis(points: Points, reference: Points) -> FloatArray:
    """Root mean square difference between two sets of points, in x and in y.

    Parameters
    ----------
    points, reference : array_like, shape (..., n, 2)
        Transformed points and those they should meet, in px.

    Returns
    -------
    ndarray, shape (..., 2), in px

    Examples
    --------
    >>> rmse_per_axis([[3, 4], [3, -4]], [[0, 0], [0, 0]])
    array([3., 4.])
    """
    return np.asarray(np.sqrt(np.square(points - reference).mean(axis=-2)))


@checked
def paired_points(source: Points, target: Points) -> tuple[FloatArray, FloatArray]:
    """Check two sets of points, (..., n, 2), that belong together row by row.

    Examples
    --------
    >>> paired_points([[1, 2]], [[3, 4]])
    (array([[1., 2.]]), array([[3., 4.]]))
    """
    return source, target


@checked
def _checked(
    source: Points, target: Points, pivot: Point, weights: Weights
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray | None]:
    """Check what every fit is given."""
    kept = None if weights is None else weights_for(weights, source.shape[-2])
    return source, target, pivot, kept


def _single(source: ArrayLike, target: ArrayLike, pivot: FloatArray) -> _Solution | None:
    """Return the least-squares similarity of one set of points, or None where a check is due.

    For a hundred points the checks and batches of the general form cost more than the fit. Here
    the arithmetic is done on plain complex numbers; whatever is unusual is left to the general
    form, which also raises the errors.
    """
    rows, landed = _complex("source", source), _complex("target", target)
    if rows is None or landed is None or rows.size != landed.size or pivot.shape != (2,):
        return None
    count = rows.size
    centre = complex(np.add.reduce(rows)) / count
    target_centre = complex(np.add.reduce(landed)) / count
    if not (cmath.isfinite(centre) and cmath.isfinite(target_centre)):
        return None
    offsets, targets = rows - centre, landed - target_centre
    spread = float(np.vdot(offsets, offsets).real)
    if not spread > count * _ROUNDING**2 * abs(centre) ** 2:
        return None
    factor = complex(np.vdot(offsets, targets)) / spread
    if abs(complex(np.dot(offsets, targets))) > abs(factor) * spread:
        return None  # perhaps a mirror image
    # Products overflow to infinity, where the power of a float would raise an error.
    size = abs(factor) * abs(factor) * spread
    if not count * _ROUNDING**2 * abs(target_centre) * abs(target_centre) < size < np.inf:
        return None
    origin = complex(pivot[0], pivot[1])
    shift = factor * (centre - origin) + (origin - target_centre)
    if not cmath.isfinite(shift):
        return None
    left = targets - factor * offsets
    scale, turn = abs(factor), cmath.phase(factor)
    return _Solution(
        np.array([scale, turn, shift.real, shift.imag]),
        left[:, None].view(np.float64),
        np.asarray(np.vdot(left, left).real),
        _cofactor(factor / scale * (centre - origin), spread, scale, count),
        rows[:, None].view(np.float64),
    )


def _complex(
    name: str, points: ArrayLike
) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]] | None:
    array = points if type(points) is np.ndarray else number_array(name, points)
    if array.dtype != np.float64 or array.ndim != 2 or array.shape[1] != 2 or len(array) < 2:
        return None
    if not array.flags.c_contiguous:
        return None
    return array.view(np.complex128)[:, 0]


def _cofactor(lever: complex, spread: float, scale: float, count: int) -> FloatArray:
    """Return the inverse normal matrix; `_cofactors` says why."""
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


def _cofactors(
    lever: ComplexArray, spread: FloatArray, scale: FloatArray, total: FloatArray | float
) -> FloatArray:
    # Scale, rotation and the image of the centroid are uncorrelated; the shift picks up scale
    # and rotation through the lever from the pivot to the centroid.
    matrix = np.zeros((*np.broadcast_shapes(lever.shape, spread.shape), 4, 4))
    matrix[..., 0, 0] = 1 / spread
    matrix[..., 1, 1] = 1 / (spread * scale**2)
    matrix[..., 0, 2:] = matrix[..., 2:, 0] = as_points(lever / spread)
    matrix[..., 1, 2:] = matrix[..., 2:, 1] = as_points(1j * lever / (spread * scale))
    variance = 1 / total + _squared(lever) / spread
    matrix[..., 2, 2] = matrix[..., 3, 3] = variance
    return matrix


def _total(weights: FloatArray | None, points: int) -> FloatArray | float:
    # A plain float where it can be: NumPy is slow on arrays of one number.
    return float(points) if weights is None else weights.sum(axis=-1)


def _centred(
    points: ComplexArray, weights: FloatArray | None, total: FloatArray | float
) -> tuple[ComplexArray, ComplexArray]:
    weighted = points if weights is None else weights * points
    centroid = np.add.reduce(weighted, axis=-1) / total
    return points - centroid[..., None], centroid


def _squared(numbers: ComplexArray) -> FloatArray:
    return numbers.real**2 + numbers.imag**2


def _refuse_vanished(
    name: str, spread: FloatArray, total: FloatArray | float, centroid: ComplexArray
) -> None:
    # What rounding leaves of coincident points grows with their distance from the origin.
    if not (spread > total * _ROUNDING**2 * _squared(centroid)).all():
        raise DegenerateGeometryError(
            f"{name}: expected at least two different points of weight above zero whose pattern "
            "fixes scale and rotation, got one point or coincident points; add "
            "spots across the field of view and pair them row by row"
        )


STEPS = 60
MOVEMENT = 1e-11  # px, root mean square: far below what a centroid can mean
DEPENDENT = 1e-13


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

    @cached_property
    def reach(self) -> float:
        """The largest coordinates of both images together, in px."""
        return float(np.abs(self.source).max() + np.abs(self.target).max())

    def transformed(self, parameters: FloatArray, points: FloatArray) -> FloatArray:
        """Return points, shape (..., n, 2) in px, laid over the target with these parameters."""
        return Registration._unchecked(self.model, parameters, self.pivot)._apply(points)

    def with_weights(self, weights: FloatArray) -> Problem:
        """Return the same problem with these weights times its own."""
        own = 1.0 if self.weights is None else self.weights
        return replace(self, weights=own * weights)

    def thinned(self, most: int) -> Problem:
        """Return so many of the points at most, spread evenly over the rows."""
        n = self.source.shape[-2]
        if n <= most:
            return self
        some = np.linspace(0, n - 1, most).astype(int)
        axes = {"source": -2, "target": -2, "weights": -1}
        axes |= {"source_covariance": -3, "target_covariance": -3}
        given = {name: getattr(self, name) for name in axes}
        taken: dict[str, Any] = {
            k: np.take(v, some, axes[k]) for k, v in given.items() if v is not None
        }
        return replace(self, **taken)

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


def prepare(
    source: ArrayLike, target: ArrayLike, pivot: ArrayLike, weights: ArrayLike | None, model: str
) -> Problem:
    """Check the points and bring them to one batch shape; covariances are still to come."""
    first, second, about, kept = _checked(source, target, pivot, weights)
    n = first.shape[-2]
    batch = np.broadcast_shapes(
        first.shape[:-2],
        second.shape[:-2],
        about.shape[:-1],
        () if kept is None else kept.shape[:-1],
    )
    return Problem(
        np.broadcast_to(first, (*batch, n, 2)),
        np.broadcast_to(second, (*batch, n, 2)),
        np.broadcast_to(about, (*batch, 2)),
        model,
        None if kept is None else np.broadcast_to(kept, (*batch, n)),
    )


def _refuse_no_covariance(name: str, matrices: FloatArray) -> None:
    lopsided = np.abs(matrices - matrices.mT).max()
    positive = (np.linalg.eigvalsh(matrices)[..., 0] > 0).all()
    if lopsided > 1e-12 * np.abs(matrices).max() or not positive:
        raise ValueError(
            f"{name}: expected symmetric matrices with variances above zero, got one that is not; "
            "leave it out for an image without errors"
        )


def solve(problem: Problem) -> _Solution:
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
        given = (problem.source, problem.target, problem.pivot, problem.weights)
        return _closed_similarity(*given)
    parameters = _starting_point(problem)
    points = problem.source
    limit = MOVEMENT * (1 + np.abs(problem.target).max())
    for _ in range(STEPS):
        carry = local_matrix(problem, parameters, points)
        weight = information(problem, carry)
        left = combined_residuals(problem, parameters, points, carry)
        rows = model_jacobian(problem, parameters, points)
        step, cofactor = _step(rows, _weighted(problem, weight), left)
        moved = (rows @ step[..., None, :, None])[..., 0]
        renewed = _true_points(problem, carry, weight, left - moved)
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
    residuals = problem.target - problem.transformed(parameters, problem.source)
    return _Solution(parameters, residuals, chi_square, cofactor, points)


def _starting_point(problem: Problem) -> FloatArray:
    """Return parameters near the minimum, shape (..., p), from a closed form."""
    source, target, pivot = problem.source, problem.target, problem.pivot
    if problem.model == "shift":
        weights = np.ones(source.shape[:-1]) if problem.weights is None else problem.weights
        shares = (weights / weights.sum(axis=-1)[..., None])[..., None]
        offsets, targets = (
            as_complex(side - (shares * side).sum(axis=-2, keepdims=True))
            for side in (source, target)
        )
        _refuse_mirrored(offsets, targets, problem.weights)
        return ((source - target) * shares).sum(axis=-2)
    if problem.model == "affine":  # which may mirror, and is linear: any start will do
        return np.broadcast_to([1.0, 0.0, 0.0, 1.0, 0.0, 0.0], (*source.shape[:-2], 6))
    closed = _closed_similarity(source, target, pivot, problem.weights).parameters
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
        matrix = _linear_part("similarity", closed)
        flat = matrix.reshape(*matrix.shape[:-2], 4)
        return np.concatenate([flat, closed[..., 2:]], axis=-1)
    return closed


def combined_residuals(
    problem: Problem, parameters: FloatArray, points: FloatArray, carry: FloatArray
) -> FloatArray:
    """Return y - f(s; u) - A (x - s), shape (..., n, 2), in px: what both images leave over.

    Without errors in the source the points s are the source, and this is target minus transformed
    source.
    """
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


def model_jacobian(problem: Problem, parameters: FloatArray, points: FloatArray) -> FloatArray:
    """Return the derivatives of transformed points by the parameters, (..., n, 2, p)."""
    q = points - problem.pivot[..., None, :]
    names = MODELS[problem.model]
    rows = np.zeros((*q.shape, len(names)))
    start = names.index("shift-x")
    rows[..., 0, start] = rows[..., 1, start + 1] = -1
    if problem.model == "affine":
        rows[..., 0, 0:2] = rows[..., 1, 2:4] = q
        return rows
    if problem.model == "shift":
        return rows
    turned = q @ _linear_part(problem.model, parameters).mT
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
        total = total + carry @ problem.source_covariance @ carry.mT
    return np.linalg.inv(total)


def local_matrix(problem: Problem, parameters: FloatArray, points: FloatArray) -> FloatArray:
    """Return A, how transformed points move with the points, shape (..., n, 2, 2)."""
    matrix = _linear_part(problem.model, parameters)[..., None, :, :]
    if problem.model != "similarity+radial":
        return np.broadcast_to(matrix, (*points.shape, 2))
    q = points - problem.pivot[..., None, :]
    c = parameters[..., -1][..., None, None, None]
    squared = np.square(q).sum(axis=-1)[..., None, None]
    return matrix @ ((1 + c * squared) * np.eye(2) + 2 * c * q[..., None] * q[..., None, :])


def _weighted(problem: Problem, information: FloatArray) -> FloatArray:
    if problem.weights is None:
        return information
    return problem.weights[..., None, None] * information


def _length(movement: FloatArray) -> FloatArray:
    return np.sqrt(np.square(movement).mean(axis=(-2, -1)))


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
