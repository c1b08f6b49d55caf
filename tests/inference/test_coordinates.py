"""Coordinates that straighten a posterior: a one-to-one map, its volume, and the draws."""

import emcee
import numpy as np
import pytest
from errors import mcse_mean

from calibrations import drawn_prior
from reproduce.inference import Coordinates, autocorrelation_time
from reproduce.inference.sampling import mixture
from reproduce.papers.posteriors import posteriors

MIXTURE = "registration-mixture"


def fitted(seed):
    """Return a model with simulated data, and parameters about its start."""
    generator = np.random.default_rng(seed)
    model = posteriors()[MIXTURE].model()
    data = model.likelihood.simulate(drawn_prior(model, generator, 1)[0], generator)
    model = model.given(data)
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
        assert (type(declared.model().coordinates) is Coordinates) == (name != MIXTURE)


@pytest.mark.parametrize("seed", range(5))
def test_there_and_back(seed):
    model, points = fitted(seed)
    coordinates = model.coordinates
    again = coordinates.parameters(coordinates.straight(points))
    np.testing.assert_allclose(again, points, rtol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_volume_is_the_determinant_of_the_derivatives(seed):
    model, points = fitted(seed)
    coordinates = model.coordinates
    jacobian = derivatives(coordinates.parameters, coordinates.straight(points))
    expected = np.linalg.slogdet(jacobian)[1]
    np.testing.assert_allclose(coordinates.log_volume(points), expected, atol=1e-4)


class Funnel(Coordinates):
    """A width that ranges over decades, and a value of that width."""

    def straight(self, parameters):
        return np.column_stack(
            [parameters[:, 0], parameters[:, 1] / np.exp(parameters[:, 0])]
        )

    def parameters(self, straight):
        return np.column_stack(
            [straight[:, 0], straight[:, 1] * np.exp(straight[:, 0])]
        )

    def log_volume(self, parameters):
        return parameters[:, 0].copy()


def log_funnel(parameters):
    """Width exp(v) with v of deviation 1.5, and x of that width."""
    v, x = parameters.T
    return -0.5 * (v / 1.5) ** 2 - v - 0.5 * (x / np.exp(v)) ** 2


def chain_of(function, coordinates, steps=2000):
    generator = np.random.default_rng(1)
    sampler = emcee.EnsembleSampler(
        48, 2, function, vectorize=True, moves=mixture(coordinates)
    )
    sampler.random_state = np.random.RandomState(2).get_state()
    sampler.run_mcmc(
        generator.normal(size=(48, 2)), steps + 300, skip_initial_state_check=True
    )
    return sampler.get_chain(discard=300)[None]


def test_draws_in_coordinates_follow_the_law():
    chain = chain_of(log_funnel, Funnel())
    v = chain[..., 0]
    for values, expected in (
        (v, 0),
        (v**2, 2.25),
        (v > 1.5, 0.158655),
        (chain[..., 1] > 0, 0.5),
    ):
        values = values.astype(float)
        assert abs(values.mean() - expected) < 4 * mcse_mean(values)
    assert autocorrelation_time(v) < 8
