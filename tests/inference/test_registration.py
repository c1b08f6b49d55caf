"""The registration models: likelihood, closed form, and errors of the stars."""

import numpy as np
import pytest
from errors import mcse_deviation, mcse_mean
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy import stats
from scipy.optimize import minimize
from simulated import table_of

import reproduce as rp
from reproduce.inference import Normal
from reproduce.inference.models import (
    DistortedRegistration,
    GaussianRegistration,
    fitted_model,
)
from reproduce.physics.registration import MODELS, prepare

GENERATOR = default_rng(3)
SOURCE = GENERATOR.uniform(0, 2000, (30, 2))
# Half of the stars are twenty times as uncertain as the others.
SIGMA = np.where(np.arange(30) % 2, 0.1, 2.0)
NORMAL = GENERATOR.normal(size=(30, 2))
TARGET = 1.0005 * (SOURCE - 1000) + [1001.2, 999.2] + SIGMA[:, None] * NORMAL
FRAME = table_of(SOURCE, TARGET)
TILTED = np.array([[0.3, 0.1], [0.1, 0.2]])
EACH = (SIGMA**2)[:, None, None] * np.eye(2)
CASES = {
    "book": (None, {}),
    "sigma of each axis": (FRAME.assign(sigma_x=SIGMA, sigma_y=1.1 * SIGMA), {}),
    "errors of both images": (
        FRAME,
        {"source_covariance": TILTED / 9, "target_covariance": EACH},
    ),
    "weights and affine": (FRAME.assign(weight=SIGMA**-2), {"model": "affine"}),
    "radial": (FRAME.assign(sigma=SIGMA), {"model": "similarity+radial"}),
}


def likelihood(**settings):
    return GaussianRegistration(prepare(SOURCE, TARGET, (900.0, 1100.0), **settings))


def test_likelihood_agrees_with_all_points(registration):
    """To far better than the log likelihood varies over the start; complex residuals."""
    data = registration.likelihood
    points = registration.start(default_rng(2), 64)
    k, theta, x, y, noise = points.T[..., None]
    pivot, source, target = (
        one @ [1, 1j] for one in (data.pivot, data.source, data.target)
    )
    left = target - k * np.exp(1j * theta) * (source - pivot) - pivot + x + 1j * y
    law = stats.norm(0, noise)
    whole = (law.logpdf(left.real) + law.logpdf(left.imag)).sum(axis=1)
    assert_allclose(data(points), whole, rtol=1e-10, atol=1e-7)
    assert np.ptp(whole) > 10


@pytest.mark.parametrize("model", MODELS)
def test_likelihood_of_stars_with_errors_is_the_normal_density(model):
    """SciPy's density of each star."""
    covariance = np.where(np.arange(30)[:, None, None] % 3, EACH, TILTED)
    data = likelihood(model=model, target_covariance=covariance)
    centre, spread = data.start()
    points = centre + spread * default_rng(12).normal(size=(4, len(centre)))
    whole = data(points)
    assert_allclose(whole, data.pointwise(points).sum(axis=1), rtol=1e-10)
    for point, found in zip(points, whole, strict=True):
        left = TARGET - data.places(point[None], SOURCE)[0]
        each = map(stats.multivariate_normal.logpdf, left, 0 * left, covariance)
        assert found == pytest.approx(sum(each), rel=1e-10)


def test_errors_of_both_images_give_the_chi_square_of_the_nearest_true_places():
    """The least sum of both images' deviations over the true place of each star, by search."""
    data = likelihood(source_covariance=TILTED, target_covariance=EACH)
    centre, spread = data.start()
    points = centre + 3 * spread * default_rng(14).normal(size=(2, 4))
    inverse, squares = np.linalg.inv(TILTED), []
    for point in points:

        def both(place, star, point=point):
            moved = data.places(point[None], place[None])[0, 0]
            off, left = SOURCE[star] - place, TARGET[star] - moved
            return off @ inverse @ off + left @ left / SIGMA[star] ** 2

        fits = [minimize(both, SOURCE[i], (i,), tol=1e-12).fun for i in range(6)]
        squares.append(sum(fits))
    found = -2 * data.pointwise(points)[:, :6].sum(axis=1)
    assert found[0] - found[1] == pytest.approx(squares[0] - squares[1], rel=1e-5)


