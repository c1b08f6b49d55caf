"""Transforms between two images: application, inverse, composition and residuals.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); the leading axes are a batch of transforms. A `Registration` is one of five models about a
fixed pivot, with q = point - pivot:

* shift: q + pivot - shift;
* rigid: R(theta) q + pivot - shift;
* similarity: k R(theta) q + pivot - shift;
* similarity+radial: k R(theta) q (1 + c r^2) + pivot - shift, with r the length of q;
* affine: A q + pivot - shift.

R(theta) turns x towards y for a positive angle. The shift is the source channel's principal point
minus the target's, so it is *subtracted*. A similarity takes a point as the complex number x + iy:
scaling and rotating is then one multiplication.

The four-parameter model of a source channel and the reference leaves out five things: that the
distortions differ, that k^3 is not k, that the pivot may not be the principal point, that a
detector may be tilted, and that there is a second radial term. For each there is the *error field*,
reference point minus modelled point at the true parameters. Its positions have shape (n, 2), in
metres on the source's focal plane, x before y, from the principal point; it has shape (n, 2), in px
of the reference.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics import validate
from reproduce.physics.optics import Camera
from reproduce.physics.optics.camera import _turned
from reproduce.physics.validate import FloatArray, Number, Point, Points, Positive

ComplexArray = NDArray[np.complex128]

# Names of the parameters, in the order in which every array has them.
MODELS: dict[str, tuple[str, ...]] = {
    "shift": ("shift-x", "shift-y"),
    "rigid": ("rotation", "shift-x", "shift-y"),
    "similarity": ("scale", "rotation", "shift-x", "shift-y"),
    "similarity+radial": ("scale", "rotation", "shift-x", "shift-y", "radial"),
    "affine": ("xx", "xy", "yx", "yy", "shift-x", "shift-y"),
}
# Units of the parameters; scales and matrix elements have none.
UNITS = {"rotation": "rad", "shift-x": "px", "shift-y": "px", "radial": "px^-2"}
_NONE = np.zeros(())
EFFECTS = ("coefficients", "cube", "pivot", "tilt", "second term")


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


@dataclass(frozen=True, eq=False)
class Registration:
    """One of the five models with its parameters; one transform or a batch of them.

    Implements: niu2024 (13), (15), (16), (17), (18).

    Attributes
    ----------
    model : str
        A key of `MODELS`.
    parameters : ndarray, shape (..., p), in the order of `MODELS`
    pivot : ndarray, shape (..., 2), in px

    Examples
    --------
    >>> double = Registration("similarity", np.array([2.0, 0, 1, 0]), np.array([5.0, 5.0]))
    >>> double.apply([[6, 5]])
    array([[6., 5.]])
    >>> double.inverse().apply([[6, 5]])
    array([[6., 5.]])
    """

    model: str
    parameters: FloatArray
    pivot: FloatArray

    def __post_init__(self) -> None:
        shape = (len(_parameter_names(self.model)),)
        parameters = validate.finite_array("parameters", self.parameters, shape=shape)
        pivot = validate.finite_array("pivot", self.pivot, shape=(2,))
        validate.common_batch(parameters=parameters.shape[:-1], pivot=pivot.shape[:-1])
        object.__setattr__(self, "parameters", parameters)
        object.__setattr__(self, "pivot", pivot)

    @classmethod
    @validate.checked
    def similarity(
        cls, scale: Positive, rotation: Number, shift: Point, pivot: Point
    ) -> Registration:
        """Make a scale, rotation and shift about a pivot: the four parameters of niu2024.

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
        return cls._unchecked("similarity", np.stack(columns, axis=-1), pivot)

    @classmethod
    def _unchecked(
        cls, model: str, parameters: FloatArray, pivot: FloatArray
    ) -> Registration:
        """Make a registration from what a fit has just computed, without checking it again."""
        registration = object.__new__(cls)
        object.__setattr__(registration, "model", model)
        object.__setattr__(registration, "parameters", parameters)
        object.__setattr__(registration, "pivot", pivot)
        return registration

    @property
    def batch(self) -> tuple[int, ...]:
        """The batch shape; () for a single transform."""
        return np.broadcast_shapes(self.parameters.shape[:-1], self.pivot.shape[:-1])

    @property
    def scale(self) -> FloatArray:
        """The scale factor k, shape (...), of a model that has one."""
        return self._named("scale")

    @property
    def rotation(self) -> FloatArray:
        """The angle theta in radians, shape (...), of a model that has one."""
        return self._named("rotation")

    @property
    def factor(self) -> ComplexArray:
        """The complex number k exp(i theta) of a similarity, shape (...)."""
        return self.scale * np.exp(1j * self.rotation)

    @property
    def matrix(self) -> FloatArray:
        """The linear part about the pivot, shape (..., 2, 2)."""
        return _linear_part(self.model, self.parameters)

    @property
    def shift(self) -> FloatArray:
        """Where the pivot was minus where it lands, shape (..., 2), in px."""
        start = MODELS[self.model].index("shift-x")
        return self.parameters[..., start : start + 2]

    @validate.checked
    def apply(self, points: Points) -> FloatArray:
        """Lay source points over the target.

        Parameters
        ----------
        points : array_like, shape (..., n, 2), in the source, in px

        Returns
        -------
        ndarray, shape (..., n, 2), in the target, in px
        """
        offsets = points - self.pivot[..., None, :]
        if self.model == "similarity":
            landed = self.factor[..., None] * as_complex(offsets)
            return as_points(landed + as_complex(self.pivot - self.shift)[..., None])
        if self.model == "similarity+radial":
            squared = np.square(offsets).sum(axis=-1, keepdims=True)
            offsets = offsets * (1 + self.parameters[..., -1:, None] * squared)
        return offsets @ self.matrix.mT + (self.pivot - self.shift)[..., None, :]

    _apply = validate.kernel(apply)

    def affine(self) -> tuple[FloatArray, FloatArray]:
        """Write the transform as matrix and translation: matrix @ point + translation.

        Implements: niu2024 (4).

        Returns
        -------
        ndarray, shape (..., 2, 2)
            The matrix: T = k R(theta) of a similarity.
        ndarray, shape (..., 2)
            The translation, in px. It is not minus the shift: it also undoes the pivot.

        Raises
        ------
        ValueError
            If the transform bends straight lines, by a radial term.
        """
        if self.model == "similarity+radial":
            raise ValueError(
                "expected a transform that keeps lines straight, got one with a radial term; "
                "apply it to points instead"
            )
        matrix = self.matrix
        return matrix, self.pivot - self.shift - (matrix @ self.pivot[..., None])[
            ..., 0
        ]

    def inverse(self) -> Registration:
        """Return the transform from target to source, about the same pivot.

        The inverse of a similarity is a similarity, the inverse of other models is affine. A model
        with a radial term raises ValueError.
        """
        if self.model == "similarity":
            back = 1 / self.factor
            shift = as_points(-back * as_complex(self.shift))
            return Registration.similarity(
                np.abs(back), np.angle(back), shift, self.pivot
            )
        inverse = np.asarray(np.linalg.inv(self.affine()[0]), dtype=np.float64)
        shift = -(inverse @ self.shift[..., None])[..., 0]
        flat = inverse.reshape(*inverse.shape[:-2], 4)
        return Registration(
            "affine", np.concatenate([flat, shift], axis=-1), self.pivot
        )

    def _named(self, name: str) -> FloatArray:
        names = MODELS[self.model]
        if name not in names:
            raise ValueError(f"expected a model with a {name}, got {self.model!r}")
        return self.parameters[..., names.index(name)]


