"""Printed numbers as data: rounding, joint sampling distributions, the interchange."""

import numpy as np
import pytest
from scipy import integrate, stats

from reproduce.inference.models import averaging, centroid_noise, stage_table
from reproduce.inference.sampling import Plan, sample
from reproduce.papers.posteriors import posteriors
from reproduce.physics.attitude import scatter_of_averages
from reproduce.units import ARCSEC_PER_RADIAN

COUNTS = (1, 4, 16, 25, 49, 100)


def test_interval_probability_in_both_tails():
    low = np.array([-40.0, -1.0, 30.0])
    high = low + np.array([1.0, 2.0, 0.5])
    # Sum of a fine grid of densities, in logarithms.
    grid = np.linspace(low, high, 20001)
    logs = stats.norm.logpdf(grid)
    top = logs.max(axis=0)
    expected = top + np.log(np.trapezoid(np.exp(logs - top), grid, axis=0))
    np.testing.assert_allclose(centroid_noise.log_interval(low, high), expected, rtol=1e-6)


def test_box_probability_against_counting():
    generator = np.random.default_rng(1)
    root = np.linalg.cholesky(0.6 + 0.4 * np.eye(3))[None]
    low, high = np.array([-0.5, -1.0, 0.0]), np.array([1.0, 0.5, 2.0])
    draws = generator.normal(size=(400_000, 3)) @ root[0].T
    share = ((draws > low) & (draws < high)).all(axis=1).mean()
    found = np.exp(
        centroid_noise.log_box(np.zeros((1, 3)), root, low, high, centroid_noise.quasi_random(3))
    )
    assert abs(found[0] - share) < 4 * np.sqrt(share / 400_000) + 2e-4


@pytest.mark.parametrize("scale", [1.0, 30.0, 3000.0])
def test_quick_box_is_the_careful_one(monkeypatch, scale):
    """Wide, narrow and far-off boxes, with every difference taken from the ends themselves."""
    generator = np.random.default_rng(1)
    root = np.linalg.cholesky(0.5 + 0.5 * np.eye(5))[None] * scale
    mean = scale * generator.normal(size=(40, 5)) * np.array([1, 1, 2, 5, 20])
    arguments = mean, np.repeat(root, 40, axis=0), np.zeros(5), np.ones(5)
    points = centroid_noise.quasi_random(5)
    quick = centroid_noise.log_box(*arguments, points)
    monkeypatch.setattr(centroid_noise, "PRECISE", 2.0)
    careful = centroid_noise.log_box(*arguments, points)
    np.testing.assert_allclose(quick, careful, rtol=1e-10, atol=1e-10)


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
    likelihood = averaging.AveragingLikelihood((1, 4), np.zeros((1, 2)), 0.05, 60)
    truth = np.array([1.0, 0.8])
    generator = np.random.default_rng(1)
    tables = np.array([likelihood.simulate(truth, generator)[0] for _ in range(12_000)]).round(6)
    common, counts = np.unique(tables, axis=0, return_counts=True)
    best = np.argsort(counts)[-8:]
    found = [np.exp(likelihood.given(common[i][None])(truth[None])[0]) for i in best]
    expected = counts[best] / len(tables)
    error = np.sqrt(expected / len(tables))
    assert (np.abs(found - expected) < 4 * error + 0.04 * expected).all()


def test_floor_is_found_and_its_absence_too():
    model = averaging.by_column(posteriors()["frame-averaging"].model())[0]
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


def stage_points(seed):
    """Return the model of the stage test with simulated data, and parameters near and far."""
    generator = np.random.default_rng(seed)
    model = posteriors()["table-5"].model()
    truth = model.draw_prior(generator, 1)
    model = model.given(model.simulate(truth[0], generator))
    # From noises that tell the two hypotheses apart to those that hide them.
    louder = np.repeat(model.likelihood.start()[0][None], 60, axis=0)
    louder[:, 4] = np.linspace(-3, 0, 60)
    louder[:, 1] = 10.0 ** louder[:, 4] / ARCSEC_PER_RADIAN
    return model.likelihood, np.concatenate([truth, model.start(generator, 20), louder])


