"""Averages over frames against NumPy's convolution, loops and the law of white noise."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from reproduce.physics.attitude import (
    Stability,
    allan_deviation,
    attitude_accuracy,
    averaged_error,
    moving_average,
    scatter_of_averages,
    stability,
)


@given(count=st.integers(1, 50), seed=st.integers(0, 1000), offset=st.floats(-1e6, 1e6))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_moving_average_is_a_convolution(count, seed, offset):
    series = offset + np.random.default_rng(seed).standard_normal(50)
    expected = np.convolve(series, np.ones(count) / count, mode="valid")
    np.testing.assert_allclose(
        moving_average(series, count), expected, rtol=1e-13, atol=1e-12
    )


def test_a_large_common_value_costs_no_digits():
    series = np.random.default_rng(1).standard_normal(800)
    shifted = moving_average(series + 2.0**20, 100) - 2.0**20
    np.testing.assert_allclose(shifted, moving_average(series, 100), atol=3e-10)


@pytest.mark.parametrize("axis", [0, 1, 2, -1, -2])
def test_any_axis_is_a_loop_over_the_others(axis):
    series = np.random.default_rng(2).standard_normal((6, 9, 7))
    together = moving_average(series, 3, axis)
    lanes = np.moveaxis(series, axis, -1).reshape(-1, series.shape[axis])
    alone = np.array([moving_average(lane, 3) for lane in lanes])
    np.testing.assert_allclose(
        np.moveaxis(together, axis, -1).reshape(alone.shape), alone, atol=1e-15
    )


def test_one_frame_changes_nothing_and_all_frames_give_the_mean():
    series = np.random.default_rng(3).standard_normal((4, 20))
    np.testing.assert_allclose(moving_average(series, 1), series, atol=1e-15)
    np.testing.assert_allclose(
        moving_average(series, 20)[:, 0], series.mean(axis=1), atol=1e-15
    )


def test_scatter_is_the_standard_deviation_of_the_averages():
    series = np.random.default_rng(4).standard_normal((5, 60, 3))
    found = scatter_of_averages(series, [1, 4, 25], axis=1)
    assert found.shape == (5, 3, 3)
    for index, count in enumerate([1, 4, 25]):
        expected = np.std(moving_average(series, count, 1), axis=1, ddof=1)
        np.testing.assert_allclose(found[:, index, :], expected, rtol=1e-12)


def test_white_noise_falls_with_the_root_of_the_count():
    series = np.random.default_rng(5).standard_normal((2000, 800))
    counts = [1, 4, 16, 49]
    mean_square = (scatter_of_averages(series, counts) ** 2).mean(axis=0)
    # The sample variance of overlapping averages, which are correlated over n frames, lacks the
    # variance of their own mean.
    expected = [variance_of_moving_averages(800, count) for count in counts]
    np.testing.assert_allclose(mean_square, expected, rtol=0.03)


def variance_of_moving_averages(frames, count):
    """Expected sample variance of moving averages of unit white noise, from its kernel."""
    runs = frames - count + 1
    kernel = np.zeros((runs, frames))
    for start in range(runs):
        kernel[start, start : start + count] = 1 / count
    covariance = kernel @ kernel.T
    return (np.trace(covariance) - covariance.sum() / runs) / (runs - 1)


def test_scatter_over_many_frames_is_itself_uncertain():
    series = np.random.default_rng(6).standard_normal((1000, 800))
    scatter = scatter_of_averages(series, [1, 100])
    spread = scatter.std(axis=0) / scatter.mean(axis=0)
    assert spread[0] == pytest.approx(1 / np.sqrt(2 * 799), rel=0.1)
    assert 0.2 < spread[1] < 0.35


def test_the_floor_is_what_averaging_leaves():
    assert averaged_error(4, 6.0, 4.0) == pytest.approx(5.0)
    np.testing.assert_allclose(averaged_error([1, 100], 3.0), [3.0, 0.3])
    assert averaged_error(1e30, 1.0, 0.25) == pytest.approx(0.25)


def test_accuracy_has_the_dimension_of_the_pixel_angle():
    np.testing.assert_allclose(
        attitude_accuracy([0.1, 0.2], [1, 4], 5e-4), [5e-5, 5e-5]
    )
    assert attitude_accuracy(0.0, 4, 1.0) == 0


def test_what_cannot_be_averaged_is_refused():
    with pytest.raises(
        ValueError, match="count: expected at most 5, the number of frames, got 6"
    ):
        moving_average(np.zeros(5), 6)
    with pytest.raises(TypeError, match="count: expected a whole number"):
        moving_average(np.zeros(5), 2.0)
    for counts in ([5], []):
        with pytest.raises(
            ValueError, match="counts: expected one number or more, each below"
        ):
            scatter_of_averages(np.zeros(5), counts)


@pytest.mark.parametrize("count", [1, 3, 10])
def test_allan_deviation_is_a_loop(count):
    series = 1e3 + np.random.default_rng(3).standard_normal((47, 2))
    means = [
        series[i : i + count].mean(axis=0) for i in range(0, 47 - count + 1, count)
    ]
    squares = [np.square(b - a) / 2 for a, b in pairwise(means)]
    found = allan_deviation(series, [count], axis=0)[0]
    np.testing.assert_allclose(found, np.sqrt(np.mean(squares, axis=0)), rtol=1e-10)


def test_a_drift_is_found_within_its_error():
    """Also where the noise of neighbours is alike; by Student's law with eight degrees."""
    generator, times = np.random.default_rng(7), np.arange(400) * 2.0
    for memory in (0.0, 0.8):
        noise = lfilter(
            [1.0], [1.0, -memory], generator.standard_normal((400, 600)), axis=0
        )
        found = stability(times, noise + 0.05 * times[:, None])
        pulls = (found.rate - 0.05) / found.rate_error
        # Of 600: 95 %, four standard errors to both sides, one per cent more for the memory.
        inside = np.abs(pulls) < 2.306
        assert inside.mean() == pytest.approx(
            0.95, abs=4 * np.sqrt(0.05 * 0.95 / 600) + 0.01
        )


