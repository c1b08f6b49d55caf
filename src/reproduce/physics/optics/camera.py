"""From starlight to image points: the pinhole camera with one radial distortion term.

Frames and units of this module:

* directions have shape (..., n, 3) in the camera frame, x along the rows of the detector, y along
  its columns, z along the boresight towards the star; their length does not matter;
* positions on the focal plane have shape (..., n, 2), in metres, measured from the principal point;
* image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
  (0, 0); distances on the detector are in px too;
* angles are in radians.

The leading axes are a batch: many frames, many simulated calibrations, many cameras at once.

The reference channel is the green one; the other is named by its role.

A channel is calibrated by itself from known starlight: focal length, principal point and
distortion. The model is linear in F, m F^3 and the principal point. Its least-squares minimum
is therefore found at once, without starting values, and it is the minimum over F and m too,
because the one pair follows from the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.validate import (
    Directions,
    FloatArray,
    Number,
    Point,
    Points,
    Positive,
    Size,
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
    return (validate.positive("pixels", pixels, shape=(2,)) - 1) / 2


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

    @validate.checked
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


@validate.checked
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
            "next to or behind it; check the frame and its sign, or drop these stars"
        )
    return focal_length[..., None, None] * (across / along)


_ideal = validate.kernel(ideal_positions)


@validate.checked
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


_displacements = validate.kernel(radial_displacements)


@validate.checked
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


_turned = validate.kernel(turned_onto_detector)


@validate.checked
def image_points(
    directions: Directions, camera: Camera, rotation: Number = 0.0
) -> FloatArray:
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
    return (
        turned / camera.pixel_pitch[..., None, None]
        + camera.principal_point[..., None, :]
    )


def field_of_view(
    pixels: ArrayLike, pixel_pitch: ArrayLike, focal_length: ArrayLike
) -> FloatArray:
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
    return 2 * angle_from_pixels(
        validate.positive("pixels", pixels) / 2, pixel_pitch, focal_length
    )


@validate.checked
def angle_from_pixels(
    pixels: Number, pixel_pitch: Positive, focal_length: Positive
) -> FloatArray:
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


@validate.checked
def scale_factor(
    reference_focal_length: Positive, focal_length: Positive
) -> FloatArray:
    """The scale factor k that lays ideal positions of a channel over those of the reference.

    Implements: niu2024 (6).

    Parameters
    ----------
    reference_focal_length, focal_length : array_like
        Focal lengths of the reference channel and of the other, in the same unit.

    Returns
    -------
    ndarray
        k = reference / other, without unit.

    Examples
    --------
    >>> float(scale_factor(30e-3, 20e-3))
    1.5
    """
    return np.asarray(reference_focal_length / focal_length)


@validate.checked
def distortion_ratio(
    scale: Positive, reference_distortion: Number = 1.0, distortion: Number = 1.0
) -> FloatArray:
    """Displacement by distortion in the reference channel over that in the other.

    Implements: niu2024 (7), (8).

    Parameters
    ----------
    scale : array_like
        Scale factor k, above zero.
    reference_distortion, distortion : array_like
        First radial coefficients of the reference channel and of the other, in the same unit; the
        other one not zero. Without them all channels share one coefficient, which is (8).

    Returns
    -------
    ndarray
        k^3 * reference_distortion / distortion, the same in x and y.

    Examples
    --------
    >>> float(distortion_ratio(2.0, 3.0, 4.0)), float(distortion_ratio(2.0))
    (6.0, 8.0)
    """
    if (distortion == 0).any():
        raise ValueError(
            "distortion: expected a coefficient other than zero, got zero; "
            "a channel without distortion has no ratio"
        )
    return np.asarray(scale**3 * (reference_distortion / distortion))


@validate.checked
def reference_points_scaled(
    points: Points, scale: Positive, principal_point: Point
) -> FloatArray:
    """Image points of the reference channel where only focal length and distortion differ.

    Implements: niu2024 (9), (10), (11), (12).

    What an image point holds beyond the principal point is its ideal position and distortion
    together, by (11). Both are scaled by k in (10), the distortion by (9), which takes k^3 = k;
    near k = 1 its relative error is 2 (1 - k).

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Image points of the other channel, in px.
    scale : array_like, shape (...)
        Scale factor k, above zero.
    principal_point : array_like, shape (..., 2)
        Shared by both channels here, in px.

    Returns
    -------
    ndarray, shape (..., n, 2)
        In px: k * points - k * principal_point + principal_point.

    Examples
    --------
    >>> reference_points_scaled([[7, 9]], 2.0, (5, 5))
    array([[ 9., 13.]])
    """
    principal_point = principal_point[..., None, :]
    return scale[..., None, None] * (points - principal_point) + principal_point


@validate.checked
def fit_camera(
    directions: Directions, points: Points, pixel_pitch: Size, rotation: Number = 0.0
) -> Camera:
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
    Camera
        The estimate, batch shape (...).

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
    >>> float(fit.focal_length.round(9)), fit.principal_point.round(9)
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
    (a, b), (_, d) = np.moveaxis(normal, (-2, -1), (0, 1))
    if not ((a > 0) & (a * d - b**2 > 1e-12 * a * d)).all():
        raise validate.DegenerateGeometryError(
            "directions: expected slopes that fix focal length and distortion, got the same slope "
            "throughout or only two points; turn the table to angles near and far from zero"
        )
    linear = np.linalg.solve(normal, pull[..., np.newaxis])[..., 0]
    origin = (points - np.einsum("...nij,...j->...ni", columns, linear)).mean(axis=-2)
    if (linear[..., 0] <= 0).any():
        raise ValueError(
            "points: expected an image that grows with the slope of the starlight, got a focal "
            "length of zero or less; check the signs of the axes"
        )
    return Camera(
        linear[..., 0], origin, linear[..., 1] / linear[..., 0] ** 3, pixel_pitch
    )
