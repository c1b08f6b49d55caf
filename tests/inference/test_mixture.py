"""Wrong matches: densities, the start, and the probability of each star."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy import stats
from simulated import PIVOT, registered, star_table, stars

import reproduce as rp
from reproduce.inference.models import MixtureRegistration
from reproduce.inference.sampling import Plan, sample
from reproduce.views.posterior import Posterior

PLAN = Plan(5, ensembles=2, steps=400, warmup=150, walkers=96)


def mixture(**settings):
    return registered(*stars(**settings), MixtureRegistration.of)


@pytest.mark.parametrize("wrong", [0, 18])
def test_three_wrong_matches_in_ten_are_named_and_move_nothing(wrong):
    """The draws are the closed form of the right stars, and a beta of their number."""
    found, (source, target) = sample(mixture(wrong=wrong), PLAN), stars(wrong=wrong)
    false = found.model.likelihood.probability_false(found.draws)
    assert (false[:wrong] > 0.9).all()
    assert (false[wrong:] < 0.1).all()
    right = registered(source[wrong:], target[wrong:])
    exact = right.exact(40_000, default_rng(1))[:, :4]
    draws, spread = found.draws[:, :4], exact.std(axis=0)
    offsets = (draws.mean(axis=0) - exact.mean(axis=0)) / spread
    assert_allclose(offsets, 0, atol=0.05)
    assert_allclose(draws.std(axis=0) / spread, 1, atol=0.05)
    fraction = stats.beta(wrong + 1, 60 - wrong + 1)  # half of all is far out
    for mean in (found.draws[:, 5].mean(), found.rows[5].mean):
        assert abs(mean - fraction.mean()) < 0.05 * fraction.std()
    assert found.draws[:, 5].std() == pytest.approx(fraction.std(), rel=0.05)


def test_a_density_is_the_sum_of_both_cases():
    model = mixture(wrong=6, count=20)
    likelihood = model.likelihood
    rows = model.start(default_rng(1), 12)
    left = (likelihood.target - likelihood.places(rows, likelihood.source)) @ [1, 1j]
    noise, fraction = rows[:, 4:5], rows[:, 5:]
    right = (1 - fraction) * stats.norm.pdf(left.real, scale=noise)
    right = right * stats.norm.pdf(left.imag, scale=noise)
    both = right + fraction / likelihood.side**2
    assert_allclose(likelihood(rows), np.log(both).sum(axis=1), rtol=1e-10)
    assert_allclose(likelihood.false(rows), 1 - right / both, atol=1e-10)
    # Outside of the square there are no wrong matches.
    far = likelihood.with_target(likelihood.target + 3 * likelihood.side)
    assert (far.false(rows) == 0).all()


@pytest.mark.parametrize("wrong", [0, 18, 27])
def test_the_start_takes_the_right_stars(wrong):
    """Though almost half of all are wrong, in a hundred fields."""
    for seed in range(100):
        model = mixture(wrong=wrong, seed=seed)
        agreeing = model.likelihood.agreeing
        assert not agreeing[:wrong].any()
        assert agreeing[wrong:].sum() >= 59 - wrong
        start = model.start(default_rng(seed), 4)
        assert np.isfinite(model.log_posterior(start)).all()
        # With nearly no noise every star is wrongly matched, the outermost ones too.
        start[:, 4] = 1e-9
        assert (model.likelihood.false(start) > 0.5).all()


def test_wrong_matches_are_drawn_with_the_fraction_and_positions_of_the_model():
    likelihood = mixture(wrong=18).likelihood
    point, right = likelihood.start()[0], stars()[1]
    point[5] = 0.3
    generator = default_rng(2)
    drawn = np.stack([likelihood.simulate(point, generator).target for _ in range(400)])
    false = np.abs(drawn - right).max(axis=-1) > 2.0
    assert abs(false.mean() - 0.3) < 4 * np.sqrt(0.21 / false.size)
    places = (drawn[false] - likelihood.corner) / likelihood.side
    assert stats.kstest(places.ravel(), "uniform").pvalue > 0.001
    # In a repeat the same stars are wrongly matched.
    again = np.stack([likelihood.repeat(point, generator).target for _ in range(100)])
    false = np.abs(again - right).max(axis=-1) > 2.0
    assert false[:, :18].mean() > 0.99
    assert not false[:, 18:].any()


def test_the_mixture_has_the_noise_model_of_the_registration():
    """Stars with errors: the right density is the normal one of each star, by SciPy."""
    _, target = stars(wrong=12)
    sigma = np.where(np.arange(60) % 2, 0.05, 0.2)
    frame = star_table(wrong=12).assign(sigma=sigma)
    found = rp.posterior("registration-mixture", frame, pivot=tuple(PIVOT))
    likelihood = found.model.likelihood
    assert found.model.names[-2:] == ("shift-y", "false-share")
    point = likelihood.start()[0]
    left = target - likelihood.places(point[None], likelihood.source)[0]
    right = stats.norm.pdf(left, scale=sigma[:, None]).prod(axis=1) * (1 - point[-1])
    expected = np.log(right + point[-1] / likelihood.side**2)
    assert_allclose(likelihood.pointwise(point[None])[0], expected, rtol=1e-8)


def test_stars_that_only_a_robust_fit_drops_give_a_warning():
    """Of 40 stars 8 are matched wrongly and 4 lie some noises off."""
    source, target = stars(40, 0.2, wrong=8)
    target[8:12] += default_rng(3).normal(0, 2.0, (4, 2))
    model = registered(source, target, MixtureRegistration.of)
    dropped = {"dropped_by_robust_fit": ~model.likelihood.agreeing}
    for false, warned in ((8, True), (11, False)):
        columns = {"probability_false": (np.arange(40) < false) * 1.0, **dropped}
        sampled = SimpleNamespace(warnings=list)
        shown = SimpleNamespace(
            _stars=pd.DataFrame(columns), sampled=sampled, remarks=[]
        )
        assert ("drops" in "".join(Posterior.findings.fget(shown))) == warned
