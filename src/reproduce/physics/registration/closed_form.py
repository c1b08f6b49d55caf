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
    common_batch,
    finite_array,
    number_array,
    weights_for,
)

ROUNDING = 64 * float(np.finfo(np.float64).eps)
# How often noise alone may be taken for a mirror image.
CHANCE = 1e-6
MIRRORED = (
    "the target points are a mirror image of the source points, as behind a mirror or with a "
    "reversed readout; flip one axis of one of the two: take the width less x in place of x, or "
    "fit the affine model, which may mirror"
)


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a fit ended.

    Attributes
    ----------
    parameters : ndarray, shape (..., p)
        In the order of `MODELS`.
    residuals : ndarray, shape (..., n, 2)
        Target minus transformed source, in px.
    chi_square : ndarray, shape (...)
        Weighted sum of squared deviations, of both images where covariances are known.
    cofactor : ndarray, shape (..., p, p)
        Inverse of the normal matrix, the sum of J^T W J.
    points : ndarray, shape (..., n, 2)
        Where the source points truly are, as far as their errors are known, in px.
    """

    parameters: FloatArray
    residuals: FloatArray
    chi_square: FloatArray
    cofactor: FloatArray
    points: FloatArray


def closed_similarity(
    source: ArrayLike, target: ArrayLike, pivot: ArrayLike, weights: ArrayLike | None = None
) -> Solution:
    """Return the weighted least-squares similarity.

    The model (17), (18) is linear in k cos(theta), k sin(theta) and the shift, so its
    least-squares solution needs no iteration and no starting value.

    Parameters
    ----------
    source, target, pivot, weights
        As for `fit.fit_registration`.

    Returns
    -------
    Solution
        Parameters (k, theta, shift x, shift y), residuals, chi-square, cofactor.

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape, or a weight is negative.
    MirroredPointsError
        If the target mirrors the source; see `refuse_mirrored`.
    DegenerateGeometryError
        If fewer than two different source points have weight, or the target leaves the scale zero:
        its points coincide.

    Examples
    --------
    >>> found = closed_similarity([[0, 0], [1, 0]], [[3, 0], [5, 0]], np.zeros(2))
    >>> found.parameters + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    if weights is None:
        single = _single(source, target, number_array("pivot", pivot))
        if single is not None:
            return single
    source, target = paired_points(source, target)
    pivot = finite_array("pivot", pivot, shape=(2,))
    checked = None if weights is None else weights_for(weights, source.shape[-2])
    common_batch(
        source=source.shape[:-2],
        target=target.shape[:-2],
        pivot=pivot.shape[:-1],
        weights=() if checked is None else checked.shape[:-1],
    )
    total = _total(checked, source.shape[-2])
    # Sums of squares about the centroids lose no digits, wherever the pivot lies.
    offsets, centroid = _centred(as_complex(source), checked, total)
    targets, target_centroid = _centred(as_complex(target), checked, total)
    row = (offsets if checked is None else checked * offsets).conj()[..., None, :]
    spread = (row @ offsets[..., None])[..., 0, 0].real
    _refuse_vanished("source", spread, total, centroid)
    factor = (row @ targets[..., None])[..., 0, 0] / spread
    refuse_mirrored(offsets, targets, checked)
    _refuse_vanished("target", _squared(factor) * spread, total, target_centroid)
    origin = as_complex(pivot)
    shift = factor * (centroid - origin) + (origin - target_centroid)
    scale, turn = np.abs(factor), np.arctan2(factor.imag, factor.real)
    columns = np.broadcast_arrays(scale, turn, shift.real, shift.imag)
    left = targets - factor[..., None] * offsets
    squares = _squared(left) if checked is None else checked * _squared(left)
    return Solution(
        np.stack(columns, axis=-1),
        as_points(left),
        np.asarray(squares.sum(axis=-1)),
        _cofactors(factor / scale * (centroid - origin), spread, scale, total),
        source,
    )