def test_the_floor_of_white_noise_has_an_honest_interval():
    generator, count = np.random.default_rng(8), 16
    series = generator.standard_normal((400, 2000))
    deviations = allan_deviation(series, [count], axis=0)
    nothing = np.zeros(2000)
    found = Stability(
        nothing, nothing, series, np.array([count]), np.array([25]), deviations
    )
    low, high = found.floor_interval(0.95)
    inside = (low < 0.25) & (high > 0.25)
    assert inside.mean() == pytest.approx(0.95, abs=0.02)


def test_averages_stop_where_noise_has_a_floor():
    generator = np.random.default_rng(9)
    walk = 0.05 * np.cumsum(generator.standard_normal((4096, 1)), axis=0)
    white = generator.standard_normal((4096, 1))
    found, alone = (stability(np.arange(4096.0), one) for one in (white + walk, white))
    # White noise of one and a walk of 1/20 a step: best at root 3 times 20 frames, or next to it.
    assert 16 <= found.reached[0] <= 64
    assert found.floor[0] > 3 * found.white[-1, 0]
    assert alone.reached[0] >= 256


def test_no_average_bridges_a_gap():
    """As if each piece were alone, with one lost frame between them."""
    series = np.cumsum(np.random.default_rng(10).standard_normal((300, 2)), axis=0)
    kept = np.r_[0:90, 91:200, 260:300]
    found = stability(1.0 * kept, series[kept])
    assert len(found.counts) > 3
    for at, count in enumerate(found.counts):
        squares, start = [], 0
        for piece in np.split(found.left, [90, 199]):
            starts = range(-start % count, len(piece) - count + 1, count)
            means = np.array([piece[one : one + count].mean(axis=0) for one in starts])
            squares.append(np.square(np.diff(means, axis=0)).reshape(-1, 2))
            start += len(piece) + 1
        expected = np.concatenate(squares)
        assert found.averages[at] == len(expected) + 1
        root = np.sqrt(expected.mean(axis=0) / 2)
        np.testing.assert_allclose(found.deviations[at], root, rtol=1e-9)


def test_without_a_gap_all_averages_count():
    found = stability(
        np.arange(300.0), np.random.default_rng(11).standard_normal((300, 2))
    )
    expected = allan_deviation(found.left, found.counts.tolist(), axis=0)
    np.testing.assert_allclose(found.deviations, expected, rtol=1e-9)
    assert found.averages.tolist() == (300 // found.counts).tolist()


@pytest.mark.parametrize(
    ("times", "count", "message"),
    [
        (np.arange(15.0), 15, "16 frames or more, got 15"),
        (np.zeros(20), 20, "later than the one"),
        (np.r_[np.arange(20.0), 19.3], 21, "got one after 0.3 of the usual time"),
    ],
)
def test_series_that_tell_nothing_are_refused(times, count, message):
    with pytest.raises(ValueError, match=message):
        stability(times, np.zeros((count, 1)))
    with pytest.raises(ValueError, match="at most 7, half of the frames"):
        allan_deviation(np.zeros(15), [8])
