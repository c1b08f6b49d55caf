"""Thermal series and their corrections, where the answer is known beforehand."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from reproduce.physics.ground import (
    last_orbits,
    orbital_period,
    thermal,
    thermal_series,
    trend_and_fourier,
)

QUIET = {"_SEASON": 0.0, "_WANDER": 0.0, "_TREND": 0.0, "_JUMPS": 0.0}


@pytest.fixture
def series(monkeypatch):
    """A series in which nothing but the harmonics and what is named moves."""

    def drawn(orbits=40, **changes):
        for name, value in (QUIET | changes).items():
            monkeypatch.setattr(thermal, name, value)
        return thermal_series(5676.0, 32, orbits, default_rng(1))

    return drawn


def test_the_period_of_the_space_station():
    assert float(orbital_period(400e3)) / 60 == pytest.approx(92.4, abs=0.3)


def test_a_quiet_series_has_its_amplitude_and_repeats(series):
    times, angles = series(_HARMONICS=(1.0,))
    assert angles.max() == pytest.approx(1.0, rel=0.01)
    # One orbit later the same, but for the slow turn of the phase with the season.
    assert_allclose(angles[32:], angles[:-32], atol=0.001)
    assert times[32] == pytest.approx(5676.0 / 86400)


@pytest.mark.parametrize(
    ("change", "value"),
    [("_WANDER", 0.2), ("_TREND", 50.0), ("_SEASON", 0.3), ("_JUMPS", 900.0)],
)
def test_every_part_is_there(series, change, value):
    quiet, loud = series(orbits=400)[1], series(orbits=400, **{change: value})[1]
    # Only about X: the numbers drawn there shift the random numbers that follow.
    assert np.abs(loud - quiet)[:, 0].max() > 0.01


def test_the_wander_has_its_size_and_its_memory(series):
    times, loud = series(orbits=4000, _WANDER=0.5)
    quiet = series(orbits=4000)[1]
    wander = (loud - quiet)[:, 0]
    assert wander.std() == pytest.approx(0.5, rel=0.15)
    lag = round(0.2 / (times[1] - times[0]))
    assert np.corrcoef(wander[lag:], wander[:-lag])[0, 1] == pytest.approx(
        np.exp(-1), abs=0.1
    )


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


def test_last_orbits_follow_a_straight_change_of_the_coefficients():
    phase = np.arange(20 * 16) / 16
    growing = (1 + 0.1 * np.floor(phase)) * np.cos(2 * np.pi * phase)
    true = np.stack([growing, -growing], axis=-1)
    found = last_orbits(true, 16)
    assert np.isnan(found[:48]).all()
    assert_allclose(found[48:], true[48:], atol=1e-12)


def test_nonsense_is_refused():
    with pytest.raises(ValueError, match="altitude"):
        orbital_period(-5.0)
    with pytest.raises(ValueError, match="reshape"):
        last_orbits(np.zeros((70, 2)), 16)
    with pytest.raises(ValueError, match="known"):
        trend_and_fourier(np.arange(9.0), np.arange(9.0), np.zeros((9, 2)), 3)
