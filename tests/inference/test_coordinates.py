"""Coordinates that straighten a posterior: a one-to-one map, its volume, and the draws."""

import emcee
import numpy as np
import pytest

from reproduce.inference import diagnostics, weighted
from reproduce.inference.model import Declared, Mirrored, Straightened
from reproduce.inference.sampling import mixture
from reproduce.papers.posteriors import posteriors

STRAIGHTENED = ["registration-mixture", "table-5"]


def fitted(name, seed):
    """Return a model with simulated data, and parameters about its start."""
    generator = np.random.default_rng(seed)
    model = posteriors()[name].model()
    model = model.given(model.simulate(model.draw_prior(generator, 1)[0], generator))
    return model, model.start(generator, 6)


def derivatives(function, points, step=1e-5):
    """Central differences, shape (n, d, d)."""
    columns = [
        (function(points + step * unit) - function(points - step * unit)) / (2 * step)
        for unit in np.eye(points.shape[1])
    ]
    return np.stack(columns, axis=-1)


def test_the_other_models_move_as_declared():
    for name, declared in posteriors().items():
        model = declared.model()
        assert isinstance(model.likelihood, Straightened) == (name in STRAIGHTENED)
        assert isinstance(model.coordinates(), Declared) == (name not in STRAIGHTENED)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", STRAIGHTENED)
def test_there_and_back(name, seed):
    model, points = fitted(name, seed)
    coordinates = model.coordinates()
    again = coordinates.parameters(coordinates.straight(points))
    np.testing.assert_allclose(again, points, rtol=1e-9)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", STRAIGHTENED)
def test_volume_is_the_determinant_of_the_derivatives(name, seed):
    model, points = fitted(name, seed)
    coordinates = model.coordinates()
    jacobian = derivatives(coordinates.parameters, coordinates.straight(points))
    expected = np.linalg.slogdet(jacobian)[1]
    np.testing.assert_allclose(coordinates.log_volume(points), expected, atol=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_mirror_takes_back_and_keeps_volumes(seed):
    model, points = fitted("table-5", seed)
    coordinates = model.coordinates()
    assert isinstance(coordinates, Mirrored)
    straight = coordinates.straight(points)
    once = coordinates.mirrored(straight)
    np.testing.assert_allclose(coordinates.mirrored(once), straight, rtol=1e-9, atol=1e-9)
    determinant = np.linalg.det(derivatives(coordinates.mirrored, straight))
    np.testing.assert_allclose(np.abs(determinant), 1, rtol=1e-5)


def test_mirror_finds_the_other_mode():
    """Two blocks alike, biases apart: the interchange of the columns interchanges the biases."""
    model = posteriors()["table-5"].model()
    shown = np.array([p.shown for p in model.parameters])
    truth = np.array([2055.0, 0.02, 0.2, -0.1, -0.2]) / shown
    model = model.given(model.simulate(truth, np.random.default_rng(3)))
    coordinates = model.coordinates()
    here = coordinates.parameters(coordinates.straight(truth[None]))
    there = coordinates.parameters(coordinates.mirrored(coordinates.straight(truth[None])))
    np.testing.assert_allclose(there[0, [0, 1, 4]], here[0, [0, 1, 4]], rtol=1e-9)
    ends = np.array([here[0, 2:4], there[0, 2:4]]) * shown[2]
    assert np.abs(ends[0] - ends[1]).min() > 0.2
    np.testing.assert_allclose(np.sort(ends[0]), np.sort(ends[1]), atol=0.08)
    ratio = np.diff(model.log_posterior(np.concatenate([here, there])))
    assert abs(ratio[0]) < 10


class Funnel:
    """A width that ranges over decades, and a value of that width, in one of two places."""

    apart = 40.0

    def straight(self, parameters):
        return np.column_stack([parameters[:, 0], parameters[:, 1] / np.exp(parameters[:, 0])])

    def parameters(self, straight):
        return np.column_stack([straight[:, 0], straight[:, 1] * np.exp(straight[:, 0])])

    def log_volume(self, parameters):
        return parameters[:, 0].copy()


class TwoFunnels(Funnel):
    def mirrored(self, straight):
        return straight * [1, -1] + [0, self.apart]


def log_funnel(parameters, second=0.0):
    """Width exp(v) with v of deviation 1.5; a share of the values lies 40 widths off."""
    v, x = parameters.T
    scaled = x / np.exp(v)
    near, far = -0.5 * scaled**2, -0.5 * (scaled - Funnel.apart) ** 2
    shares = np.logaddexp(near + np.log1p(-second), far + np.log(second)) if second else near
    return -0.5 * (v / 1.5) ** 2 - v + shares


def chain_of(function, coordinates, steps=2000):
    generator = np.random.default_rng(1)
    sampler = emcee.EnsembleSampler(48, 2, function, vectorize=True, moves=mixture(coordinates))
    sampler.random_state = np.random.RandomState(2).get_state()
    sampler.run_mcmc(generator.normal(size=(48, 2)), steps + 300, skip_initial_state_check=True)
    return sampler.get_chain(discard=300)[None]


def test_draws_in_coordinates_follow_the_law():
    chain = chain_of(log_funnel, Funnel())
    v = chain[..., 0]
    for values, expected in ((v, 0), (v**2, 2.25), (v > 1.5, 0.158655), (chain[..., 1] > 0, 0.5)):
        values = values.astype(float)
        assert abs(values.mean() - expected) < 4 * diagnostics.mcse_mean(values)
    assert diagnostics.autocorrelation_time(v) < 8


def test_mirror_weighs_two_modes_rightly():
    """Forty widths lie between them: without the mirror no walker would cross."""
    chain = chain_of(lambda parameters: log_funnel(parameters, 0.3), TwoFunnels())
    second = (chain[..., 1] / np.exp(chain[..., 0]) > Funnel.apart / 2).astype(float)
    assert diagnostics.autocorrelation_time(second) < 20
    assert abs(second.mean() - 0.3) < 4 * diagnostics.mcse_mean(second)


def test_weighted_agrees_with_the_product_of_densities():
    grid = np.linspace(-3, 5, 4001)
    density = np.exp(-0.5 * ((grid - 2) / 0.7) ** 2 - 0.5 * ((grid + 1) / 1.1) ** 2)
    density /= density.sum()
    mean = (density * grid).sum()
    deviation = np.sqrt((density * (grid - mean) ** 2).sum())
    found = weighted(2.0, np.array([0.7]), -1.0, 1.1)
    np.testing.assert_allclose(np.concatenate(found), [mean, deviation], rtol=1e-6)
