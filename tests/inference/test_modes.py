"""Two modes of a posterior are found, and one mode is not split."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from reproduce.inference.models import mixture_model, registration_model
from reproduce.inference.modes import two_modes
from reproduce.inference.posterior import bimodal
from reproduce.views.posterior import Posterior, book_posterior

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
        draw = getattr(np.random.default_rng(1), name)
        alarms = sum(two_modes(draw(size=COUNT)) is not None for _ in range(SAMPLES))
        assert alarms <= 1, name


def test_both_modes_and_their_fractions_are_found():
    for fraction in (0.05, 0.16, 0.5):
        found = two_modes(split(np.random.default_rng(2), 10_000, fraction))
        assert (found.low, found.high) == pytest.approx((0.24, 0.60), abs=0.03)
        assert found.below == pytest.approx(fraction, abs=0.02)
        assert found.below + found.above == pytest.approx(1)


def test_close_or_rare_modes_are_not_reported():
    """Two equal Gaussians have a valley from two standard deviations of distance."""
    generator = np.random.default_rng(3)
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
    values = split(np.random.default_rng(2), found.chain[..., 5].size, 0.16)
    parameter, chain = found.model.parameters[5], found.chain.copy()
    chain[..., 5] = values.reshape(chain.shape[:-1]) / parameter.shown
    modes = bimodal(replace(found, chain=chain))
    assert list(modes) == [parameter.name]
    assert modes[parameter.name].low == pytest.approx(0.24, abs=0.03)
    assert modes[parameter.name].below == pytest.approx(0.16, abs=0.02)


def test_stars_that_only_a_robust_fit_drops_give_a_warning():
    """Of 40 stars 8 are exchanged and 4 lie some noises off."""
    generator = np.random.default_rng(3)
    source = generator.uniform(0, 2000, (40, 2))
    target = 1.0004 * source + [3, -2] + 0.2 * generator.normal(size=source.shape)
    target[:8] = target[np.roll(np.arange(8), 1)]
    target[8:12] += generator.normal(0, 2.0, (4, 2))
    model = mixture_model(registration_model(source, target, (1000, 1000)))
    for false, warned in ((8, True), (11, False)):
        stars = pd.DataFrame({"probability_false": (np.arange(40) < false) * 1.0})
        shown = SimpleNamespace(model=model, _stars=stars)
        assert ("drops" in Posterior._dropped.fget(shown)) == warned
