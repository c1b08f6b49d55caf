"""Two modes of a posterior are found, and one mode is not split."""

import numpy as np
import pandas as pd
import pytest

import reproduce as rp
from reproduce.inference.modes import MAX_DIP, dip, two_modes
from reproduce.store.points import STARS

COUNT, SAMPLES = 1000, 400
ONE_MODE = ("uniform", "normal", "exponential", "standard_cauchy", "lognormal")


def split(generator, count, fraction):
    """Draws of the noise of a mixture: a narrow mode and a wide one."""
    low = generator.uniform(size=count) < fraction
    wide = generator.normal(0.60, 0.1, count)
    return np.where(low, generator.normal(0.24, 0.03, count), wide)


def test_draws_with_one_mode_are_not_split():
    """The uniform has the largest dips: 0.1 % of its samples exceed the limit."""
    for name in ONE_MODE:
        draw = getattr(np.random.default_rng(1), name)
        dips = np.array([dip(draw(size=COUNT)) for _ in range(SAMPLES)])
        alarms = (dips * np.sqrt(COUNT) > MAX_DIP).sum()
        assert alarms <= (3 if name == "uniform" else 0), name


def test_both_modes_and_their_fractions_are_found():
    for fraction in (0.05, 0.16, 0.5):
        found = two_modes(split(np.random.default_rng(2), 10_000, fraction))
        assert (found.low, found.high) == pytest.approx((0.24, 0.60), abs=0.03)
        assert found.below == pytest.approx(fraction, abs=0.02)
        assert found.below + found.above == pytest.approx(1)


def test_dip_of_known_distributions():
    """Half the smaller one of two point-like modes; repeated draws change nothing."""
    generator = np.random.default_rng(3)
    low, high = generator.normal(0, 1e-3, 300), generator.normal(1, 1e-3, 700)
    assert dip(np.concatenate([low, high])) == pytest.approx(0.15, abs=0.01)
    draws = split(generator, 4000, 0.16)
    assert dip(np.repeat(draws, 3)) == pytest.approx(dip(draws), rel=0.01)
    assert two_modes(np.ones(100)) is None


def test_a_mixture_with_two_modes_reports_both():
    """Of 40 stars 8 are exchanged and 4 lie some noises off: the noise is small or large."""
    generator = np.random.default_rng(3)
    source = generator.uniform(0, 2000, (40, 2))
    target = 1.0004 * source + [3, -2] + 0.2 * generator.normal(size=source.shape)
    target[:8] = target[np.roll(np.arange(8), 1)]
    target[8:12] += generator.normal(0, 2.0, (4, 2))
    frame = pd.DataFrame(np.hstack([source, target]), columns=list(STARS))
    found = rp.posterior("registration-mixture", frame)
    modes = found.modes["noise"]
    # The true noise is 0.2 px. The other mode includes the stars near their places.
    assert 0.15 < modes.low < 0.3
    assert modes.high > 1.5 * modes.low
    halfway = (modes.low + modes.high) / 2
    below = (found.draws["noise (px)"] < halfway).mean()
    assert modes.below == pytest.approx(below, abs=0.05)
    assert 0.05 < modes.below < 0.95
    fit = rp.register(frame, robust=True).fit
    assert (fit.weights == 0).sum() > (found.stars()["probability_false"] > 0.5).sum()
    text = " ".join(repr(found).split())
    assert "Warning: noise has two modes: " in text
    assert "a robust fit drops " in text
    assert found.record()["modes"]["noise"] == modes._asdict()
