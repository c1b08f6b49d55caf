"""Every posterior of the book: coordinates, pointwise likelihood, consequences and checks."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.stats import kstest, norm, truncnorm

import reproduce as rp
from reproduce.inference import Normal, Uniform
from reproduce.inference.sampling import Plan, sample
from reproduce.papers.posteriors import posteriors

PLAN = Plan(5, ensembles=2, steps=300, warmup=120)


def test_coordinates_are_one_to_one_with_the_stated_volume():
    model = posteriors()["registration-mixture"].model()
    for seed in range(5):
        generator = default_rng(seed)
        truth = model.drawn_prior(generator, 1)[0]
        data = model.likelihood.simulate(truth, generator)
        points = replace(model, likelihood=data).start(generator, 6)
        coordinates = model.coordinates(points)
        assert not np.allclose(coordinates[:, 4:], points[:, 4:])
        assert_allclose(model.parameters_at(coordinates), points, rtol=1e-9)
        steps = 1e-5 * np.eye(6)[:, None]
        ahead, behind = (
            model.parameters_at(coordinates + sign * steps) for sign in (1, -1)
        )
        jacobian = np.moveaxis((ahead - behind) / 2e-5, 0, -1)
        volume = np.linalg.slogdet(jacobian)[1]
        found = model.log_density(coordinates) - model.log_posterior(points)
        assert_allclose(found, volume, atol=1e-4)


def test_a_normal_prior_of_a_noise_is_truncated_at_zero():
    priors = {"noise": Normal(0.02, 0.05, "a test"), "false-share": Normal(0, 1, "too")}
    found = rp.posterior("registration-mixture", priors=priors)
    model, text = found.model, found.priors["prior"]["noise"]
    assert text.endswith("above zero")
    prior = dict(zip(model.names, model.parameters, strict=True))["noise"].prior
    draws = prior.draw(default_rng(1), 1000)
    assert kstest(draws, truncnorm(-0.4, np.inf, 0.02, 0.05).cdf).pvalue > 1e-3
    rows = np.repeat(model.start(default_rng(1), 1), 3, axis=0)
    rows[1:, 4:] *= [[-1, 1], [1, -1]]
    assert np.isfinite(model.log_posterior(rows)).tolist() == [True, False, False]
    floor = rp.posterior("averaging-x", priors={"floor": Normal(0, 1, "a test")})
    rows = floor.model.likelihood.start()[0] * [[1, 1], [1, -1]]
    assert np.isfinite(floor.model.log_posterior(rows)).tolist() == [True, False]
    half = {"noise": Normal(0.0, 0.05, "half of a normal")}
    assert (
        rp.posterior("registration", priors=half).priors["why"]["noise"][:4] == "half"
    )
    for wrong in (Normal(-1, 0.1, "a test"), Uniform(-1, 1, "a test"), (-1, 1)):
        with pytest.raises(ValueError, match=r"^prior of noise: "):
            rp.posterior("registration", priors={"noise": wrong})


@pytest.mark.parametrize("name", list(posteriors()))
def test_pointwise_likelihood_consequences_and_summary(name):
    """The pointwise likelihood sums to that of stars; mean spots have a part of it."""
    declared = posteriors()[name]
    model = declared.model()
    rows = model.start(default_rng(1), 8)
    likelihood = model.likelihood
    each = likelihood.pointwise(rows)
    if "spots" in likelihood.observed:
        scale = np.multiply.outer(rows[:, -1], likelihood.counts**-0.5)
        density = norm(likelihood.predicted(rows)[:, 0], scale[..., None, None])
        law = density.logpdf(likelihood.spots)
        assert_allclose(each, law.sum(axis=-1), rtol=1e-9)
    else:
        assert_allclose(each.sum(axis=1), likelihood(rows), rtol=1e-9)
    found = model.consequences(rows)
    assert np.isfinite([quantity.values for quantity in found.values()]).all()
    if "registration" in name or "misalignment" in name:
        units = {quantity.unit for quantity in found.values()}
        assert units >= {"arcsec"} | ({"m"} if declared.paper == "chen2023" else set())
    assert set(declared.summary) <= {*model.names, *found}


def test_predictive_checks_pass_for_data_of_the_model_and_show_a_distortion(
    registration,
):
    found = sample(registration, PLAN).checks
    assert found["tail"].min() > 0.01
    data = registration.likelihood
    offsets = data.source - data.pivot
    bent = data.target + 1e-7 * offsets * (offsets**2).sum(axis=1, keepdims=True)
    distorted = replace(registration, likelihood=data.with_target(bent))
    found = sample(distorted, PLAN).checks
    assert found["tail"]["outer residual, outwards (px)"] < 0.02