@pytest.mark.parametrize("seed", range(8))
def test_negligible_hypothesis_is_left_out_without_loss(seed):
    likelihood, points = stage_points(seed)
    printed = likelihood.printed(points)
    whole = [
        likelihood.reference.log_hypothesis(points[:, 0], printed, np.full(len(points), which))
        for which in (0, 1)
    ]
    np.testing.assert_allclose(
        likelihood(points), np.logaddexp(*whole) - np.log(2), rtol=1e-13, atol=1e-12
    )


@pytest.mark.parametrize("seed", range(8))
def test_bound_of_a_hypothesis_holds(seed):
    likelihood, points = stage_points(seed)
    quiet = points.copy()
    quiet[:, 1], quiet[:, 4] = 2e-3 / ARCSEC_PER_RADIAN, -3.0
    points = np.concatenate([points, quiet])
    printed = likelihood.printed(points)
    bounds = likelihood.reference.bounds(points[:, 0], printed)
    for which in (0, 1):
        found = likelihood.reference.log_hypothesis(
            points[:, 0], printed, np.full(len(points), which)
        )
        assert (bounds[:, which] >= found - 1e-9).all()


def test_a_hypothesis_is_left_out():
    """Else the test above compares a thing with itself."""
    model = posteriors()["table-5"].model()
    both = model.likelihood.both(model.likelihood.start()[0][None])
    np.testing.assert_array_equal(np.isfinite(both), [[False, True]])


def plain_integral(likelihood, point, which):
    """Log probability of Table V, angle by angle, the zero position by adaptive steps."""
    reference, focal = likelihood.reference, point[0]
    half, unit = reference.half_position, reference.half_angle
    noises = (10.0 ** point[4] / ARCSEC_PER_RADIAN, point[1])
    total = 0.0
    for block in (0, 1):
        column = 1 - block if which else block
        motions = reference.positions[1:, block] - reference.positions[0, block]
        pairs = [(reference.angles[:, column], noises[0], 0.0),
                 (likelihood.monitored[:, column], noises[1], point[3 - block])]  # fmt: skip

        def logs(zero, pairs=pairs, motions=motions):
            found = 0.0
            for angles, noise, bias in pairs:
                middles = -np.arctan((motions - zero) / focal) + bias
                shifts = np.linspace(-half, half, 201) / focal
                for angle, middle in zip(angles, middles, strict=True):
                    off = angle - middle - shifts
                    share = stats.norm.cdf((off + unit) / noise) - stats.norm.cdf(
                        (off - unit) / noise
                    )
                    found += np.log(np.trapezoid(share, shifts) / (shifts[-1] - shifts[0]))
            return found

        middle = logs(0.0)
        shown = integrate.quad(lambda zero, f=logs, m=middle: np.exp(f(zero) - m), -half, half)
        total += middle + np.log(shown[0] / (2 * half))
    return total


def test_hypothesis_against_a_plain_integral():
    model = posteriors()["table-5"].model()
    arcsec = ARCSEC_PER_RADIAN
    point = np.array([2.05, 0.004 / arcsec, 0.01 / arcsec, -0.02 / arcsec, np.log10(0.003)])
    likelihood = model.given(model.simulate(point, np.random.default_rng(2))).likelihood
    found = likelihood.both(point[None])[0]
    which = int(np.argmax(found))
    assert abs(found[which] - plain_integral(likelihood, point, which)) < 1e-3


def test_interchange_is_certain_in_print_and_found_in_simulation():
    model = posteriors()["table-5"].model()
    centre = model.likelihood.start()[0][None]
    assert model.likelihood.interchanged(centre)[0] > 0.999
    quiet = centre.copy()
    quiet[0, 1:4] = [1e-3 / ARCSEC_PER_RADIAN, 0, 0]
    told = [model.simulate(quiet[0], np.random.default_rng(seed)) for seed in range(12)]
    found = np.array([model.likelihood.given(data).interchanged(quiet)[0] for data in told])
    # Monitored angles stand beside their references in either order: a few thousandths apart.
    assert max(np.abs(left - right).max() for left, right in told) < 0.006 / ARCSEC_PER_RADIAN
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
    assert model.name == name
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