@validate.checked
def principal_point_shift(
    principal_point: Point, reference_principal_point: Point
) -> FloatArray:
    """The shift of a channel against the reference: the difference of principal points.

    Implements: niu2024 (14).

    Parameters
    ----------
    principal_point, reference_principal_point : array_like, shape (..., 2), in px

    Returns
    -------
    ndarray, shape (..., 2)
        Channel minus reference, in px.

    Examples
    --------
    >>> principal_point_shift((7, 9), (5, 10))
    array([ 2., -1.])
    """
    return principal_point - reference_principal_point


@validate.checked
def similarity_between(
    camera: Camera, rotation: Number, reference: Camera
) -> Registration:
    """The similarity that the imaging parameters of two channels imply, distortion left aside.

    Parameters
    ----------
    camera, reference : Camera
        The source channel and the reference (target) channel.
    rotation : array_like, shape (...)
        Angle of the source detector against the reference, in radians.

    Returns
    -------
    Registration
        Scale: ratio of focal lengths in px; shift: difference of principal points; pivot: the
        principal point of `camera`. Exact where both distortions are zero.

    Examples
    --------
    >>> green = Camera(30e-3, (10, 10), 0, 1e-5)
    >>> similarity_between(Camera(20e-3, (11, 9), 0, 1e-5), 0.0, green).parameters
    array([ 1.5,  0. ,  1. , -1. ])
    """
    # In px, so that channels may differ in pixel pitch too; the paper's do not.
    scale = (reference.focal_length / camera.focal_length) * (
        camera.pixel_pitch / reference.pixel_pitch
    )
    shift = camera.principal_point - reference.principal_point
    return Registration.similarity(scale, rotation, shift, camera.principal_point)


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


