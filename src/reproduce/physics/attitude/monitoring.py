"""Misalignment of a camera from the spots of its lights, image by image.

Spots have shape (frames, n, 2), in px, x before y; spot i is always that of light i, and a spot
that is lost is NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from reproduce.physics import validate
from reproduce.physics.attitude.platform import Platform
from reproduce.physics.validate import FloatArray

# Fewest images whose neighbours are compared.
_MIN_IMAGES = 5
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
        one for one in groups if len(one) >= _MIN_IMAGES and one.std(axis=0).any()
    ]
    if not groups:
        return 0.0, 0.0, 1.0
    counts = np.array([len(one) for one in groups])
    products = sum((one[1:] * one[:-1]).sum() for one in groups)
    squares = np.array([np.square(one).sum() for one in groups])
    pairs = [np.square(one.T @ one).sum() for one in groups]
    own = [np.square(np.square(one).sum(axis=1)).sum() for one in groups]
    score = (products + (squares / counts).sum()) / np.sqrt(
        (np.subtract(pairs, own) / counts).sum()
    )
    # Expected moments of such a process about its own mean, over its variance.
    counts = counts[:, None]
    decay = (1 - _LAGS**counts) / (1 - _LAGS) / counts
    mean = (1 + _LAGS - 2 * _LAGS * decay) / (1 - _LAGS) / counts
    square = (counts * (1 - mean)).sum(axis=0)
    product = ((counts - 1) * _LAGS - (counts + 1) * mean + 2 * decay).sum(axis=0)
    lag = np.interp(products / squares.sum(), product / square, _LAGS)
    ratio = mean.sum(axis=0) / square * (counts - 1).sum() / (1 / counts).sum()
    return float(score), float(lag), float(np.sqrt(np.interp(lag, _LAGS, ratio)))


@dataclass(frozen=True, eq=False)
class _Group:
    """Angles, (frames, 3), and response, (frames, 3, n, 2), of the usable images of a group."""

    angles: FloatArray
    response: FloatArray

    @cached_property
    def variance(self) -> FloatArray:
        """Variance of the angles for spots of unit variance, (frames, 3)."""
        return np.square(self.response).sum(axis=(-2, -1))

    @cached_property
    def weights(self) -> FloatArray:
        """Weight of each image in the mean, (frames, 3): the inverse variance."""
        return np.asarray(1 / self.variance / (1 / self.variance).sum(axis=0))

    @cached_property
    def mean(self) -> FloatArray:
        """Weighted mean of the angles, (3,)."""
        return np.asarray((self.weights * self.angles).sum(axis=0))


@dataclass(frozen=True, eq=False)
class Monitoring:
    """Turn of a camera since the zero point, with its errors.

    Angles are those of `misalignment_angles`, in radians.

    Parameters
    ----------
    angles : ndarray, shape (frames, 3)
        Angles of the images at the present; NaN where fewer than two lights are seen.
    groups : pair
        Usable images at the present and at the zero point.
    counts : ndarray, shape (n,)
        Number of images at the zero point in which each light is seen.
    widening, limit : float
        Factor on the standard error of the mean, and upper limit of its degrees of freedom.

    Notes
    -----
    Spots may move together from image to image, so errors come from the scatter of the angles, not
    of the spots. The error of the zero point is that of the lights seen at the present.
    """

    angles: FloatArray
    groups: tuple[_Group, _Group]
    counts: FloatArray
    widening: float = 1.0
    limit: float = np.inf

    @property
    def mean(self) -> FloatArray:
        """Mean misalignment, shape (3,)."""
        return self.groups[0].mean

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the scatter: images beyond the first of each group."""
        return sum(len(one.angles) - 1 for one in self.groups)

    @cached_property
    def _noise(self) -> FloatArray:
        """Noise of a spot, in px, from the scatter of each angle, shape (3,)."""
        squares = sum(
            (np.square(one.angles - one.mean) / one.variance).sum(axis=0)
            for one in self.groups
        )
        return np.sqrt(squares / self.freedom) if self.freedom else np.full(3, np.nan)

    @property
    def scatter(self) -> FloatArray:
        """Standard deviation of one image with all lights, shape (3,); NaN for single images."""
        least = np.min([one.variance.min(axis=0) for one in self.groups], axis=0)
        return self._noise * np.sqrt(least)

    def covariance(self) -> FloatArray:
        """Return the covariance of the angles of each image at the present, (frames, 3, 3).

        It is NaN without angles. The noise is the scatter about the mean, so it includes a drift.
        """
        response = self.groups[0].response * self._noise[:, None, None]
        found = np.full((len(self.angles), 3, 3), np.nan)
        found[np.isfinite(self.angles[:, 0])] = np.einsum(
            "faij,fbij->fab", response, response
        )
        return found

    @property
    def error(self) -> FloatArray:
        """Standard error of the mean, shape (3,); it includes the zero point."""
        now = self.groups[0]
        together = np.einsum("fa,faij->aij", now.weights, now.response)
        zero = np.square(together).sum(axis=-1) @ (1 / self.counts)
        single = (np.square(now.weights) * now.variance).sum(axis=0)
        return self.widening * self._noise * np.sqrt(single + zero)

    def interval(self, share: float) -> FloatArray:
        """Return the central interval of the mean by Student's t-distribution, shape (2, 3)."""
        freedom = min(self.freedom, self.limit)
        reach = stdtrit(freedom, 0.5 + share / 2) if freedom else np.nan
        return self.mean + np.array([[-1.0], [1.0]]) * reach * self.error


