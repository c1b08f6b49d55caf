"""The four-parameter transform that lays one channel's image over another's, and its closed fit.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); the leading axes are a batch of transforms. Parameters are always in the order scale k,
rotation theta (radians), shift x, shift y (px). A positive rotation turns x towards y. The shift
is the source channel's principal point minus the target's, so it is *subtracted*.

Inside, a point is the complex number x + iy: scaling and rotating is then one multiplication.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import fdtri

from reproduce.physics.optics.camera import Camera
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    MirroredPointsError,
    common_batch,
    finite_array,
    positive,
    weights_for,
)

ComplexArray = NDArray[np.complex128]


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
    # Not ascontiguousarray, which would give a single number an axis it does not have.
    return np.asarray(numbers, order="C")[..., None].view(np.float64)


@dataclass(frozen=True, eq=False, init=False)
class Similarity:
    """A scale, rotation and shift about a fixed pivot; one transform or a batch of them.

    Implements: niu2024 (13), (15), (16), (17), (18).

    Parameters
    ----------
    scale : array_like, shape (...)
        Scale factor k, above zero.
    rotation : array_like, shape (...)
        Angle theta, in radians.
    shift : array_like, shape (..., 2)
        Source principal point minus target principal point, in px.
    pivot : array_like, shape (..., 2)
        The point rotated and scaled about, in px: the source channel's principal point.

    Raises
    ------
    ValueError
        If a parameter is not finite, has the wrong shape, or `scale` is not above zero.

    Examples
    --------
    Double the distance from the pivot (5, 5), then subtract the shift (1, 0).

    >>> Similarity(2.0, 0.0, (1, 0), (5, 5)).transform([[6, 5]])
    array([[6., 5.]])
    """

    scale: FloatArray
    rotation: FloatArray
    shift: FloatArray
    pivot: FloatArray

    def __init__(
        self, scale: ArrayLike, rotation: ArrayLike, shift: ArrayLike, pivot: ArrayLike
    ) -> None:
        self._set(
            positive("scale", scale),
            finite_array("rotation", rotation),
            finite_array("shift", shift, shape=(2,)),
            finite_array("pivot", pivot, shape=(2,)),
        )
        common_batch(
            scale=self.scale.shape,
            rotation=self.rotation.shape,
            shift=self.shift.shape[:-1],
            pivot=self.pivot.shape[:-1],
        )

    @classmethod
    def from_factor(cls, factor: ComplexArray, shift: FloatArray, pivot: FloatArray) -> Self:
        """Make a similarity from checked arrays and the complex factor k exp(i theta)."""
        # Checking again what a fit has just computed would cost as much as the fit.
        similarity = object.__new__(cls)
        rotation = np.arctan2(factor.imag, factor.real)
        similarity._set(np.asarray(np.abs(factor)), np.asarray(rotation), shift, pivot)
        return similarity

    def _set(
        self, scale: FloatArray, rotation: FloatArray, shift: FloatArray, pivot: FloatArray
    ) -> None:
        object.__setattr__(self, "scale", scale)
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "shift", shift)
        object.__setattr__(self, "pivot", pivot)

    @property
    def batch(self) -> tuple[int, ...]:
        """The batch shape; () for a single transform."""
        return np.broadcast_shapes(
            self.scale.shape, self.rotation.shape, self.shift.shape[:-1], self.pivot.shape[:-1]
        )

    @property
    def parameters(self) -> FloatArray:
        """The vector u = (k, theta, shift x, shift y), shape (..., 4)."""
        columns = (self.scale, self.rotation, self.shift[..., 0], self.shift[..., 1])
        return np.stack(np.broadcast_arrays(*columns), axis=-1)

    @property
    def factor(self) -> ComplexArray:
        """The complex number k exp(i theta), shape (...)."""
        return np.asarray(self.scale * np.exp(1j * self.rotation))

    def transform(self, points: ArrayLike) -> FloatArray:
        """Lay source points over the target: k R(theta) (points - pivot) + pivot - shift.

        Parameters
        ----------
        points : array_like, shape (..., n, 2)
            In the source channel, in px.

        Returns
        -------
        ndarray, shape (..., n, 2)
            In the target channel, in px.

        Raises
        ------
        ValueError
            If `points` is not finite or has the wrong shape.
        """
        points = finite_array("points", points, shape=(None, 2))
        common_batch(points=points.shape[:-2], similarity=self.batch)
        pivot = as_complex(self.pivot)[..., None]
        landed = pivot - as_complex(self.shift)[..., None]
        return as_points(self.factor[..., None] * (as_complex(points) - pivot) + landed)

    def affine(self) -> tuple[FloatArray, FloatArray]:
        """Write the transform as matrix and translation: matrix @ point + translation.

        Implements: niu2024 (4).

        Returns
        -------
        ndarray, shape (..., 2, 2)
            The matrix T = k R(theta).
        ndarray, shape (..., 2)
            The translation, in px. It is not minus the shift: it also undoes the pivot.
        """
        factor = self.factor
        matrix = np.stack([as_points(factor), as_points(1j * factor)], axis=-1)
        pivot = as_complex(self.pivot)
        return matrix, as_points(pivot - factor * pivot - as_complex(self.shift))

    def inverse(self) -> Similarity:
        """Return the transform from target to source, about the same pivot."""
        back = 1 / self.factor
        return Similarity.from_factor(back, as_points(-back * as_complex(self.shift)), self.pivot)

    def about(self, pivot: ArrayLike) -> Similarity:
        """Return the same transform written about another pivot, shape (..., 2), in px."""
        pivot = finite_array("pivot", pivot, shape=(2,))
        common_batch(similarity=self.batch, pivot=pivot.shape[:-1])
        landed = self.transform(pivot[..., None, :])[..., 0, :]
        return Similarity(self.scale, self.rotation, pivot - landed, pivot)

    def after(self, first: Similarity) -> Similarity:
        """Return the composition: apply `first`, then this one; about the pivot of `first`."""
        common_batch(similarity=self.batch, first=first.batch)
        landed = self.transform(first.transform(first.pivot[..., None, :]))[..., 0, :]
        shift = first.pivot - landed
        return Similarity.from_factor(self.factor * first.factor, shift, first.pivot)


def principal_point_shift(
    principal_point: ArrayLike, reference_principal_point: ArrayLike
) -> FloatArray:
    """The shift of a channel against the reference: the difference of principal points.

    Implements: niu2024 (14).

    Parameters
    ----------
    principal_point, reference_principal_point : array_like, shape (..., 2)
        In px.

    Returns
    -------
    ndarray, shape (..., 2)
        Channel minus reference, in px.

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape.

    Examples
    --------
    >>> principal_point_shift((7, 9), (5, 10))
    array([ 2., -1.])
    """
    channel = finite_array("principal_point", principal_point, shape=(2,))
    reference = finite_array("reference_principal_point", reference_principal_point, shape=(2,))
    common_batch(principal_point=channel.shape[:-1], reference_principal_point=reference.shape[:-1])
    return channel - reference


def similarity_between(camera: Camera, rotation: ArrayLike, reference: Camera) -> Similarity:
    """The similarity that the imaging parameters of two channels imply, distortion left aside.

    Parameters
    ----------
    camera, reference : Camera
        The source channel and the reference (target) channel.
    rotation : array_like, shape (...)
        Angle of the source detector against the reference, in radians.

    Returns
    -------
    Similarity
        Scale: ratio of focal lengths in px; shift: difference of principal points; pivot: the
        principal point of `camera`. Exact where both distortions are zero.

    Raises
    ------
    ValueError
        If `rotation` is not finite or the batch shapes do not broadcast.

    Examples
    --------
    >>> green = Camera(30e-3, (10, 10), 0, 1e-5)
    >>> similarity_between(Camera(20e-3, (11, 9), 0, 1e-5), 0.0, green).parameters
    array([ 1.5,  0. ,  1. , -1. ])
    """
    rotation = finite_array("rotation", rotation)
    common_batch(camera=camera.batch, reference=reference.batch, rotation=rotation.shape)
    # In px, so that channels may differ in pixel pitch too; the paper's do not.
    scale = (reference.focal_length / camera.focal_length) * (
        camera.pixel_pitch / reference.pixel_pitch
    )
    shift = principal_point_shift(camera.principal_point, reference.principal_point)
    return Similarity(scale, rotation, shift, camera.principal_point)


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
