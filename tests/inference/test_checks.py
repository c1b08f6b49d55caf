"""Predictive checks, sensitivity to the priors, evidence: each sees what it should."""

import numpy as np
import pytest

from reproduce.inference.checks import predictive_checks, two_sided
from reproduce.inference.registration import principal_point_model
from reproduce.inference.sampling import Plan, sample
from reproduce.inference.sensitivity import NOTABLE, sensitivities

PLAN = Plan(5, steps=500, warmup=200)


@pytest.fixture(scope="module")
def posterior(registration):
    return sample(registration, PLAN)


def test_data_of_the_model_pass(posterior):
    assert min(check.tail.value for check in predictive_checks(posterior, 100)) > 0.01


def test_distortion_is_seen(registration):
    """A radial term the similarity does not have shows in the outer residuals."""
    data = registration.likelihood
    offsets = data.source - data.pivot
    bent = data.target + 1e-7 * offsets * (offsets**2).sum(axis=1, keepdims=True)
    found = predictive_checks(sample(registration.given(bent), PLAN), 100)
    assert {c.name: c.tail.value for c in found}["outer residual, outwards (px)"] < 0.02


def test_only_the_principal_point_answers_to_its_prior(registration):
    free = sample(principal_point_model(registration, 1.0), Plan(5, steps=1000, warmup=200))
    found = {one.name: one for one in sensitivities(free)}
    assert found["pivot-x"].prior > NOTABLE > found["pivot-x"].likelihood
    assert found["scale"].prior < NOTABLE < found["scale"].likelihood
    assert all(one.shape < 0.7 for one in found.values())


def test_errors_of_sensitivities_are_their_scatter(registration):
    """Over independent runs the answers scatter as much as each run says of itself."""
    runs = [
        sensitivities(sample(registration, Plan(seed, steps=500, warmup=200))) for seed in range(12)
    ]
    answers = np.array([[(r.prior, r.likelihood, r.shift) for r in run] for run in runs])
    errors = np.array([[r.errors for r in run] for run in runs])
    ratio = answers.std(axis=0, ddof=1) / np.sqrt(np.square(errors).mean(axis=0))
    # Twelve runs know a standard deviation to a fifth; the parameters are not independent.
    assert 0.6 < np.exp(np.log(ratio).mean()) < 1.6
    assert ((ratio > 0.3) & (ratio < 3)).all()


def test_two_sided_tail():
    draws = np.arange(1, 101) / 100
    assert two_sided(draws, 0.025) == pytest.approx(0.04)
    assert two_sided(draws, 2.0) == 0.0
    assert two_sided(np.ones(5), 1.0) == 1.0
