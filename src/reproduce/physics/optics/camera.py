"""From starlight to image points: the pinhole camera with one radial distortion term.

Frames and units of this module:

* directions have shape (..., n, 3) in the camera frame, x along the rows of the detector, y along
  its columns, z along the boresight towards the star; their length does not matter;
* positions on the focal plane have shape (..., n, 2), in metres, measured from the principal point;
* image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
  (0, 0); distances on the detector are in px too;
* angles are in radians.

The leading axes of directions and points are a batch, for example of frames or simulated
calibrations. A camera is one channel. The reference channel is green.

A channel is calibrated separately from known starlight: focal length F, principal point and
distortion m. The model is linear in F, m F^3 and the principal point, so its least-squares solution
needs no starting values.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reproduce.physics.validate import (
    DegenerateGeometryError,
    Directions,
    FloatArray,
    Number,
    Point,
    Points,
    Positive,
    Sides,
    Size,
    checked,
    checked_fields,
    valid,
)


@checked
def detector_centre(pixels: Sides) -> FloatArray:
    """Return the middle of a detector, which replaces an unprinted principal point.

    Parameters
    ----------
    pixels : array_like, shape (..., 2)
        Numbers of pixels along x and along y.

    Returns
    -------
    ndarray, shape (..., 2)
        Middle, in px.

    Examples
    --------
    >>> detector_centre((3, 4))
    array([1. , 1.5])
    """
    return (pixels - 1) / 2


@checked_fields
@dataclass(frozen=True, eq=False)
class Camera:
    """Imaging parameters of one channel, checked when they are set.

    Parameters
    ----------
    focal_length : float
        Focal length, in metres.
    principal_point : array_like, shape (2,)
        Position of the boresight on the detector, in px.
    radial_distortion : float
        First radial coefficient, in m^-2 (1e-5 per square millimetre is 10 per square metre).
    pixel_pitch : float
        Distance between the centres of neighbouring pixels, in metres.
    """

    focal_length: Positive
    principal_point: Point
    radial_distortion: Number
    pixel_pitch: Positive


@checked
def ideal_positions(directions: Directions, focal_length: Positive) -> FloatArray:
    """Return the positions of directions in an ideal pinhole camera.

    Implements: niu2024 (1), (5).

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Directions of the stars in the camera frame, of any length.
    focal_length : array_like, shape (...)
        Focal length, in metres.

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
    # Nearer to the focal plane, the position overflows.
    front = along[..., 0] > 1e-9 * np.abs(across).max(axis=-1)
    valid("directions", along[..., 0], front, "stars in front of the camera")
    return focal_length[..., None, None] * (across / along)


@checked
def radial_displacements(ideal: Points, radial_distortion: Number) -> FloatArray:
    """Return the displacements of spots by the first radial term.

    Implements: niu2024 (3).

    Parameters
    ----------
    ideal : array_like, shape (..., n, 2)
        Ideal positions, in metres, from the principal point.
    radial_distortion : array_like, shape (...)
        First radial coefficient, in m^-2; displacements are outwards if it is positive.

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


@checked
def turned_onto_detector(positions: Points, rotation: Number) -> FloatArray:
    """Return spots in the axes of a detector that is rotated about the boresight.

    The matrix is [[cos, sin], [-sin, cos]]: on a detector rotated by +theta (x towards y), the
    spots are rotated by -theta.

    Parameters
    ----------
    positions : array_like, shape (..., n, 2)
        Positions from the principal point, in any unit of length.
    rotation : array_like, shape (...)
        Angle theta of the detector against the reference detector, in radians.

    Returns
    -------
    ndarray, shape (..., n, 2)
        Positions in the same unit.

    Examples
    --------
    >>> turned_onto_detector([[1, 0]], np.pi / 2).round(12)
    array([[ 0., -1.]])
    """
    cosine, sine = np.cos(rotation)[..., None], np.sin(rotation)[..., None]
    x, y = positions[..., 0], positions[..., 1]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=-1)


@checked
def image_points(
    directions: Directions, camera: Camera, rotation: Number = 0.0
) -> FloatArray:
    """Return the image points of directions: projection, distortion, rotated detector.

    Implements: niu2024 (2), (21), (22), (23).

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Directions of the stars in the frame of the reference (green) channel.
    camera : Camera
        Imaging parameters of this channel.
    rotation : array_like, shape (...)
        Angle theta of the detector of this channel against the reference, in radians. Zero, for
        the reference channel, is (2) and (21).

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
    ideal = ideal_positions(directions, camera.focal_length)
    bent = ideal + radial_displacements(ideal, camera.radial_distortion)
    spots = turned_onto_detector(bent, rotation)
    return spots / camera.pixel_pitch + camera.principal_point


@checked
def field_of_view(
    pixels: Positive, pixel_pitch: Positive, focal_length: Positive
) -> FloatArray:
    """Return the full field of view of a row of pixels about the boresight.

    Parameters are those of `angle_from_pixels`, with the number of pixels, above zero.

    Returns
    -------
    ndarray, shape (...)
        Full angle, in radians: 2 atan(pixels * pixel_pitch / (2 * focal_length)).

    Examples
    --------
    A detector of twice the focal length has a field of view of 90 degrees.

    >>> float(np.degrees(field_of_view(2000, 1e-5, 10e-3)).round(9))
    90.0
    """
    return 2 * angle_from_pixels(pixels / 2, pixel_pitch, focal_length)


