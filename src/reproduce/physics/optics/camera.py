"""From starlight to image points: the pinhole camera with one radial distortion term.

Frames and units, said once for this module:

* directions have shape (..., n, 3) in the camera frame, x along the rows of the detector, y along
  its columns, z along the boresight towards the star; their length does not matter;
* positions on the focal plane have shape (..., n, 2), in metres, measured from the principal point;
* image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
  (0, 0); distances on the detector are in px too;
* angles are in radians.

The leading axes are a batch: many frames, many simulated calibrations, many cameras at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.validate import FloatArray, common_batch, finite_array, positive


def detector_centre(pixels: ArrayLike) -> FloatArray:
    """The middle of a detector whose first pixel has its centre at (0, 0).

    It stands in for a principal point that is not printed.

    Parameters
    ----------
    pixels : array_like, shape (..., 2)
        How many along x and along y.

    Returns
    -------
    ndarray, shape (..., 2)
        In px: half a pixel less than half of their number.

    Raises
    ------
    ValueError
        If a number is not finite and above zero, or the shape does not fit.

    Examples
    --------
    >>> detector_centre((3, 4))
    array([1. , 1.5])
    """
    return (positive("pixels", finite_array("pixels", pixels, shape=(2,))) - 1) / 2


@dataclass(frozen=True, eq=False, init=False)
class Camera:
    """The imaging parameters of one channel, checked when it is made.

    Every parameter may carry leading batch axes, so that one object holds many cameras.

    Parameters
    ----------
    focal_length : array_like, shape (...)
        In metres, above zero.
    principal_point : array_like, shape (..., 2)
        Where the boresight meets the detector, in px.
    radial_distortion : array_like, shape (...)
        First radial coefficient, in m^-2 (1e-5 per square millimetre is 10 per square metre).
    pixel_pitch : array_like, shape (...)
        Distance between the centres of neighbouring pixels, in metres, above zero.

    Raises
    ------
    ValueError
        If a parameter is not finite, has the wrong shape, or a length is not above zero.

    Examples
    --------
    >>> camera = Camera(25e-3, (1032, 772), 0, 3.45e-6)
    >>> camera.principal_point
    array([1032.,  772.])
    """

    focal_length: FloatArray
    principal_point: FloatArray
    radial_distortion: FloatArray
    pixel_pitch: FloatArray

    def __init__(
        self,
        focal_length: ArrayLike,
        principal_point: ArrayLike,
        radial_distortion: ArrayLike,
        pixel_pitch: ArrayLike,
    ) -> None:
        checked = {
            "focal_length": positive("focal_length", focal_length),
            "principal_point": finite_array("principal_point", principal_point, shape=(2,)),
            "radial_distortion": finite_array("radial_distortion", radial_distortion),
            "pixel_pitch": positive("pixel_pitch", pixel_pitch),
        }
        batches = {name: array.shape for name, array in checked.items()}
        common_batch(**batches | {"principal_point": batches["principal_point"][:-1]})
        for name, array in checked.items():
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


def per_point(parameter: FloatArray) -> FloatArray:
    """Return a parameter of shape (...) with two axes more, to go with points (..., n, 2).

    Examples
    --------
    >>> per_point(np.ones(5)).shape
    (5, 1, 1)
    """
    return parameter[..., None, None]


def ideal_positions(directions: ArrayLike, focal_length: ArrayLike) -> FloatArray:
    """Where an ideal pinhole camera images the given directions.

    Implements: niu2024 (1), (5).

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Towards the stars, in the camera frame, of any length, in front of the camera (z > 0).
    focal_length : array_like, shape (...)
        In metres.

    Returns
    -------
    ndarray, shape (..., n, 2)
        Positions on the focal plane, in metres, from the principal point.

    Raises
    ------
    ValueError
        If a direction does not point in front of the camera, or an argument has the wrong shape
        or is not finite.

    Examples
    --------
    >>> ideal_positions([[1, 2, 10]], 20e-3)
    array([[0.002, 0.004]])
    """
    directions = finite_array("directions", directions, shape=(None, 3))
    focal_length = positive("focal_length", focal_length)
    common_batch(directions=directions.shape[:-2], focal_length=focal_length.shape)
    across, along = directions[..., :2], directions[..., 2:]
    # Below this slope the tangent is so large that the position means nothing any more.
    behind = along[..., 0] <= 1e-9 * np.abs(across).max(axis=-1)
    if behind.any():
        raise ValueError(
            f"directions: expected stars in front of the camera (z > 0), got {int(behind.sum())} "
            "beside or behind it; check the frame and its sign, or drop these stars"
        )
    return per_point(focal_length) * (across / along)


def radial_displacements(ideal: ArrayLike, radial_distortion: ArrayLike) -> FloatArray:
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

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape.

    Examples
    --------
    >>> radial_displacements([[3.0, 4.0]], 2.0)
    array([[150., 200.]])
    """
    ideal = finite_array("ideal", ideal, shape=(None, 2))
    radial_distortion = finite_array("radial_distortion", radial_distortion)
    common_batch(ideal=ideal.shape[:-2], radial_distortion=radial_distortion.shape)
    squared_radius = np.square(ideal).sum(axis=-1, keepdims=True)
    return np.asarray(ideal * (per_point(radial_distortion) * squared_radius))


