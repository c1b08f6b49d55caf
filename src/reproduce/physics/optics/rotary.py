"""The rotary table that turns the sensor in front of a single-star simulator.

`external` is the angle of the external frame (phi_1), `middle` that of the middle frame (phi_2),
both in radians and broadcast against each other. Matrices have shape (..., 3, 3) and take a vector
of the table's frame to the sensor's frame; directions have shape (..., 3), z along the boresight.
A positive middle angle moves the star towards negative x, a positive external angle towards
positive y.
"""

from __future__ import annotations

import numpy as np

from reproduce.physics.validate import FloatArray, Number, checked, kernel


@checked
def rotary_matrix(external: Number, middle: Number) -> FloatArray:
    """The rotation of the table: the external frame's about x after the middle frame's about y.

    Implements: niu2024 (20).

    The sign of sin(middle) in the bottom row is positive here, which makes the middle frame's
    matrix a rotation; as extracted it is negative, see `rotary_matrix_printed`.

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
    return _external_frame(external) @ _middle_frame(middle, bottom_left=np.sin(middle))


@checked
def rotary_matrix_printed(external: Number, middle: Number) -> FloatArray:
    """The matrix with the sign of its bottom-left element as extracted from the print.

    Printed form of niu2024 (20).

    It is not a rotation: its determinant is cos(2 * middle), and its first column is not
    orthogonal to its third. Its third column is the right one, so starlight that starts along z
    comes out the same; any other starting vector does not. Arguments are those of `rotary_matrix`.

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> matrix = rotary_matrix_printed(0.0, np.pi / 2)
    >>> float(np.linalg.det(matrix).round(12))
    -1.0
    """
    return _external_frame(external) @ _middle_frame(middle, bottom_left=-np.sin(middle))


@checked
def starlight(external: Number, middle: Number) -> FloatArray:
    """The direction of the simulator's star in the sensor's frame.

    Implements: niu2024 (19).

    Arguments are those of `rotary_matrix`; angles of shape (n,) give directions (n, 3), as
    `camera.image_points` takes them.

    Returns
    -------
    ndarray, shape (..., 3)
        Unit vectors (-sin m, sin e cos m, cos e cos m): the third column of `rotary_matrix`,
        because the star starts along z.

    Examples
    --------
    >>> starlight(np.pi / 2, 0.0).round(12) + 0.0
    array([0., 1., 0.])
    """
    external, middle = np.broadcast_arrays(external, middle)
    # Written out instead of multiplied: many thousand angles are turned into starlight at once.
    return np.stack(
        [-np.sin(middle), np.sin(external) * np.cos(middle), np.cos(external) * np.cos(middle)],
        axis=-1,
    )


_starlight = kernel(starlight)


def _external_frame(external: FloatArray) -> FloatArray:
    matrix = np.zeros((*external.shape, 3, 3))
    matrix[..., 0, 0] = 1
    matrix[..., 1, 1] = matrix[..., 2, 2] = np.cos(external)
    matrix[..., 1, 2] = np.sin(external)
    matrix[..., 2, 1] = -np.sin(external)
    return matrix


def _middle_frame(middle: FloatArray, *, bottom_left: FloatArray) -> FloatArray:
    matrix = np.zeros((*middle.shape, 3, 3))
    matrix[..., 1, 1] = 1
    matrix[..., 0, 0] = matrix[..., 2, 2] = np.cos(middle)
    matrix[..., 0, 2] = -np.sin(middle)
    matrix[..., 2, 0] = bottom_left
    return matrix
