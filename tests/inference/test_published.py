"""Posteriors of printed numbers against closed forms, grids and simulated experiments."""

import numpy as np
import pytest
from numpy.random import default_rng
from scipy import stats

from reproduce.inference import PosteriorSamples
from reproduce.inference.sampling import Plan, run_ensemble
from reproduce.papers.niu2024 import experiment, published, simulation
from reproduce.papers.posteriors import posteriors
from reproduce.physics.optics import channel_centroids
from reproduce.physics.registration import fit_registration
from reproduce.printed.inputs import load_inputs
from reproduce.views.posterior import book_posterior


def likelihood_of(key):
    return posteriors()[key].model().likelihood


def test_a_printed_fit_has_the_variance_of_rounding_and_noise():
    """The two parts add: a third of the squared half unit, and noise times error, squared."""
    likelihood = likelihood_of("camera-blue")
    exact = likelihood.exact(400_000, default_rng(5))
    freedom = 2 * likelihood.points
    noise = (likelihood.residuals**2).mean() * freedom / (freedom - 2)
    errors = np.square(likelihood.errors).mean(axis=0)
    expected = likelihood.half_units**2 / 3 + noise * errors
    assert exact[:, :4].var(axis=0) == pytest.approx(expected, rel=0.01)


def test_the_likelihood_of_a_printed_fit_is_a_probability():
    """Boxes of the normal and the density of chi, by SciPy's distributions."""
    likelihood = likelihood_of("simulation-red")
    centre, error = likelihood.start()
    points = centre + error * np.array([[0, 0, 0, 0, 0], [2, -1, 3, 0.5, 1]])
    low, high = (
        likelihood.estimates + side * likelihood.half_units for side in (-1, 1)
    )
    expected = []
    for *values, noise in points:
        boxes = [
            np.diff(stats.norm.cdf([low, high], values, noise * errors), axis=0).prod()
            for errors in likelihood.errors
        ]
        scale = noise / np.sqrt(likelihood.points)
        chi = stats.chi.logpdf(likelihood.residuals, likelihood.count, scale=scale)
        expected.append(np.log(np.mean(boxes)) + chi.sum())
    assert np.diff(likelihood(points)) == pytest.approx(np.diff(expected), rel=1e-9)


@pytest.mark.parametrize("kind", ["simulation", "camera"])
def test_errors_per_noise_are_those_of_repeated_fits(kind):
    """For noise in both images; and the scale of the cameras is the mean of the fits."""
    inputs = load_inputs(posteriors()[f"{kind}-red"].inputs)
    instrument = {"simulation": simulation, "camera": experiment}[kind].instrument
    bench, angles = instrument(inputs), simulation.arrangement(inputs)
    green, red, _ = channel_centroids(bench, angles)
    noise, rng = 0.1, default_rng(4)
    errors = rng.normal(0, noise / np.sqrt(2), (2, 2000, *green.shape))
    pivot = bench[1].principal_point
    fits = fit_registration(red + errors[0], green + errors[1], pivot)
    known = published._noise_free_fit(bench, angles, "red")
    spread = fits.parameters.std(axis=0)
    assert spread == pytest.approx(noise * known.standard_errors, rel=0.06)
    off = fits.parameters.mean(axis=0) - known.parameters
    assert (np.abs(off) < 4 * spread / np.sqrt(2000)).all()
    assert np.abs(np.corrcoef(fits.parameters.T) - np.eye(4)).max() < 0.08


def test_emcee_agrees_with_a_grid():
    found = book_posterior("averaging-y")
    draws = found.draws
    axes = [
        np.linspace(*ends, 300) for ends in zip(draws.min(0), draws.max(0), strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    logs = found.model.log_posterior(points)
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    mean = weights @ points
    spread = np.sqrt(weights @ (points - mean) ** 2)
    assert (np.abs(draws.mean(axis=0) - mean) < 0.06 * spread).all()
    assert draws.std(axis=0) == pytest.approx(spread, rel=0.06)


def test_the_focal_length_of_the_stage_is_that_of_generalised_least_squares():
    """Independent: a tangent, the full covariance of the angles, and Student's t."""
    likelihood = likelihood_of("stage")
    inverse = np.linalg.inv(np.eye(4) + 1)
    lengths = np.linspace(1.8, 2.4, 2001)
    squares = []
    for motions in (likelihood.motions, likelihood.motions[::-1]):
        left = likelihood.angles + np.arctan(motions / lengths[:, None, None])
        squares.append(np.einsum("nij,jk,nik->n", left, inverse, left))
    # With a flat prior of the logarithm of the noise: its power of minus half the angles.
    weights = np.array(squares) ** -4.0
    density = weights.sum(axis=0) / weights.sum()
    mean = density @ lengths
    frame = book_posterior("stage")
    length, chance = (frame.summaries[i] for i in (0, 2))
    assert length.mean == pytest.approx(1e3 * mean, abs=1.0)
    spread = np.sqrt(density @ (lengths - mean) ** 2)
    assert length.deviation == pytest.approx(1e3 * spread, rel=0.05)
    assert chance.mean == pytest.approx(weights[1].sum() / weights.sum(), abs=0.01)


def test_printed_numbers_are_saved_in_the_groups_of_arviz():
    """Arrays of different lengths and dimensions have separate dimensions."""
    for key, parts in (("camera-red", 3), ("averaging-x", 1), ("stage", 1)):
        model = posteriors()[key].model()
        chain, accepted = run_ensemble(model, Plan(1, 1, 0, 60, 20), 0)
        found = PosteriorSamples(model, 1, chain[None], (accepted,))
        tree = found.to_datatree()
        # The estimates together and two residuals, or all numbers together.
        assert {n: len(log.T) for n, log in tree["log_likelihood"].items()} == {
            "data": parts
        }
        for name, values in model.likelihood.observed.items():
            np.testing.assert_array_equal(tree["observed_data"][name], values)
            assert tree["prior_predictive"][name].shape == (1, 250, *values.shape)
