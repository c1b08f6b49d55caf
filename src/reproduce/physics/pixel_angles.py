"""Between pixels on the detector and angles on the sky, for one pitch and one focal length.

Lengths are in metres, distances on the detector in px from the principal point, angles in radians.
Arguments broadcast against each other; results have their common shape.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.validate import FloatArray, common_batch, finite_array, positive


def field_of_view(pixels: ArrayLike, pixel_pitch: ArrayLike, focal_length: ArrayLike) -> FloatArray:
    """The full angle that a row of pixels sees, the boresight at its middle.

    Parameters
    ----------
    pixels : array_like
        Number of pixels, above zero.
    pixel_pitch, focal_length : array_like
        In metres, above zero.

    Returns
    -------
    ndarray
        Full angle, in radians: 2 atan(pixels * pixel_pitch / (2 * focal_length)).

    Raises
    ------
    ValueError
        If an argument is not finite and above zero.

    Examples
    --------
    A detector as wide as twice the focal length sees 90 degrees.

    >>> float(np.degrees(field_of_view(2000, 1e-5, 10e-3)).round(9))
    90.0
    """
    pixels = positive("pixels", pixels)
    return 2 * angle_from_pixels(pixels / 2, positive("pixel_pitch", pixel_pitch), focal_length)


def angle_from_pixels(
    pixels: ArrayLike, pixel_pitch: ArrayLike, focal_length: ArrayLike
) -> FloatArray:
    """The angle between the boresight and a spot that many pixels from the principal point.

    Parameters
    ----------
    pixels : array_like
        Signed distance, in px.
    pixel_pitch, focal_length : array_like
        In metres, above zero.

    Returns
    -------
    ndarray
        Signed angle, in radians: atan(pixels * pixel_pitch / focal_length). Multiply by
        `ARCSEC_PER_RADIAN` for arcseconds.

    Raises
    ------
    ValueError
        If an argument is not finite, or a length is not above zero.

    Examples
    --------
    >>> float(np.degrees(angle_from_pixels(1000, 1e-5, 10e-3)).round(9))
    45.0
    """
    pixels = finite_array("pixels", pixels)
    pixel_pitch = positive("pixel_pitch", pixel_pitch)
    focal_length = positive("focal_length", focal_length)
    common_batch(
        pixels=pixels.shape, pixel_pitch=pixel_pitch.shape, focal_length=focal_length.shape
    )
    return np.asarray(np.arctan(pixels * pixel_pitch / focal_length))


def pixels_from_angle(
    angle: ArrayLike, pixel_pitch: ArrayLike, focal_length: ArrayLike
) -> FloatArray:
    """The distance from the principal point of a spot at that angle from the boresight.

    Parameters
    ----------
    angle : array_like
        Signed angle, in radians, between -pi/2 and pi/2.
    pixel_pitch, focal_length : array_like
        In metres, above zero.

    Returns
    -------
    ndarray
        Signed distance, in px: the inverse of `angle_from_pixels`.

    Raises
    ------
    ValueError
        If an argument is not finite, a length is not above zero, or an angle reaches 90 degrees.

    Examples
    --------
    >>> float(pixels_from_angle(np.pi / 4, 1e-5, 10e-3).round(9))
    1000.0
    """
    angle = finite_array("angle", angle)
    pixel_pitch = positive("pixel_pitch", pixel_pitch)
    focal_length = positive("focal_length", focal_length)
    if (np.abs(angle) >= np.pi / 2).any():
        raise ValueError(
            f"angle: expected between -pi/2 and pi/2, got {np.abs(angle).max():g} rad; "
            "angles are in radians, not degrees"
        )
    common_batch(angle=angle.shape, pixel_pitch=pixel_pitch.shape, focal_length=focal_length.shape)
    return np.asarray(np.tan(angle) * focal_length / pixel_pitch)
