"""A star sensor on a rotary table: table angles, directions of the star, and image points.

Frames and units of this module:

* angles are in radians; `external` is the angle of the external frame of the table (phi_1) and
  `middle` that of its middle frame (phi_2), of shape (...). A positive middle angle moves the star
  towards negative x, a positive external angle towards positive y;
* rotation matrices of the table have shape (..., 3, 3) and take a vector of the frame of the table
  to the frame of the sensor;
* directions have shape (..., n, 3) in the camera frame, x along the rows of the detector, y along
  its columns, z along the boresight towards the star; their length does not matter;
* positions on the focal plane have shape (..., n, 2), in metres, measured from the principal point;
* image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
  (0, 0); distances on the detector are in px too.

The leading axes of directions and points are a batch, for example of frames or simulated
calibrations. The camera is a pinhole with one radial distortion term. A camera is one channel. The
reference channel is green.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.validate import (
    BoolArray,
    DegenerateGeometryError,
    Directions,
    FloatArray,
    Number,
    Point,
    Points,
    Positive,
    Sides,
    Size,
    Text,
    checked,
    checked_fields,
    valid,
)

# Relative distance within which a point is on a border.
_BORDER_TOLERANCE = 1e-9
# Steps in half a range, above which the unit of an angle is probably wrong.
_MAX_STEPS = 2000
# Squared spacings of the fine grid, in squared steps.
_SQUARED_SPACINGS = {
    "square, step between neighbours": (1, 1),
    "quincunx, step between rows": (1, 1),
    "quincunx, step between neighbours": (0.5, 0.5),
    "quincunx, step along a row": (0.25, 0.25),
    "hexagonal, rows along x": (0.25, 0.75),
    "hexagonal, rows along y": (0.75, 0.25),
}
# Offsets in half spacings of the points along a row, and of the rows.
_OFFSETS = {
    "centred": (0, 0),
    "half a spacing along x": (1, 0),
    "half a row spacing along y": (0, 1),
    "half a spacing along both": (1, 1),
}
_CORNER = "from the lower left corner"


@checked
def arrangement_angles(
    name: Text, half_x: Size, half_y: Size, step: Size
) -> FloatArray:
    """Return the rotation angles of an arrangement.

    A step and a range do not determine the arrangement of the angles. Every lattice is a fine
    rectangular grid of spacings (a, b), either whole (square) or chequered. A chequered grid
    keeps the nodes whose indices have an even sum, which gives the quincunx and hexagonal
    lattices. Its points are 2a apart along a row, and its rows are b apart.

    Parameters
    ----------
    name : str
        Lattice, offset and window, separated by semicolons. The error of another name lists them.
    half_x, half_y, step : float
        Half the range in x and in y, and the step of the angles, in radians, above zero.

    Returns
    -------
    ndarray, shape (n, 2)
        Angles, in radians, x before y, sorted by y, then x.

    Raises
    ------
    ValueError
        If the name is unknown, or the step is too small for the range.

    Examples
    --------
    >>> name = "square, step between neighbours; centred; diamond"
    >>> arrangement_angles(name, 1.0, 1.0, 1.0)
    array([[ 0., -1.],
           [-1.,  0.],
           [ 0.,  0.],
           [ 1.,  0.],
           [ 0.,  1.]])
    """
    half = np.array([half_x, half_y])
    expected = f"at least 1/{_MAX_STEPS} of the half range, both in radians"
    valid("step", step, half.max() <= _MAX_STEPS * step, expected)
    known = _lattices(half, step), (*_OFFSETS, _CORNER), _windows(half[None], half)
    parts = name.split("; ")
    if tuple(parts) not in {*product(*known)}:
        listed = ", ".join(f"one of {list(names)}" for names in known)
        raise ValueError(
            f"name: expected three parts with semicolons between them, {listed}, got {name!r}. "
            "Correct the name"
        )
    lattice, offset, window = parts
    spacing = known[0][lattice]
    # Points of a chequered grid are two spacings apart along a row.
    along = 1 if lattice.startswith("square") else 2
    x, y = (2 * half / spacing).astype(int) + 2
    indices = np.mgrid[-x : x + 1, -y : y + 1].T.reshape(-1, 2)
    origin = -half
    if offset != _CORNER:
        origin = spacing * _OFFSETS[offset] * [along, 1] / 2
    nodes = origin + spacing * indices
    inside = _windows(nodes, half)
    kept = indices.sum(axis=1) % along == 0
    return nodes[kept & inside["rectangle"] & inside[window]]


def _lattices(half: FloatArray, step: float) -> dict[str, FloatArray]:
    """Return the spacings of the fine grid of every lattice, shape (2,)."""
    width = 2 * half
    nearest = width / np.maximum(1, np.rint(width / step))
    return {
        **{name: step * np.sqrt(square) for name, square in _SQUARED_SPACINGS.items()},
        "square, stretched to the edges": nearest,
        "quincunx, stretched to the edges, spacings nearest the step": nearest,
        # Numbers of spacings whose mean spacing is the step, for the printed range.
        "quincunx, stretched to the edges in 16 by 15 spacings": width / [16, 15],
        "quincunx, stretched to the edges in 20 by 12 spacings": width / [20, 12],
    }


def _windows(nodes: FloatArray, half: FloatArray) -> dict[str, BoolArray]:
    """Return the nodes that each window contains, as masks."""
    # Distance from the centre by the order of its norm, and the distance of the border.
    norms = {
        "rectangle": (np.inf, half),
        "rectangle without its border": (np.inf, half * (1 - 2 * _BORDER_TOLERANCE)),
        "inscribed ellipse": (2, half),
        "circle of the smaller half range": (2, half.min()),
        "circle of the larger half range": (2, half.max()),
        "diamond": (1, half),
    }
    return {
        name: np.linalg.norm(nodes / border, order, axis=1) <= 1 + _BORDER_TOLERANCE
        for name, (order, border) in norms.items()
    }


@checked
def rotary_matrix(external: Number, middle: Number) -> FloatArray:
    """Return the rotation of the table: about y by the middle angle, then about x.

    Implements: niu2024 (20).

    The sign of sin(middle) in the bottom row is positive, so that the matrix is a rotation. In the
    extracted text it is negative, see `rotary_matrix_printed`.

    Parameters
    ----------
    external, middle : array_like, shape (...)
        Angles of the frames of the table, in radians.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Proper rotations.

    Examples
    --------
    >>> rotary_matrix(0.0, np.pi / 2).round(12) + 0.0
    array([[ 0.,  0., -1.],
           [ 0.,  1.,  0.],
           [ 1.,  0.,  0.]])
    """
    angles = np.broadcast_arrays(external, middle)
    (sin_e, sin_m), (cos_e, cos_m) = np.sin(angles), np.cos(angles)
    rows = [
        [cos_m, 0 * cos_m, -sin_m],
        [sin_e * sin_m, cos_e, sin_e * cos_m],
        [cos_e * sin_m, -sin_e, cos_e * cos_m],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def rotary_matrix_printed(external: ArrayLike, middle: ArrayLike) -> FloatArray:
    """Return the matrix with the sign of its bottom left element as extracted.

    Printed form of niu2024 (20).

    It is not a rotation: its determinant is cos(2 * middle). Its third column is correct, and with
    it the direction of starlight along z. Parameters are those of `rotary_matrix`.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Printed matrices.

    Examples
    --------
    >>> matrix = rotary_matrix_printed(0.0, np.pi / 2)
    >>> float(np.linalg.det(matrix).round(12))
    -1.0
    """
    signs = [[1, 1, 1], [-1, 1, 1], [-1, 1, 1]]
    return rotary_matrix(external, middle) * signs


def starlight(external: ArrayLike, middle: ArrayLike) -> FloatArray:
    """Return the direction of the star of the simulator in the frame of the sensor.

    Implements: niu2024 (19).

    It is the third column of `rotary_matrix`, because the star is on the z axis of the table.
    Parameters are those of `rotary_matrix`.

    Returns
    -------
    ndarray, shape (..., 3)
        Unit vectors.

    Examples
    --------
    >>> starlight(np.pi / 2, 0.0).round(12) + 0.0
    array([0., 1., 0.])
    """
    return rotary_matrix(external, middle)[..., 2]


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
    rotation : float
        Angle theta of the detector against the reference detector, in radians.
    """

    focal_length: Positive
    principal_point: Point
    radial_distortion: Number
    pixel_pitch: Positive
    rotation: Number = 0.0


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
    across, along = np.split(directions, [2], axis=-1)
    # Nearer to the focal plane, the position overflows.
    front = along[..., 0] > 1e-9 * np.abs(across).max(axis=-1)
    valid(
        "directions",
        along[..., 0],
        front,
        "light from in front, with Z well above zero",
    )
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
    x, y = np.moveaxis(positions, -1, 0)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=-1)


