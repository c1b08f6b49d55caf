"""Averages over consecutive frames, and how their scatter falls with the number of frames.

A series has its frames along one axis, the last unless `axis` says otherwise; all other axes
(replicates, angles) are a batch. Units are those of the series.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.validate import (
    FloatArray,
    NonNegative,
    Positive,
    checked,
    finite_array,
    whole_number,
)


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
    frames = _frames_last(series, axis)
    return np.moveaxis(_averages(*_sums(frames), _run("count", count, frames)), -1, axis)


def scatter_of_averages(series: ArrayLike, counts: Sequence[int], axis: int = -1) -> FloatArray:
    """Return the standard deviation of moving averages over n frames of a series, for each n.

    The values for different n come from the same frames, so they are strongly correlated;
    for n close to the number of frames few averages are independent and the value itself is
    uncertain. Pass many replicates to see both.

    Parameters
    ----------
    series : array_like
        Values frame by frame, along `axis`.
    counts : sequence of int
        The numbers n of frames in an average.
    axis : int

    Returns
    -------
    ndarray
        As the series, with one 1 sigma standard deviation (n - 1 in the denominator) for
        each count along `axis`.

    Raises
    ------
    ValueError
        If no count is given, a count leaves a single average, or the axis does not exist.

    Examples
    --------
    >>> scatter_of_averages([0, 2, 0, 2, 0, 2, 0, 2, 0, 2], [2])
    array([0.])
    """
    if len(counts) == 0:
        raise ValueError("counts: expected one number of frames or more, got none; pass [1]")
    frames = _frames_last(series, axis)
    first, sums = _sums(frames)
    scatters = []
    for count in counts:
        averages = _averages(first, sums, _run("counts", count, frames))
        if averages.shape[-1] < 2:
            raise ValueError(
                f"counts: expected two averages or more for each count, got one for {count} "
                "frames; average fewer frames or pass a longer series"
            )
        scatters.append(averages.std(axis=-1, ddof=1))
    return np.stack(scatters, axis=axis)


@checked
def averaged_error(count: Positive, single: NonNegative, floor: NonNegative = 0.0) -> FloatArray:
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


@checked
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


def _frames_last(series: ArrayLike, axis: int) -> FloatArray:
    """Return a checked series with its frames along the last axis."""
    array = finite_array("series", series, shape=(None,))
    if not -array.ndim <= axis < array.ndim:
        raise ValueError(
            f"axis: expected an axis of the series, from {-array.ndim} to {array.ndim - 1}, "
            f"got {axis}; name the axis along which the frames follow each other"
        )
    return np.moveaxis(array, axis, -1)


def _run(name: str, count: int, frames: FloatArray) -> int:
    size = whole_number(name, count)
    if size > frames.shape[-1]:
        raise ValueError(
            f"{name}: expected at most {frames.shape[-1]}, the number of frames, got {size}; "
            "average fewer frames or pass a longer series"
        )
    return size


def _sums(frames: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the first frame, and sums of deviations from it: a common value would cost digits."""
    first = frames[..., :1]
    sums = np.zeros((*frames.shape[:-1], frames.shape[-1] + 1))
    np.cumsum(frames - first, axis=-1, out=sums[..., 1:])
    return first, sums


def _averages(first: FloatArray, sums: FloatArray, runs: int) -> FloatArray:
    averages = sums[..., runs:] - sums[..., :-runs]
    averages /= runs
    averages += first
    return averages
