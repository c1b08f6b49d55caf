"""Averages over frames against NumPy's convolution, loops and the law of white noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reproduce.physics.attitude import (
    attitude_accuracy,
    averaged_error,
    moving_average,
    scatter_of_averages,
)


@given(count=st.integers(1, 50), seed=st.integers(0, 1000), offset=st.floats(-1e6, 1e6))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_moving_average_is_a_convolution(count, seed, offset):
    series = offset + np.random.default_rng(seed).standard_normal(50)
    expected = np.convolve(series, np.ones(count) / count, mode="valid")
    np.testing.assert_allclose(moving_average(series, count), expected, rtol=1e-13, atol=1e-12)


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
    np.testing.assert_allclose(moving_average(series, 20)[:, 0], series.mean(axis=1), atol=1e-15)


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
    np.testing.assert_allclose(attitude_accuracy([0.1, 0.2], [1, 4], 5e-4), [5e-5, 5e-5])
    assert attitude_accuracy(0.0, 4, 1.0) == 0


def test_what_cannot_be_averaged_is_refused():
    with pytest.raises(ValueError, match="count: expected at most 5, the number of frames, got 6"):
        moving_average(np.zeros(5), 6)
    with pytest.raises(TypeError, match="count: expected a whole number"):
        moving_average(np.zeros(5), 2.0)
    for counts in ([5], []):
        with pytest.raises(ValueError, match="counts: expected one number or more, each below"):
            scatter_of_averages(np.zeros(5), counts)