@validate.checked
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


@validate.checked
def paired_points(source: Points, target: Points) -> tuple[FloatArray, FloatArray]:
    """Check two sets of points, (..., n, 2), that belong together row by row.

    Examples
    --------
    >>> paired_points([[1, 2]], [[3, 4]])
    (array([[1., 2.]]), array([[3., 4.]]))
    """
    return source, target


def registered_image(
    image: ArrayLike,
    transform: Registration,
    *,
    order: Literal[0, 1, 3] = 3,
    corner: tuple[int, int] = (0, 0),
) -> FloatArray:
    """Return a source image on the pixels of the target.

    The value of a target pixel is read off the source where the transform comes from, between the
    pixels by splines. It is divided by how much the transform enlarges an area: a spot that is
    stretched over more pixels keeps its light.

    Parameters
    ----------
    image : array_like, shape (height, width)
        In any unit of light, background taken away: outside the image there is nothing.
    transform : Registration, or what a fit returns
        From source to target; a single one, without a radial term.
    order : int
        Order of the splines: 0 for the nearest pixel, 1 for linear, 3 for cubic splines.
    corner : tuple of int
        x and y of the image's first pixel, where it is a window of a larger one.

    Returns
    -------
    ndarray, shape (height, width)
        On target pixels that begin at the same corner.

    Raises
    ------
    ValueError
        If the transform is a batch, or has a radial term.

    Examples
    --------
    A spot one pixel to the right, brought back by a shift of one.

    >>> image = np.zeros((3, 4))
    >>> image[1, 2] = 8.0
    >>> registered_image(image, Registration.similarity(1, 0, (1, 0), (0, 0)), order=1)
    array([[0., 0., 0., 0.],
           [0., 8., 0., 0.],
           [0., 0., 0., 0.]])
    """
    from scipy.ndimage import affine_transform  # registering stars does not need it

    light = validate.finite_array("image", image, shape=(None, None))
    # A fit and the result of `reproduce.register` contain their transform.
    transform = getattr(transform, "transform", transform)
    if not isinstance(transform, Registration):
        raise TypeError(
            f"transform: expected a Registration, got {type(transform).__name__}. Pass a fit"
        )
    if transform.batch or light.ndim != 2:
        raise ValueError(
            f"image: expected one image and one transform, got shapes {light.shape} and "
            f"{transform.batch}. Pass one of them at a time"
        )
    first = validate.finite_array("corner", corner, shape=(2,))
    back, origin = transform.inverse().affine()
    # Source position of target pixel p: back (p + corner) + origin - corner; y before x below.
    offset = (back @ first + origin - first)[::-1]
    resampled = affine_transform(light, back[::-1, ::-1], offset, order=order)
    return np.asarray(resampled / np.abs(np.linalg.det(transform.matrix)))


def _parameter_names(model: str) -> tuple[str, ...]:
    if model not in MODELS:
        raise ValueError(f"model: expected one of {', '.join(MODELS)}, got {model!r}")
    return MODELS[model]


def _linear_part(model: str, parameters: FloatArray) -> FloatArray:
    """Return the matrix of a model about its pivot, shape (..., 2, 2); the radial term aside."""
    batch = parameters.shape[:-1]
    if model == "affine":
        return parameters[..., :4].reshape(*batch, 2, 2)
    if model == "shift":
        return np.broadcast_to(np.eye(2), (*batch, 2, 2))
    scale = 1.0 if model == "rigid" else parameters[..., 0]
    turn = parameters[..., 0 if model == "rigid" else 1]
    cosine, sine = scale * np.cos(turn), scale * np.sin(turn)
    rows = np.stack([cosine, -sine, sine, cosine], axis=-1)
    return rows.reshape(*batch, 2, 2)