@checked
def image_points(directions: Directions, camera: Camera) -> FloatArray:
    """Return the image points of directions: projection, distortion, rotated detector.

    Implements: niu2024 (2), (21), (22), (23).

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Directions of the stars in the frame of the reference (green) channel.
    camera : Camera
        Imaging parameters of this channel. A rotation of zero, for the reference channel, is (2)
        and (21).

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
    spots = turned_onto_detector(bent, camera.rotation)
    return spots / camera.pixel_pitch + camera.principal_point[..., None, :]


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
def fit_camera(
    directions: Directions, points: Points, pixel_pitch: Size, rotation: Number = 0.0
) -> Camera:
    """Fit the imaging parameters of one channel by least squares on its model, (2) with (3).

    The model is linear in the focal length F, in m F^3 with the distortion m, and in the principal
    point, so its solution needs no starting values.

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
    bent = radial_displacements(slopes, 1.0)
    columns = np.stack([slopes, bent], axis=-1) / pixel_pitch
    origin = np.broadcast_to(np.eye(2), columns.shape)
    # One row per coordinate, with the columns of F, m F^3 and both coordinates of the point.
    design = np.concatenate([columns, origin], axis=-1)
    design = design.reshape(*columns.shape[:-3], -1, 4)
    # Columns of length one have a rank at any size of the field.
    lengths = np.linalg.norm(design, axis=-2, keepdims=True)
    design /= np.maximum(lengths, np.finfo(float).tiny)
    if (np.linalg.matrix_rank(design, rtol=1e-12) < 4).any():
        raise DegenerateGeometryError(
            "directions: expected slopes that determine focal length and distortion, got equal "
            "slopes or only two points. Rotate the table to angles near and far from zero"
        )
    observed = points.reshape(*points.shape[:-2], -1, 1)
    linear = (np.linalg.pinv(design) @ observed / lengths.mT)[..., 0]
    focal, cubic = np.moveaxis(linear[..., :2], -1, 0)
    valid("points", focal, focal > 0, "axes that give a positive focal length")
    return Camera(focal, linear[..., 2:], cubic / focal**3, pixel_pitch, rotation)


@checked
def channel_centroids(cameras: Sequence[Camera], angles: Points) -> FloatArray:
    """Return the image points of the star of the simulator in every channel, without noise.

    Parameters
    ----------
    cameras : sequence of Camera
        Cameras of the channels.
    angles : array_like, shape (..., n, 2)
        Angles of the table, in radians: middle frame (x), then external frame (y).

    Returns
    -------
    ndarray, shape (..., channels, n, 2)
        Centroids, in px, channels in the order of `cameras`.

    Raises
    ------
    ValueError
        If the star is behind the sensor.

    Examples
    --------
    >>> camera = Camera(20e-3, (50, 60), 0, 10e-6)
    >>> channel_centroids([camera], [[0.0, np.pi / 4]]).round(6)
    array([[[  50., 2060.]]])
    """
    directions = starlight(angles[..., 1], angles[..., 0])
    return np.stack([image_points(directions, camera) for camera in cameras], axis=-3)
