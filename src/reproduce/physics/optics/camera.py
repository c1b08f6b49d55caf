"""From starlight to image points: the pinhole camera with one radial distortion term.

Frames and units, said once for this module:

* directions have shape (..., n, 3) in the camera frame, x along the rows of the detector, y along
  its columns, z along the boresight towards the star; their length does not matter;
* positions on the focal plane have shape (..., n, 2), in metres, measured from the principal point;
* image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
  (0, 0); distances on the detector are in px too;
* angles are in radians.

The leading axes are a batch: many frames, many simulated calibrations, many cameras at once.

Calibrating one channel alone: focal length, principal point and distortion from known starlight.

Directions have shape (..., n, 3), in the camera frame, z along the boresight; image points have
shape (..., n, 2), in px, x before y, with the centre of the first pixel at (0, 0). Parameters are
always in the order focal length F (m), principal point x, y (px), radial distortion m (m^-2); the
leading axes are a batch of calibrations.

The model is linear in F, m F^3 and the principal point. Its least-squares minimum is therefore
found at once, without starting values, and it is the minimum over F and m too, because the one
pair follows from the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.validate import (
    DegenerateGeometryError,
    Directions,
    FloatArray,
    Number,
    Point,
    Points,
    Positive,
    Size,
    checked,
    kernel,
    positive,
)


def detector_centre(pixels: ArrayLike) -> FloatArray:
    """The middle of a detector, (..., 2) in px; it stands in for an unprinted principal point.

    Parameters
    ----------
    pixels : array_like, shape (..., 2)
        How many along x and along y.

    Returns
    -------
    ndarray, shape (..., 2), in px

    Examples
    --------
    >>> detector_centre((3, 4))
    array([1. , 1.5])
    """
    return (positive("pixels", pixels, shape=(2,)) - 1) / 2


@dataclass(frozen=True, eq=False, init=False)
class Camera:
    """The imaging parameters of one channel, or of a batch of them; checked when it is made.

    Parameters
    ----------
    focal_length : array_like, shape (...), in metres
    principal_point : array_like, shape (..., 2)
        Where the boresight meets the detector, in px.
    radial_distortion : array_like, shape (...)
        First radial coefficient, in m^-2 (1e-5 per square millimetre is 10 per square metre).
    pixel_pitch : array_like, shape (...)
        Distance between the centres of neighbouring pixels, in metres.
    """

    focal_length: FloatArray
    principal_point: FloatArray
    radial_distortion: FloatArray
    pixel_pitch: FloatArray

    @checked
    def __init__(
        self,
        focal_length: Positive,
        principal_point: Point,
        radial_distortion: Number,
        pixel_pitch: Positive,
    ) -> None:
        given = (focal_length, principal_point, radial_distortion, pixel_pitch)
        for name, array in zip(self.__dataclass_fields__, given, strict=True):
            object.__setattr__(self, name, array)

    @property
    def batch(self) -> tuple[int, ...]:
        """The batch shape of the parameters; () for a single camera."""
        return np.broadcast_shapes(
            self.focal_length.shape,
            self.principal_point.shape[:-1],
            self.radial_distortion.shape,
            self.pixel_pitch.shape,
        )


@checked
def ideal_positions(directions: Directions, focal_length: Positive) -> FloatArray:
    """Where an ideal pinhole camera images the given directions.

    Implements: niu2024 (1), (5).

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Towards the stars, in the camera frame, of any length.
    focal_length : array_like, shape (...), in metres

    Returns
    -------
    ndarray, shape (..., n, 2)
        Positions on the focal plane, in metres, from the principal point.

    Raises
    ------
    ValueError
        If a direction does not point in front of the camera (z > 0).

    Examples
    --------
    >>> ideal_positions([[1, 2, 10]], 20e-3)
    array([[0.002, 0.004]])
    """
    across, along = directions[..., :2], directions[..., 2:]
    # Below this slope the tangent is so large that the position means nothing any more.
    behind = along[..., 0] <= 1e-9 * np.abs(across).max(axis=-1)
    if behind.any():
        raise ValueError(
            f"directions: expected stars in front of the camera (z > 0), got {int(behind.sum())} "
            "beside or behind it; check the frame and its sign, or drop these stars"
        )
    return focal_length[..., None, None] * (across / along)


_ideal = kernel(ideal_positions)


@checked
def radial_displacements(ideal: Points, radial_distortion: Number) -> FloatArray:
    """How far the first radial term moves spots from their ideal positions.

    Implements: niu2024 (3).

    Parameters
    ----------
    ideal : array_like, shape (..., n, 2)
        Ideal positions, in metres, from the principal point.
    radial_distortion : array_like, shape (...)
        First radial coefficient, in m^-2; positive pushes outwards.

    Returns
    -------
    ndarray, shape (..., n, 2)
        Displacements, in metres: position times coefficient times squared radius.

    Examples
    --------
    >>> radial_displacements([[3.0, 4.0]], 2.0)
    array([[150., 200.]])
    """
    squared_radius = np.square(ideal).sum(axis=-1, keepdims=True)
    return ideal * (radial_distortion[..., None, None] * squared_radius)


_displacements = kernel(radial_displacements)


@checked
def turned_onto_detector(positions: Points, rotation: Number) -> FloatArray:
    """The same spots in the axes of a detector that is turned about the boresight.

    The matrix is [[cos, sin], [-sin, cos]]: a detector turned by +theta (x towards y) sees the
    spots turned by -theta, and rotating the spots by +theta brings them back.

    Parameters
    ----------
    positions : array_like, shape (..., n, 2), from the principal point, in any unit of length
    rotation : array_like, shape (...)
        Angle theta of the detector against the reference detector, in radians.

    Returns
    -------
    ndarray, shape (..., n, 2), in the same unit

    Examples
    --------
    >>> turned_onto_detector([[1, 0]], np.pi / 2).round(12)
    array([[ 0., -1.]])
    """
    cosine, sine = np.cos(rotation)[..., None], np.sin(rotation)[..., None]
    x, y = positions[..., 0], positions[..., 1]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=-1)


_turned = kernel(turned_onto_detector)


@checked
def image_points(directions: Directions, camera: Camera, rotation: Number = 0.0) -> FloatArray:
    """Where a channel images the given directions: projection, distortion, rotated detector.

    Implements: niu2024 (2), (21), (22), (23).

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Towards the stars, in the frame of the reference (green) channel.
    camera : Camera
        Imaging parameters of this channel.
    rotation : array_like, shape (...)
        Angle theta of this channel's detector against the reference, in radians; zero for the
        reference channel itself, which is (2) and (21).

    Returns
    -------
    ndarray, shape (..., n, 2)
        Image points, in px.

    Raises
    ------
    ValueError
        If a direction does not point in front of the camera (z > 0).

    Examples
    --------
    A slope of 1/10 at 20 mm is 2 mm, which is 200 px of 10 micrometres.

    >>> image_points([[1, 0, 10]], Camera(20e-3, (50, 60), 0, 10e-6)).round(9)
    array([[250.,  60.]])
    """
    ideal = _ideal(directions, camera.focal_length)
    turned = _turned(ideal + _displacements(ideal, camera.radial_distortion), rotation)
    return turned / camera.pixel_pitch[..., None, None] + camera.principal_point[..., None, :]


def field_of_view(pixels: ArrayLike, pixel_pitch: ArrayLike, focal_length: ArrayLike) -> FloatArray:
    """The full angle that a row of pixels sees, the boresight at its middle.

    Arguments are those of `angle_from_pixels`, with the pixels their number, above zero.

    Returns
    -------
    ndarray
        Full angle, in radians: 2 atan(pixels * pixel_pitch / (2 * focal_length)).

    Examples
    --------
    A detector as wide as twice the focal length sees 90 degrees.

    >>> float(np.degrees(field_of_view(2000, 1e-5, 10e-3)).round(9))
    90.0
    """
    return 2 * angle_from_pixels(positive("pixels", pixels) / 2, pixel_pitch, focal_length)


@checked
def angle_from_pixels(pixels: Number, pixel_pitch: Positive, focal_length: Positive) -> FloatArray:
    """The angle between the boresight and a spot that many pixels from the principal point.

    Parameters
    ----------
    pixels : array_like
        Signed distance, in px.
    pixel_pitch, focal_length : array_like, in metres

    Returns
    -------
    ndarray
        Signed angle, in radians: atan(pixels * pixel_pitch / focal_length).

    Examples
    --------
    >>> float(np.degrees(angle_from_pixels(1000, 1e-5, 10e-3)).round(9))
    45.0
    """
    return np.asarray(np.arctan(pixels * pixel_pitch / focal_length))


_PARAMETERS = 4


@dataclass(frozen=True, eq=False)
class CameraFit:
    """A channel's fitted imaging parameters and what they leave over.

    Attributes
    ----------
    camera : Camera
        The estimate, batch shape (...).
    residuals : ndarray, shape (..., n, 2)
        Measured minus modelled image points, in px.
    cofactor : ndarray, shape (..., 4, 4)
        Inverse normal matrix of (F, x, y, m): the covariance for errors of one px.
    """

    camera: Camera
    residuals: FloatArray
    cofactor: FloatArray

    @property
    def parameters(self) -> FloatArray:
        """The vector (F, x, y, m), shape (..., 4), in m, px, px, m^-2."""
        point = self.camera.principal_point
        columns = (self.camera.focal_length, point[..., 0], point[..., 1])
        return np.stack([*columns, self.camera.radial_distortion], axis=-1)

    @property
    def covariance(self) -> FloatArray:
        """The cofactor matrix scaled by the residuals' own variance, shape (..., 4, 4)."""
        freedom = 2 * self.residuals.shape[-2] - _PARAMETERS
        if freedom <= 0:
            raise DegenerateGeometryError(
                "covariance: expected at least three points, got two; add points, or multiply "
                "`cofactor` by a known variance"
            )
        variance = np.square(self.residuals).sum(axis=(-2, -1)) / freedom
        return variance[..., None, None] * self.cofactor


