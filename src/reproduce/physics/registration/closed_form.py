"""The least-squares similarity in closed form, and how far two sets of points lie apart.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); the leading axes are a batch. Parameters are in the order scale k, rotation theta (radians),
shift x, shift y (px).
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.registration.transforms import ComplexArray, as_complex, as_points
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    MirroredPointsError,
    Point,
    Points,
    Weights,
    checked,
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
