"""Diagnostics compared with ArviZ, emcee and chains of known autocorrelation."""

import pickle

import emcee
import numpy as np
import pytest
from arviz_stats.base import array_stats
from errors import mcse_mean
from numpy.random import default_rng

from reproduce.inference import (
    UnconvergedError,
    autocorrelation_time,
    diagnostics,
    summarised,
)
from reproduce.inference.diagnostics import _mcse_quantile, require
from reproduce.inference.sampling import _move_mixture


def autoregressive(correlation, shape, seed=1):
    """Chains of unit variance, shape (ensembles, steps, walkers), time (1 + r) / (1 - r)."""
    generator = default_rng(seed)
    noise = generator.normal(size=shape) * np.sqrt(1 - correlation**2)
    chains = np.empty(shape)
    chains[:, 0] = generator.normal(size=(shape[0], shape[2]))
    for step in range(1, shape[1]):
        chains[:, step] = correlation * chains[:, step - 1] + noise[:, step]
    return chains


def test_split_rhat_agrees_with_arviz():
    draws = default_rng(1).standard_t(3, size=(4, 500))
    for shift in (0.0, 0.3):
        moved = draws + shift * np.arange(4)[:, None]
        expected = float(array_stats.rhat(moved))
        assert diagnostics._split_rhat(moved) == pytest.approx(expected, rel=1e-9)


def test_autocorrelation_time_is_that_of_emcee_and_of_theory():
    chains = autoregressive(0.8, (1, 4000, 8))
    expected = emcee.autocorr.integrated_time(chains[0], quiet=True)[0]
    assert autocorrelation_time(chains) == pytest.approx(expected, rel=0.02)
    for correlation in (0.0, 0.5, 0.9):
        chains = autoregressive(correlation, (4, 4000, 16))
        expected = (1 + correlation) / (1 - correlation)
        assert autocorrelation_time(chains) == pytest.approx(expected, rel=0.15)


def test_walkers_that_move_together_count_once():
    """The mean of emcee's estimate over walkers does not show them."""
    single = autoregressive(0.5, (4, 2000, 1))
    together = autocorrelation_time(np.repeat(single, 16, axis=2))
    assert together > 16 / 1.3 * autocorrelation_time(single)


def test_errors_of_mean_and_median_scatter_by_the_standard_error():
    """60 repeats, four standard deviations."""
    chains = [autoregressive(0.7, (4, 500, 8), seed) for seed in range(60)]
    means = [chain.mean() / mcse_mean(chain) for chain in chains]
    medians = [np.median(chain) / _mcse_quantile(chain, 0.5) for chain in chains]
    for ratios in (means, medians):
        assert abs(np.std(ratios) - 1) < 4 / np.sqrt(2 * 60)


def test_bad_chains_are_rejected_with_the_number_of_steps():
    good, acceptance = autoregressive(0.3, (4, 1000, 16)), (0.4,) * 4
    require([summarised("a", "", good)], 1000, acceptance)
    apart = good + np.arange(4)[:, None, None]
    slow = autoregressive(0.98, (4, 1000, 16))
    stuck = (0.4, 0.4, 0.4, 0.01)
    for chain, fractions in ((apart, acceptance), (slow, acceptance), (good, stuck)):
        with pytest.raises(UnconvergedError) as caught:
            require([summarised("a", "", chain)], 1000, fractions)
        error = caught.value
        assert pickle.loads(pickle.dumps(error)).steps == error.steps
        assert (error.steps is None) == (fractions is stuck)


def banana(points):
    """A curved density with known moments: x normal, y normal about x^2."""
    x, y = points.T
    return -0.5 * x**2 - 0.5 * (y - x**2) ** 2


def test_moves_leave_a_curved_density_unchanged():
    """The Gaussian proposal does not fit it, but the draws must be right."""
    chains = []
    for seed in range(2):
        sampler = emcee.EnsembleSampler(
            64, 2, banana, vectorize=True, moves=_move_mixture()
        )
        points = default_rng(seed).normal(size=(64, 2))
        random_state = np.random.RandomState(seed).get_state()
        sampler.run_mcmc(emcee.State(points, random_state=random_state), 3000)
        chains.append(sampler.get_chain(discard=500))
    x, y = np.moveaxis(np.stack(chains), -1, 0)
    moments = [(x, 0.0), (x**2, 1.0), (y, 1.0), ((y - 1) ** 2, 3.0), (x * y, 0.0)]
    for values, truth in moments:
        assert abs(values.mean() - truth) < 4 * mcse_mean(values)
