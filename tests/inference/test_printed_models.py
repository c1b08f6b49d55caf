"""Printed numbers as data: rounding, joint sampling distributions, the interchange."""

import numpy as np
import pytest
from scipy import stats

from reproduce.inference import averaging, censored, stage_table
from reproduce.inference.sampling import Plan, sample
from reproduce.papers.posteriors import posteriors
from reproduce.physics.averaging import scatter_of_averages

COUNTS = (1, 4, 16, 25, 49, 100)


def test_interval_probability_in_both_tails():
    low = np.array([-40.0, -1.0, 30.0])
    high = low + np.array([1.0, 2.0, 0.5])
    # Sum of a fine grid of densities, in logarithms.
    grid = np.linspace(low, high, 20001)
    logs = stats.norm.logpdf(grid)
    top = logs.max(axis=0)
    expected = top + np.log(np.trapezoid(np.exp(logs - top), grid, axis=0))
    np.testing.assert_allclose(censored.log_interval(low, high), expected, rtol=1e-6)


def test_box_probability_against_counting():
    generator = np.random.default_rng(1)
    root = np.linalg.cholesky(0.6 + 0.4 * np.eye(3))[None]
    low, high = np.array([-0.5, -1.0, 0.0]), np.array([1.0, 0.5, 2.0])
    draws = generator.normal(size=(400_000, 3)) @ root[0].T
    share = ((draws > low) & (draws < high)).all(axis=1).mean()
    found = np.exp(censored.log_box(np.zeros((1, 3)), root, low, high, censored.quasi_random(3)))
    assert abs(found[0] - share) < 4 * np.sqrt(share / 400_000) + 2e-4


def test_moments_of_running_averages_against_simulation():
    """Means, variances and correlations of the squared scatter, white noise and floor together."""
    white, floor, pairs, bent = averaging.moments(800, COUNTS)
    a, b = 1.0, 0.1
    drift = np.linspace(-1, 1, 800)
    generator = np.random.default_rng(2)
    series = a * generator.normal(size=(4000, 800)) + b * drift / drift.std(ddof=1)
    squares = scatter_of_averages(series, COUNTS, axis=1) ** 2
    mean = a**2 * white + b**2 * floor
    covariance = 2 * a**4 * pairs + 4 * a**2 * b**2 * bent
    error = np.sqrt(np.diagonal(covariance) / 4000)
    assert np.abs((squares.mean(axis=0) - mean) / error).max() < 4
    found, scale = np.cov(squares, rowvar=False), np.sqrt(np.diagonal(covariance))
    assert np.abs((found - covariance) / np.outer(scale, scale)).max() < 0.12


def test_likelihood_of_a_table_against_counting():
    """Short series, coarse print, a strong floor: how often does each table come out?"""
    likelihood = averaging.AveragingLikelihood((1, 4), np.zeros(2), 0.05, 60)
    truth = np.array([1.0, 0.8])
    generator = np.random.default_rng(1)
    tables = np.array([likelihood.simulate(truth, generator) for _ in range(12_000)]).round(6)
    common, counts = np.unique(tables, axis=0, return_counts=True)
    best = np.argsort(counts)[-8:]
    found = [np.exp(likelihood.given(common[i])(truth[None])[0]) for i in best]
    expected = counts[best] / len(tables)
    error = np.sqrt(expected / len(tables))
    assert (np.abs(found - expected) < 4 * error + 0.04 * expected).all()


def test_floor_is_found_and_its_absence_too():
    model = posteriors()["frame-averaging"].model()
    radian = model.parameters[0].shown
    for truth in (0.0, 0.15):
        data = model.simulate(np.array([0.39, truth]) / radian, np.random.default_rng(5))
        found = sample(model.given(data), Plan(5, steps=400, warmup=150))
        low, high = np.quantile(found.chain[..., 1] * radian, (0.005, 0.995))
        assert low <= truth + 0.01
        assert truth <= high
        assert (high < 0.1) == (truth == 0.0)