def refuse_mirrored(
    offsets: ComplexArray, targets: ComplexArray, weights: FloatArray | None
) -> None:
    """Refuse target points that are a mirror image of the source points.

    They are if a similarity of the mirrored source leaves so much less than one of the source
    itself that chance does not explain it: for noise alone, and a source that is its own mirror
    image, the ratio of what the two leave follows the F law. Two points never tell.

    Parameters
    ----------
    offsets, targets : ndarray of complex, shape (..., n)
        Points as x + iy, less their weighted means.
    weights : ndarray, shape (..., n), or None
        Inverse variances; None where all are alike.

    Raises
    ------
    MirroredPointsError
        If they are.

    Examples
    --------
    >>> points = np.array([0, 1, 2 + 1j]) - (1 + 1j / 3)
    >>> refuse_mirrored(points, 2j * points, None)
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
    limit = fdtri(np.maximum(freedom, 1), np.maximum(freedom, 1), 1 - CHANCE)
    # What is lost in rounding counts as left over.
    left, mirrored = (whole - part**2 / spread + ROUNDING * whole for part in (along, across))
    found = suspect & (freedom > 0) & (left > limit * mirrored)
    if found.any():
        where = f"in {int(found.sum())} of {found.size} sets: " if found.ndim else ""
        raise MirroredPointsError(where + MIRRORED)


def rmse(points: ArrayLike, reference: ArrayLike) -> FloatArray:
    """Root mean square distance between two sets of points: one number for both axes.

    Implements: niu2024 (26).

    Parameters
    ----------
    points, reference : array_like, shape (..., n, 2)
        Transformed points and those they should meet, in px.

    Returns
    -------
    ndarray, shape (...)
        In px. Noise of standard deviation s per coordinate in one set gives s * sqrt(2).

    Raises
    ------
    ValueError
        If an argument is not finite, has the wrong shape, or the counts differ.

    Examples
    --------
    >>> float(rmse([[3, 4]], [[0, 0]]))
    5.0
    """
    return np.asarray(np.sqrt(np.square(rmse_per_axis(points, reference)).sum(axis=-1)))


def rmse_per_axis(points: ArrayLike, reference: ArrayLike) -> FloatArray:
    """Root mean square difference between two sets of points, in x and in y.

    Parameters
    ----------
    points, reference : array_like, shape (..., n, 2)
        Transformed points and those they should meet, in px.

    Returns
    -------
    ndarray, shape (..., 2)
        In px.

    Raises
    ------
    ValueError
        If an argument is not finite, has the wrong shape, or the counts differ.

    Examples
    --------
    >>> rmse_per_axis([[3, 4], [3, -4]], [[0, 0], [0, 0]])
    array([3., 4.])
    """
    points, reference = paired_points(points, reference, names=("points", "reference"))
    return np.asarray(np.sqrt(np.square(points - reference).mean(axis=-2)))


def paired_points(
    source: ArrayLike, target: ArrayLike, *, names: tuple[str, str] = ("source", "target")
) -> tuple[FloatArray, FloatArray]:
    """Check two sets of points that belong together row by row.

    Parameters
    ----------
    source, target : array_like, shape (..., n, 2)
        In px.
    names : tuple of str
        What to call them in a message.

    Returns
    -------
    tuple of ndarray
        Both as float arrays.

    Raises
    ------
    ValueError
        If an argument is not finite, has the wrong shape, or the counts differ.

    Examples
    --------
    >>> paired_points([[1, 2]], [[3, 4]])
    (array([[1., 2.]]), array([[3., 4.]]))
    """
    source = finite_array(names[0], source, shape=(None, 2))
    target = finite_array(names[1], target, shape=(None, 2))
    if source.shape[-2] != target.shape[-2]:
        raise ValueError(
            f"expected as many {names[0]} points as {names[1]} points, got {source.shape[-2]} and "
            f"{target.shape[-2]}; row i of both must be the same star"
        )
    common_batch(**{names[0]: source.shape[:-2], names[1]: target.shape[:-2]})
    return source, target


def _single(source: ArrayLike, target: ArrayLike, pivot: FloatArray) -> Solution | None:
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
    squared: FloatArray = numbers.real**2 + numbers.imag**2
    return squared


def _refuse_vanished(
    name: str, spread: FloatArray, total: FloatArray | float, centroid: ComplexArray
) -> None:
    # What rounding leaves of coincident points grows with their distance from the origin.
    if not (spread > total * ROUNDING**2 * _squared(centroid)).all():
        raise DegenerateGeometryError(
            f"{name}: expected at least two different points of weight above zero whose pattern "
            "fixes scale and rotation, got one point or coincident points; add "
            "spots across the field of view and pair them row by row"
        )
