"""What a pixel, an angle or a covariance is worth on the ground, in the numbers that are quoted.

Lengths are in metres, angles in radians. A pixel and a pointing error are taken straight below; for
any line of sight see `imaging`. Covariances are of east and north on the ground, in square metres,
leading axes a batch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr

from reproduce.physics.ground.earth import local_axes
from reproduce.physics.ground.imaging import WGS84, Ellipsoid
from reproduce.physics.validate import (
    FloatArray,
    Number,
    Positive,
    checked,
    common_batch,
    finite_array,
)

# Strips over which a normal law in the plane is integrated; enough for five digits.
_SECTORS = 256
_HALVINGS = 60


@checked
def ground_resolution(
    focal_length: Positive, pixel_pitch: Positive, altitude: Positive
) -> FloatArray:
    """Return the size of a pixel on the ground at nadir.

    Parameters
    ----------
    focal_length, pixel_pitch, altitude : array_like, in metres

    Returns
    -------
    ndarray
        pitch × altitude / focal length, in metres.

    Examples
    --------
    >>> float(ground_resolution(focal_length=10.0, pixel_pitch=1e-5, altitude=500e3))
    0.5
    """
    return np.asarray(pixel_pitch * altitude / focal_length)


@checked
def altitude_for_resolution(
    focal_length: Positive, pixel_pitch: Positive, resolution: Positive
) -> FloatArray:
    """Return the altitude from which a pixel has a given size on the ground at nadir.

    Arguments are those of `ground_resolution`, the size in place of the altitude.

    Returns
    -------
    ndarray
        resolution × focal length / pitch, in metres.

    Examples
    --------
    >>> round(float(altitude_for_resolution(10.0, 1e-5, resolution=0.5)))
    500000
    """
    return np.asarray(resolution * focal_length / pixel_pitch)


@checked
def ground_error(altitude: Positive, angle: Number) -> FloatArray:
    """Return how far a small pointing error moves the line of sight on the ground at nadir.

    Parameters
    ----------
    altitude : array_like, in metres
    angle : array_like
        Pointing error about an axis across the boresight, in radians, small; keeps its sign.

    Returns
    -------
    ndarray
        altitude × angle, in metres.

    Examples
    --------
    >>> float(ground_error(500e3, 2e-6))
    1.0
    """
    return np.asarray(altitude * angle)


@dataclass(frozen=True, eq=False)
class Ellipse:
    """The one-sigma ellipse of an error on the ground.

    Attributes
    ----------
    major, minor : ndarray, shape (...)
        Semi-axes, in metres.
    azimuth : ndarray, shape (...)
        Of the major axis, from north towards east, in radians, from 0 to pi.
    """

    major: FloatArray
    minor: FloatArray
    azimuth: FloatArray


def ground_covariance(
    position: ArrayLike,
    jacobian: ArrayLike,
    covariance: ArrayLike,
    ellipsoid: Ellipsoid = WGS84,
) -> FloatArray:
    """Return the covariance of east and north that a term of the imaging model causes.

    Parameters
    ----------
    position : array_like, shape (..., 3)
        Ground positions, Earth-fixed, in metres.
    jacobian : array_like, shape (..., 3, k)
        Derivative of the positions by k parameters, from `imaging.ground_jacobian`.
    covariance : array_like, shape (..., k, k), of the parameters
    ellipsoid : Ellipsoid
        Whose east and north are meant.

    Returns
    -------
    ndarray, shape (..., 2, 2), in square metres

    Examples
    --------
    >>> ground_covariance([6378137.0, 0, 0], np.eye(3), np.diag([9.0, 4.0, 1.0])).diagonal()
    array([4., 1.])
    """
    slopes = finite_array("jacobian", jacobian, shape=(3, None))
    spread = finite_array("covariance", covariance, shape=(slopes.shape[-1], slopes.shape[-1]))
    local = local_axes(position, ellipsoid)[..., :2, :]
    common_batch(
        position=local.shape[:-2], jacobian=slopes.shape[:-2], covariance=spread.shape[:-2]
    )
    onto = local @ slopes
    return onto @ spread @ onto.mT


def ellipse(covariance: ArrayLike) -> Ellipse:
    """Return the one-sigma ellipse of a covariance.

    Arguments and errors are those of `circular_error`.

    Returns
    -------
    Ellipse

    Examples
    --------
    >>> float(ellipse(np.diag([4.0, 1.0])).major)
    2.0
    """
    values, vectors = _eigen(covariance)
    azimuth = np.arctan2(vectors[..., 0, 1], vectors[..., 1, 1]) % np.pi
    minor, major = np.moveaxis(np.sqrt(values), -1, 0)
    return Ellipse(major, minor, azimuth)


def circular_error(covariance: ArrayLike, share: float = 0.9) -> FloatArray:
    """Return the radius of the circle that holds a share of the errors: CE90 by default.

    Parameters
    ----------
    covariance : array_like, shape (..., 2, 2)
        Of east and north about the true place, in square metres; negative in no direction.
    share : float
        Above 0 and below 1.

    Returns
    -------
    ndarray, shape (...), in metres

    Examples
    --------
    Equal errors of 1 m: the Rayleigh law's 2.146 m. Along one line only: 1.645 m.

    >>> circular_error([np.eye(2), np.diag([1.0, 0.0])]).round(3)
    array([2.146, 1.645])
    """
    if not 0.0 < share < 1.0:
        raise ValueError(f"share: expected above 0 and below 1, got {share}; 0.9 is nine tenths")
    values, _ = _eigen(covariance)
    large = np.sqrt(values[..., 1])
    scale = np.where(large > 0, large, 1.0)
    # Thinner than a millionth is a line for every purpose, and keeps the integral regular.
    ratio = np.maximum(np.sqrt(values[..., 0]) / scale, 0.0)
    low, high = np.zeros_like(scale), np.full_like(scale, np.sqrt(-2.0 * np.log1p(-share)))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        inside = _held(middle, ratio) < share
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return np.where(large > 0, high * scale, 0.0)


def _held(radius: FloatArray, ratio: FloatArray) -> FloatArray:
    """Return the share of a normal law with semi-axes 1 and `ratio` inside a circle."""
    # Across the long axis: x from -R to R, and |y| below the circle's edge there.
    turn = (np.arange(_SECTORS) + 0.5) / _SECTORS * np.pi - np.pi / 2
    x = radius[..., np.newaxis] * np.sin(turn)
    edge = radius[..., np.newaxis] * np.cos(turn)
    thin = np.maximum(ratio, 1e-12)[..., np.newaxis]
    within = 2.0 * ndtr(edge / thin) - 1.0
    density = np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi)
    return (density * within * edge).mean(axis=-1) * np.pi


def _eigen(covariance: ArrayLike) -> tuple[FloatArray, FloatArray]:
    matrix = finite_array("covariance", covariance, shape=(2, 2))
    values, vectors = np.linalg.eigh(matrix)
    floor = -1e-9 * np.maximum(values[..., 1], 0.0)
    if (values[..., 0] < floor).any():
        raise ValueError(
            "covariance: expected no negative variance in any direction, got "
            f"{values.min():g}; pass a covariance, not its inverse or a correlation of mixed units"
        )
    return np.maximum(values, 0.0), vectors
