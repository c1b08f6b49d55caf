"""Rotary table that rotates a sensor in front of a single-star simulator.

`external` is the angle of the external frame (phi_1) and `middle` the angle of the middle
frame (phi_2), both in radians, of shape (...). Matrices have shape (..., 3, 3) and take a vector of
the frame of the table to the frame of the sensor. Directions have shape (..., 3), with z along the
boresight. A positive middle angle moves the star towards negative x, a positive external angle
towards positive y.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.optics.camera import Camera, image_points
from reproduce.physics.validate import (
    FloatArray,
    Number,
    checked,
)

_Rotations = Annotated[Any, ("channels",)]
_Angles = Annotated[Any, (None, 2)]


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
    e, m = np.broadcast_arrays(external, middle)
    rows = [
        [np.cos(m), 0 * m, -np.sin(m)],
        [np.sin(e) * np.sin(m), np.cos(e), np.sin(e) * np.cos(m)],
        [np.cos(e) * np.sin(m), -np.sin(e), np.cos(e) * np.cos(m)],
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
def channel_centroids(
    cameras: Sequence[Camera], rotations: _Rotations, angles: _Angles
) -> FloatArray:
    """Return the image points of the star of the simulator in every channel, without noise.

    Parameters
    ----------
    cameras : sequence of Camera
        Cameras of the channels.
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
        If the counts of cameras and rotations differ, or the star is behind the sensor.

    Examples
    --------
    >>> camera = Camera(20e-3, (50, 60), 0, 10e-6)
    >>> channel_centroids([camera], [0.0], [[0.0, np.pi / 4]]).round(6)
    array([[[  50., 2060.]]])
    """
    if len(rotations) != len(cameras):
        raise ValueError(
            f"rotations: expected one per camera ({len(cameras)}), got {len(rotations)}. Give zero "
            "for the reference channel"
        )
    directions = starlight(angles[..., 1], angles[..., 0])
    channels = zip(cameras, rotations, strict=True)
    return np.stack(
        [image_points(directions, *channel) for channel in channels], axis=-3
    )
