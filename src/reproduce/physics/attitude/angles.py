"""The camera's misalignment from laser spots in the star tracker.

Names. A rotation is named target first. The paper writes the source below and the target
above, so its T_cam^st is our `tracker_from_camera` (along the light, mirrors included), its
R_st^cam our `camera_from_tracker` (the installation, mirrors apart), and its misalignment
R_cam,0^cam,t our `camera_now_from_camera_zero`: it takes coordinates in the camera frame at
the zero point to coordinates in the camera frame at time t.

Sign. The misalignment angles (theta_X, theta_Y, theta_Z) are the right-handed turn that brings
the camera from its zero position to the present one, about the camera's own axes. A camera
that turns moves the world the other way through its frame, so to first order
`camera_now_from_camera_zero` is I - [theta ×].

Directions have shape (..., n, 3), angles are in radians, leading axes are a batch of frames.

In products of rotations (installation, misalignment, attitude) neighbours cancel. A laser transform
follows the light, an installation the axes of the instruments; a misalignment taken from two laser
transforms corrects an installation because the mirrors between have not moved.

A stage that moves the focal plane by L, in metres, stands in for a camera that turns: it turns
every beam by atan(L / f).
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from reproduce.physics.attitude.rotations import attitude, unit, vector_from_rotation
from reproduce.physics.validate import (
    Directions,
    FloatArray,
    Number,
    Point,
    Positive,
    Rotation,
    Weights,
    checked,
    weights_for,
)

_Moves = Annotated[Any, ("n", 3, None)]


@checked
def laser_transform(
    camera_directions: Directions,
    tracker_directions: Directions,
    weights: Weights = None,
) -> FloatArray:
    """Return the rotation that carries laser light from the camera into the tracker.

    Implements: chen2023 (4), (5).

    The sum over frames of (5) is one over rows: give the spots of all frames as one set, and they
    make one rotation; give a batch, and each frame makes its own.

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
    """Return the camera's misalignment directly from the laser spots.

    Implements: chen2023 (7).

    The arguments and errors of `laser_transform` apply. The directions in the tracker are
    those at the present, w_i,t^k.

    Parameters
    ----------
    tracker_from_camera_zero : array_like, shape (..., 3, 3)
        T_cam,0^st, the laser transform at the zero point.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        camera_now_from_camera_zero; `misalignment_angles` reads its angles.

    Examples
    --------
    >>> directions = [[0, 0, 1], [0.6, 0, 0.8]]
    >>> np.allclose(misalignment(directions, directions, np.eye(3)), np.eye(3))
    True
    """
    # Rows times T are the columns T' w: what the camera would have to emit at the zero point.
    carried = tracker_directions @ tracker_from_camera_zero
    return attitude(camera_directions, carried, weights)


@checked
def misalignment_angles(camera_now_from_camera_zero: Rotation) -> FloatArray:
    """Return the turn of the camera about its X, Y and Z axes since the zero point.

    Parameters
    ----------
    camera_now_from_camera_zero : array_like, shape (..., 3, 3)
        The misalignment R_cam,0^cam,t.

    Returns
    -------
    ndarray, shape (..., 3)
        Rotation vector (theta_X, theta_Y, theta_Z) in the camera frame, in radians,
        right-handed: positive theta_Y swings the boresight towards X.

    Raises
    ------
    ValueError
        If a matrix turns by half a turn.

    Examples
    --------
    The camera has turned right-handed about Z by a quarter turn: what lay along X now lies
    along -Y of the camera.

    >>> misalignment_angles([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) / np.pi
    array([0. , 0. , 0.5])
    """
    return vector_from_rotation(camera_now_from_camera_zero.mT)


