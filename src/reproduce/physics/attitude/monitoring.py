"""Averages over consecutive frames, and how their scatter falls with the number of frames.

A series has its frames along one axis, the last unless `axis` says otherwise; all other axes
(replicates, angles) are a batch. Units are those of the series.

A camera's misalignment from spots of its lights, image by image: chen2023's monitoring.

Spots have shape (frames, n, 2), in px, x before y; spot i is always that of light i, and a spot
that is lost is NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics import validate
from reproduce.physics.attitude.platform import Platform
from reproduce.physics.validate import FloatArray, NonNegative, Positive


def moving_average(series: ArrayLike, count: int, axis: int = -1) -> FloatArray:
    """Return the averages over every run of `count` consecutive frames.

    Parameters
    ----------
    series : array_like
        Values frame by frame, along `axis`.
    count : int
        How many frames make one average; at most all.
    axis : int

    Returns
    -------
    ndarray
        As the series, with frames - count + 1 averages along `axis`; neighbours share frames.

    Examples
    --------
    >>> moving_average([1, 2, 6, 10], 2)
    array([1.5, 4. , 8. ])
    """
    frames, sums = _sums(series, axis)
    if validate.whole_number("count", count) > frames.shape[-1]:
        raise ValueError(
            f"count: expected at most {frames.shape[-1]}, the number of frames, got {count}; "
            "average fewer frames or pass a longer series"
        )
    averages = (sums[..., count:] - sums[..., :-count]) / count + frames[..., :1]
    return np.moveaxis(averages, -1, axis)


def _sums(series: ArrayLike, axis: int) -> tuple[FloatArray, FloatArray]:
    """Return frames along the last axis, and their sums less the first: it would cost digits."""
    frames = np.moveaxis(
        validate.finite_array("series", series, shape=(None,)), axis, -1
    )
    sums = np.zeros((*frames.shape[:-1], frames.shape[-1] + 1))
    np.cumsum(frames - frames[..., :1], axis=-1, out=sums[..., 1:])
    return frames, sums


def scatter_of_averages(
    series: ArrayLike, counts: Sequence[int], axis: int = -1
) -> FloatArray:
    """Return the standard deviation of moving averages over n frames of a series, for each n.

    The values for different n come from the same frames, so they are strongly correlated;
    for n close to the number of frames few averages are independent and the value itself is
    uncertain. Pass many replicates to see both.

    Parameters
    ----------
    series : array_like
        Values frame by frame, along `axis`.
    counts : sequence of int
        The numbers n of frames in an average, each smaller than that of all frames.
    axis : int

    Returns
    -------
    ndarray
        As the series, with one 1 sigma standard deviation (n - 1 in the denominator) for
        each count along `axis`.

    Raises
    ------
    ValueError
        If no count is given, or a count leaves a single average.

    Examples
    --------
    >>> scatter_of_averages([0, 2, 0, 2, 0, 2, 0, 2, 0, 2], [2])
    array([0.])
    """
    frames, sums = _sums(series, axis)
    most = frames.shape[-1]
    if (
        not 0
        < max((validate.whole_number("counts", n) for n in counts), default=0)
        < most
    ):
        raise ValueError(
            f"counts: expected one number or more, each below the {most} frames, got {counts}; "
            "average fewer frames or pass a longer series"
        )
    scatters = []
    for count in counts:
        totals = sums[..., count:] - sums[..., :-count]
        scatters.append(totals.std(axis=-1, ddof=1) / count)
    return np.stack(scatters, axis=axis)


def allan_deviation(
    series: ArrayLike, counts: Sequence[int], axis: int = -1
) -> FloatArray:
    """Return the Allan deviation of averages over n frames of a series, for each n.

    It is half the mean square difference of neighbouring averages, under a root: for white noise
    the error of an average. Averages share no frames.

    Parameters
    ----------
    series : array_like
        Values frame by frame, evenly in time, along `axis`.
    counts : sequence of int
        The numbers n of frames in an average, each at most half of all.
    axis : int

    Returns
    -------
    ndarray
        As the series, with one deviation for each count along `axis`.

    Raises
    ------
    ValueError
        If no count is given, or a count leaves a single average.

    Examples
    --------
    >>> allan_deviation([0, 2, 0, 2, 0, 2], [1, 2]).round(3) + 0.0
    array([1.414, 0.   ])
    """
    frames = np.moveaxis(
        validate.finite_array("series", series, shape=(None,)), axis, -1
    )
    most = frames.shape[-1] // 2
    if (
        not 0
        < max((validate.whole_number("counts", n) for n in counts), default=0)
        <= most
    ):
        raise ValueError(
            f"counts: expected one number or more, each at most {most}, half of the frames, got "
            f"{counts}; average fewer frames or pass a longer series"
        )
    squares = [np.square(_changes(frames, count)).mean(axis=-1) for count in counts]
    return np.sqrt(np.stack(squares, axis=axis) / 2)


def _changes(frames: FloatArray, count: int) -> FloatArray:
    """Return how averages over n frames differ from the next ones, along the last axis."""
    averages = (
        np.add.reduceat(frames, np.arange(0, frames.shape[-1], count), axis=-1) / count
    )
    return np.diff(averages[..., : frames.shape[-1] // count], axis=-1)


# Averages that a deviation is told by, at least; parts of a series whose means tell its drift.
_AVERAGES, _PARTS = 8, 10
_FEWEST = 2 * _AVERAGES


@dataclass(frozen=True, eq=False)
class Stability:
    """How a series of angles drifts, and how far averaging frames reaches beside the drift.

    Attributes
    ----------
    rate, rate_error : ndarray, shape (k,)
        Drift in a unit of time, by least squares, and its standard error.
    left : ndarray, shape (frames, k)
        The series less the straight drift.
    counts : ndarray of int, shape (m,)
        How many frames are averaged: powers of two.
    averages : ndarray of int, shape (m,)
        How many averages tell each deviation; none lies across a gap.
    deviations : ndarray, shape (m, k)
        Allan deviation of what the drift leaves.

    Notes
    -----
    The error of the rate is that of a line through the means of ten parts of the series: noise
    that neighbouring frames share counts in it, if the parts are longer than it lasts.
    """

    rate: FloatArray
    rate_error: FloatArray
    left: FloatArray
    counts: NDArray[np.int64]
    averages: NDArray[np.int64]
    deviations: FloatArray

    @property
    def floor(self) -> FloatArray:
        """The least deviation of an average, shape (k,)."""
        return np.asarray(self.deviations.min(axis=0))

    @property
    def reached(self) -> NDArray[np.int64]:
        """How many frames the average has that is the best, shape (k,); more make it no better."""
        return np.asarray(self.counts[self.deviations.argmin(axis=0)])

    @property
    def white(self) -> FloatArray:
        """The deviations if all noise were white, shape (m, k)."""
        return np.asarray(self.deviations[:1] / np.sqrt(self.counts)[:, None])

    def floor_interval(self, share: float) -> FloatArray:
        """Return the interval of the deviation at the floor, of nominal share, shape (2, k).

        Chi-squared with 2 (M - 1)^2 / (3 M - 4) degrees of freedom for M averages, the law for
        white noise. It takes the number of frames for given; as the least of several deviations
        chose it, the floor is a little low, and where averages are alike the interval too short.
        """
        from scipy.special import gammaincinv

        averages = self.averages[self.deviations.argmin(axis=0)]
        half = np.square(averages - 1) / (3 * averages - 4)
        ends = np.array([[0.5 + share / 2], [0.5 - share / 2]])
        return self.floor * np.sqrt(half / gammaincinv(half, ends))


def stability(times: ArrayLike, series: ArrayLike) -> Stability:
    """Return how a series of angles drifts, and where averaging its frames stops paying.

    Parameters
    ----------
    times : array_like, shape (frames,)
        Increasing, in any unit; evenly spaced to half a frame but for gaps. No average bridges one.
    series : array_like, shape (frames, k)
        16 frames or more.

    Returns
    -------
    Stability

    Raises
    ------
    ValueError
        If there are too few frames, or times do not increase or not evenly.

    Examples
    --------
    >>> found = stability(np.arange(20.0), 3.0 * np.arange(20.0)[:, None])
    >>> found.rate.round(9), found.floor.round(9) + 0.0
    (array([3.]), array([0.]))
    """
    values = validate.finite_array("series", series, shape=(None, None))
    when = validate.finite_array("times", times, shape=(len(values),))
    if len(values) < _FEWEST:
        raise ValueError(
            f"series: expected {_FEWEST} frames or more, got {len(values)}"
        )
    if (np.diff(when) <= 0).any():
        raise ValueError("times: expected each later than the one before; sort them")
    steps = np.diff(when) / np.median(np.diff(when))
    if steps.min() < 1 / 2:
        raise ValueError(
            f"times: expected evenly spaced frames, got one after {steps.min():.2g} of the usual "
            "time; leave out frames in between"
        )
    when = when - when.mean()
    rate, level = np.polyfit(when, values, 1)
    left = values - level - when[:, None] * rate
    parts = np.array_split(np.column_stack([when, values]), _PARTS)
    means = np.array([part.mean(axis=0) for part in parts])
    _, covariance = np.polyfit(means[:, 0], means[:, 1:], 1, cov=True)
    error = np.sqrt(covariance[0, 0])
    # A lost frame in a gap keeps averages of both sides apart.
    broken = np.insert(left, np.flatnonzero(steps > 3 / 2) + 1, np.nan, axis=0).T
    tried = 2 ** np.arange(int(np.log2(len(values) // _AVERAGES)) + 1, dtype=np.int64)
    changes = [_changes(broken, int(count)) for count in tried]
    averages = np.array([np.isfinite(one[0]).sum() + 1 for one in changes])
    kept = np.flatnonzero(averages >= _AVERAGES)
    deviations = np.sqrt(
        [np.nanmean(np.square(changes[at]), axis=1) / 2 for at in kept]
    )
    return Stability(rate, error, left, tried[kept], averages[kept], deviations)


# Fewest images whose neighbours are compared, and correlations that are tried.
_MIN_IMAGES = 5
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


@validate.checked
def averaged_error(
    count: Positive, single: NonNegative, floor: NonNegative = 0.0
) -> FloatArray:
    """Return the error of an average in the model E^2 = a^2 / n + b^2.

    Parameters
    ----------
    count : array_like
        n, how many independent frames are averaged; above zero.
    single, floor : array_like, in one unit
        a, the error of a single frame that averaging reduces, and b, what it does not reduce.

    Returns
    -------
    ndarray
        E, in the unit of `single`.

    Examples
    --------
    >>> float(averaged_error(4, single=6.0, floor=4.0))
    5.0
    """
    return np.asarray(np.hypot(single / np.sqrt(count), floor))


@validate.checked
def attitude_accuracy(
    centroid_sigma: NonNegative, count: Positive, pixel_angle: Positive
) -> FloatArray:
    """Return the accuracy of an attitude about X or Y from centroids of many spots.

    Implements: chen2023 (11).

    Holds for spots near the boresight, where a turn about X moves all spots alike along Y;
    about Z the error is larger, by one over the distance of the spots from their centre.

    Parameters
    ----------
    centroid_sigma : array_like
        delta, error of one centroid along one axis, in px; about X it is the error along Y.
    count : array_like
        N, number of spots; above zero.
    pixel_angle : array_like
        theta_pixel, the angle that a pixel subtends, in radians.

    Returns
    -------
    ndarray
        E = delta / sqrt(N) theta_pixel, in radians, at the same number of sigmas as delta.

    Examples
    --------
    >>> float(attitude_accuracy(0.5, count=4, pixel_angle=8.0))
    2.0
    """
    return np.asarray(centroid_sigma / np.sqrt(count) * pixel_angle)


@dataclass(frozen=True, eq=False)
class _Group:
    """Angles, (frames, 3), and response, (frames, 3, n, 2), of the images of a group that tell."""

    angles: FloatArray
    response: FloatArray

    @cached_property
    def variance(self) -> FloatArray:
        """Of the angles, for spots of unit variance, (frames, 3)."""
        return np.square(self.response).sum(axis=(-2, -1))

    @cached_property
    def weights(self) -> FloatArray:
        """Share of each image in the mean, (frames, 3): the less the fewer lights it shows."""
        return np.asarray(1 / self.variance / (1 / self.variance).sum(axis=0))

    @cached_property
    def mean(self) -> FloatArray:
        """Weighted mean of the angles, (3,)."""
        return np.asarray((self.weights * self.angles).sum(axis=0))


@dataclass(frozen=True, eq=False)
class Monitoring:
    """How far a camera has turned since the zero point, and how well that is known.

    Angles are rotation vectors in the camera frame, in radians, as `misalignment_angles` gives
    them.

    Parameters
    ----------
    angles : ndarray, shape (frames, 3)
        Of the images at the present; NaN where fewer than two lights are seen.
    groups : pair
        The images that tell, at the present and at the zero point.
    counts : ndarray, shape (n,)
        Images at the zero point in which each light is seen.
    widening, limit : float
        Factor on the standard error of the mean, and upper limit of its degrees of freedom.

    Notes
    -----
    Spots may move together from image to image, so errors come from the scatter of the angles, not
    of the spots. An image counts the less the fewer lights it shows, and the error of the zero
    point is that of the lights seen at the present.
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
        """Noise of a spot as each of the three angles shows it, in px."""
        squares = sum(
            (np.square(one.angles - one.mean) / one.variance).sum(axis=0)
            for one in self.groups
        )
        return np.sqrt(squares / self.freedom) if self.freedom else np.full(3, np.nan)

    @property
    def scatter(self) -> FloatArray:
        """Standard deviation of one image with all lights, shape (3,); NaN for single images."""
        least = min(one.variance.min(axis=0).tolist() for one in self.groups)
        return self._noise * np.sqrt(least)

    def covariance(self) -> FloatArray:
        """Return that of the angles of each image at the present, (frames, 3, 3).

        NaN where there are no angles. The scatter about the mean tells it: a drift counts.
        """
        response = self.groups[0].response
        found = np.full((len(self.angles), 3, 3), np.nan)
        told = np.isfinite(self.angles).all(axis=-1)
        found[told] = np.einsum("faij,fbij->fab", response, response)
        return np.asarray(found * np.outer(self._noise, self._noise))

    @property
    def error(self) -> FloatArray:
        """Standard error of the mean, that of the zero point in it, shape (3,)."""
        now = self.groups[0]
        together = np.einsum("fa,faij->aij", now.weights, now.response)
        zero = np.square(together).sum(axis=-1) @ (1 / self.counts)
        single = (np.square(now.weights) * now.variance).sum(axis=0)
        return self.widening * self._noise * np.sqrt(single + zero)

    def interval(self, share: float) -> FloatArray:
        """Return the central interval of the mean by Student's t-distribution, shape (2, 3)."""
        from scipy.special import (
            stdtrit,
        )  # only now: its import takes longer than most solutions

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
    """Return how far the camera has turned since the zero point, in every image.

    An image that lacks a spot is compared with the same lights at the zero point.

    Parameters
    ----------
    zero_spots, spots : array_like, shape (frames, n, 2)
        Images at the zero point, which are pooled, and at the present, in px; NaN where lost.
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
    counts = np.isfinite(before).all(axis=-1).sum(axis=0)
    zero = np.nanmean(before, axis=0)
    angles, groups = [], []
    for name, images in (("spots", now), ("zero_spots", before)):
        found, response = _turned(zero, images, platform)
        told = np.isfinite(found).all(axis=-1)
        if not told.any():
            raise ValueError(
                f"{name}: expected two lights or more in an image, got fewer in all"
            )
        angles.append(found)
        groups.append(_Group(found[told], response[told]))
    return Monitoring(angles[0], (groups[0], groups[1]), counts, widening, limit)


def _turned(
    zero: FloatArray, images: FloatArray, platform: Platform
) -> tuple[FloatArray, FloatArray]:
    """Angles of images against a zero point, (n, 2), and their response."""
    angles = np.full((len(images), 3), np.nan)
    response = np.zeros((len(images), 3, *zero.shape))
    seen = np.isfinite(images).all(axis=-1)
    shown, which = np.unique(seen, axis=0, return_inverse=True)
    for number, lights in enumerate(shown):
        if lights.sum() < 2:
            continue
        rows = np.flatnonzero(which.reshape(-1) == number)
        spots, places = (
            images[rows][:, lights],
            np.ix_(rows, np.arange(3), np.flatnonzero(lights)),
        )
        shows = platform.with_lights(lights)
        angles[rows] = shows.misalignment(spots, shows.transform(zero[lights]))
        response[places] = shows.response(spots)
    return angles, response
