"""The registration models: sufficient statistics, closed form, shared noise."""

import numpy as np
import pytest
from errors import mcse_deviation, mcse_mean
from exact import registration_posterior
from scipy import stats
from scipy.optimize import minimize_scalar

from reproduce.inference import LogUniform, Uniform
from reproduce.inference.diagnostics import mcse_quantile
from reproduce.inference.models import (
    distortion_model,
    joint_model,
    registration_model,
)
from reproduce.inference.sampling import Plan, sample
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import fit_registration

PIVOT = np.array([1030.0, 770.0])


@pytest.fixture(scope="module")
def posterior(registration):
    return sample(registration, Plan(11, steps=400, warmup=150))


@pytest.fixture(scope="module")
def exact(registration):
    data = registration.likelihood
    return registration_posterior(data.source, data.target, data.pivot)


@pytest.fixture(scope="module")
def joint(registration):
    data = registration.likelihood
    generator = np.random.default_rng(4)
    blue = data.source + 0.07 * generator.normal(size=data.source.shape)
    return joint_model((data.source, blue), data.target, (PIVOT, PIVOT + 3.0))


def start_of(model, count=64):
    return model.start(np.random.default_rng(2), count)


def point_by_point(likelihood, parameters):
    """Log likelihood from all points, by the normal density of complex residuals."""
    green = likelihood.target @ [1, 1j]
    sources = getattr(likelihood, "sources", None) or [likelihood.source]
    found = []
    for u in parameters:
        residuals = []
        for i, (source, pivot) in enumerate(
            zip(sources, likelihood.pivots, strict=True)
        ):
            k, theta, x, y = u[4 * i : 4 * i + 4]
            centre = pivot @ [1, 1j]
            moved = (
                k * np.exp(1j * theta) * (source @ [1, 1j] - centre)
                + centre
                - x
                - 1j * y
            )
            residuals.append(green - moved)
        scales = u[:8:4] if len(sources) == 2 else np.zeros(1)
        covariance = u[-1] ** 2 * (np.ones((len(sources),) * 2) + np.diag(scales**2))
        law = stats.multivariate_normal(np.zeros(len(sources)), covariance)
        total = sum(
            law.logpdf(np.transpose(part)).sum()
            for part in (np.real(residuals), np.imag(residuals))
        )
        # Given the red points the blue ones are random too, which adds the Jacobian k^2 per star.
        jacobian = 2 * len(green) * np.log(scales[1]) if len(sources) == 2 else 0.0
        found.append(total + jacobian)
    return np.array(found)


def test_sufficient_statistics_agree_with_all_points(registration, joint):
    """To far better than the log likelihood varies over the start."""
    for model in (registration, joint):
        points = start_of(model)
        whole = point_by_point(model.likelihood, points)
        np.testing.assert_allclose(
            model.likelihood(points), whole, rtol=1e-10, atol=1e-7
        )
        assert np.ptp(whole) > 10


def test_sampler_agrees_with_the_closed_form(posterior, exact):
    """Mean, standard deviation, correlation and quantiles, within Monte Carlo errors."""
    draws, parameters = (
        exact.draw(np.random.default_rng(3), 400_000),
        posterior.model.parameters,
    )
    for i, (one, parameter) in enumerate(zip(posterior.rows, parameters, strict=True)):
        chain, direct = posterior.chain[..., i], draws[:, i]
        error = np.hypot(
            one.mcse / parameter.shown, direct.std() / np.sqrt(len(direct))
        )
        assert abs(chain.mean() - direct.mean()) < 4 * error
        assert abs(chain.std() - direct.std()) < 5 * mcse_deviation(chain)
        for probability in (0.025, 0.5, 0.975):
            off = np.quantile(chain, probability) - np.quantile(direct, probability)
            assert abs(off) < 5 * mcse_quantile(chain, probability)
    ours = np.corrcoef(posterior.draws.T)
    assert np.abs(ours - np.corrcoef(draws.T)).max() < 5 / np.sqrt(len(posterior.draws))


