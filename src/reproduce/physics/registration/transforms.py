"""Transforms between two images: application, inverse, composition and residuals.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); the leading axes are a batch of transforms. A `Registration` is one of five models about a
fixed pivot, with q = point - pivot:

* shift: q + pivot - shift;
* rigid: R(theta) q + pivot - shift;
* similarity: k R(theta) q + pivot - shift;
* similarity+radial: k R(theta) q (1 + c r^2) + pivot - shift, with r the length of q;
* affine: A q + pivot - shift.

R(theta) rotates x towards y for a positive angle. The shift is the principal point of the source
minus that of the target, so it is *subtracted*.

The four-parameter model of a source channel and the reference neglects five effects: different
distortions, k^3 unlike k, a pivot that is not the principal point, the tilt of a detector, and a
second radial term. `error_field` returns their error. Its positions are in metres on the focal
plane of the source, x before y, from the principal point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics.optics import Camera, turned_onto_detector
from reproduce.physics.registration._similarity import (
    as_complex,
    as_points,
    squared,
)
from reproduce.physics.validate import (
    FloatArray,
    Image,
    Number,
    Point,
    Points,
    Positive,
    checked,
    checked_fields,
    valid,
)

_Row = Annotated[Any, (None,)]

# Names of the parameters, in the order of all arrays of parameters.
MODELS: dict[str, tuple[str, ...]] = {
    "shift": ("shift-x", "shift-y"),
    "rigid": ("rotation", "shift-x", "shift-y"),
    "similarity": ("scale", "rotation", "shift-x", "shift-y"),
    "similarity+radial": ("scale", "rotation", "shift-x", "shift-y", "radial"),
    "affine": ("xx", "xy", "yx", "yy", "shift-x", "shift-y"),
}
# Units of the parameters; scales and matrix elements have none.
UNITS = {"rotation": "rad", "shift-x": "px", "shift-y": "px", "radial": "px^-2"}


@checked_fields
@dataclass(frozen=True, eq=False)
class Registration:
    """One of the five models with its parameters; one transform or a batch of them.

    Implements: niu2024 (13), (15), (16), (17), (18).

    Attributes
    ----------
    model : str
        A key of `MODELS`.
    parameters : ndarray, shape (..., p)
        Parameters in the order of `MODELS`.
    pivot : ndarray, shape (..., 2)
        Centre of rotation and scale, in px.

    Examples
    --------
    >>> double = Registration("similarity", np.array([2.0, 0, 1, 0]), np.array([5.0, 5.0]))
    >>> double.apply([[6, 5]])
    array([[6., 5.]])
    >>> double.inverse().apply([[6, 5]])
    array([[6., 5.]])
    """

    model: str
    parameters: _Row
    pivot: Point

    def __post_init__(self) -> None:
        given, needed = self.parameters.shape[-1], len(_parameter_names(self.model))
        valid("parameters", given, given == needed, f"{needed} parameters")

    @classmethod
    @checked
    def similarity(
        cls, scale: Positive, rotation: Number, shift: Point, pivot: Point
    ) -> Registration:
        """Return the transform of a scale, rotation and shift: the four parameters of niu2024.

        Implements: niu2024 (9), (10), (11), (12).

        With a rotation and a shift of zero, it maps points of a channel onto a reference that
        differs in focal length and distortion only: k * points - k * pivot + pivot. By (11), an
        image point minus the principal point is the sum of ideal position and distortion. Both are
        scaled by k in (10), the distortion by (9) with k^3 = k. Near k = 1 the relative error of
        this approximation is 2 (1 - k).

        Parameters
        ----------
        scale : array_like, shape (...)
            Scale factor k, above zero.
        rotation : array_like, shape (...)
            Angle theta, in radians.
        shift : array_like, shape (..., 2)
            Principal point of the source minus that of the target, in px.
        pivot : array_like, shape (..., 2)
            Centre of rotation and scale, in px: the principal point of the source.

        Returns
        -------
        Registration
            Parameters of the model "similarity".

        Examples
        --------
        Double the distance from the pivot (5, 5), then subtract the shift (1, 0).

        >>> Registration.similarity(2.0, 0.0, (1, 0), (5, 5)).apply([[6, 5]])
        array([[6., 5.]])
        """
        columns = np.broadcast_arrays(scale, rotation, shift[..., 0], shift[..., 1])
        return cls("similarity", np.stack(columns, axis=-1), pivot)

    @property
    def batch(self) -> tuple[int, ...]:
        """Batch shape; () for a single transform."""
        return np.broadcast_shapes(self.parameters.shape[:-1], self.pivot.shape[:-1])

    @property
    def scale(self) -> FloatArray:
        """Scale factor k, shape (...), if the model has a scale."""
        return self._parameter("scale")

    @property
    def rotation(self) -> FloatArray:
        """Angle theta in radians, shape (...), if the model has a rotation."""
        return self._parameter("rotation")

    @property
    def matrix(self) -> FloatArray:
        """Linear part about the pivot, shape (..., 2, 2)."""
        return self.derivative(self.pivot[..., None, :])[..., 0, :, :]

    @property
    def shift(self) -> FloatArray:
        """Pivot minus its image, shape (..., 2), in px."""
        values = self._values
        return np.concatenate([values["shift-x"], values["shift-y"]], axis=-1)

    def _parameter(self, name: str) -> FloatArray:
        if name not in MODELS[self.model]:
            raise ValueError(
                f"model: expected a model with a {name}, got {self.model!r}. Fit another model"
            )
        return self._values[name][..., 0]

    @property
    def _values(self) -> dict[str, FloatArray]:
        """Parameters by name, shape (..., 1); a model without one has that of the identity."""
        columns = np.moveaxis(self.parameters, -1, 0)[..., None]
        zero = 0 * columns[0]
        identity = {"rotation": zero, "radial": zero, "xy": zero, "yx": zero}
        identity |= dict.fromkeys(("scale", "xx", "yy"), 1 + zero)
        return identity | dict(zip(MODELS[self.model], columns, strict=True))

    def _terms(self, points: FloatArray) -> tuple[NDArray[Any], ...]:
        """Return a, b, c, q and |q|^2 of the images a q (1 + c |q|^2) + b conj(q) of points.

        The offsets q from the pivot have shape (..., n), and a, b and c have shape (..., 1).
        """
        known = self._values
        factor = known["scale"] * np.exp(1j * known["rotation"])
        # The images of x and y by the matrix of an affine model.
        x, y = known["xx"] + 1j * known["yx"], known["xy"] + 1j * known["yy"]
        along, across = factor * (x - 1j * y) / 2, (x + 1j * y) / 2
        offsets = as_complex(points - self.pivot[..., None, :])
        return along, across, known["radial"], offsets, squared(offsets)

    @checked
    def apply(self, points: Points) -> FloatArray:
        """Return the registered positions of source points.

        Parameters
        ----------
        points : array_like, shape (..., n, 2)
            Points in the source, in px.

        Returns
        -------
        ndarray, shape (..., n, 2)
            Positions in the target, in px.
        """
        along, across, radial, offsets, squares = self._terms(points)
        image = as_complex(self.pivot - self.shift)[..., None]
        bent = along * offsets * (1 + radial * squares)
        return as_points(bent + across * offsets.conj() + image)

    def derivative(self, points: FloatArray) -> FloatArray:
        """Return the derivatives of registered points by the source points, (..., n, 2, 2)."""
        along, across, radial, offsets, squares = self._terms(points)
        bend = along * radial
        along, across = along + 2 * bend * squares, across + bend * offsets**2
        # The images of 1 and i under the derivative z -> along * z + across * conj(z).
        columns = [along + across, 1j * (along - across)]
        return as_points(np.stack(columns, axis=-1)).mT

    def jacobian(self, points: FloatArray) -> FloatArray:
        """Return the derivatives of registered points by the parameters, (..., n, 2, p).

        In px per unit of the parameter.
        """
        known, (*_, offsets, squares) = self._values, self._terms(points)
        turned = np.exp(1j * known["rotation"]) * offsets
        bent, scale = turned * (1 + known["radial"] * squares), known["scale"]
        columns = {
            "scale": bent,
            "rotation": 1j * scale * bent,
            "radial": scale * turned * squares,
            "xx": offsets.real,
            "xy": offsets.imag,
            "yx": 1j * offsets.real,
            "yy": 1j * offsets.imag,
            "shift-x": -1.0,
            "shift-y": -1j,
        }
        rows = [columns[name] + 0 * turned for name in MODELS[self.model]]
        return as_points(np.stack(rows, axis=-1)).mT

    def affine(self) -> tuple[FloatArray, FloatArray]:
        """Return the transform as matrix and translation: matrix @ point + translation.

        Implements: niu2024 (4).

        Returns
        -------
        matrix : ndarray, shape (..., 2, 2)
            For a similarity, T = k R(theta).
        translation : ndarray, shape (..., 2)
            In px. It is not minus the shift, because it includes the effect of the pivot.

        Raises
        ------
        ValueError
            If the model has a radial term.
        """
        if self.model == "similarity+radial":
            raise ValueError(
                "model: expected a transform that keeps lines straight, got one with a radial "
                "term. Apply it to points instead"
            )
        return self.matrix, self.apply(np.zeros((1, 2)))[..., 0, :]

    def inverse(self) -> Registration:
        """Return the transform from target to source, about the same pivot.

        The inverse of a similarity is a similarity, the inverse of other models is affine. A model
        with a radial term raises ValueError.
        """
        inverse = np.linalg.inv(self.affine()[0])
        shift = -(inverse @ self.shift[..., None])[..., 0]
        if self.model == "similarity":
            angle = -self.rotation
            return Registration.similarity(1 / self.scale, angle, shift, self.pivot)
        flat = inverse.reshape(*inverse.shape[:-2], 4)
        return Registration(
            "affine", np.concatenate([flat, shift], axis=-1), self.pivot
        )


@checked
def similarity_between(camera: Camera, reference: Camera) -> Registration:
    """Return the similarity that the imaging parameters of two channels imply.

    It is exact if both distortions are zero.

    Implements: niu2024 (14).

    Parameters
    ----------
    camera, reference : Camera
        Source channel and reference (target) channel.

    Returns
    -------
    Registration
        Scale: ratio of focal lengths in px; shift: difference of principal points; pivot: the
        principal point of `camera`.

    Examples
    --------
    >>> green = Camera(30e-3, (10, 10), 0, 1e-5)
    >>> similarity_between(Camera(20e-3, (11, 9), 0, 1e-5), green).parameters
    array([ 1.5,  0. ,  1. , -1. ])
    """
    # In px, because channels may differ in pixel pitch.
    scale = (reference.focal_length / camera.focal_length) * (
        camera.pixel_pitch / reference.pixel_pitch
    )
    shift = camera.principal_point - reference.principal_point
    rotation = camera.rotation - reference.rotation
    return Registration.similarity(scale, rotation, shift, camera.principal_point)


def rmse(points: ArrayLike, reference: ArrayLike) -> FloatArray:
    """Return the root mean square distance between two sets of points, over both axes.

    Implements: niu2024 (26).

    Parameters and errors are those of `rmse_per_axis`.

    Returns
    -------
    ndarray, shape (...)
        Distance, in px. Noise of standard deviation s per coordinate in one set gives s * sqrt(2).

    Examples
    --------
    >>> float(rmse([[3, 4]], [[0, 0]]))
    5.0
    """
    return np.sqrt(np.square(rmse_per_axis(points, reference)).sum(axis=-1))


@checked
def rmse_per_axis(points: Points, reference: Points) -> FloatArray:
    """Return the root mean square difference between two sets of points, in x and in y.

    Parameters
    ----------
    points, reference : array_like, shape (..., n, 2)
        Registered points and the points of the reference, in px.

    Returns
    -------
    ndarray, shape (..., 2)
        Differences along x and y, in px.

    Examples
    --------
    >>> rmse_per_axis([[3, 4], [3, -4]], [[0, 0], [0, 0]])
    array([3., 4.])
    """
    return np.sqrt(np.square(points - reference).mean(axis=-2))


@checked
def registered_image(
    image: Image,
    transform: Registration,
    *,
    corner: Point = (0, 0),
) -> FloatArray:
    """Return a source image on the pixels of the target.

    The value of a target pixel is interpolated in the source by cubic splines, and divided by the
    magnification of areas, so that a spot keeps its flux.

    Parameters
    ----------
    image : array_like, shape (height, width)
        Flux without background, in any unit. It is zero outside of the image.
    transform : Registration
        Single transform from source to target, without a radial term.
    corner : array_like, shape (2,)
        x and y of the first pixel of the image, if it is a window of a larger image.

    Returns
    -------
    ndarray, shape (height, width)
        Flux on target pixels that begin at the same corner.

    Raises
    ------
    ValueError
        If the transform is a batch, or has a radial term.

    Examples
    --------
    A shift of one moves a spot by one pixel to the left.

    >>> image = np.zeros((3, 4))
    >>> image[1, 2] = 8.0
    >>> moved = registered_image(image, Registration.similarity(1, 0, (1, 0), (0, 0)))
    >>> moved.round(9) + 0.0
    array([[0., 0., 0., 0.],
           [0., 8., 0., 0.],
           [0., 0., 0., 0.]])
    """
    from scipy.ndimage import affine_transform  # registering stars does not need it

    if transform.batch or image.ndim != 2:
        raise ValueError(
            f"image: expected one image and one transform, got shapes {image.shape} and "
            f"{transform.batch}. Pass one of them at a time"
        )
    back, origin = transform.inverse().affine()
    # Source position of target pixel p: back (p + corner) + origin - corner; y before x below.
    offset = (back @ corner + origin - corner)[::-1]
    resampled = affine_transform(image, back[::-1, ::-1], offset)
    return resampled / np.abs(np.linalg.det(transform.matrix))


def _parameter_names(model: str) -> tuple[str, ...]:
    if str(model) not in MODELS:  # a list has no hash
        raise ValueError(
            f"model: expected one of {', '.join(MODELS)}, got {model!r}. Correct the name"
        )
    return MODELS[model]


@checked
def error_field(
    source: Camera,
    reference: Camera,
    positions: Points,
    *,
    pivot_error: Point = (0.0, 0.0),
    tilt: Point = (0.0, 0.0),
    second_term: Point = (0.0, 0.0),
) -> FloatArray:
    """Return reference points minus modelled points, at the true parameters.

    Parameters
    ----------
    source, reference : Camera
        Imaging parameters of both channels. Different distortions are an effect that the model
        neglects. The detector of the reference is not rotated.
    positions : array_like, shape (n, 2)
        Ideal positions in the source channel, in metres.
    pivot_error : array_like, shape (2,)
        Assumed pivot minus principal point of the source, in px.
    tilt : array_like, shape (2,)
        Slopes of the source detector along x and y: the tangents of its tilt. A positive slope
        moves that side away from the lens, where positions are further from the centre.
    second_term : array_like, shape (2,)
        Second radial coefficients of source and reference, in m^-4.

    Returns
    -------
    ndarray, shape (n, 2)
        Error of the model, in px.

    Examples
    --------
    Equal channels without distortion have no error.

    >>> camera = Camera(25e-3, (1000, 700), 0, 1e-5)
    >>> error_field(camera, camera, [[1e-3, 2e-3]])
    array([[0., 0.]])
    """
    truth = similarity_between(source, reference)
    ideal = positions * (reference.focal_length / source.focal_length)
    expected = _displaced(ideal, reference, second_term[1])
    bent = _displaced(positions, source, second_term[0])
    # The ray through a point p of the plane at F meets the tilted plane at p F / (F - p . tilt).
    slope = (bent @ tilt)[:, None] / source.focal_length
    bent = bent / (1 - slope) * np.sqrt(1 + np.square(tilt))
    bent = turned_onto_detector(bent, source.rotation)
    seen = bent / source.pixel_pitch + source.principal_point
    # True parameters, but about the pivot that is assumed.
    modelled = replace(truth, pivot=truth.pivot + pivot_error).apply(seen)
    return expected / reference.pixel_pitch + reference.principal_point - modelled


def _displaced(ideal: FloatArray, camera: Camera, second: float) -> FloatArray:
    squared = np.square(ideal).sum(axis=-1, keepdims=True)
    return ideal * (1 + camera.radial_distortion * squared + second * squared**2)
