"""A fit of the thermal misalignment, by known answers."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from reproduce.physics.ground import trend_and_fourier


def test_trend_and_fourier_foretells_what_it_can_express():
    times = np.arange(3000) * 0.002
    phase = times / 0.065
    angle = 2 * np.pi * phase
    true = np.stack(
        [3e-6 * times + 1e-5 * np.cos(angle), 5e-6 * np.sin(2 * angle)], axis=-1
    )
    assert_allclose(trend_and_fourier(times, phase, true, 1000), true, atol=1e-15)
    third = true + np.stack([1e-6 * np.cos(3 * angle)] * 2, axis=-1)
    missed = trend_and_fourier(times, phase, third, 1000) - third
    assert np.abs(missed).max() > 0.9e-6, "a third harmonic is beyond the second degree"


def test_nonsense_is_refused():
    with pytest.raises(ValueError, match="known"):
        trend_and_fourier(np.arange(9.0), np.arange(9.0), np.zeros((9, 2)), 3)
