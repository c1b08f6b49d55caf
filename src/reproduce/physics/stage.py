"""A stage that moves the focal plane stands in for a camera that turns.

A shift of the focal plane by L turns every beam by atan(L / f). Shifts are in metres, angles
in radians. The sign convention of the angles is that of `misalignment`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.validate import FloatArray, common_batch, finite_array, positive


def stage_angle(shift: ArrayLike, focal_length: ArrayLike) -> FloatArray:
    """Return the misalignment angle that a shift of the focal plane stands for.

    Implements: chen2023 (10).

    The minus sign is the paper's, for both axes. With right-handed angles it belongs to a
    shift along X, which turns about Y; see `stage_angles` for both axes.

    Parameters
    ----------
    shift : array_like
        L, the motion of the focal plane along X (or Y), in metres.
    focal_length : array_like
        Of the camera, in metres; broadcasts against the shift.

    Returns
    -------
    ndarray
        theta = -atan(L / f) about Y (or X), in radians.

    Raises
    ------
    ValueError
        If a value is not finite, or the focal length is not above zero.

    Examples
    --------
    >>> float(stage_angle(1.0, 1.0)) / np.pi
    -0.25
    """
    motion, focal = _checked(shift, focal_length)
    return np.asarray(-np.arctan2(motion, focal))


def stage_angle_printed(shift: ArrayLike, focal_length: ArrayLike) -> FloatArray:
    """Return what the relation gives as it is printed, -tan(L) f.

    Printed form of chen2023 (10). It takes the tangent of a length and multiplies where it
    should divide: for small shifts the result is -L f, in square metres, larger than the
    angle by the square of the focal length in metres.

    Parameters
    ----------
    shift : array_like
        L, in metres, taken for radians.
    focal_length : array_like
        In metres.

    Returns
    -------
    ndarray
        -tan(L) f; a number that is no angle.

    Raises
    ------
    ValueError
        If a value is not finite, or the focal length is not above zero.

    Examples
    --------
    >>> round(float(stage_angle_printed(1e-6, 2.0)), 12)
    -2e-06
    """
    motion, focal = _checked(shift, focal_length)
    return np.asarray(-np.tan(motion) * focal)


def stage_angles(shifts: ArrayLike, focal_length: ArrayLike) -> FloatArray:
    """Return the right-handed misalignment that a shift of the focal plane stands for.

    This is what `misalignment_angles` measures when the lasers move: a shift along X turns
    the camera about -Y, a shift along Y turns it about +X. The two signs differ, while (10)
    prints the same one for both axes.

    Parameters
    ----------
    shifts : array_like, shape (..., 2)
        Motion of the lasers along X and Y of the camera frame, in metres.
    focal_length : array_like, shape (...)
        In metres.

    Returns
    -------
    ndarray, shape (..., 3)
        (theta_X, theta_Y, theta_Z) = (atan(L_Y / f), -atan(L_X / f), 0), in radians.

    Raises
    ------
    ValueError
        If a shape does not fit, a value is not finite, or the focal length is not above zero.

    Examples
    --------
    >>> stage_angles([1.0, 1.0], 1.0) / np.pi
    array([ 0.25, -0.25,  0.  ])
    """
    motion = finite_array("shifts", shifts, shape=(2,))
    focal = positive("focal_length", focal_length)
    batch = common_batch(shifts=motion.shape[:-1], focal_length=focal.shape)
    result = np.zeros((*batch, 3))
    result[..., 0] = np.arctan2(motion[..., 1], focal)
    result[..., 1] = -np.arctan2(motion[..., 0], focal)
    return result


def _checked(shift: ArrayLike, focal_length: ArrayLike) -> tuple[FloatArray, FloatArray]:
    motion = finite_array("shift", shift)
    focal = positive("focal_length", focal_length)
    common_batch(shift=motion.shape, focal_length=focal.shape)
    return motion, focal
