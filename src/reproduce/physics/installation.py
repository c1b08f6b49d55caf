"""Products of rotations: installation, misalignment and attitude of the camera.

Rotations are named target first, so in every product neighbours cancel. The paper's symbols
and the sign of the misalignment are explained in `misalignment`. A laser transform follows
the light, an installation the axes of the instruments; a misalignment taken from two laser
transforms corrects an installation because the mirrors between have not moved.
"""

from __future__ import annotations

from numpy.typing import ArrayLike

from reproduce.physics.rotations import rotations, transpose
from reproduce.physics.validate import FloatArray, common_batch


def moved_laser_transform(
    tracker_from_camera_zero: ArrayLike, camera_now_from_camera_zero: ArrayLike
) -> FloatArray:
    """Return the laser transform after the camera has moved.

    Implements: chen2023 (6).

    Parameters
    ----------
    tracker_from_camera_zero : array_like, shape (..., 3, 3)
        T_cam,0^st, the laser transform at the zero point.
    camera_now_from_camera_zero : array_like, shape (..., 3, 3)
        R_cam,0^cam,t, the misalignment.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        T_cam,t^st, tracker_from_camera_now.

    Raises
    ------
    ValueError
        If a matrix is not a rotation.

    Examples
    --------
    >>> import numpy as np
    >>> moved_laser_transform(np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    return _product(
        tracker_from_camera_zero=tracker_from_camera_zero,
        camera_zero_from_camera_now=transpose(
            rotations("camera_now_from_camera_zero", camera_now_from_camera_zero)
        ),
    )


def misalignment_between(
    tracker_from_camera_now: ArrayLike, tracker_from_camera_zero: ArrayLike
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

    Raises
    ------
    ValueError
        If a matrix is not a rotation.

    Examples
    --------
    >>> import numpy as np
    >>> misalignment_between(np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    return _product(
        camera_now_from_tracker=transpose(
            rotations("tracker_from_camera_now", tracker_from_camera_now)
        ),
        tracker_from_camera_zero=tracker_from_camera_zero,
    )


def transform_error_printed(
    tracker_from_camera: ArrayLike, tracker_from_camera_reference: ArrayLike
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

    Raises
    ------
    ValueError
        If a matrix is not a rotation.

    Examples
    --------
    >>> import numpy as np
    >>> transform_error_printed(np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    return _product(
        tracker_from_camera=tracker_from_camera,
        camera_reference_from_tracker=transpose(
            rotations("tracker_from_camera_reference", tracker_from_camera_reference)
        ),
    )


def corrected_installation(
    camera_now_from_camera_zero: ArrayLike, camera_zero_from_tracker: ArrayLike
) -> FloatArray:
    """Return the installation of the camera, corrected for its misalignment.

    Implements: chen2023 (8).

    Parameters
    ----------
    camera_now_from_camera_zero : array_like, shape (..., 3, 3)
        R_cam,0^cam,t, the misalignment.
    camera_zero_from_tracker : array_like, shape (..., 3, 3)
        R_st^cam,0, the installation calibrated at the zero point.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        R_st^cam,t, camera_now_from_tracker.

    Raises
    ------
    ValueError
        If a matrix is not a rotation.

    Examples
    --------
    >>> import numpy as np
    >>> corrected_installation(np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    return _product(
        camera_now_from_camera_zero=camera_now_from_camera_zero,
        camera_zero_from_tracker=camera_zero_from_tracker,
    )


def inertial_attitude(
    camera_from_tracker: ArrayLike, tracker_from_inertial: ArrayLike
) -> FloatArray:
    """Return the attitude of the camera among the stars.

    Implements: chen2023 (9).

    Parameters
    ----------
    camera_from_tracker : array_like, shape (..., 3, 3)
        R_st^cam,t, the corrected installation.
    tracker_from_inertial : array_like, shape (..., 3, 3)
        R_inertial^st,t, the attitude that the tracker finds from its stars.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        R_inertial^cam,t, camera_from_inertial.

    Raises
    ------
    ValueError
        If a matrix is not a rotation.

    Examples
    --------
    >>> import numpy as np
    >>> inertial_attitude(np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    return _product(
        camera_from_tracker=camera_from_tracker, tracker_from_inertial=tracker_from_inertial
    )


def misalignment_in_tracker(
    camera_now_from_camera_zero: ArrayLike, tracker_from_camera_zero: ArrayLike
) -> FloatArray:
    """Return the misalignment as the imaging model wants it, between two tracker frames.

    The R_U of (1) stands between the star tracker and the installation R_cam^star, so it
    begins and ends in the tracker. The misalignment of (7) begins and ends in the camera and
    runs the other way; putting it in the place of R_U is wrong in its axes and its sign.

    Parameters
    ----------
    camera_now_from_camera_zero : array_like, shape (..., 3, 3)
        R_cam,0^cam,t, the misalignment.
    tracker_from_camera_zero : array_like, shape (..., 3, 3)
        R_cam,0^st, the installation at the zero point.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        R_U = R_cam,0^st (R_cam,0^cam,t)' (R_cam,0^st)'.

    Raises
    ------
    ValueError
        If a matrix is not a rotation.

    Examples
    --------
    >>> import numpy as np
    >>> misalignment_in_tracker(np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    zero = rotations("tracker_from_camera_zero", tracker_from_camera_zero)
    return _product(
        tracker_from_camera_now=moved_laser_transform(zero, camera_now_from_camera_zero),
        camera_zero_from_tracker=transpose(zero),
    )


def _product(**factors: ArrayLike) -> FloatArray:
    """Return the product of two named rotations in the order given."""
    checked = {name: rotations(name, matrix) for name, matrix in factors.items()}
    common_batch(**{name: matrix.shape[:-2] for name, matrix in checked.items()})
    left, right = checked.values()
    result: FloatArray = left @ right
    return result
