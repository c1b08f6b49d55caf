"""Diagnostics against ArviZ and emcee, and against chains whose truth is known."""

import pickle

import emcee
import numpy as np
import pytest
from arviz_stats.base import array_stats
from errors import mcse_mean

from reproduce.inference import UnconvergedError, diagnostics, summarised
from reproduce.inference.diagnostics import require
from reproduce.inference.sampling import move_mixture


def autoregressive(correlation, shape, seed=1):
    """Chains of unit variance, shape (ensembles, steps, walkers), time (1 + r) / (1 - r)."""
    generator = np.random.default_rng(seed)
    noise = generator.normal(size=shape) * np.sqrt(1 - correlation**2)
    chains = np.empty(shape)
    chains[:, 0] = generator.normal(size=(shape[0], shape[2]))
    for step in range(1, shape[1]):
        chains[:, step] = correlation * chains[:, step - 1] + noise[:, step]
    return chains


@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_split_rhat_is_arvizs(shift):
    draws = (
        np.random.default_rng(1).standard_t(3, size=(4, 500))
        + shift * np.arange(4)[:, None]
    )
    theirs = array_stats.rhat(draws)
    np.testing.assert_allclose(diagnostics._split_rhat(draws), float(theirs), rtol=1e-9)


def test_autocorrelation_time_is_emcees():
    chains = autoregressive(0.8, (1, 4000, 8))[0]
    ours = diagnostics._integrated_time(diagnostics._autocorrelation(chains))
    np.testing.assert_allclose(
        ours, emcee.autocorr.integrated_time(chains, quiet=True)[0], rtol=0.02
    )


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_autocorrelation_time_is_the_known_one(correlation):
    chains = autoregressive(correlation, (4, 4000, 16))
    known = (1 + correlation) / (1 - correlation)
    np.testing.assert_allclose(
        diagnostics.autocorrelation_time(chains), known, rtol=0.15
    )


def test_walkers_that_move_together_are_one_walker():
    """What the mean of emcee's own estimate over walkers cannot see."""
    alone = autoregressive(0.5, (4, 2000, 1))
    chains = np.repeat(alone, 16, axis=2)
    assert diagnostics._effective_size(chains) < 1.3 * diagnostics._effective_size(
        alone
    )


def test_standard_errors_are_honest():
    """Errors of the mean over their standard error scatter by one: 60 repeats, four sigma."""
    found = []
    for seed in range(60):
        chains = autoregressive(0.7, (4, 500, 8), seed)
        found.append(chains.mean() / mcse_mean(chains))
    assert abs(np.std(found) - 1) < 4 / np.sqrt(2 * 60)


@pytest.mark.parametrize("fault", ["apart", "slow", "stuck"])
def test_bad_chains_are_refused_with_their_numbers(fault):
    chain = autoregressive(0.3, (4, 1000, 16))
    acceptance = (0.4,) * 4
    if fault == "apart":
        chain = chain + np.arange(4)[:, None, None]
    elif fault == "slow":
        chain = autoregressive(0.98, (4, 1000, 16))
    else:
        acceptance = (0.4, 0.4, 0.4, 0.01)
    with pytest.raises(UnconvergedError) as caught:
        require([summarised("a", "", chain)], 1000, acceptance)
    assert pickle.loads(pickle.dumps(caught.value)).steps == caught.value.steps
    assert (caught.value.steps is None) == (fault == "stuck")


def test_good_chains_pass():
    chain = autoregressive(0.3, (4, 1000, 16))
    require([summarised("a", "", chain)], 1000, (0.4,) * 4)


def banana(points):
    """A curved density with known moments: x normal, y normal about x^2."""
    x, y = points.T
    return -0.5 * x**2 - 0.5 * (y - x**2) ** 2


def test_moves_leave_a_curved_density_unchanged():
    """The Gaussian proposal fits it badly; the draws must be right all the same."""
    chains = []
    for seed in range(4):
        sampler = emcee.EnsembleSampler(
            64, 2, banana, vectorize=True, moves=move_mixture()
        )
        state = emcee.State(
            np.random.default_rng(seed).normal(size=(64, 2)),
            random_state=np.random.RandomState(seed).get_state(),
        )
        sampler.run_mcmc(state, 3000)
        chains.append(sampler.get_chain(discard=500))
    chain = np.stack(chains)
    x, y = chain[..., 0], chain[..., 1]
    for values, truth in (
        (x, 0.0),
        (x**2, 1.0),
        (y, 1.0),
        ((y - 1) ** 2, 3.0),
        (x * y, 0.0),
    ):
        assert abs(values.mean() - truth) < 4 * mcse_mean(values)