@checked
def fit_camera(
    directions: Directions, points: Points, pixel_pitch: Size, rotation: Number = 0.0
) -> CameraFit:
    """The imaging parameters of one channel by least squares on its imaging model, (2) with (3).

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Known starlight, in the frame of the reference channel.
    points : array_like, shape (..., n, 2)
        Where the channel images it, in px.
    pixel_pitch : float, in metres
    rotation : array_like, shape (...)
        Angle of the detector against the reference, in radians; zero for the reference itself.

    Returns
    -------
    CameraFit

    Raises
    ------
    ValueError
        If the counts differ, a direction does not point in front of the camera, or the points
        leave the focal length zero or negative (a mirrored axis does).
    DegenerateGeometryError
        If the directions do not fix all four parameters: the same slope throughout.

    Examples
    --------
    >>> slopes = [[0, 0, 1], [0.1, 0, 1], [0, 0.2, 1]]
    >>> fit = fit_camera(slopes, [[50, 60], [250, 60], [50, 460]], 1e-5)
    >>> float(fit.camera.focal_length.round(9)), fit.camera.principal_point.round(9)
    (0.02, array([50., 60.]))
    """
    slopes = _turned(_ideal(directions, np.ones(())), rotation)
    squared = np.square(slopes).sum(axis=-1, keepdims=True)
    columns = np.stack([slopes, slopes * squared], axis=-1) / pixel_pitch
    # About the means, so that the principal point need not be solved for with the others.
    centred = columns - columns.mean(axis=-3, keepdims=True)
    observed = points - points.mean(axis=-2, keepdims=True)
    normal = np.einsum("...nij,...nik->...jk", centred, centred)
    pull = np.einsum("...nij,...ni->...j", centred, observed)
    linear = np.einsum("...jk,...k->...j", _inverse(normal), pull)
    modelled = np.einsum("...nij,...j->...ni", columns, linear)
    origin = (points - modelled).mean(axis=-2)
    if (linear[..., 0] <= 0).any():
        raise ValueError(
            "points: expected an image that grows with the slope of the starlight, got a focal "
            "length of zero or less; check the signs of the axes"
        )
    camera = Camera(linear[..., 0], origin, linear[..., 1] / linear[..., 0] ** 3, pixel_pitch)
    residuals = points - modelled - origin[..., None, :]
    return CameraFit(camera, residuals, _cofactor(camera, columns, normal))