@checked
def angle_jacobian(
    camera_directions: Directions,
    tracker_directions: Directions,
    direction_jacobian: _Moves,
    weights: Weights = None,
) -> FloatArray:
    """Return how the misalignment angles respond to each spot: the exact derivative.

    At the optimum sum w b × v vanishes, b a tracker direction carried into the camera.
    Differentiating that gives theta = H^-1 sum w v × db, with the stiffness
    H = trace(P) I - P and P = sum w v b^T. Weights and errors are those of `laser_transform`.

    Parameters
    ----------
    camera_directions, tracker_directions : array_like, shape (..., n, 3)
        Emitted and received directions at the point of differentiation.
    direction_jacobian : array_like, shape (..., n, 3, k)
        Derivative of each tracker direction by k parameters; for the spots in
        px see `received_jacobian`.

    Returns
    -------
    ndarray, shape (..., 3, n, k)
        Derivative of (theta_X, theta_Y, theta_Z), in radians per unit of the parameters.

    Examples
    --------
    Two directions along X and Y hold the turn about Z together, half each. A tracker
    direction that goes from X towards Y tells of a camera that turned about Z.

    >>> moves = np.zeros((2, 3, 1))
    >>> moves[0, 1, 0] = 1.0
    >>> np.round(angle_jacobian(np.eye(3)[:2], np.eye(3)[:2], moves)[:, 0, 0], 12)
    array([0. , 0. , 0.5])
    """
    camera_from_tracker = attitude(camera_directions, tracker_directions, weights)
    kept = weights_for(weights, camera_directions.shape[-2])
    camera = kept[..., None] * unit("camera_directions", camera_directions)
    carried = unit("tracker_directions", tracker_directions) @ camera_from_tracker.mT
    product = camera.mT @ carried
    trace = np.trace(product, axis1=-2, axis2=-1)[..., None, None]
    stiffness = trace * np.eye(3) - 0.5 * (product + product.mT)
    moved = camera_from_tracker[..., None, :, :] @ direction_jacobian
    torque = np.cross(camera[..., None, :], moved.mT)
    # The stiffness is symmetric, so rows times its inverse are the turns.
    return np.moveaxis(torque @ np.linalg.inv(stiffness)[..., None, :, :], -1, -3)


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
    """Return the misalignment that leads from one laser transform to another.

    It is (6) solved for the misalignment: R_cam,0^cam,t = (T_cam,t^st)' T_cam,0^st. The
    product begins and ends in the camera, so its angles are about the camera's axes.

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
def transform_error_printed(
    tracker_from_camera: Rotation, tracker_from_camera_reference: Rotation
) -> FloatArray:
    """Return the error of a laser transform in the order in which the text multiplies.

    The text behind Fig. 8 multiplies the transform by the transposed reference, T T_ref'.
    That product begins and ends in the tracker, where the spots stand off the boresight, so
    the poorly known roll of the spot cluster leaks into X and Y. The quoted accuracies belong
    to the camera frame: use `misalignment_between`.

    Parameters
    ----------
    tracker_from_camera, tracker_from_camera_reference : array_like, shape (..., 3, 3)
        A laser transform and the one taken as true.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        A small rotation within the tracker frame.

    Examples
    --------
    >>> transform_error_printed(np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    return tracker_from_camera @ tracker_from_camera_reference.mT


@checked
def inertial_attitude(
    camera_now_from_camera_zero: Rotation,
    camera_zero_from_tracker: Rotation,
    tracker_from_inertial: Rotation,
) -> FloatArray:
    """Return the attitude of the camera among the stars, its installation corrected.

    Implements: chen2023 (8), (9).

    Parameters
    ----------
    camera_now_from_camera_zero, camera_zero_from_tracker : array_like, shape (..., 3, 3)
        R_cam,0^cam,t, the misalignment, and R_st^cam,0, the installation at the zero point; their
        product is R_st^cam,t, the corrected installation.
    tracker_from_inertial : array_like, shape (..., 3, 3)
        R_inertial^st,t, the tracker's attitude.

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
    """Return the misalignment as the imaging model wants it, between two tracker frames.

    The R_U of (1) stands between the star tracker and the installation R_cam^star, so it
    begins and ends in the tracker. The misalignment of (7) begins and ends in the camera and
    runs the other way; putting it in the place of R_U is wrong in its axes and its sign.

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
    """Return the misalignment angle that a shift of the focal plane stands for.

    Implements: chen2023 (10).

    The minus sign is the paper's, for both axes. With right-handed angles it belongs to a
    shift along X, which turns about Y; see `stage_angles` for both axes.

    Parameters
    ----------
    shift, focal_length : array_like, in metres
        L, the motion of the focal plane along X (or Y), and the camera's focal length f.

    Returns
    -------
    ndarray
        theta = -atan(L / f) about Y (or X), in radians.

    Examples
    --------
    >>> float(stage_angle(1.0, 1.0)) / np.pi
    -0.25
    """
    return np.asarray(-np.arctan2(shift, focal_length))


@checked
def stage_angle_printed(shift: Number, focal_length: Positive) -> FloatArray:
    """Return the angle by the relation as extracted, -tan(L) f.

    Printed form of chen2023 (10). It takes the tangent of a length and multiplies where it
    should divide: for small shifts the result is -L f, in square metres, larger than the
    angle by the square of the focal length in metres. Arguments are those of `stage_angle`.

    Returns
    -------
    ndarray
        A number that is no angle.

    Examples
    --------
    >>> round(float(stage_angle_printed(1e-6, 2.0)), 12)
    -2e-06
    """
    return np.asarray(-np.tan(shift) * focal_length)


@checked
def stage_angles(shifts: Point, focal_length: Positive) -> FloatArray:
    """Return the right-handed misalignment that a shift of the focal plane stands for.

    This is what `misalignment_angles` measures when the lasers move: a shift along X turns
    the camera about -Y, a shift along Y turns it about +X. The two signs differ, while (10)
    prints the same one for both axes.

    Parameters
    ----------
    shifts : array_like, shape (..., 2)
        Motion of the lasers along X and Y of the camera frame, in metres.
    focal_length : array_like, shape (...), in metres

    Returns
    -------
    ndarray, shape (..., 3)
        (theta_X, theta_Y, theta_Z) = (atan(L_Y / f), -atan(L_X / f), 0), in radians.

    Examples
    --------
    >>> stage_angles([1.0, 1.0], 1.0) / np.pi
    array([ 0.25, -0.25,  0.  ])
    """
    angles = np.arctan2(shifts[..., ::-1] * [1, -1], focal_length[..., None])
    return np.insert(angles, 2, 0.0, axis=-1)