def test_doubly_rounded_probability_against_counting():
    generator = np.random.default_rng(1)
    noise, shift, angle, distance = 0.3, 0.4, 0.5, 0.6
    drawn = generator.uniform(-shift, shift, 400_000) + noise * generator.normal(size=400_000)
    share = (np.abs(drawn - distance) < angle).mean()
    found = stage_table.log_rounded(
        np.array([distance]), angle, np.array([shift]), np.array([noise])
    )
    assert abs(np.exp(found[0]) - share) < 4 * np.sqrt(share / 400_000)


def test_interchange_is_certain_in_print_and_found_in_simulation():
    model = posteriors()["table-5"].model()
    centre = model.likelihood.start()[0][None]
    assert model.likelihood.interchanged(centre)[0] > 0.999
    quiet = centre.copy()
    quiet[0, 1:4] = [1e-3 / stage_table.ARCSEC, 0, 0]
    told = [model.simulate(quiet[0], np.random.default_rng(seed)) for seed in range(12)]
    found = np.array([model.likelihood.given(data).interchanged(quiet)[0] for data in told])
    # Monitored angles stand beside their references in either order: a few thousandths apart.
    assert max(np.abs(left - right).max() for left, right in told) < 0.006 / stage_table.ARCSEC
    # The simulation draws either order with equal probability, and the data tell which.
    assert ((found < 0.01) | (found > 0.99)).all()
    assert 0 < (found > 0.5).sum() < 12


def test_focal_length_of_the_stage_test():
    """Independent: a straight line through reference angles and the other block's motions."""
    model = posteriors()["table-5"].model()
    reference = model.likelihood.reference
    motions = reference.positions[1:] - reference.positions[0]
    focal = -(motions**2).sum() / (motions * reference.angles[:, ::-1]).sum()
    centre, spread = model.likelihood.start()
    assert abs(centre[0] - focal) < spread[0]
    assert 2.05 < focal < 2.06


def test_noise_of_the_simulation_is_scaled_as_it_should(registration):
    """Ten times the errors tell of ten times the noise."""
    model = posteriors()["centroid-noise"].model()
    quiet = model.simulate(np.array([0.05]), np.random.default_rng(1))
    loud = model.simulate(np.array([0.5]), np.random.default_rng(1))
    grid = np.geomspace(0.01, 5, 400)[:, None]
    best = [grid[np.argmax(model.given(data).log_likelihood(grid))][0] for data in (quiet, loud)]
    assert 5 < best[1] / best[0] < 20
    assert 0.2 < best[1] < 1.2


@pytest.mark.parametrize("name", list(posteriors()))
def test_every_model_is_whole(name):
    """It builds from its declared cells alone, simulates, conditions, and starts inside."""
    declared = posteriors()[name]
    model = declared.model()
    generator = np.random.default_rng(1)
    start = model.start(generator, 8)
    assert np.isfinite(model.log_posterior(start)).all()
    assert model.draw_prior(generator, 5).shape == (5, model.dimension)
    again = model.given(model.simulate(start[0], generator))
    assert np.isfinite(again.log_likelihood(start[:1])).all()
    assert set(model.likelihood.checks()) == set(again.likelihood.checks())
    assert all(len(p.prior.reason.split()) >= 4 for p in model.parameters), "say why"
    assert set(model.estimate) <= set(model.names)


@pytest.mark.parametrize("name", list(posteriors()))
def test_priors_are_proper(name):
    """Draws from a prior lie in it, and its density falls to nothing outside."""
    for parameter in posteriors()[name].model().parameters:
        draws = parameter.prior.draw(np.random.default_rng(1), 4000)
        assert np.isfinite(parameter.prior.log_density(draws)).all()
        # The entropy identity: mean of one over the density is the width of the support.
        edges = np.quantile(draws, np.linspace(0, 1, 201))
        middle = 0.5 * (edges[1:] + edges[:-1])
        mass = (np.exp(parameter.prior.log_density(middle)) * np.diff(edges)).sum()
        assert 0.9 < mass < 1.1, parameter.name
