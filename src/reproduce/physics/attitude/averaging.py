"""Averages over consecutive frames, and their scatter as a function of the number of frames.

The last axis of a series contains its frames unless a function states otherwise; other axes
(replicates, angles) are a batch. Units are those of the series.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import uniform_filter1d
from scipy.special import gammaincinv

from reproduce.physics.validate import (
    FloatArray,
    IntArray,
    NonNegative,
    Positive,
    checked,
    valid,
    whole_number,
)

_Series = Annotated[Any, ("frames",)]
_Angles = Annotated[Any, ("frames", None)]
# Fewest averages of a deviation, and fewest frames.
_MIN_AVERAGES = 8
_MIN_FRAMES = 2 * _MIN_AVERAGES
# Parts of a series, of which the means give the error of its drift.
_DRIFT_PARTS = 10


@checked
def moving_average(series: _Series, count: int) -> FloatArray:
    """Return the averages over every run of `count` consecutive frames.

    Parameters
    ----------
    series : array_like, shape (..., frames)
        Values of each frame.
    count : int
        Number of frames in an average, at most the number of frames.

    Returns
    -------
    ndarray, shape (..., frames - count + 1)
        Averages. Neighbours have frames in common.

    Examples
    --------
    >>> moving_average([1, 2, 6, 10], 2)
    array([1.5, 4. , 8. ])
    """
    frames = series.shape[-1]
    _check_counts("count", [count], frames)
    # The filter returns an average for each frame, also for those with too few neighbours.
    first = count // 2
    return uniform_filter1d(series, count)[..., first : first + frames - count + 1]


def _check_counts(name: str, counts: Sequence[int], greatest: int) -> None:
    numbers = [whole_number(name, count) for count in counts]
    if not 0 < max(numbers, default=0) <= greatest:
        raise ValueError(
            f"{name}: expected numbers of frames up to {greatest}, got {counts}. Average "
            "fewer frames or give a longer series"
        )


@checked
def scatter_of_averages(series: _Series, counts: Sequence[int]) -> FloatArray:
    """Return the standard deviation of moving averages over n frames of a series, for each n.

    The values for different n come from the same frames, so they are strongly correlated. For n
    close to the number of frames, few averages are independent, and the value is uncertain.

    Parameters
    ----------
    series : array_like, shape (..., frames)
        Values of each frame.
    counts : sequence of int
        Numbers n of frames in an average, each smaller than the number of frames.

    Returns
    -------
    ndarray, shape (..., counts)
        Standard deviations, 1 sigma, with n - 1 in the denominator.

    Raises
    ------
    ValueError
        If no count is given, or a count leaves a single average.

    Examples
    --------
    >>> scatter_of_averages([0, 2, 0, 2, 0, 2, 0, 2, 0, 2], [2])
    array([0.])
    """
    _check_counts("counts", counts, series.shape[-1] - 1)
    averages = (moving_average(series, count) for count in counts)
    return np.stack([average.std(axis=-1, ddof=1) for average in averages], axis=-1)


@checked
def allan_deviation(series: _Series, counts: Sequence[int]) -> FloatArray:
    """Return the Allan deviation of averages over n frames of a series, for each n.

    It is the root of half the mean square difference of neighbouring averages. For white noise, it
    is the error of an average. Averages have no frames in common.

    Parameters
    ----------
    series : array_like, shape (..., frames)
        Values of each frame, evenly spaced in time.
    counts : sequence of int
        Numbers n of frames in an average, at most half of the frames.

    Returns
    -------
    ndarray, shape (..., counts)
        Deviations, 1 sigma.

    Raises
    ------
    ValueError
        If no count is given, or a count leaves a single average.

    Examples
    --------
    >>> allan_deviation([0, 2, 0, 2, 0, 2], [1, 2]).round(3) + 0.0
    array([1.414, 0.   ])
    """
    _check_counts("counts", counts, series.shape[-1] // 2)
    squares = [np.square(_changes(series, count)).mean(axis=-1) for count in counts]
    return np.sqrt(np.stack(squares, axis=-1) / 2)


def _changes(frames: FloatArray, count: int) -> FloatArray:
    """Return the differences of averages over n frames from the next ones, (..., averages - 1)."""
    windows = sliding_window_view(frames, count, axis=-1)[..., ::count, :]
    return np.diff(windows.mean(axis=-1), axis=-1)


@dataclass(frozen=True, eq=False)
class Stability:
    """Drift of a series of angles, and the errors of averages without the drift.

    Attributes
    ----------
    rate, rate_error : ndarray, shape (k,)
        Drift in a unit of time, by least squares, and its standard error.
    counts : ndarray of int, shape (m,)
        Numbers of averaged frames: powers of two.
    averages : ndarray of int, shape (m,)
        Numbers of averages of each deviation, without averages across a gap.
    deviations : ndarray, shape (m, k)
        Allan deviation without the drift.

    Notes
    -----
    The error of the rate is that of a line through the means of ten parts of the series. It
    includes correlated noise if the correlation is shorter than a part.
    """

    rate: FloatArray
    rate_error: FloatArray
    counts: IntArray
    averages: IntArray
    deviations: FloatArray

    @property
    def floor(self) -> FloatArray:
        """Smallest deviation of an average, shape (k,)."""
        return self.deviations.min(axis=0)

    @property
    def reached(self) -> IntArray:
        """Number of frames in the best average, shape (k,)."""
        return self.counts[self.deviations.argmin(axis=0)]

    @property
    def white(self) -> FloatArray:
        """Deviations if all noise were white, shape (m, k)."""
        return self.deviations[:1] / np.sqrt(self.counts)[:, None]

    def floor_interval(self, level: float) -> FloatArray:
        """Return the interval of the deviation at the floor, of nominal coverage, shape (2, k).

        It is chi-squared with 2 (M - 1)^2 / (3 M - 4) degrees of freedom for M averages, as for
        white noise. The choice of the smallest deviation biases it a little towards low values.
        """
        averages = self.averages[self.deviations.argmin(axis=0)]
        half = np.square(averages - 1) / (3 * averages - 4)
        ends = 0.5 + np.array([[level], [-level]]) / 2
        return self.floor * np.sqrt(half / gammaincinv(half, ends))


@checked
def stability(times: _Series, series: _Angles) -> Stability:
    """Return the drift of a series of angles, and the number of frames that an average needs.

    Parameters
    ----------
    times : array_like, shape (frames,)
        Increasing times, in any unit, evenly spaced to half a frame except for gaps.
    series : array_like, shape (frames, k)
        Values of 16 frames or more.

    Returns
    -------
    Stability
        Drift, and deviations of averages.

    Raises
    ------
    ValueError
        If there are too few frames, or times do not increase or not evenly.

    Examples
    --------
    >>> drift = stability(np.arange(20.0), 3.0 * np.arange(20.0)[:, None])
    >>> drift.rate.round(9), drift.floor.round(9) + 0.0
    (array([3.]), array([0.]))
    """
    frames = len(series)
    valid("series", frames, frames >= _MIN_FRAMES, f"{_MIN_FRAMES} frames or more")
    steps = np.diff(times)
    usual = np.median(steps)
    valid(
        "times",
        steps,
        (steps > 0) & (steps >= usual / 2),
        "increasing, evenly spaced frames",
    )
    when = times - times.mean()
    rate, level = np.polyfit(when, series, 1)
    left = series - level - when[:, None] * rate
    parts = np.array_split(np.column_stack([when, series]), _DRIFT_PARTS)
    means = np.array([part.mean(axis=0) for part in parts])
    _, covariance = np.polyfit(means[:, 0], means[:, 1:], 1, cov=True)
    # A lost frame in a gap separates the averages of both sides.
    broken = np.insert(left, np.flatnonzero(steps > 1.5 * usual) + 1, np.nan, axis=0).T
    results = []
    for power in range((frames // _MIN_AVERAGES).bit_length()):
        count = 2**power
        squares = np.square(_changes(broken, count))
        averages = np.isfinite(squares[0]).sum() + 1
        if averages >= _MIN_AVERAGES:
            results.append((count, averages, np.sqrt(np.nanmean(squares, axis=1) / 2)))
    columns = map(np.array, zip(*results, strict=True))
    return Stability(rate, np.sqrt(covariance[0, 0]), *columns)


def shared_zero_chi_square(differences: FloatArray) -> FloatArray:
    """Return chi-square of differences of angles that contain the noise of one zero state.

    Parameters
    ----------
    differences : ndarray, shape (..., states)
        Differences of the states from the zero state, over the standard deviation of an angle.

    Returns
    -------
    ndarray, shape (...)
        Chi-square, with one degree of freedom for each state.

    Examples
    --------
    >>> float(shared_zero_chi_square(np.ones(3)))
    0.75
    """
    # The inverse of the covariance, one plus the matrix of ones.
    shared = differences.sum(axis=-1) ** 2 / (differences.shape[-1] + 1)
    return np.square(differences).sum(axis=-1) - shared


@checked
def averaged_error(
    count: Positive, single: NonNegative, floor: NonNegative = 0.0
) -> FloatArray:
    """Return the error of an average in the model E^2 = a^2 / n + b^2.

    Parameters
    ----------
    count : array_like, shape (...)
        Number n of independent frames, above zero.
    single, floor : array_like, shape (...)
        Error a of a single frame that averaging reduces, and remaining error b, in one unit.

    Returns
    -------
    ndarray, shape (...)
        Error E, in the unit of `single`.

    Examples
    --------
    >>> float(averaged_error(4, single=6.0, floor=4.0))
    5.0
    """
    return np.hypot(single / np.sqrt(count), floor)


@checked
def attitude_accuracy(
    centroid_sigma: NonNegative, count: Positive, pixel_angle: Positive
) -> FloatArray:
    """Return the accuracy of an attitude about X or Y from centroids of many spots.

    Implements: chen2023 (11).

    It is valid for spots near the boresight, where a rotation about X moves all spots equally along
    Y. About Z the error is larger, by one over the distance of the spots from their centre.

    Parameters
    ----------
    centroid_sigma : array_like, shape (...)
        Error delta of one centroid along one axis, in px; about X it is the error along Y.
    count : array_like, shape (...)
        Number N of spots, above zero.
    pixel_angle : array_like, shape (...)
        Angle theta_pixel of a pixel, in radians.

    Returns
    -------
    ndarray, shape (...)
        E = delta / sqrt(N) theta_pixel, in radians, with as many sigmas as delta.

    Examples
    --------
    >>> float(attitude_accuracy(0.5, count=4, pixel_angle=8.0))
    2.0
    """
    return centroid_sigma / np.sqrt(count) * pixel_angle