def monitored(
    zero_spots: ArrayLike,
    spots: ArrayLike,
    platform: Platform,
    widening: float = 1.0,
    limit: float = np.inf,
) -> Monitoring:
    """Return the turn of the camera since the zero point, in every image.

    An image that lacks a spot is compared with the same lights at the zero point.

    Parameters
    ----------
    zero_spots, spots : array_like, shape (frames, n, 2)
        Images at the zero point, which are averaged, and at the present, in px; NaN if lost.
    platform : Platform
        With n lights, each of which is seen at the zero point.
    widening, limit : float
        As in `Diagnosis`: factor on the standard error, and limit of its degrees of freedom.

    Returns
    -------
    Monitoring
        Angles of both groups, with the mean and its error.

    Raises
    ------
    DegenerateGeometryError, ValueError
        As for `laser_transform`; or if no image of a group shows two lights.

    Examples
    --------
    >>> lasers = [[1e-3, 0], [0, 1e-3], [-1e-3, 0]]
    >>> spots = [[[20.0, 0], [0, 20], [-20, 0]]]
    >>> monitored(spots, spots, Platform(lasers, 1.0, 0.05, 5e-6, (0, 0))).mean.round(9) + 0.0
    array([0., 0., 0.])
    """
    shape = (None, len(platform.lasers), 2)
    before = validate.number_array("zero_spots", zero_spots, shape=shape)
    now = validate.number_array("spots", spots, shape=shape)
    zero = np.nanmean(before, axis=0)
    angles, present = _measured("spots", now, zero, platform)
    _, past = _measured("zero_spots", before, zero, platform)
    counts = np.isfinite(before).all(axis=-1).sum(axis=0)
    return Monitoring(angles, (present, past), counts, widening, limit)


def _measured(
    name: str, images: FloatArray, zero: FloatArray, platform: Platform
) -> tuple[FloatArray, _Group]:
    """Return the angles of images against a zero point, (n, 2), and the usable images."""
    seen = np.asarray(np.isfinite(images).all(axis=-1))
    usable = seen.sum(axis=-1) > 1
    if not usable.any():
        raise ValueError(
            f"{name}: expected two lights or more in an image, got fewer in all. Add lights"
        )
    weights = seen[usable].astype(np.float64)
    spots = np.where(seen[..., None], images, zero)[usable]
    angles = np.full((len(images), 3), np.nan)
    # The zero point of an image has the lights of the image.
    before = platform.transform(zero, weights)
    angles[usable] = platform.misalignment(spots, before, weights)
    return angles, _Group(angles[usable], platform.response(spots, weights))