def turned_onto_detector(positions: ArrayLike, rotation: ArrayLike) -> FloatArray:
    """The same spots in the axes of a detector that is turned about the boresight.

    The matrix is [[cos, sin], [-sin, cos]]: a detector turned by +theta (x towards y) sees the
    spots turned by -theta, and rotating the spots by +theta brings them back.

    Parameters
    ----------
    positions : array_like, shape (..., n, 2)
        From the principal point, in any unit of length.
    rotation : array_like, shape (...)
        Angle theta of the detector against the reference detector, in radians.

    Returns
    -------
    ndarray, shape (..., n, 2)
        In the same unit.

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape.

    Examples
    --------
    >>> turned_onto_detector([[1, 0]], np.pi / 2).round(12)
    array([[ 0., -1.]])
    """
    positions = finite_array("positions", positions, shape=(None, 2))
    rotation = finite_array("rotation", rotation)
    common_batch(positions=positions.shape[:-2], rotation=rotation.shape)
    cosine, sine = np.cos(rotation)[..., None], np.sin(rotation)[..., None]
    x, y = positions[..., 0], positions[..., 1]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=-1)


def image_points(directions: ArrayLike, camera: Camera, rotation: ArrayLike = 0.0) -> FloatArray:
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
        If a direction does not point in front of the camera, or an argument has the wrong shape
        or is not finite.

    Examples
    --------
    A slope of 1/10 at 20 mm is 2 mm, which is 200 px of 10 micrometres.

    >>> image_points([[1, 0, 10]], Camera(20e-3, (50, 60), 0, 10e-6)).round(9)
    array([[250.,  60.]])
    """
    ideal = ideal_positions(directions, camera.focal_length)
    rotation = finite_array("rotation", rotation)
    common_batch(directions=ideal.shape[:-2], camera=camera.batch, rotation=rotation.shape)
    displaced = ideal + radial_displacements(ideal, camera.radial_distortion)
    turned = turned_onto_detector(displaced, rotation)
    return turned / per_point(camera.pixel_pitch) + camera.principal_point[..., None, :]


def field_of_view(pixels: ArrayLike, pixel_pitch: ArrayLike, focal_length: ArrayLike) -> FloatArray:
    """The full angle that a row of pixels sees, the boresight at its middle.

    Parameters
    ----------
    pixels : array_like
        Number of pixels, above zero.
    pixel_pitch, focal_length : array_like
        In metres, above zero.

    Returns
    -------
    ndarray
        Full angle, in radians: 2 atan(pixels * pixel_pitch / (2 * focal_length)).

    Raises
    ------
    ValueError
        If an argument is not finite and above zero.

    Examples
    --------
    A detector as wide as twice the focal length sees 90 degrees.

    >>> float(np.degrees(field_of_view(2000, 1e-5, 10e-3)).round(9))
    90.0
    """
    pixels = positive("pixels", pixels)
    return 2 * angle_from_pixels(pixels / 2, positive("pixel_pitch", pixel_pitch), focal_length)


def angle_from_pixels(
    pixels: ArrayLike, pixel_pitch: ArrayLike, focal_length: ArrayLike
) -> FloatArray:
    """The angle between the boresight and a spot that many pixels from the principal point.

    Parameters
    ----------
    pixels : array_like
        Signed distance, in px.
    pixel_pitch, focal_length : array_like
        In metres, above zero.

    Returns
    -------
    ndarray
        Signed angle, in radians: atan(pixels * pixel_pitch / focal_length). Multiply by
        `ARCSEC_PER_RADIAN` for arcseconds.

    Raises
    ------
    ValueError
        If an argument is not finite, or a length is not above zero.

    Examples
    --------
    >>> float(np.degrees(angle_from_pixels(1000, 1e-5, 10e-3)).round(9))
    45.0
    """
    pixels = finite_array("pixels", pixels)
    pixel_pitch = positive("pixel_pitch", pixel_pitch)
    focal_length = positive("focal_length", focal_length)
    common_batch(
        pixels=pixels.shape, pixel_pitch=pixel_pitch.shape, focal_length=focal_length.shape
    )
    return np.asarray(np.arctan(pixels * pixel_pitch / focal_length))


def pixels_from_angle(
    angle: ArrayLike, pixel_pitch: ArrayLike, focal_length: ArrayLike
) -> FloatArray:
    """The distance from the principal point of a spot at that angle from the boresight.

    Parameters
    ----------
    angle : array_like
        Signed angle, in radians, between -pi/2 and pi/2.
    pixel_pitch, focal_length : array_like
        In metres, above zero.

    Returns
    -------
    ndarray
        Signed distance, in px: the inverse of `angle_from_pixels`.

    Raises
    ------
    ValueError
        If an argument is not finite, a length is not above zero, or an angle reaches 90 degrees.

    Examples
    --------
    >>> float(pixels_from_angle(np.pi / 4, 1e-5, 10e-3).round(9))
    1000.0
    """
    angle = finite_array("angle", angle)
    pixel_pitch = positive("pixel_pitch", pixel_pitch)
    focal_length = positive("focal_length", focal_length)
    if (np.abs(angle) >= np.pi / 2).any():
        raise ValueError(
            f"angle: expected between -pi/2 and pi/2, got {np.abs(angle).max():g} rad; "
            "angles are in radians, not degrees"
        )
    common_batch(angle=angle.shape, pixel_pitch=pixel_pitch.shape, focal_length=focal_length.shape)
    return np.asarray(np.tan(angle) * focal_length / pixel_pitch)