@dataclass(frozen=True, eq=False)
class Channels:
    """A source channel and the reference, with the effects that the model neglects.

    Attributes
    ----------
    source, reference : Camera
        Their imaging parameters; single cameras.
    rotation : float
        Angle of the source detector against the reference, in radians.
    pivot_error : tuple of float
        How far the assumed pivot lies from the source's principal point, in px.
    tilt : tuple of float
        Slopes of the source detector along x and y: the tangents of its tilt. A positive one
        leans that side away from the lens, where the light has spread further.
    second_term : tuple of float
        Second radial coefficients of source and reference, in m^-4.
    """

    source: Camera
    reference: Camera
    rotation: float = 0.0
    pivot_error: tuple[float, float] = (0.0, 0.0)
    tilt: tuple[float, float] = (0.0, 0.0)
    second_term: tuple[float, float] = (0.0, 0.0)

    @property
    def scale(self) -> float:
        """The scale factor k."""
        return float(self.reference.focal_length / self.source.focal_length)

    def only(self, effect: str) -> Channels:
        """Return the same channels with a single effect left, all others taken away.

        Parameters
        ----------
        effect : str
            One of `EFFECTS`. For "coefficients" the source's distortion is kept and the difference
            alone counts; for "cube" both channels get the source's.

        Returns
        -------
        Channels

        """
        if effect not in EFFECTS:
            raise ValueError(f"effect: expected one of {EFFECTS}, got {effect!r}")
        m = self.source.radial_distortion if effect in EFFECTS[:2] else _NONE
        shared = {"coefficients": self.reference.radial_distortion, "cube": m}.get(
            effect, _NONE
        )
        return Channels(
            replace(self.source, radial_distortion=m),
            replace(self.reference, radial_distortion=shared),
            self.rotation,
            self.pivot_error if effect == "pivot" else (0.0, 0.0),
            self.tilt if effect == "tilt" else (0.0, 0.0),
            self.second_term if effect == "second term" else (0.0, 0.0),
        )


def error_field(channels: Channels, positions: ArrayLike) -> FloatArray:
    """Reference points minus modelled points, at the true parameters and imaged exactly.

    Parameters
    ----------
    channels : Channels
    positions : array_like, shape (n, 2)
        Ideal positions in the source channel, in metres.

    Returns
    -------
    ndarray, shape (n, 2), in px

    Examples
    --------
    Equal channels without distortion have no error.

    >>> camera = Camera(25e-3, (1000, 700), 0, 1e-5)
    >>> error_field(Channels(camera, camera), [[1e-3, 2e-3]])
    array([[0., 0.]])
    """
    source, reference = _imaged(channels, positions)
    truth = similarity_between(channels.source, channels.rotation, channels.reference)
    # True parameters, but about the pivot that is assumed.
    pivot = channels.source.principal_point + np.asarray(channels.pivot_error)
    turned = _turned(source - pivot, -truth.rotation)
    return reference - (truth.scale * turned + pivot - truth.shift)


def even_positions(half_size: ArrayLike, across: int = 200) -> FloatArray:
    """Cover a detector evenly with positions.

    Parameters
    ----------
    half_size : array_like, shape (2,)
        Half the sides of the detector, in metres.
    across : int
        How many along either side.

    Returns
    -------
    ndarray, shape (across * across, 2)
        The middles of equal cells, in metres, rows from the smallest y.

    Examples
    --------
    >>> even_positions((2.0, 1.0), 2)
    array([[-1. , -0.5],
           [ 1. , -0.5],
           [-1. ,  0.5],
           [ 1. ,  0.5]])
    """
    sides = validate.positive("half_size", half_size, shape=(2,))
    steps = (np.arange(across) + 0.5) / across * 2 - 1
    x, y = np.meshgrid(sides[0] * steps, sides[1] * steps)
    return np.stack([x.ravel(), y.ravel()], axis=-1)


@validate.checked
def _imaged(channels: Channels, positions: Points) -> tuple[FloatArray, FloatArray]:
    """Image the same stars in both channels, in px, with tilt and second radial terms."""
    source = _displaced(positions, channels.source, channels.second_term[0])
    # The ray through a point p of the plane at F meets the tilted plane at p F / (F - p . tilt).
    focal = float(channels.source.focal_length)
    lean = (source @ np.asarray(channels.tilt))[:, None] / focal
    along = np.sqrt(1 + np.square(channels.tilt))
    tilted = source / (1 - lean) * along
    turned = _turned(tilted, np.asarray(channels.rotation))
    reference = _displaced(
        positions * channels.scale, channels.reference, channels.second_term[1]
    )
    return _in_pixels(turned, channels.source), _in_pixels(
        reference, channels.reference
    )


def _displaced(ideal: FloatArray, camera: Camera, second: float) -> FloatArray:
    squared = np.square(ideal).sum(axis=-1, keepdims=True)
    first = float(camera.radial_distortion)
    return ideal * (1 + first * squared + second * squared**2)


def _in_pixels(positions: FloatArray, camera: Camera) -> FloatArray:
    return positions / camera.pixel_pitch + camera.principal_point
