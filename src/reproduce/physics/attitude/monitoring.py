"""Misalignment of a camera from the spots of its lights in each image.

Spots have shape (frames, n, 2), in px, x before y. Spot i is the spot of light i. A lost spot is
NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from reproduce.physics.attitude.platform import Platform
from reproduce.physics.validate import (
    BoolArray,
    DegenerateGeometryError,
    FloatArray,
    number_array,
)

# Fewest images whose neighbours are compared.
_MIN_IMAGES = 5
# Iterations of mean spots and of the motion of images.
_ROUNDS = 30
# Correlations of neighbours that are tried.
_LAGS = np.linspace(0, 0.99, 100)


def _correlation(groups: Sequence[FloatArray]) -> tuple[float, float, float]:
    """Return score, correlation and factor for neighbours in series (frames, k) about their means.

    The score compares the products of neighbours with all permutations of the images, so common
    motion of spots does not matter. White noise has a standard normal score. The correlation is the
    parameter of an autoregressive process of first order. The factor is the standard deviation of
    the difference of two means over its estimate for white noise.
    """
    groups = [
        group
        for group in groups
        if len(group) >= _MIN_IMAGES and group.std(axis=0).any()
    ]
    if not groups:
        return 0.0, 0.0, 1.0
    products = squares = centre = variance = 0.0
    for group in groups:
        square, count = np.square(group).sum(axis=1), len(group)
        products += (group[1:] * group[:-1]).sum()
        squares += square.sum()
        # Mean and variance of the products over the permutations.
        centre -= square.sum() / count
        variance += (np.square(group.T @ group).sum() - square @ square) / count
    # Expected moments of such a process about its own mean, over its variance.
    counts = np.array([len(group) for group in groups])[:, None]
    decay = (1 - _LAGS**counts) / (1 - _LAGS) / counts
    mean = (1 + _LAGS - 2 * _LAGS * decay) / (1 - _LAGS) / counts
    square = (counts * (1 - mean)).sum(axis=0)
    product = ((counts - 1) * _LAGS - (counts + 1) * mean + 2 * decay).sum(axis=0)
    lag = np.interp(products / squares, product / square, _LAGS)
    ratio = mean.sum(axis=0) / square * (counts - 1).sum() / (1 / counts).sum()
    factor = np.sqrt(np.interp(lag, _LAGS, ratio))
    return float((products - centre) / np.sqrt(variance)), float(lag), float(factor)


@dataclass(frozen=True, eq=False)
class Monitoring:
    """Rotation of a camera since the zero point, with its errors.

    Angles are those of `misalignment_angles`, in radians.

    Attributes
    ----------
    angles, covariance : ndarray, shape (frames, 3) and (frames, 3, 3)
        Angles of the images at the present; NaN for fewer than two lights.
    mean, scatter, error : ndarray, shape (3,)
        Mean misalignment, standard deviation of one image with all lights, and standard error of
        the mean, which includes the zero point. Errors are NaN for single images.
    freedom : float
        Degrees of freedom of the errors.
    """

    angles: FloatArray
    covariance: FloatArray
    mean: FloatArray
    scatter: FloatArray
    error: FloatArray
    freedom: float

    def interval(self, level: float) -> FloatArray:
        """Return the central interval of the mean by Student's t-distribution, shape (2, 3)."""
        half = stdtrit(self.freedom, 0.5 + level / 2) * self.error
        return np.stack([self.mean - half, self.mean + half])


