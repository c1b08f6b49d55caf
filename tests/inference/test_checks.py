"""Predictive checks: each sees what it should."""

import pytest

from reproduce.inference import posterior_checks
from reproduce.inference.sampling import Plan, sample

PLAN = Plan(5, steps=500, warmup=200)


@pytest.fixture(scope="module")
def posterior(registration):
    return sample(registration, PLAN)


def test_data_of_the_model_pass(posterior):
    assert min(check.tail for check in posterior_checks(posterior, 1000)) > 0.01


def test_distortion_is_seen(registration):
    """A radial term the similarity does not have shows in the outer residuals."""
    data = registration.likelihood
    offsets = data.source - data.pivot
    bent = data.target + 1e-7 * offsets * (offsets**2).sum(axis=1, keepdims=True)
    found = posterior_checks(sample(registration.with_data(bent), PLAN), 100)
    assert {c.name: c.tail for c in found}["outer residual, outwards (px)"] < 0.02
