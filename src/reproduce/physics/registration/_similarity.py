"""The similarity that maps one set of points onto another, by least squares in closed form.

Points have shape (..., n, 2), in px; the leading axes are a batch. A point is taken as the complex
number x + iy. Scaling and rotating is then one multiplication.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reproduce.physics import validate
from reproduce.physics.validate import FloatArray

ComplexArray = NDArray[np.complex128]

# Relative rounding error of a sum of many numbers.
_ROUNDING_ERROR = 64 * np.finfo(np.float64).eps
# Probability that noise resembles a mirror image.
_MIRROR_PROBABILITY = 1e-6


def as_complex(points: FloatArray) -> ComplexArray:
    """Return points (..., 2) as complex numbers x + iy of shape (...).

    Examples
    --------
    >>> as_complex(np.array([[3.0, 4.0]]))
    array([3.+4.j])
    """
    return np.ascontiguousarray(points).view(np.complex128)[..., 0]


def as_points(numbers: ComplexArray) -> FloatArray:
    """Return complex numbers x + iy of shape (...) as points (..., 2).

    Examples
    --------
    >>> as_points(np.array([3 + 4j]))
    array([[3., 4.]])
    """
    # ascontiguousarray would add an axis to a single number.
    return np.asarray(numbers, order="C")[..., None].view(np.float64)


def closed_similarity(
    source: FloatArray, target: FloatArray, pivot: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the least-squares similarity of points without known errors.

    The model (17), (18) is linear in k cos(theta), k sin(theta) and the shift, so its
    least-squares solution needs no iteration and no starting value.

    Parameters
    ----------
    source, target : ndarray, shape (..., n, 2)
        The same n spots in both images, in px.
    pivot : ndarray, shape (..., 2)
        Centre of rotation and scale, in px.
    weights : ndarray, shape (..., n)
        Relative weights, not negative.

    Returns
    -------
    parameters : ndarray, shape (..., 4)
        Scale k, angle theta in radians, and shift in px, as in `Registration`.
    residuals : ndarray, shape (..., n, 2)
        Target minus registered source, in px.
    cofactor : ndarray, shape (..., 4, 4)
        Inverse normal matrix.

    Raises
    ------
    MirroredPointsError
        If the target mirrors the source.
    DegenerateGeometryError
        If the points of either image coincide.

    Examples
    --------
    >>> source, target = np.array([[[0.0, 0], [1, 0]], [[3, 0], [5, 0]]])
    >>> closed_similarity(source, target, np.zeros(2), np.ones(2))[0] + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    # Sums of squares about the centroids lose no digits, wherever the pivot is.
    offsets, centroid = _centred(source, weights)
    # Displacements are small if both images are similar, so their sums keep their digits.
    moved, drift = _centred(target - source, weights)
    weighted, total = weights * offsets, weights.sum(axis=-1)
    spread = np.vecdot(offsets, weighted).real
    _check_spread("source", spread, total, centroid)
    change = np.vecdot(weighted, moved) / spread
    factor = 1.0 + change
    scale = np.abs(factor)
    _check_not_mirrored(offsets, offsets + moved, weights, spread, scale)
    _check_spread("target", scale**2 * spread, total, centroid + drift)
    lever = centroid - as_complex(pivot)
    shift = change * lever - drift
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
    cofactor[..., [2, 3], [2, 3]] = (1 / total + squared(lever) / spread)[..., None]
    columns = scale, np.angle(factor), shift.real, shift.imag
    return np.stack(columns, axis=-1), as_points(residuals), cofactor


def _centred(
    points: FloatArray, weights: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return points minus their weighted mean, and the mean."""
    numbers = as_complex(points)
    centroid = (weights * numbers).sum(axis=-1) / weights.sum(axis=-1)
    return numbers - centroid[..., None], centroid


def squared(numbers: ComplexArray) -> FloatArray:
    """Return the squared magnitudes of complex numbers."""
    return numbers.real**2 + numbers.imag**2


def _check_spread(
    name: str, spread: FloatArray, total: FloatArray, centroid: ComplexArray
) -> None:
    # The rounding error of coincident points grows with their distance from the origin.
    if not (spread > total * _ROUNDING_ERROR**2 * squared(centroid)).all():
        raise validate.DegenerateGeometryError(
            f"{name}: expected at least two different points of weight above zero, got one point "
            "or coincident points. Add points across the field, row by row in both images"
        )


def _check_not_mirrored(
    offsets: ComplexArray,
    targets: ComplexArray,
    weights: FloatArray,
    spread: FloatArray,
    scale: FloatArray,
) -> None:
    """Raise `MirroredPointsError` if the target mirrors the source; both minus their means.

    The residual of a similarity of the mirrored source is then so much smaller than that of the
    source itself that chance does not explain it: for noise only, and a source that is its own
    mirror image, the ratio follows the F distribution. Two points are never a mirror image.
    """
    mirrored = np.abs(np.vecdot(offsets.conj(), weights * targets)) / spread
    if not (mirrored > scale).any():
        return
    # A rounding error counts as a residual.
    total = (1 + _ROUNDING_ERROR) * (weights * squared(targets)).sum(axis=-1)
    residuals = (total - factor**2 * spread for factor in (scale, mirrored))
    check_ratio(2 * np.count_nonzero(weights, axis=-1) - 4, *residuals)


def check_ratio(freedom: Any, residual: FloatArray, mirrored: FloatArray) -> None:
    """Raise `MirroredPointsError` if a mirror image has much smaller squared residuals."""
    from scipy.special import fdtri  # this import takes longer than most fits

    denominator = np.maximum(freedom, 1)
    limit = fdtri(denominator, denominator, 1 - _MIRROR_PROBABILITY)
    sets = (freedom == denominator) & (residual > limit * mirrored)
    if sets.any():
        count = f" (in {int(sets.sum())} of {sets.size} sets)" * bool(sets.ndim)
        raise validate.MirroredPointsError(
            f"target: expected no mirror image, got one of the source points{count}. Replace x of "
            "one image by the width minus x (flip one axis), or fit the affine model"
        )