def monitored(
    zero_spots: ArrayLike,
    spots: ArrayLike,
    platform: Platform,
    widening: float = 1.0,
    limit: float = np.inf,
    design_variance: float = 0.0,
) -> Monitoring:
    """Return the rotation of the camera since the zero point, in every image.

    An image without a spot is compared with the other lights at the zero point.

    Parameters
    ----------
    zero_spots, spots : array_like, shape (frames, n, 2)
        Images at the zero point, which are averaged, and at the present, in px; NaN if lost.
    platform : Platform
        Platform with n lights, each of which has spots at the zero point.
    widening, limit, design_variance : float
        As in `Diagnosis`: factor on the standard error, limit of its degrees of freedom, and
        variance of lights about their designed places.

    Returns
    -------
    Monitoring
        Angles of the images at the present, with the mean and its error.

    Raises
    ------
    ValueError
        If no image of a group has two lights, or all spots of an image are at one place.

    Notes
    -----
    Spots may move together from image to image. So the errors are computed from the scatter of the
    angles about their mean, not of the spots, and include a drift. The weight of an image is its
    inverse variance. The error of the zero point is that of the lights in use at the present.

    Examples
    --------
    >>> lasers = [[1e-3, 0], [0, 1e-3], [-1e-3, 0]]
    >>> spots = [[[20.0, 0], [0, 20], [-20, 0]]]
    >>> monitored(spots, spots, Platform(lasers, 1.0, 0.05, 5e-6, (0, 0))).mean.round(9) + 0.0
    array([0., 0., 0.])
    """
    shape = (None, len(platform.lasers), 2)
    before = number_array("zero_spots", zero_spots, shape=shape)
    now = number_array("spots", spots, shape=shape)
    zero = _zero_point(before)
    squares, freedom = np.zeros(3), 0
    for name, images in (("zero_spots", before), ("spots", now)):
        usable, single, response = _measured(name, images, zero, platform)
        # Variance of small rotations for spots of unit variance.
        variance = np.square(response).sum(axis=-1)
        weights = 1 / variance / (1 / variance).sum(axis=0)
        mean = (weights * single).sum(axis=0)
        turned = _derivative(mean)
        offsets = (single - mean) @ np.linalg.inv(turned).T
        squares += (np.square(offsets) / variance).sum(axis=0)
        freedom += len(single) - 1
    # Noise of a spot, in px, from the scatter of the rotations about each axis.
    noise = np.sqrt(squares / (freedom or np.nan))
    counts = np.isfinite(before[..., 0]).sum(axis=0)
    response *= noise[:, None]
    # The zero point is rotated in the opposite sense.
    past = turned.T @ (weights[..., None] * response).sum(axis=0)
    present = turned @ response
    angles = np.full((len(now), 3), np.nan)
    covariance = np.full((len(now), 3, 3), np.nan)
    angles[usable] = single
    covariance[usable] = present @ present.mT
    variance = np.square(past) @ (1 / np.repeat(counts, 2))
    variance += np.square(weights[..., None] * present).sum(axis=(0, 2))
    # Lights off their designed places rotate the axes of both groups equally.
    complete = platform.response(zero).reshape(3, -1)
    axes = (turned - turned.T) @ complete
    variance = widening**2 * variance + design_variance * np.square(axes).sum(axis=1)
    return Monitoring(
        angles,
        covariance,
        mean,
        np.sqrt(np.square(turned * noise) @ np.square(complete).sum(axis=1)),
        np.sqrt(variance),
        min(freedom, limit),
    )


def _derivative(angles: FloatArray) -> FloatArray:
    """Return the derivative of a rotation vector by a small rotation after it, shape (3, 3).

    The error is about angle^4 / 720.
    """
    matrix = np.cross(np.eye(3), angles)  # of the cross product of the angles
    return np.eye(3) + matrix / 2 + matrix @ matrix / 12


def _zero_point(images: FloatArray) -> FloatArray:
    """Return the mean spots as if no spot were lost: the spots of an image move together."""
    spots, moved = np.ma.masked_invalid(images), np.zeros(1)
    for _ in range(_ROUNDS):
        zero = (spots - moved).mean(axis=0)
        moved = (spots - zero).mean(axis=1, keepdims=True)
    return np.ma.filled(zero + moved.mean(axis=0), np.nan)


def _measured(
    name: str, images: FloatArray, zero: FloatArray, platform: Platform
) -> tuple[BoolArray, FloatArray, FloatArray]:
    """Return which images have two lights, their angles since a zero point, and their response."""
    seen = np.asarray(np.isfinite(images).all(axis=-1))
    usable = seen.sum(axis=-1) > 1
    if not usable.any():
        raise ValueError(
            f"{name}: expected two lights or more in an image, got fewer in all images. Add lights"
        )
    lights = seen[usable]
    spots = np.where(lights[..., None], images[usable], zero)
    try:
        # The zero point of an image has the lights of the image.
        angles = platform.misalignment(spots, platform.transform(zero, lights), lights)
    except DegenerateGeometryError as error:
        raise ValueError(
            f"{name}: expected two places or more in each image, got spots at one place. Mark "
            f"lost spots (NaN or masked) ({error})"
        ) from error
    response = platform.response(spots, lights)
    return usable, angles, response.reshape(*angles.shape, -1)
