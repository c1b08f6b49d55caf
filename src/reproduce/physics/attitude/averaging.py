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
    common_batch,
    finite_array,
    non_negative,
    positive,
    whole_number,
)


def moving_average(series: ArrayLike, count: int, axis: int = -1) -> FloatArray:
    """Return the averages over every run of `count` consecutive frames.

    Parameters
    ----------
    series : array_like
        Values frame by frame, along `axis`.
    count : int
        How many frames make one average.
    axis : int
        The axis of the frames.

    Returns
    -------
    ndarray
        As the series, with frames - count + 1 averages along `axis`; neighbours share frames.

    Raises
    ------
    TypeError, ValueError
        If `count` is not a whole number from 1 to the number of frames, the axis does not
        exist, or a value is not finite.

    Examples
    --------
    >>> moving_average([1, 2, 6, 10], 2)
    array([1.5, 4. , 8. ])
    """
    frames, runs = _frames_last(series, count, axis)
    # Sums of deviations from the first frame: a large common value would cost digits.
    first = frames[..., :1]
    sums = np.zeros((*frames.shape[:-1], frames.shape[-1] + 1))
    np.cumsum(frames - first, axis=-1, out=sums[..., 1:])
    averages = first + (sums[..., runs:] - sums[..., :-runs]) / runs
    return np.moveaxis(averages, -1, axis)


def block_average(series: ArrayLike, count: int, axis: int = -1) -> FloatArray:
    """Return the averages over disjoint blocks of `count` consecutive frames.

    Parameters
    ----------
    series : array_like
        Values frame by frame, along `axis`.
    count : int
        How many frames make one block.
    axis : int
        The axis of the frames.

    Returns
    -------
    ndarray
        As the series, with frames // count averages along `axis`; frames left over at the
        end are not used.

    Raises
    ------
    TypeError, ValueError
        As for `moving_average`.

    Examples
    --------
    >>> block_average([1, 2, 6, 10, 99], 2)
    array([1.5, 8. ])
    """
    frames, size = _frames_last(series, count, axis)
    blocks = frames.shape[-1] // size
    kept = frames[..., : blocks * size].reshape(*frames.shape[:-1], blocks, size)
    return np.moveaxis(kept.mean(axis=-1), -1, axis)


def scatter_of_averages(
    series: ArrayLike, counts: Sequence[int], axis: int = -1, kind: str = "moving"
) -> FloatArray:
    """Return the standard deviation of averages over n frames of the same series, for each n.

    The values for different n come from the same frames, so they are strongly correlated;
    for n close to the number of frames few averages are independent and the value itself is
    uncertain. Pass many replicates to see both.

    Parameters
    ----------
    series : array_like
        Values frame by frame, along `axis`.
    counts : sequence of int
        The numbers n of frames in an average; each must leave two averages at least.
    axis : int
        The axis of the frames.
    kind : {"moving", "block"}
        Whether runs overlap or are disjoint.

    Returns
    -------
    ndarray
        As the series, with one 1 sigma standard deviation (n - 1 in the denominator) for
        each count along `axis`.

    Raises
    ------
    TypeError, ValueError
        As for `moving_average`; also if no count is given, a count leaves a single average,
        or the kind is unknown.

    Examples
    --------
    >>> scatter_of_averages([0, 2, 0, 2, 0, 2, 0, 2, 0, 2], [2])
    array([0.])
    """
    averages_of = {"moving": moving_average, "block": block_average}
    if kind not in averages_of:
        raise ValueError(f"kind: expected one of {sorted(averages_of)}, got {kind!r}; choose one")
    if len(counts) == 0:
        raise ValueError("counts: expected one number of frames or more, got none; pass [1]")
    scatters = []
    for count in counts:
        averages = averages_of[kind](series, count, axis)
        if averages.shape[axis] < 2:
            raise ValueError(
                f"counts: expected two averages or more for each count, got one for {count} "
                "frames; average fewer frames or pass a longer series"
            )
        scatters.append(averages.std(axis=axis, ddof=1))
    return np.stack(scatters, axis=axis)


def averaged_error(count: ArrayLike, single: ArrayLike, floor: ArrayLike = 0.0) -> FloatArray:
    """Return the error of an average in the model E^2 = a^2 / n + b^2.

    Parameters
    ----------
    count : array_like
        n, how many independent frames are averaged; above zero.
    single : array_like
        a, the error of a single frame that averaging reduces.
    floor : array_like
        b, the error that averaging does not reduce, in the unit of `single`.

    Returns
    -------
    ndarray
        E, in the unit of `single`.

    Raises
    ------
    ValueError
        If a value is not finite, the count is not above zero, or an error is negative.

    Examples
    --------
    >>> float(averaged_error(4, single=6.0, floor=4.0))
    5.0
    """
    number = positive("count", count)
    noise, base = non_negative("single", single), non_negative("floor", floor)
    common_batch(count=number.shape, single=noise.shape, floor=base.shape)
    return np.asarray(np.hypot(noise / np.sqrt(number), base))


def attitude_accuracy(
    centroid_sigma: ArrayLike, count: ArrayLike, pixel_angle: ArrayLike
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

    Raises
    ------
    ValueError
        If a value is not finite, delta is negative, or N or the angle is not above zero.

    Examples
    --------
    >>> float(attitude_accuracy(0.5, count=4, pixel_angle=8.0))
    2.0
    """
    delta = non_negative("centroid_sigma", centroid_sigma)
    number, angle = positive("count", count), positive("pixel_angle", pixel_angle)
    common_batch(centroid_sigma=delta.shape, count=number.shape, pixel_angle=angle.shape)
    return np.asarray(delta / np.sqrt(number) * angle)


def _frames_last(series: ArrayLike, count: int, axis: int) -> tuple[FloatArray, int]:
    """Return the series with its frames along the last axis, and the checked count."""
    array = finite_array("series", series, shape=(None,))
    if not -array.ndim <= axis < array.ndim:
        raise ValueError(
            f"axis: expected an axis of the series, from {-array.ndim} to {array.ndim - 1}, "
            f"got {axis}; name the axis along which the frames follow each other"
        )
    size = whole_number("count", count)
    if size > array.shape[axis]:
        raise ValueError(
            f"count: expected at most {array.shape[axis]}, the number of frames, got {size}; "
            "average fewer frames or pass a longer series"
        )
    return np.moveaxis(array, axis, -1), size
