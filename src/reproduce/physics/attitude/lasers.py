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

from reproduce.physics.attitude.rotations import _unit
from reproduce.physics.validate import Directions, FloatArray, Point, Points, Positive, checked


@checked
def emitted_directions(
    points: Points, focal_length: Positive, principal_point: Point = (0.0, 0.0)
) -> FloatArray:
    """Return the directions in which lasers on the focal plane leave the camera.

    Implements: chen2023 (2).

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Laser positions (X_i, Y_i) on the focal plane, in metres.
    focal_length : array_like, shape (...), of the camera, in metres
    principal_point : array_like, shape (..., 2)
        (X_0, Y_0), in metres.

    Returns
    -------
    ndarray, shape (..., n, 3)
        Unit vectors v_i,cam in the camera frame, pointing outwards.

    Examples
    --------
    A laser at three quarters of the focal length from the centre.

    >>> emitted_directions([[3.0, 0.0]], focal_length=4.0)
    array([[-0.6,  0. ,  0.8]])
    """
    return _unit("points", _outward(principal_point[..., np.newaxis, :] - points, focal_length))


@checked
def received_directions(
    spots: Points, principal_point: Point, pixel_pitch: Positive, focal_length: Positive
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
    focal_length : array_like, shape (...), of the tracker, in metres

    Returns
    -------
    ndarray, shape (..., n, 3)
        Unit vectors w_i in the tracker frame, pointing to where the light comes from.

    Examples
    --------
    >>> received_directions([[13.0, 10.0]], (10.0, 10.0), pixel_pitch=1.0, focal_length=4.0)
    array([[-0.6,  0. ,  0.8]])
    """
    return _unit("spots", _received_rays(spots, principal_point, pixel_pitch, focal_length))


@checked
def received_spots(
    directions: Directions, principal_point: Point, pixel_pitch: Positive, focal_length: Positive
) -> FloatArray:
    """Return where light from given directions makes spots: `received_directions` turned round.

    Other arguments are those of `received_directions`.

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Tracker directions, of any length, pointing to where the light comes from: in front of the
        tracker (z > 0).

    Returns
    -------
    ndarray, shape (..., n, 2), in px

    Examples
    --------
    >>> received_spots([[-0.6, 0.0, 0.8]], (10.0, 10.0), pixel_pitch=1.0, focal_length=4.0)
    array([[13., 10.]])
    """
    return _spots(directions, principal_point, focal_length / pixel_pitch)


@checked
def received_jacobian(
    spots: Points, principal_point: Point, pixel_pitch: Positive, focal_length: Positive
) -> FloatArray:
    """Return how a received direction moves with its spot.

    Arguments are those of `received_directions`.

    Returns
    -------
    ndarray, shape (..., n, 3, 2)
        Derivative of each tracker direction by (x, y) of its spot, in 1/px.

    Examples
    --------
    On the boresight one pixel is pitch over focal length, and the image is inverted.

    >>> float(received_jacobian([[0, 0]], (0, 0), pixel_pitch=1.0, focal_length=4.0)[0, 0, 0])
    -0.25
    """
    rays = _received_rays(spots, principal_point, pixel_pitch, focal_length)
    lengths = np.linalg.norm(rays, axis=-1)[..., np.newaxis, np.newaxis]
    directions = rays[..., np.newaxis] / lengths
    # Only the part of the ray's motion across the ray turns the direction.
    across = np.eye(3) - directions * directions.mT
    return -pixel_pitch[..., np.newaxis, np.newaxis, np.newaxis] / lengths * across[..., :, :2]


def _received_rays(
    spots: FloatArray, centre: FloatArray, pitch: FloatArray, focal_length: FloatArray
) -> FloatArray:
    offsets = centre[..., np.newaxis, :] - spots
    return _outward(offsets * pitch[..., np.newaxis, np.newaxis], focal_length)


def _outward(offsets: FloatArray, focal_length: FloatArray) -> FloatArray:
    """Return the rays that belong to inverted points on the focal plane, pointing outwards."""
    depth = focal_length[..., np.newaxis]
    shape = np.broadcast_shapes(offsets.shape[:-1], depth.shape)
    rays = np.empty((*shape, 3))
    rays[..., :2] = offsets
    rays[..., 2] = depth
    return rays


def _spots(rays: FloatArray, centre: FloatArray, focal_length: FloatArray) -> FloatArray:
    """Return where rays meet the detector, in the unit of the focal length and the centre."""
    if (rays[..., 2] <= 0).any():
        raise ValueError(
            "directions: expected light from in front of the tracker, got a third component of "
            f"{rays[..., 2].min():g}; the tracker looks along its Z axis"
        )
    scale = focal_length[..., np.newaxis, np.newaxis]
    return centre[..., np.newaxis, :] - scale * rays[..., :2] / rays[..., 2:]
