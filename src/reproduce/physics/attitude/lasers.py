"""Directions of laser light: leaving the camera, arriving in the star tracker.

Both instruments use the same frame, said once here: the origin where the boresight meets the
focal plane, Z along the boresight out of the instrument, X and Y along the axes of the focal
plane. An image through one lens is inverted, hence the minus signs of (2) and (3): a source
at positive X sends its light towards negative X. A direction in the tracker points to where
the light comes from, as for a star.

Points on the camera's focal plane are in metres, spots on the tracker's detector in px, x
before y; directions are unit vectors of shape (..., n, 3). The paper's v_i,cam are our camera
directions, its w_i^k our tracker directions. Leading axes are a batch.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.attitude.rotations import unit
from reproduce.physics.validate import FloatArray, common_batch, finite_array, positive


def emitted_directions(
    points: ArrayLike, focal_length: ArrayLike, principal_point: ArrayLike = (0.0, 0.0)
) -> FloatArray:
    """Return the directions in which lasers on the focal plane leave the camera.

    Implements: chen2023 (2).

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Laser positions (X_i, Y_i) on the focal plane, in metres.
    focal_length : array_like, shape (...)
        Of the camera, in metres.
    principal_point : array_like, shape (..., 2)
        (X_0, Y_0), in metres.

    Returns
    -------
    ndarray, shape (..., n, 3)
        Unit vectors v_i,cam in the camera frame, pointing outwards.

    Raises
    ------
    ValueError
        If a shape does not fit, a value is not finite, or the focal length is not above zero.

    Examples
    --------
    A laser at three quarters of the focal length from the centre.

    >>> emitted_directions([[3.0, 0.0]], focal_length=4.0)
    array([[-0.6,  0. ,  0.8]])
    """
    offsets, focal = _offsets("points", points, principal_point, focal_length)
    return unit("points", _outward(offsets, focal))


def received_directions(
    spots: ArrayLike,
    principal_point: ArrayLike,
    pixel_pitch: ArrayLike,
    focal_length: ArrayLike,
) -> FloatArray:
    """Return the directions from which the tracker sees laser spots arrive.

    Implements: chen2023 (3).

    Parameters
    ----------
    spots : array_like, shape (..., n, 2)
        Centroids (x_i, y_i) of the spots, in px.
    principal_point : array_like, shape (..., 2)
        (x_0, y_0), in px.
    pixel_pitch : array_like, shape (...)
        Distance between the centres of neighbouring pixels, in metres.
    focal_length : array_like, shape (...)
        Of the tracker, in metres.

    Returns
    -------
    ndarray, shape (..., n, 3)
        Unit vectors w_i in the tracker frame, pointing to where the light comes from.

    Raises
    ------
    ValueError
        If a shape does not fit, a value is not finite, or a length is not above zero.

    Examples
    --------
    >>> received_directions([[13.0, 10.0]], (10.0, 10.0), pixel_pitch=1.0, focal_length=4.0)
    array([[-0.6,  0. ,  0.8]])
    """
    offsets, focal = _offsets("spots", spots, principal_point, focal_length)
    pitch = positive("pixel_pitch", pixel_pitch)
    common_batch(spots=offsets.shape[:-2], pixel_pitch=pitch.shape)
    return unit("spots", _outward(offsets * pitch[..., np.newaxis, np.newaxis], focal))


def received_spots(
    directions: ArrayLike,
    principal_point: ArrayLike,
    pixel_pitch: ArrayLike,
    focal_length: ArrayLike,
) -> FloatArray:
    """Return where light from given directions makes spots: `received_directions` turned round.

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Tracker directions, of any length, pointing to where the light comes from.
    principal_point, pixel_pitch, focal_length
        As for `received_directions`.

    Returns
    -------
    ndarray, shape (..., n, 2)
        Spots, in px.

    Raises
    ------
    ValueError
        If a direction does not point in front of the tracker, a shape does not fit, a value is
        not finite, or a length is not above zero.

    Examples
    --------
    >>> received_spots([[-0.6, 0.0, 0.8]], (10.0, 10.0), pixel_pitch=1.0, focal_length=4.0)
    array([[13., 10.]])
    """
    rays = finite_array("directions", directions, shape=(None, 3))
    centre = finite_array("principal_point", principal_point, shape=(2,))
    pitch, focal = positive("pixel_pitch", pixel_pitch), positive("focal_length", focal_length)
    common_batch(
        directions=rays.shape[:-2],
        principal_point=centre.shape[:-1],
        pixel_pitch=pitch.shape,
        focal_length=focal.shape,
    )
    if (rays[..., 2] <= 0).any():
        raise ValueError(
            "directions: expected light from in front of the tracker, got a third component of "
            f"{rays[..., 2].min():g}; the tracker looks along its Z axis"
        )
    scale = (focal / pitch)[..., np.newaxis, np.newaxis]
    return np.asarray(centre[..., np.newaxis, :] - scale * rays[..., :2] / rays[..., 2:])


def received_jacobian(
    spots: ArrayLike,
    principal_point: ArrayLike,
    pixel_pitch: ArrayLike,
    focal_length: ArrayLike,
) -> FloatArray:
    """Return how a received direction moves with its spot.

    Parameters
    ----------
    spots, principal_point, pixel_pitch, focal_length
        As for `received_directions`.

    Returns
    -------
    ndarray, shape (..., n, 3, 2)
        Derivative of each tracker direction by (x, y) of its spot, in 1/px.

    Raises
    ------
    ValueError
        As for `received_directions`.

    Examples
    --------
    On the boresight one pixel is pitch over focal length, and the image is inverted.

    >>> float(received_jacobian([[0, 0]], (0, 0), pixel_pitch=1.0, focal_length=4.0)[0, 0, 0])
    -0.25
    """
    offsets, focal = _offsets("spots", spots, principal_point, focal_length)
    pitch = positive("pixel_pitch", pixel_pitch)
    common_batch(spots=offsets.shape[:-2], pixel_pitch=pitch.shape)
    rays = _outward(offsets * pitch[..., np.newaxis, np.newaxis], focal)
    lengths = np.linalg.norm(rays, axis=-1)[..., np.newaxis, np.newaxis]
    directions = rays[..., np.newaxis] / lengths
    # Only the part of the ray's motion across the ray turns the direction.
    across = np.eye(3) - directions * np.swapaxes(directions, -1, -2)
    scale = -pitch[..., np.newaxis, np.newaxis, np.newaxis] / lengths
    result: FloatArray = scale * across[..., :, :2]
    return result


def _offsets(
    name: str, points: ArrayLike, principal_point: ArrayLike, focal_length: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return points relative to the principal point, inverted by the lens, and the focal length."""
    rows = finite_array(name, points, shape=(None, 2))
    centre = finite_array("principal_point", principal_point, shape=(2,))
    focal = positive("focal_length", focal_length)
    common_batch(
        **{name: rows.shape[:-2], "principal_point": centre.shape[:-1], "focal_length": focal.shape}
    )
    return centre[..., np.newaxis, :] - rows, focal


def _outward(offsets: FloatArray, focal_length: FloatArray) -> FloatArray:
    """Return the rays that belong to inverted points on the focal plane, pointing outwards."""
    depth = focal_length[..., np.newaxis]
    shape = np.broadcast_shapes(offsets.shape[:-1], depth.shape)
    rays = np.empty((*shape, 3))
    rays[..., :2] = offsets
    rays[..., 2] = depth
    return rays
