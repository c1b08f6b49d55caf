"""A camera's misalignment from spots of lasers, image by image: chen2023's monitoring, end to end.

Spots have shape (..., n, 2), in px, x before y; row i is always laser i.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.attitude.lasers import emitted_directions, received_directions
from reproduce.physics.attitude.misalignment import (
    laser_transform,
    misalignment,
    misalignment_angles,
)
from reproduce.physics.validate import FloatArray, number_array

__all__ = ["mean_misalignment", "monitored_angles"]


def monitored_angles(
    zero_spots: ArrayLike,
    spots: ArrayLike,
    lasers: ArrayLike,
    camera_focal_length: float,
    tracker: tuple[ArrayLike, float, float],
) -> FloatArray:
    """Return how far the camera has turned since the zero point, in every image.

    Parameters
    ----------
    zero_spots, spots : array_like, shape (frames, n, 2)
        Images at the zero point, which are pooled, and at the present, in px.
    lasers : array_like, shape (n, 2)
        Positions on the camera's focal plane, in metres.
    camera_focal_length : float, in metres
    tracker : tuple
        Principal point (px), pixel pitch and focal length (metres) of the tracker.

    Returns
    -------
    ndarray, shape (frames, 3)
        Rotation vectors in the camera frame, in radians, as `misalignment_angles` gives them.

    Raises
    ------
    DegenerateGeometryError, ValueError
        As for `laser_transform`.

    Examples
    --------
    >>> lasers = [[1e-3, 0], [0, 1e-3], [-1e-3, 0]]
    >>> spots = [[[20.0, 0], [0, 20], [-20, 0]]]
    >>> monitored_angles(spots, spots, lasers, 1.0, ((0, 0), 5e-6, 0.05)).round(9) + 0.0
    array([[0., 0., 0.]])
    """
    camera = emitted_directions(lasers, camera_focal_length)
    zero = laser_transform(camera, received_directions(zero_spots, *tracker), pooled=True)
    now = received_directions(spots, *tracker)
    return misalignment_angles(misalignment(camera, now, zero))


def mean_misalignment(
    angles: ArrayLike, zero_angles: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the mean misalignment, the scatter of one image and the error of the mean.

    The zero point is a mean over images too, so its error counts as well. The scatter is that of
    both groups, each about its own mean: images are taken alike at both times.

    Parameters
    ----------
    angles, zero_angles : array_like, shape (frames, 3)
        From `monitored_angles`: of the images at the present, and of those of the zero point.

    Returns
    -------
    mean, scatter, error : ndarray, shape (3,)
        In the unit of the angles; scatter and error are NaN for one image in each group.

    Examples
    --------
    >>> mean, scatter, error = mean_misalignment([[1, 0, 0], [3, 0, 0]], [[0, 0, 0]])
    >>> mean, scatter.round(3), error.round(3)
    (array([2., 0., 0.]), array([1.414, 0.   , 0.   ]), array([1.732, 0.   , 0.   ]))
    """
    now, zero = (
        number_array(name, one) for name, one in (("angles", angles), ("zero_angles", zero_angles))
    )
    squares = sum(np.square(one - one.mean(axis=0)).sum(axis=0) for one in (now, zero))
    spare = len(now) + len(zero) - 2
    scatter = np.sqrt(squares / spare) if spare else np.full(now.shape[-1], np.nan)
    return now.mean(axis=0), scatter, scatter * np.sqrt(1 / len(now) + 1 / len(zero))
