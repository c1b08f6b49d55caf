"""Misalignment of the camera from laser spots in the star tracker.

Names. A rotation is named target first. The paper writes the source below and the target
above: its T_cam^st is `tracker_from_camera` (along the light, with mirrors), its R_st^cam is
`camera_from_tracker` (the installation, without mirrors), and its misalignment R_cam,0^cam,t is
`camera_now_from_camera_zero`. It takes coordinates in the camera frame at the zero point to
coordinates in the camera frame at time t.

Sign. The misalignment angles (theta_X, theta_Y, theta_Z) are the right-handed rotation of the
camera from its zero position to the present position, about the axes of the camera. A fixed
direction rotates in the opposite sense in the frame of the camera, so to first order
`camera_now_from_camera_zero` is I - [theta ×].

Directions have shape (..., n, 3), angles are in radians, leading axes are a batch of frames.

In products of rotations (installation, misalignment, attitude) neighbouring frames cancel. A laser
transform follows the light, an installation the axes of the instruments. A misalignment from two
laser transforms corrects an installation if the mirrors do not move.

A stage that moves the focal plane by L, in metres, simulates a rotation of the camera: it rotates
every beam by atan(L / f).
"""

from __future__ import annotations

import numpy as np

from reproduce.physics.attitude.rotations import attitude, vector_from_rotation
from reproduce.physics.validate import (
    Directions,
    FloatArray,
    Number,
    Point,
    Positive,
    Rotation,
    Size,
    Weights,
    checked,
)


@checked
def laser_transform(
    camera_directions: Directions,
    tracker_directions: Directions,
    weights: Weights = None,
) -> FloatArray:
    """Return the rotation of laser light from the camera to the tracker.

    Implements: chen2023 (4), (5).

    The sum over frames in (5) is a sum over rows: the spots of all frames as one set give one
    rotation, and a batch of frames gives one rotation for each frame.

    Parameters
    ----------
    camera_directions : array_like, shape (..., n, 3)
        Emitted directions v_i,cam in the camera frame, of any length but zero.
    tracker_directions : array_like, shape (..., n, 3)
        Received directions w_i^k in the tracker frame, in the same order.
    weights : array_like, shape (..., n), optional
        Relative weights; zero for a light that is lost. Default: all 1.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        T_cam^st, tracker_from_camera: w = T v.

    Raises
    ------
    DegenerateGeometryError
        If there are not two lasers in different directions.

    Examples
    --------
    >>> directions = [[0, 0, 1], [0.6, 0, 0.8]]
    >>> np.allclose(laser_transform(directions, directions), np.eye(3))
    True
    """
    return attitude(tracker_directions, camera_directions, weights)


@checked
def misalignment(
    camera_directions: Directions,
    tracker_directions: Directions,
    tracker_from_camera_zero: Rotation,
    weights: Weights = None,
) -> FloatArray:
    """Return the misalignment of the camera directly from the laser spots.

    Implements: chen2023 (7).

    Errors are those of `laser_transform`.

    Parameters
    ----------
    camera_directions, tracker_directions : array_like, shape (..., n, 3)
        Emitted directions v_i,cam, and received directions w_i,t^k at the present.
    weights : array_like, shape (..., n), optional
        Relative weights. Default: all 1.
    tracker_from_camera_zero : array_like, shape (..., 3, 3)
        T_cam,0^st, the laser transform at the zero point.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        camera_now_from_camera_zero. `misalignment_angles` returns its angles.

    Examples
    --------
    >>> directions = [[0, 0, 1], [0.6, 0, 0.8]]
    >>> np.allclose(misalignment(directions, directions, np.eye(3)), np.eye(3))
    True
    """
    # Rows times T are the columns T' w: directions in the camera at the zero point.
    return attitude(
        camera_directions, tracker_directions @ tracker_from_camera_zero, weights
    )


@checked
def misalignment_angles(camera_now_from_camera_zero: Rotation) -> FloatArray:
    """Return the rotation of the camera about its X, Y and Z axes since the zero point.

    Parameters
    ----------
    camera_now_from_camera_zero : array_like, shape (..., 3, 3)
        The misalignment R_cam,0^cam,t.

    Returns
    -------
    ndarray, shape (..., 3)
        Rotation vector (theta_X, theta_Y, theta_Z) in the camera frame, in radians,
        right-handed: a positive theta_Y rotates the boresight towards X.

    Examples
    --------
    After a right-handed rotation of the camera by 90 deg about Z, a direction along X at the zero
    point is along -Y of the camera.

    >>> misalignment_angles([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) / np.pi
    array([0. , 0. , 0.5])
    """
    return vector_from_rotation(camera_now_from_camera_zero.mT)


