"""Predictive checks, sensitivity to the priors, evidence: each sees what it should."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from reproduce.inference.checks import Range, predictive_checks, two_sided
from reproduce.inference.model import Parameter
from reproduce.inference.models.registration import GaussianRegistration, registration_model
from reproduce.inference.priors import LogUniform, Normal
from reproduce.inference.sampling import Plan, sample
from reproduce.inference.sensitivity import NOTABLE, _distance, sensitivities

PLAN = Plan(5, steps=500, warmup=200)


@pytest.fixture(scope="module")
def posterior(registration):
    return sample(registration, PLAN)


def test_data_of_the_model_pass(posterior):
    assert min(check.tail.value for check in predictive_checks(posterior, 1000)) > 0.01


def test_distortion_is_seen(registration):
    """A radial term the similarity does not have shows in the outer residuals."""
    data = registration.likelihood
    offsets = data.source - data.pivot
    bent = data.target + 1e-7 * offsets * (offsets**2).sum(axis=1, keepdims=True)
    found = predictive_checks(sample(registration.given(bent), PLAN), 100)
    assert {c.name: c.tail.value for c in found}["outer residual, outwards (px)"] < 0.02


class FreePivot(GaussianRegistration):
    """With one more parameter, how far the principal point is off in x: the data cannot tell."""

    def weights(self, parameters):
        weights = super().weights(parameters)
        weights[:, 1] -= (weights[:, 0] + 1) * parameters[:, 5]
        return weights

    def start(self):
        centre, spread = super().start()
        return np.append(centre, 0.0), np.append(spread, 0.1)


def test_only_the_principal_point_answers_to_its_prior(registration):
    data = registration.likelihood
    pivot = Parameter("pivot-x", "p_x", "px", Normal(0.0, 1.0, "for a test"))
    model = replace(
        registration,
        parameters=(*registration.parameters, pivot),
        likelihood=FreePivot(data.source, data.target, data.pivot),
    )
    free = sample(model, Plan(5, steps=1000, warmup=200))
    found = {one.name: one for one in sensitivities(free)}
    assert found["pivot-x"].prior > NOTABLE > found["pivot-x"].likelihood
    assert found["scale"].prior < NOTABLE < found["scale"].likelihood
    assert all(one.shape < 0.7 for one in found.values())


def test_errors_of_sensitivities_are_their_scatter(registration):
    """Over independent runs the answers scatter as much as each run says of itself."""
    runs = [
        sensitivities(sample(registration, Plan(seed, steps=300, warmup=80))) for seed in range(8)
    ]
    answers = np.array([[(r.prior, r.likelihood, r.shift) for r in run] for run in runs])
    errors = np.array([[r.errors for r in run] for run in runs])
    ratio = answers.std(axis=0, ddof=1) / np.sqrt(np.square(errors).mean(axis=0))
    # Eight runs know a standard deviation to a quarter; the parameters are not independent.
    assert 0.6 < np.exp(np.log(ratio).mean()) < 1.6
    assert ((ratio > 0.3) & (ratio < 3)).all()


def test_end_of_a_flat_prior_that_cuts_the_posterior_is_named(registration):
    """Power scaling cannot see it: the prior stays flat under any power."""
    noise = registration.likelihood.start()[0][4]
    prior = LogUniform(noise / 10, 1.02 * noise, "cuts the upper tail")
    data = registration.likelihood
    cut = registration_model(data.source, data.target, data.pivot, priors={"noise": prior})
    found = {one.name: one for one in sensitivities(sample(cut, PLAN))}
    assert found["noise"].held_by_end
    assert found["noise"].prior < NOTABLE
    assert not any(one.held_by_end for name, one in found.items() if name != "noise")


@pytest.mark.parametrize(("shift", "scale"), [(0.1, 1.0), (0.0, 1.1)])
def test_distance_is_that_of_the_distribution_functions(shift, scale):
    """Reweighted draws of a Gaussian, against an integral over the exact functions."""
    values = np.sort(np.random.default_rng(1).normal(size=200_000))
    other = stats.norm(shift, scale)
    weights = other.pdf(values) / stats.norm.pdf(values)
    found = _distance(values, weights / weights.sum())
    grid = np.linspace(-7, 7, 20_001)
    exact = []
    for side in (1, -1):
        one, two = stats.norm.cdf(side * grid), other.cdf(grid) if side > 0 else other.sf(grid)
        middle = 0.5 * (one + two)
        parts = one * np.log2(one / middle) + two * np.log2(two / middle)
        reach = np.abs(grid) < 4.4  # as far as the draws go
        exact.append(np.sqrt(parts[reach].sum() / (one + two)[reach].sum()))
    np.testing.assert_allclose(found, max(exact), rtol=0.05)
    assert 0.01 < found < NOTABLE


def test_errors_of_a_range_are_the_scatter_of_its_ends():
    """Of Gaussian predictions, over many sets of them; and they follow the unit."""
    generator = np.random.default_rng(2)
    found = [Range.of(generator.normal(size=400)) for _ in range(400)]
    ends = np.array([(one.low, one.high) for one in found])
    told = np.array([one.errors for one in found])
    # The width of an end's own bracket scatters by a third: its root mean square is what counts.
    np.testing.assert_allclose(ends.std(axis=0), np.sqrt((told**2).mean(axis=0)), rtol=0.15)
    turned = found[0].scaled(-2.0)
    assert turned.low == -2 * found[0].low
    assert turned.errors[0] == 2 * found[0].errors[0]


def test_two_sided_tail():
    draws = np.arange(1, 101) / 100
    assert two_sided(draws, 0.025) == pytest.approx(0.04)
    assert two_sided(draws, 2.0) == 0.0
    assert two_sided(np.ones(5), 1.0) == 1.0
