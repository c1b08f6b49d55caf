"""Starting values of the calibration: two lines, the zero position, and random restarts.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); parameter vectors u = (k, theta, shift x, shift y) have shape (..., 4); the leading axes are
a batch of calibrations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.gauss_newton import PARAMETERS
from reproduce.physics.similarity import as_complex, principal_point_shift
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    common_batch,
    finite_array,
    non_negative,
    whole_number,
)


def line_direction(points: ArrayLike) -> FloatArray:
    """The direction of the straight line that fits points best, by perpendicular distance.

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Centroids of spots along a line, in px.

    Returns
    -------
    ndarray, shape (...)
        Angle from the x axis towards y, in radians, within (-pi/2, pi/2]: a line has no sense.

    Raises
    ------
    ValueError
        If `points` is not finite or has the wrong shape.
    DegenerateGeometryError
        If the points coincide, or spread alike in all directions.

    Examples
    --------
    >>> float(np.degrees(line_direction([[0, 0], [1, 1], [2, 2]])).round(9))
    45.0
    """
    return _direction("points", points)


def two_line_rotation(source_line: ArrayLike, target_line: ArrayLike) -> FloatArray:
    """Starting value of theta: the angle between two lines seen by both channels.

    Parameters
    ----------
    source_line, target_line : array_like, shape (..., n, 2)
        Centroids while the middle frame of the rotary table turns alone, in px. The number of
        spots may differ.

    Returns
    -------
    ndarray, shape (...)
        Direction in the target minus direction in the source, in radians, within (-pi/2, pi/2].

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape.
    DegenerateGeometryError
        If the spots of a channel fix no line.

    Examples
    --------
    >>> float(np.degrees(two_line_rotation([[0, 0], [1, 0]], [[0, 0], [1, 1]])).round(9))
    45.0
    """
    source = _direction("source_line", source_line)
    target = _direction("target_line", target_line)
    common_batch(source_line=source.shape, target_line=target.shape)
    return np.asarray(np.angle(np.exp(2j * (target - source))) / 2)


def starting_values(
    source_line: ArrayLike, target_line: ArrayLike, source_zero: ArrayLike, target_zero: ArrayLike
) -> FloatArray:
    """The starting vector u: scale one, the angle of two lines, the shift at the zero position.

    Parameters
    ----------
    source_line, target_line : array_like, shape (..., n, 2)
        Centroids while the middle frame of the rotary table turns alone, in px.
    source_zero, target_zero : array_like, shape (..., 2)
        Centroids at the table's zero position, in px: each channel's principal point, nearly.

    Returns
    -------
    ndarray, shape (..., 4)
        (1, theta, shift x, shift y).

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape.
    DegenerateGeometryError
        If the spots of a channel fix no line.

    Examples
    --------
    >>> starting_values([[0, 0], [1, 0]], [[0, 0], [1, 0]], (7, 9), (5, 10))
    array([ 1.,  0.,  2., -1.])
    """
    rotation = two_line_rotation(source_line, target_line)
    source_zero = finite_array("source_zero", source_zero, shape=(2,))
    target_zero = finite_array("target_zero", target_zero, shape=(2,))
    shift = principal_point_shift(source_zero, target_zero)
    batch = common_batch(lines=rotation.shape, zero_positions=shift.shape[:-1])
    values = np.ones((*batch, PARAMETERS))
    values[..., 1] = rotation
    values[..., 2:] = shift
    return values


def random_starts(
    start: ArrayLike, half_widths: ArrayLike, count: int, generator: np.random.Generator
) -> FloatArray:
    """Random starting vectors, uniform within a box about a given one.

    Parameters
    ----------
    start : array_like, shape (..., 4)
        The centre of the box, a vector u.
    half_widths : array_like, shape (4,)
        Half the box in k, theta (radians), shift x and shift y (px); zero or more.
    count : int
        How many starts.
    generator : numpy.random.Generator
        The source of randomness.

    Returns
    -------
    ndarray, shape (count, ..., 4)
        Starts for `calibrate_from_all`.

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape, or a half width is negative.

    Examples
    --------
    >>> random_starts((1, 0, 0, 0), (0, 0, 0, 0), 2, np.random.default_rng(1))
    array([[1., 0., 0., 0.],
           [1., 0., 0., 0.]])
    """
    start = finite_array("start", start, shape=(PARAMETERS,))
    half_widths = non_negative("half_widths", finite_array("half_widths", half_widths, shape=(4,)))
    count = whole_number("count", count)
    return start + half_widths * generator.uniform(-1, 1, (count, *start.shape))


def _direction(name: str, points: ArrayLike) -> FloatArray:
    points = finite_array(name, points, shape=(None, 2))
    numbers = as_complex(points - points.mean(axis=-2, keepdims=True))
    # Squaring doubles the angle, so that both senses of the line add up.
    doubled = (numbers**2).sum(axis=-1)
    spread = (np.abs(numbers) ** 2).sum(axis=-1)
    rounding = (1e-12 * np.abs(points).max(axis=(-2, -1))) ** 2 * points.shape[-2]
    if ((spread <= rounding) | (np.abs(doubled) <= 1e-12 * spread)).any():
        raise DegenerateGeometryError(
            f"{name}: expected spots along a line, got coincident points or points that spread "
            "alike in all directions; rotate the middle frame alone, over a wider range"
        )
    return np.asarray(np.angle(doubled) / 2)