@checked
def angle_from_pixels(
    pixels: Number, pixel_pitch: Positive, focal_length: Positive
) -> FloatArray:
    """Return the angle between the boresight and a spot.

    Parameters
    ----------
    pixels : array_like, shape (...)
        Signed distance of the spot from the principal point, in px.
    pixel_pitch, focal_length : array_like, shape (...)
        Pixel pitch and focal length, in metres.

    Returns
    -------
    ndarray, shape (...)
        Signed angle, in radians: atan(pixels * pixel_pitch / focal_length).

    Examples
    --------
    >>> float(np.degrees(angle_from_pixels(1000, 1e-5, 10e-3)).round(9))
    45.0
    """
    return np.arctan(pixels * pixel_pitch / focal_length)


@checked
def scale_factor(
    reference_focal_length: Positive, focal_length: Positive
) -> FloatArray:
    """Return the scale factor k from ideal positions of a channel to those of the reference.

    Implements: niu2024 (6).

    Parameters
    ----------
    reference_focal_length, focal_length : array_like, shape (...)
        Focal lengths of the reference channel and of the channel, in the same unit.

    Returns
    -------
    ndarray, shape (...)
        k = reference / channel, without unit.

    Examples
    --------
    >>> float(scale_factor(30e-3, 20e-3))
    1.5
    """
    return reference_focal_length / focal_length


@checked
def distortion_ratio(
    scale: Positive, reference_distortion: Number = 1.0, distortion: Number = 1.0
) -> FloatArray:
    """Return the displacement by distortion in the reference over that in a channel.

    Implements: niu2024 (7), (8).

    Parameters
    ----------
    scale : array_like, shape (...)
        Scale factor k, above zero.
    reference_distortion, distortion : array_like, shape (...)
        First radial coefficients of the reference channel and of the channel, in the same unit,
        the latter not zero. By default all channels share one coefficient, which is (8).

    Returns
    -------
    ndarray, shape (...)
        k^3 * reference_distortion / distortion, the same in x and y.

    Examples
    --------
    >>> float(distortion_ratio(2.0, 3.0, 4.0)), float(distortion_ratio(2.0))
    (6.0, 8.0)
    """
    valid("distortion", distortion, distortion != 0, "values other than zero")
    return scale**3 * (reference_distortion / distortion)


@checked
def reference_points_scaled(
    points: Points, scale: Positive, principal_point: Point
) -> FloatArray:
    """Return image points of the reference if only focal length and distortion differ.

    Implements: niu2024 (9), (10), (11), (12).

    By (11), an image point minus the principal point is the sum of ideal position and distortion.
    Both are scaled by k in (10), the distortion by (9) with k^3 = k. Near k = 1 the relative error
    of this approximation is 2 (1 - k).

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Image points of the channel, in px.
    scale : array_like, shape (...)
        Scale factor k, above zero.
    principal_point : array_like, shape (..., 2)
        Principal point of both channels, in px.

    Returns
    -------
    ndarray, shape (..., n, 2)
        k * points - k * principal_point + principal_point, in px.

    Examples
    --------
    >>> reference_points_scaled([[7, 9]], 2.0, (5, 5))
    array([[ 9., 13.]])
    """
    principal_point = principal_point[..., None, :]
    return scale[..., None, None] * (points - principal_point) + principal_point


@checked
def fit_camera(
    directions: Directions, points: Points, pixel_pitch: Size, rotation: Number = 0.0
) -> Camera:
    """Fit the imaging parameters of one channel by least squares on its model, (2) with (3).

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Known directions of stars in the frame of the reference channel.
    points : array_like, shape (..., n, 2)
        Image points in the channel, in px.
    pixel_pitch : float
        Pixel pitch, in metres.
    rotation : array_like, shape (...)
        Angle of the detector against the reference, in radians; zero for the reference.

    Returns
    -------
    Camera
        Estimates. Each parameter has the batch shape (...).

    Raises
    ------
    ValueError
        If the counts differ, a direction does not point in front of the camera, or the focal
        length is not positive, for example because an axis is mirrored.
    DegenerateGeometryError
        If the directions do not determine all four parameters.

    Examples
    --------
    >>> slopes = [[0, 0, 1], [0.1, 0, 1], [0, 0.2, 1]]
    >>> fit = fit_camera(slopes, [[50, 60], [250, 60], [50, 460]], 1e-5)
    >>> float(fit.focal_length.round(9)), fit.principal_point.round(9)
    (0.02, array([50., 60.]))
    """
    slopes = turned_onto_detector(ideal_positions(directions, 1.0), rotation)
    squared = np.square(slopes).sum(axis=-1, keepdims=True)
    columns = np.stack([slopes, slopes * squared], axis=-1) / pixel_pitch
    # The principal point follows from the means.
    centred = columns - columns.mean(axis=-3, keepdims=True)
    observed = points - points.mean(axis=-2, keepdims=True)
    normal = np.einsum("...nij,...nik->...jk", centred, centred)
    pull = np.einsum("...nij,...ni->...j", centred, observed)
    squares = np.diagonal(normal, axis1=-2, axis2=-1).prod(axis=-1)
    if not (np.linalg.det(normal) > 1e-12 * squares).all():
        raise DegenerateGeometryError(
            "directions: expected slopes that determine focal length and distortion, got equal "
            "slopes or only two points. Rotate the table to angles near and far from zero"
        )
    linear = np.linalg.solve(normal, pull[..., None])[..., 0]
    origin = (points - np.einsum("...nij,...j->...ni", columns, linear)).mean(axis=-2)
    focal, cubic = np.moveaxis(linear, -1, 0)
    valid("points", focal, focal > 0, "axes that give a positive focal length")
    return Camera(focal, origin, cubic / focal**3, pixel_pitch)
