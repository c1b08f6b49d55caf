"""Fitting one channel's image points onto another's in closed form, and what is left over.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); the leading axes are a batch of calibrations. The transform, its parameters and their signs
are those of `similarity.Similarity`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics.similarity import ComplexArray, Similarity, as_complex, as_points
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    MirroredPointsError,
    common_batch,
    finite_array,
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
class SimilarityFit:
    """A fitted similarity, its uncertainty and what it leaves over.

    Attributes
    ----------
    similarity : Similarity
        The estimate, batch shape (...).
    residuals : ndarray, shape (..., n, 2)
        Target minus transformed source, in px.
    weights : ndarray, shape (..., n), or None
        The weights given, None where every point counts alike.
    centroid : ndarray, shape (..., 2)
        Weighted mean of the source points, in px.
    spread : ndarray, shape (...)
        Weighted sum of the squared distances of the source points from the centroid.
    """

    similarity: Similarity
    residuals: FloatArray
    weights: FloatArray | None
    centroid: FloatArray
    spread: FloatArray

    @property
    def parameters(self) -> FloatArray:
        """The vector u = (k, theta, shift x, shift y), shape (..., 4)."""
        return self.similarity.parameters

    @property
    def chi_square(self) -> FloatArray:
        """Weighted sum of squared residuals, shape (...)."""
        squares = np.square(self.residuals).sum(axis=-1)
        weighted = squares if self.weights is None else self.weights * squares
        return np.asarray(weighted.sum(axis=-1))

    @property
    def degrees_of_freedom(self) -> NDArray[np.int64]:
        """Two per point of weight above zero, less four; shape (...), or () without weights."""
        if self.weights is None:
            return np.asarray(2 * self.residuals.shape[-2] - 4)
        return np.asarray(2 * np.count_nonzero(self.weights, axis=-1) - 4)

    @property
    def cofactor(self) -> FloatArray:
        """Inverse normal matrix of (k, theta, shift x, shift y), shape (..., 4, 4).

        It is the covariance where the weights are inverse variances in px^-2; without weights,
        multiply it by the variance of one residual coordinate.
        """
        # Scale, rotation and the image of the centroid are uncorrelated; the shift picks up scale
        # and rotation through the lever from the pivot to the centroid.
        scale, spread = self.similarity.scale, self.spread
        direction = np.exp(1j * self.similarity.rotation)
        lever = direction * as_complex(self.centroid - self.similarity.pivot)
        matrix = np.zeros((*np.broadcast_shapes(lever.shape, spread.shape), 4, 4))
        matrix[..., 0, 0] = 1 / spread
        matrix[..., 1, 1] = 1 / (spread * scale**2)
        matrix[..., 0, 2:] = matrix[..., 2:, 0] = as_points(lever / spread)
        matrix[..., 1, 2:] = matrix[..., 2:, 1] = as_points(1j * lever / (spread * scale))
        total = _total(self.weights, self.residuals.shape[-2])
        variance = 1 / total + (lever.real**2 + lever.imag**2) / spread
        matrix[..., 2, 2] = matrix[..., 3, 3] = variance
        return matrix

    @property
    def covariance(self) -> FloatArray:
        """The cofactor matrix scaled by the residuals' own variance, shape (..., 4, 4).

        Raises
        ------
        DegenerateGeometryError
            If two points only are left, which fit exactly and say nothing of their variance.
        """
        if (self.degrees_of_freedom <= 0).any():
            raise DegenerateGeometryError(
                "covariance: expected at least three points of weight above zero, got two; "
                "add points, or multiply `cofactor` by a known variance"
            )
        return (self.chi_square / self.degrees_of_freedom)[..., None, None] * self.cofactor


def fit_similarity(
    source: ArrayLike, target: ArrayLike, pivot: ArrayLike, weights: ArrayLike | None = None
) -> SimilarityFit:
    """The weighted least-squares similarity in closed form.

    The model (17), (18) is linear in k cos(theta), k sin(theta) and the shift, so its
    least-squares solution needs no iteration and no starting value.

    Parameters
    ----------
    source, target : array_like, shape (..., n, 2)
        The same n spots in both channels, in px.
    pivot : array_like, shape (..., 2)
        The source channel's principal point, in px.
    weights : array_like, shape (..., n), optional
        Inverse variances of a target coordinate, in px^-2; zero drops a point. One by default.

    Returns
    -------
    SimilarityFit
        Estimate, residuals, cofactor and covariance.

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
    >>> fit = fit_similarity([[0, 0], [1, 0]], [[3, 0], [5, 0]], pivot=(0, 0))
    >>> fit.parameters + 0.0
    array([ 2.,  0., -3.,  0.])
    """
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
    similarity = Similarity.from_factor(factor, as_points(shift), pivot)
    residuals = as_points(targets - factor[..., None] * offsets)
    return SimilarityFit(similarity, residuals, checked, as_points(centroid), spread)


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