def _inverse(normal: FloatArray) -> FloatArray:
    a, b, d = normal[..., 0, 0], normal[..., 0, 1], normal[..., 1, 1]
    determinant = a * d - b**2
    if not ((a > 0) & (determinant > 1e-12 * a * d)).all():
        raise DegenerateGeometryError(
            "directions: expected slopes that fix focal length and distortion, got the same slope "
            "throughout or two points alone; turn the table to angles near and far from zero"
        )
    rows = [np.stack([d, -b], axis=-1), np.stack([-b, a], axis=-1)]
    return np.stack(rows, axis=-2) / determinant[..., None, None]


def _cofactor(camera: Camera, columns: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the inverse normal matrix by F, x, y, m, from that by the linear parameters."""
    focal, count = camera.focal_length, columns.shape[-3]
    inner = _inverse(normal)
    mean = columns.mean(axis=-3)
    batch = np.broadcast_shapes(inner.shape[:-2], focal.shape)
    linear = np.zeros((*batch, _PARAMETERS, _PARAMETERS))
    linear[..., :2, :2] = inner
    linear[..., 2:, :2] = -mean @ inner
    linear[..., :2, 2:] = linear[..., 2:, :2].mT
    linear[..., 2:, 2:] = np.eye(2) / count + mean @ inner @ mean.mT
    # Rows: F, x, y, m; columns: F, m F^3, x, y.
    change = np.zeros_like(linear)
    change[..., 0, 0] = change[..., 1, 2] = change[..., 2, 3] = 1
    change[..., 3, 0] = -3 * camera.radial_distortion / focal
    change[..., 3, 1] = 1 / focal**3
    return change @ linear @ change.mT
