"""The four-parameter transform that lays one channel's image points over another's.

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

from reproduce.physics.camera import Camera
from reproduce.physics.validate import FloatArray, common_batch, finite_array, positive

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
