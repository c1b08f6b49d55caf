"""Tests of averages over frames against NumPy's convolution, loops and white noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from reproduce.physics.attitude import (
    Stability,
    allan_deviation,
    moving_average,
    scatter_of_averages,
    stability,
)


@given(count=st.integers(1, 50), seed=st.integers(0, 1000), offset=st.floats(-1e6, 1e6))
@settings(max_examples=50)
def test_moving_average_is_a_convolution(count, seed, offset):
    series = offset + default_rng(seed).standard_normal((3, 50))
    window = np.ones(count) / count
    expected = [np.convolve(one, window, mode="valid") for one in series]
    found = moving_average(series, count)
    assert_allclose(found, expected, rtol=1e-13, atol=1e-12)


def test_a_drift_is_found_within_its_error():
    """Also for correlated noise; Student's t-distribution with eight degrees of freedom."""
    generator, times = default_rng(7), np.arange(400) * 2.0
    for memory in (0.0, 0.8):
        white = generator.standard_normal((400, 600))
        noise = lfilter([1.0], [1.0, -memory], white, axis=0)
        found = stability(times, noise + 0.05 * times[:, None])
        inside = np.abs((found.rate - 0.05) / found.rate_error) < 2.306
        # Four standard errors of 600 to both sides, one per cent more for the memory.
        error = 4 * np.sqrt(0.05 * 0.95 / 600) + 0.01
        assert inside.mean() == pytest.approx(0.95, abs=error)


@pytest.mark.parametrize("averages", [5, 25])
def test_the_floor_of_white_noise_has_an_honest_interval(averages):
    count, nothing = 16, np.zeros(2000)
    series = default_rng(8).standard_normal((2000, 16 * averages))
    found = Stability(
        nothing,
        nothing,
        np.array([count]),
        np.array([averages]),
        allan_deviation(series, [count]).T,
    )
    low, high = found.floor_interval(0.95)
    inside = (low < 0.25) & (high > 0.25)
    assert inside.mean() == pytest.approx(0.95, abs=0.02)


def test_averages_stop_where_noise_has_a_floor():
    white, steps = default_rng(9).standard_normal((2, 4096, 1))
    walk = white + 0.05 * np.cumsum(steps, axis=0)
    found, alone = (stability(np.arange(4096.0), one) for one in (walk, white))
    # White noise of one and a walk of 1/20 a step: best at root 3 times 20 frames, or next to it.
    assert 16 <= found.reached[0] <= 64
    assert found.floor[0] > 3 * found.white[-1, 0]
    assert alone.reached[0] >= 256


def test_no_average_bridges_a_gap():
    """Each part gives the result of a separate series; one frame between them is lost."""
    kept = np.r_[0:90, 91:200, 260:300]
    series = np.cumsum(default_rng(10).standard_normal((300, 2)), axis=0)
    found = stability(1.0 * kept, series[kept])
    assert len(found.counts) > 3
    left = series[kept] - kept[:, None] * found.rate
    pieces = np.split(left, np.flatnonzero(np.diff(kept) > 1) + 1)
    for place, count in enumerate(found.counts):
        squares, start = [], 0
        for piece in pieces:
            whole = piece[-start % count :]
            whole = whole[: len(whole) // count * count].reshape(-1, count, 2)
            squares.extend(np.square(np.diff(whole.mean(axis=1), axis=0)))
            start += len(piece) + 1
        assert found.averages[place] == len(squares) + 1
        root = np.sqrt(np.mean(squares, axis=0) / 2)
        assert_allclose(found.deviations[place], root, rtol=1e-9)


@pytest.mark.parametrize(
    ("function", "arguments", "name"),
    [
        (moving_average, (np.zeros(5), 6), "count"),
        (scatter_of_averages, (np.zeros(5), [5]), "counts"),
        (allan_deviation, (np.zeros(15), [8]), "counts"),
        (stability, (np.arange(15.0), np.zeros((15, 1))), "series"),
        (stability, (np.r_[np.arange(20.0), 19.4], np.zeros((21, 1))), "times"),
    ],
)
def test_bad_series_are_errors(function, arguments, name):
    with pytest.raises(ValueError, match=f"^{name}:"):
        function(*arguments)
