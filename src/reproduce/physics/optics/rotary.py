"""Rotary table that turns a sensor in front of a single-star simulator.

`external` is the angle of the external frame (phi_1) and `middle` the angle of the middle
frame (phi_2), both in radians and broadcast against each other. Matrices have shape
(..., 3, 3) and take a vector of the table's frame to the sensor's frame. Directions have
shape (..., 3), with z along the boresight. A positive middle angle moves the star towards
negative x, a positive external angle towards positive y.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.optics.camera import Camera, image_points
from reproduce.physics.validate import FloatArray, Number


@validate.checked
def starlight(external: Number, middle: Number) -> FloatArray:
    """Return the direction of the simulator's star in the sensor's frame.

    Implements: niu2024 (19).

    Parameters
    ----------
    external, middle : array_like, shape (...)
        Angles of the two frames, in radians.

    Returns
    -------
    ndarray, shape (..., 3)
        Unit vectors (-sin m, sin e cos m, cos e cos m): the third column of
        `rotary_matrix`, because the star starts along z.

    Examples
    --------
    >>> starlight(np.pi / 2, 0.0).round(12) + 0.0
    array([0., 1., 0.])
    """
    return _turned(external, -np.sin(middle), np.cos(middle))


def _turned(external: FloatArray, x: FloatArray, z: FloatArray) -> FloatArray:
    """Return the vectors (x, 0, z), shape (..., 3), as the external frame turns them."""
    x, y, z = np.broadcast_arrays(x, np.sin(external) * z, np.cos(external) * z)
    return np.stack([x, y, z], axis=-1)


@validate.checked
def rotary_matrix(external: Number, middle: Number) -> FloatArray:
    """Return the rotation of the table: about y by the middle angle, then about x.

    Implements: niu2024 (20).

    The sign of sin(middle) in the bottom row is positive here, which makes the middle
    frame's matrix a rotation. As extracted it is negative, see `rotary_matrix_printed`.

    Parameters
    ----------
    external, middle : array_like, shape (...)
        Angles of the two frames, in radians.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Proper rotations: transpose is inverse, determinant +1.

    Examples
    --------
    >>> rotary_matrix(0.0, np.pi / 2).round(12) + 0.0
    array([[ 0.,  0., -1.],
           [ 0.,  1.,  0.],
           [ 1.,  0.,  0.]])
    """
    along_y = _turned(external, 0.0 * middle, 0.0 * middle)
    along_y[..., 1:] = np.stack([np.cos(external), -np.sin(external)], axis=-1)
    along_x = _turned(external, np.cos(middle), np.sin(middle))
    return np.stack([along_x, along_y, starlight(external, middle)], axis=-1)


def rotary_matrix_printed(external: ArrayLike, middle: ArrayLike) -> FloatArray:
    """Return the matrix with the sign of its bottom-left element as extracted.

    Printed form of niu2024 (20).

    It is not a rotation: its determinant is cos(2 * middle), and its first column is not
    orthogonal to its third. Its third column is correct, so starlight that starts along z
    has the correct direction. Any other starting vector has a wrong one.

    Parameters
    ----------
    external, middle : array_like, shape (...)
        Angles of the two frames, in radians.

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> matrix = rotary_matrix_printed(0.0, np.pi / 2)
    >>> float(np.linalg.det(matrix).round(12))
    -1.0
    """
    signs = [[1, 1, 1], [-1, 1, 1], [-1, 1, 1]]
    return np.asarray(rotary_matrix(external, middle) * signs)


def channel_centroids(
    cameras: Sequence[Camera], rotations: ArrayLike, angles: ArrayLike
) -> FloatArray:
    """Return where every channel images the simulator's star, without noise.

    Parameters
    ----------
    cameras : sequence of Camera
        One per channel.
    rotations : array_like, shape (channels,)
        Angle of each detector against the reference, in radians; zero for the reference.
    angles : array_like, shape (..., n, 2)
        Angles of the table, in radians: middle frame (x), then external frame (y).

    Returns
    -------
    ndarray, shape (..., channels, n, 2)
        Centroids, in px, channels in the order of `cameras`.

    Raises
    ------
    ValueError
        If there is no camera, the counts differ, or an angle turns the star behind the
        sensor.

    Examples
    --------
    >>> camera = Camera(20e-3, (50, 60), 0, 10e-6)
    >>> channel_centroids([camera], [0.0], [[0.0, np.pi / 4]]).round(6)
    array([[[  50., 2060.]]])
    """
    turns = validate.finite_array("rotations", rotations, shape=(None,))
    if turns.shape != (len(cameras),):
        raise ValueError(
            f"rotations: expected one per camera ({len(cameras)}), got shape {turns.shape}. "
            "Give zero for the reference channel."
        )
    middle, external = np.moveaxis(
        validate.finite_array("angles", angles, shape=(None, 2)), -1, 0
    )
    directions = starlight(external, middle)
    channels = zip(cameras, turns, strict=True)
    return np.stack(
        [image_points(directions, *channel) for channel in channels], axis=-3
    )