def test_flat_in_scale_and_rotation_is_another_prior():
    """Eight noisy stars, where the factor k shows: the sampler against weighted exact draws.

    These are flat in (k cos, k sin), and a weight of 1/k carries them to the prior of the model.
    """
    generator = np.random.default_rng(3)
    source = generator.uniform(-1, 1, (8, 2))
    target = source + 0.3 * generator.normal(size=source.shape)
    priors = {
        "scale": Uniform(1e-3, 9.0, "a test"),
        "rotation": Uniform(-3.1, 3.1, "a test"),
        "noise": LogUniform(1e-3, 9.0, "a test"),
    }
    model = registration_model(source, target, (0, 0)).with_priors(priors)
    draws = registration_posterior(source, target, (0, 0)).draw(generator, 400_000)
    found = sample(model, Plan(3, steps=600, warmup=200))
    inside = np.isfinite(model.log_prior(draws))
    assert inside.mean() > 0.98
    k = draws[inside, 0]
    weights = 1 / k / np.sum(1 / k)
    for power in (1, 2):
        chain = found.chain[..., 0] ** power
        error = np.hypot(mcse_mean(chain), (k**power).std() / np.sqrt(len(k)))
        assert abs(chain.mean() - weights @ k**power) < 4.5 * error
        assert abs(chain.mean() - (k**power).mean()) > 10 * error, (
            "the factor would be missed"
        )


def test_correlation_of_both_channels_is_checked(joint):
    """Half, from the green noise in both; none where green has no noise."""
    truth = np.array([1.0, 0.002, 0.3, 0.5, 1.0, -0.001, -0.4, -0.6, 0.05])
    drawn = [
        joint.likelihood.simulate(truth, np.random.default_rng(seed))
        for seed in range(40)
    ]
    name = "correlation of both residuals"
    shared = [joint.likelihood.checks(data)[name] for data in drawn]
    assert abs(np.mean(shared) - 0.5) < 0.03
    stars = PIVOT + 700 * np.random.default_rng(8).uniform(-1, 1, (137, 2))
    red, blue = stars + 0.07 * np.random.default_rng(9).normal(size=(2, *stars.shape))
    quiet = joint_model((red, blue), stars, (PIVOT, PIVOT))
    assert abs(quiet.likelihood.checks()[name]) < 0.25


def test_too_few_points_are_refused():
    with pytest.raises(ValueError, match="source: "):
        registration_model([[0, 0], [1, 0], [0, 1]], [[0, 0], [1, 0], [0, 1]], (0, 0))


def test_the_noise_of_the_book_is_even_across_the_field():
    """The likeliest growth h of a noise sigma exp(h rho^2) from centre to edge, and its error."""
    data = posteriors()["registration"].model().likelihood
    fit = fit_registration(data.source, data.target, data.pivot)
    squares = np.square(fit.residuals).sum(axis=1)
    rho = np.square(data.source - data.pivot).sum(axis=1)
    off = (rho - rho.mean()) / rho.max()
    growth = minimize_scalar(
        lambda h: np.log((squares * np.exp(-2 * h * off)).mean())
    ).x
    assert abs(growth) < 2 * 0.5 / np.sqrt(off @ off)


def test_distortions_cancel_or_vanish(registration):
    """Equal ones under the identity, and those of zero in any registration."""
    likelihood = distortion_model(registration).likelihood
    back = likelihood.places(np.array([[1.0, 0, 0, 0, 0.1, 3.0, 3.0]]))[0]
    np.testing.assert_allclose(back, likelihood.source, atol=1e-9)
    plain = start_of(registration, 16)
    straight = likelihood(np.column_stack([plain, np.zeros((16, 2))]))
    np.testing.assert_allclose(straight, registration.likelihood(plain), rtol=1e-9)
    bent = likelihood.places(np.array([[1.0, 0, 0, 0, 0.1, 0.0, 3.0]]))[0]
    moved = np.hypot(*(bent - likelihood.source).T)
    assert moved.max() == pytest.approx(3.0)