@checked
def moved_laser_transform(
    tracker_from_camera_zero: Rotation, camera_now_from_camera_zero: Rotation
) -> FloatArray:
    """Return the laser transform after the camera has moved.

    Implements: chen2023 (6).

    Parameters
    ----------
    tracker_from_camera_zero, camera_now_from_camera_zero : array_like, shape (..., 3, 3)
        T_cam,0^st, the laser transform at the zero point, and R_cam,0^cam,t, the misalignment.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        T_cam,t^st, tracker_from_camera_now.

    Examples
    --------
    >>> moved_laser_transform(np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    return tracker_from_camera_zero @ camera_now_from_camera_zero.mT


@checked
def misalignment_between(
    tracker_from_camera_now: Rotation, tracker_from_camera_zero: Rotation
) -> FloatArray:
    """Return the misalignment between two laser transforms.

    It is (6) solved for the misalignment: R_cam,0^cam,t = (T_cam,t^st)' T_cam,0^st. The
    product begins and ends in the camera, so its angles are about the axes of the camera.

    Parameters
    ----------
    tracker_from_camera_now, tracker_from_camera_zero : array_like, shape (..., 3, 3)
        Laser transforms at the present and at the zero point.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        camera_now_from_camera_zero.

    Examples
    --------
    >>> misalignment_between(np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    return tracker_from_camera_now.mT @ tracker_from_camera_zero


@checked
def inertial_attitude(
    camera_now_from_camera_zero: Rotation,
    camera_zero_from_tracker: Rotation,
    tracker_from_inertial: Rotation,
) -> FloatArray:
    """Return the inertial attitude of the camera with the corrected installation.

    Implements: chen2023 (8), (9).

    Parameters
    ----------
    camera_now_from_camera_zero, camera_zero_from_tracker : array_like, shape (..., 3, 3)
        R_cam,0^cam,t, the misalignment, and R_st^cam,0, the installation at the zero point; their
        product is R_st^cam,t, the corrected installation.
    tracker_from_inertial : array_like, shape (..., 3, 3)
        R_inertial^st,t, the attitude of the tracker.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        R_inertial^cam,t, camera_from_inertial.

    Examples
    --------
    >>> inertial_attitude(np.eye(3), np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    camera_from_tracker = camera_now_from_camera_zero @ camera_zero_from_tracker
    return camera_from_tracker @ tracker_from_inertial


@checked
def misalignment_in_tracker(
    camera_now_from_camera_zero: Rotation, tracker_from_camera_zero: Rotation
) -> FloatArray:
    """Return the misalignment of the imaging model, between two tracker frames.

    In (1), R_U is between the star tracker and the installation R_cam^star, so it begins and ends
    in the tracker. The misalignment of (7) begins and ends in the camera and has the opposite
    sense, so it is not R_U.

    Parameters
    ----------
    camera_now_from_camera_zero, tracker_from_camera_zero : array_like, shape (..., 3, 3)
        R_cam,0^cam,t, the misalignment, and R_cam,0^st, the installation at the zero point.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        R_U = R_cam,0^st (R_cam,0^cam,t)' (R_cam,0^st)'.

    Examples
    --------
    >>> misalignment_in_tracker(np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    return (
        tracker_from_camera_zero
        @ camera_now_from_camera_zero.mT
        @ tracker_from_camera_zero.mT
    )


@checked
def stage_angle(shift: Number, focal_length: Positive) -> FloatArray:
    """Return the misalignment angle that corresponds to a shift of the focal plane.

    Implements: chen2023 (10).

    The paper prints the minus sign for both axes. With right-handed angles it belongs to a
    shift along X, which is a rotation about Y; see `stage_angles` for both axes.

    Parameters
    ----------
    shift, focal_length : array_like, shape (...)
        Motion L of the focal plane along X (or Y), and focal length f of the camera, in metres.

    Returns
    -------
    ndarray, shape (...)
        theta = -atan(L / f) about Y (or X), in radians.

    Examples
    --------
    >>> float(stage_angle(1.0, 1.0)) / np.pi
    -0.25
    """
    return -np.arctan2(shift, focal_length)


@checked
def stage_angle_printed(shift: Number, focal_length: Positive) -> FloatArray:
    """Return the angle by the relation as extracted, -tan(L) f.

    Printed form of chen2023 (10). It contains the tangent of a length, and a product instead of a
    ratio: for small shifts the result is -L f, in square metres, larger than the angle by the
    square of the focal length in metres. Parameters are those of `stage_angle`.

    Returns
    -------
    ndarray, shape (...)
        Value of the printed relation.

    Examples
    --------
    >>> round(float(stage_angle_printed(1e-6, 2.0)), 12)
    -2e-06
    """
    return -np.tan(shift) * focal_length


@checked
def stage_angles(shifts: Point, focal_length: Size) -> FloatArray:
    """Return the right-handed misalignment that corresponds to a shift of the focal plane.

    It is the result of `misalignment_angles` when the lasers move: a shift along X is a rotation of
    the camera about -Y, a shift along Y a rotation about +X. The two signs differ, but (10)
    contains the same sign for both axes.

    Parameters
    ----------
    shifts : array_like, shape (..., 2)
        Motion of the lasers along X and Y of the camera frame, in metres.
    focal_length : float
        Focal length f of the camera, in metres.

    Returns
    -------
    ndarray, shape (..., 3)
        (theta_X, theta_Y, theta_Z) = (atan(L_Y / f), -atan(L_X / f), 0), in radians.

    Examples
    --------
    >>> stage_angles([1.0, 1.0], 1.0) / np.pi
    array([ 0.25, -0.25,  0.  ])
    """
    angles = np.arctan2(shifts[..., ::-1] * [1, -1], focal_length)
    return np.insert(angles, 2, 0.0, axis=-1)
