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
    return sample(registration, Plan(11, steps=1000, warmup=300))


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


def test_cost_does_not_grow_with_the_points(registration):
    assert registration.likelihood.root.shape == (3, 3)


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


def test_posterior_is_as_wide_as_the_bound_and_hardly_wider(registration, posterior):
    """The flat priors add nothing: Fisher information by differences, in all five parameters."""
    centre, spread = registration.likelihood.start()
    step = 1e-3 * np.diag(spread)
    data = registration.likelihood
    response = np.stack(
        [
            (data.residuals((centre + s)[None]) - data.residuals((centre - s)[None]))[0]
            / 2
            for s in step[:4]
        ],
        axis=-1,
    ) / (1e-3 * spread[:4])
    information = (response.conj().T @ response).real / centre[4] ** 2
    known = np.sqrt(np.diagonal(np.linalg.inv(information)))
    bound = np.append(known, centre[4] / np.sqrt(4 * len(data.source)))
    np.testing.assert_allclose(posterior.draws.std(axis=0) / bound, 1, atol=0.05)


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
    found = sample(model, Plan(3, steps=1000, warmup=300))
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


def test_residuals_of_both_channels_have_the_stated_covariance(joint):
    """The green noise is shared: simulate, and compare second moments."""
    truth = np.array([0.9, 0.002, 0.3, 0.5, 1.1, -0.001, -0.4, -0.6, 0.05])
    pairs = []
    for seed in range(60):
        data = joint.likelihood.given(
            joint.likelihood.simulate(truth, np.random.default_rng(seed))
        )
        left, right = (w @ data.columns.T for w in data.weights(truth[None]))
        pairs.append(np.stack([left[0].real, right[0].real], axis=-1))
    found = np.cov(np.concatenate(pairs), rowvar=False)
    stated = 0.05**2 * np.array([[1 + 0.81, 1], [1, 1 + 1.21]])
    # About 8,000 pairs: a variance is known to 1.6 per cent.
    np.testing.assert_allclose(found, stated, rtol=0.08)


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


def test_joint_likelihood_is_the_normal_density_star_by_star(joint):
    """Independent: SciPy's bivariate normal per axis, and the Jacobian of blue."""
    point = start_of(joint, 1)
    left, right = (
        w @ joint.likelihood.columns.T for w in joint.likelihood.weights(point)
    )
    k_red, k_blue, noise = point[0, [0, 4, 8]]
    law = stats.multivariate_normal(
        [0, 0], noise**2 * np.array([[1 + k_red**2, 1], [1, 1 + k_blue**2]])
    )
    pairs = np.stack([left[0], right[0]], axis=-1)
    expected = law.logpdf(pairs.real).sum() + law.logpdf(pairs.imag).sum()
    expected += 2 * len(pairs) * np.log(k_blue)
    np.testing.assert_allclose(joint.likelihood(point)[0], expected, rtol=1e-9)


def test_equal_distortions_cancel_under_the_identity(registration):
    """Undistorted and distorted again, every star comes back to its place."""
    model = distortion_model(registration)
    back = model.likelihood.predicted(np.array([[1.0, 0, 0, 0, 0.1, 3.0, 3.0]]))[0]
    np.testing.assert_allclose(back, model.likelihood.offsets, atol=1e-9)


def test_a_variant_reduces_to_the_plain_registration(registration):
    plain = start_of(registration, 16)
    expected = registration.likelihood(plain)
    straight = distortion_model(registration).likelihood(
        np.column_stack([plain, np.zeros((16, 2))])
    )
    np.testing.assert_allclose(straight, expected, rtol=1e-9)


def test_too_few_points_are_refused():
    with pytest.raises(ValueError, match="at least four points"):
        registration_model([[0, 0], [1, 0], [0, 1]], [[0, 0], [1, 0], [0, 1]], (0, 0))


def test_unknown_prior_is_refused(registration):
    with pytest.raises(ValueError, match="names among scale"):
        registration.with_priors({"sale": None})


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5])
def test_a_principal_point_that_is_off_hardly_moves_the_shift(angle):
    """The same stars fitted again about a point so far away, in any direction: by (w - 1) d."""
    data, off = posteriors()["registration"].model().likelihood, 2.0
    pivots = (data.pivot, data.pivot + off * np.array([np.cos(angle), np.sin(angle)]))
    shifts = [
        fit_registration(data.source, data.target, one).parameters[2:] for one in pivots
    ]
    scale, rotation = fit_registration(data.source, data.target, data.pivot).parameters[
        :2
    ]
    moved = np.hypot(*(shifts[1] - shifts[0]))
    np.testing.assert_allclose(
        moved, off * abs(scale * np.exp(1j * rotation) - 1), rtol=1e-6
    )
    assert moved < 0.02 * off


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
