"""Two modes of a posterior are found, and one mode is not split."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

from reproduce.inference._modes import two_modes
from reproduce.views.posterior import book_posterior

COUNT, SAMPLES = 1000, 50
ONE_MODE = ("uniform", "normal", "exponential", "standard_cauchy", "lognormal")


def split(generator, count, fraction):
    """Draws of the noise of a mixture: a narrow mode and a wide one."""
    low = generator.uniform(size=count) < fraction
    wide = generator.normal(0.60, 0.1, count)
    return np.where(low, generator.normal(0.24, 0.03, count), wide)


def test_draws_with_one_mode_are_not_split():
    """The tail of a log-normal has bumps, of which few contain 3 % of the draws."""
    for name in ONE_MODE:
        draw = getattr(default_rng(1), name)
        alarms = sum(two_modes(draw(size=COUNT)) is not None for _ in range(SAMPLES))
        assert alarms <= 1, name


def test_both_modes_and_their_fractions_are_found():
    for fraction in (0.05, 0.16, 0.5):
        found = two_modes(split(default_rng(2), 10_000, fraction))
        assert (found.low, found.high) == pytest.approx((0.24, 0.60), abs=0.03)
        assert found.below == pytest.approx(fraction, abs=0.02)
        assert found.below + found.above == pytest.approx(1)


def test_close_or_rare_modes_are_not_reported():
    """Two equal Gaussians have a valley from two standard deviations of distance."""
    generator = default_rng(3)
    normal = generator.normal(size=10_000)
    for distance, found in ((2, False), (4, True)):
        values = np.concatenate([normal, distance + generator.normal(size=10_000)])
        assert (two_modes(values) is not None) == found
    assert two_modes(split(generator, 10_000, 0.01)) is None
    draws = split(generator, 4000, 0.16)
    again = two_modes(np.repeat(draws, 3))
    assert again.below == pytest.approx(two_modes(draws).below, abs=0.01)
    assert two_modes(np.ones(100)) is None


def test_a_parameter_with_two_modes_is_named_with_both_in_the_displayed_unit():
    found = book_posterior("misalignment")
    values = split(default_rng(2), found.chain[..., 5].size, 0.16)
    parameter, chain = found.model.parameters[5], found.chain.copy()
    chain[..., 5] = values.reshape(chain.shape[:-1]) / parameter.shown
    modes = replace(found, chain=chain).modes
    assert list(modes) == [parameter.name]
    assert modes[parameter.name].low == pytest.approx(0.24, abs=0.03)
    assert modes[parameter.name].below == pytest.approx(0.16, abs=0.02)
    assert found.modes == {}
