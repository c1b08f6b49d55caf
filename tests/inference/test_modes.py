"""Two modes of a posterior are found, and one mode is not taken for two."""

import numpy as np
import pandas as pd
import pytest

import reproduce as rp
from reproduce.inference.modes import LARGEST_DIP, dip, two_modes
from reproduce.store.points import STARS

COUNT, SAMPLES = 1000, 400


def split(generator, count, share):
    """Draws of the noise of a mixture: a narrow mode and a wide one."""
    low = generator.uniform(size=count) < share
    wide = generator.normal(0.60, 0.1, count)
    return np.where(low, generator.normal(0.24, 0.03, count), wide)


@pytest.mark.parametrize(
    "law",
    ["uniform", "normal", "exponential", "standard_cauchy", "lognormal", "pareto"],
)
def test_draws_with_one_mode_are_not_split(law):
    """The uniform is the least favourable: 0.1 % of its samples exceed the limit."""
    generator = np.random.default_rng(1)
    draw = getattr(generator, law)
    draws = (
        draw(2.0, COUNT) if law == "pareto" else draw(size=COUNT)
        for _ in range(SAMPLES)
    )
    alarms = sum(dip(one) * np.sqrt(COUNT) > LARGEST_DIP for one in draws)
    assert alarms <= (3 if law == "uniform" else 0)


@pytest.mark.parametrize("share", [0.05, 0.16, 0.5])
def test_both_modes_and_their_fractions_are_found(share):
    found = two_modes(split(np.random.default_rng(2), 10_000, share))
    assert (found.low, found.high) == pytest.approx((0.24, 0.60), abs=0.03)
    assert found.below == pytest.approx(share, abs=0.02)
    assert found.below + found.above == pytest.approx(1)


def test_dip_is_half_the_smaller_mode_of_two_that_are_far_apart():
    """Of two point-like modes no distribution with one mode comes nearer."""
    generator = np.random.default_rng(3)
    low, high = generator.normal(0, 1e-3, 300), generator.normal(1, 1e-3, 700)
    assert dip(np.concatenate([low, high])) == pytest.approx(0.15, abs=0.01)


def test_repeated_draws_count():
    """A walker that stays repeats its place."""
    draws = split(np.random.default_rng(4), 4000, 0.16)
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
    noise = found.draws[next(name for name in found.draws if name.startswith("noise"))]
    halfway = (modes.low + modes.high) / 2
    assert modes.below == pytest.approx((noise < halfway).mean(), abs=0.05)
    assert 0.05 < modes.below < 0.95
    dropped = int((rp.register(frame, robust=True).fit.weights == 0).sum())
    false = int((found.stars()["probability_false"] > 0.5).sum())
    told = " ".join(repr(found).split())
    fractions = f"{100 * modes.below:.0f} % of the draws near {modes.low:.3g},"
    assert f"Warning: noise has two modes: {fractions}" in told
    assert dropped > false
    assert f"a robust fit drops {dropped} stars, the mixture {false}" in told
    assert found.record()["modes"]["noise"] == modes._asdict()
