"""The registration models: sufficient statistics, closed form, shared noise."""

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize_scalar

from reproduce.inference.models import (
    distortion_model,
    joint_model,
    registration_model,
)
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import fit_registration

PIVOT = np.array([1030.0, 770.0])


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


def test_correlation_of_both_channels_is_checked(joint):
    """Half, from the green noise in both channels."""
    truth = np.array([1.0, 0.002, 0.3, 0.5, 1.0, -0.001, -0.4, -0.6, 0.05])
    drawn = [
        joint.likelihood.simulate(truth, np.random.default_rng(seed))
        for seed in range(40)
    ]
    name = "correlation of both residuals"
    shared = [joint.likelihood.checks(data)[name] for data in drawn]
    assert abs(np.mean(shared) - 0.5) < 0.03


def test_too_few_points_are_refused():
    with pytest.raises(ValueError, match="source: "):
        registration_model([[0, 0], [1, 0], [0, 1]], [[0, 0], [1, 0], [0, 1]], (0, 0))


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


def test_an_error_of_the_pivot_moves_the_shift_by_a_small_part():
    """The stars of the book, fitted about a displaced point: by (w - 1) d."""
    data, off = posteriors()["registration"].model().likelihood, 2.0
    plain = fit_registration(data.source, data.target, data.pivot).parameters
    for angle in (0.0, 1.0, 2.5):
        aside = data.pivot + off * np.array([np.cos(angle), np.sin(angle)])
        shift = fit_registration(data.source, data.target, aside).parameters[2:]
        moved = np.hypot(*(shift - plain[2:]))
        expected = off * abs(plain[0] * np.exp(1j * plain[1]) - 1)
        np.testing.assert_allclose(moved, expected, rtol=1e-6)
        assert moved < 0.02 * off


def test_the_noise_of_the_book_is_homogeneous():
    """The likeliest growth h of a noise sigma exp(h rho^2) is within two of its errors."""
    data = posteriors()["registration"].model().likelihood
    fit = fit_registration(data.source, data.target, data.pivot)
    squares = np.square(fit.residuals).sum(axis=1)
    rho = np.square(data.source - data.pivot).sum(axis=1)
    off = (rho - rho.mean()) / rho.max()
    growth = minimize_scalar(
        lambda h: np.log((squares * np.exp(-2 * h * off)).mean())
    ).x
    assert abs(growth) < 2 * 0.5 / np.sqrt(off @ off)