@pytest.mark.parametrize("case", list(CASES)[1:])
def test_posterior_and_fit_agree(case):
    """In means, standard deviations and warnings, within Monte Carlo errors."""
    data, settings = CASES[case]
    result = rp.register(data, **settings)
    found = rp.posterior("registration", data, steps=280, walkers=80, **settings)
    fit = result.fit
    warnings = (one.text for one in result.findings if one.kind != "sensitive")
    assert [*found.remarks] == [*warnings]
    freedom = float(fit.degrees_of_freedom)
    # With an unknown noise the posterior is a Student-t, which is wider.
    wider = 1.0 if fit.errors_known else np.sqrt(freedom / (freedom - 2))
    assert ("noise" in found.model.names) != fit.errors_known
    errors = wider * fit.standard_errors
    for i, (value, error) in enumerate(zip(fit.parameters, errors, strict=True)):
        chain = found.sampled.chain[..., i]
        assert abs(chain.mean() - value) < 4 * mcse_mean(chain) + 0.02 * error
        assert abs(chain.std() - error) < 5 * mcse_deviation(chain) + 0.01 * error


@pytest.mark.parametrize("case", ["book", "sigma of each axis", "eight"])
def test_emcee_agrees_with_exact_draws(case):
    """Means and standard deviations, within Monte Carlo errors of both."""
    # Noisy stars, for which flat in the scale is not flat in its two parts.
    source = default_rng(15).uniform(-1, 1, (8, 2))
    target = source + 0.2 * default_rng(16).normal(size=(8, 2))
    eight = table_of(source, target), {"steps": 300}
    data, settings = CASES.get(case, eight)
    found = rp.posterior("registration", data, **settings)
    exact = found.exact(100_000, seed=1)
    assert list(exact) == list(found.draws)
    for i, name in enumerate(exact):
        chain = found.sampled.chain[..., i] * found.model.parameters[i].shown
        direct = exact[name].to_numpy()
        error = np.hypot(mcse_mean(chain), direct.std() / np.sqrt(len(direct)))
        assert abs(chain.mean() - direct.mean()) < 4.5 * error
        spread = np.hypot(mcse_deviation(chain), mcse_deviation(direct[None, :, None]))
        assert abs(chain.std() - direct.std()) < 5 * spread


def test_arguments_and_models_that_do_not_fit_are_rejected():
    for name, settings, argument in (
        ("registration-mixture", {"model": "spline"}, "model"),
        ("registration", {"model": "spline"}, "model"),
        ("registration", {"target_covariance": -np.eye(2)}, "target_covariance"),
        ("registration", {"platform": "platform.toml"}, "platform"),
    ):
        with pytest.raises(ValueError, match=f"{argument}: "):
            rp.posterior(name, FRAME, **settings)
    for name, settings in (
        ("registration-mixture", {}),
        ("registration", {"model": "similarity+radial"}),
        ("registration", {"source_covariance": TILTED}),
        ("registration", {"priors": {"scale": (3.0, 4.0)}}),
        ("registration", {"priors": {"scale": Normal(1.0, 0.1, "a test")}}),
        ("registration", {"priors": {"noise": (0.001, 10.0)}}),
    ):
        with pytest.raises(ValueError, match="exact: "):
            rp.posterior(name, FRAME, **settings).exact(100)
    with pytest.raises(ValueError, match="draws: "):
        rp.posterior("registration", FRAME).exact(0)
    few = np.array([[0, 0], [1, 0], [0, 1]])
    with pytest.raises(ValueError, match="source: "):
        fitted_model(GaussianRegistration(prepare(few, few, (0, 0))))


def test_simulated_stars_scatter_as_stated():
    data = likelihood(target_covariance=TILTED)
    point, generator = data.start()[0], default_rng(1)
    drawn = np.stack([data.simulate(point, generator).target for _ in range(4000)])
    drawn = drawn - data.places(point[None], data.source)
    assert_allclose(np.cov(drawn.reshape(-1, 2).T), TILTED, atol=0.004)


def test_distortions_cancel_or_vanish(registration):
    """Equal ones under the identity, and those of zero in any registration."""
    likelihood = DistortedRegistration(registration.likelihood.problem)
    back = likelihood.places(
        np.array([[1.0, 0, 0, 0, 0.1, 3.0, 3.0]]), likelihood.source
    )[0]
    assert_allclose(back, likelihood.source, atol=1e-9)
    plain = registration.start(default_rng(2), 16)
    straight = likelihood(np.column_stack([plain, np.zeros((16, 2))]))
    assert_allclose(straight, registration.likelihood(plain), rtol=1e-9)
    bent = likelihood.places(
        np.array([[1.0, 0, 0, 0, 0.1, 0.0, 3.0]]), likelihood.source
    )[0]
    assert np.hypot(*(bent - likelihood.source).T).max() == pytest.approx(3.0)
