"""What a pixel and a pointing error are worth on the ground, straight below.

Lengths are in metres, angles in radians. For any line of sight see `imaging`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.validate import FloatArray, common_batch, finite_array, positive


def ground_resolution(
    focal_length: ArrayLike, pixel_pitch: ArrayLike, altitude: ArrayLike
) -> FloatArray:
    """Return the size of a pixel on the ground at nadir.

    Parameters
    ----------
    focal_length, pixel_pitch, altitude : array_like
        In metres, above zero.

    Returns
    -------
    ndarray
        pitch × altitude / focal length, in metres.

    Raises
    ------
    ValueError
        If a length is not finite or not above zero.

    Examples
    --------
    >>> float(ground_resolution(focal_length=10.0, pixel_pitch=1e-5, altitude=500e3))
    0.5
    """
    focal, pitch, height = _lengths(
        focal_length=focal_length, pixel_pitch=pixel_pitch, altitude=altitude
    )
    return np.asarray(pitch * height / focal)


def altitude_for_resolution(
    focal_length: ArrayLike, pixel_pitch: ArrayLike, resolution: ArrayLike
) -> FloatArray:
    """Return the altitude from which a pixel has a given size on the ground at nadir.

    Parameters
    ----------
    focal_length, pixel_pitch, resolution : array_like
        In metres, above zero.

    Returns
    -------
    ndarray
        resolution × focal length / pitch, in metres.

    Raises
    ------
    ValueError
        If a length is not finite or not above zero.

    Examples
    --------
    >>> round(float(altitude_for_resolution(10.0, 1e-5, resolution=0.5)))
    500000
    """
    focal, pitch, size = _lengths(
        focal_length=focal_length, pixel_pitch=pixel_pitch, resolution=resolution
    )
    return np.asarray(size * focal / pitch)


def ground_error(altitude: ArrayLike, angle: ArrayLike) -> FloatArray:
    """Return how far a small pointing error moves the line of sight on the ground at nadir.

    Parameters
    ----------
    altitude : array_like
        In metres, above zero.
    angle : array_like
        Pointing error about an axis across the boresight, in radians, small; keeps its sign.

    Returns
    -------
    ndarray
        altitude × angle, in metres.

    Raises
    ------
    ValueError
        If a value is not finite, or the altitude is not above zero.

    Examples
    --------
    >>> float(ground_error(500e3, 2e-6))
    1.0
    """
    (height,) = _lengths(altitude=altitude)
    turn = finite_array("angle", angle)
    common_batch(altitude=height.shape, angle=turn.shape)
    return np.asarray(height * turn)


def _lengths(**values: ArrayLike) -> tuple[FloatArray, ...]:
    checked = {name: positive(name, value) for name, value in values.items()}
    common_batch(**{name: array.shape for name, array in checked.items()})
    return tuple(checked.values())
