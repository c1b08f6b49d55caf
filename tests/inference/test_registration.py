"""The registration models: likelihood, closed form, and errors of the stars."""

import numpy as np
import pandas as pd
import pytest
import xarray
from arviz_stats.base import array_stats
from errors import mcse_deviation, mcse_mean
from scipy import stats
from scipy.optimize import minimize, minimize_scalar

import reproduce as rp
from reproduce.inference import Normal
from reproduce.inference.models import (
    GaussianRegistration,
    distortion_model,
    registration_model,
)
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import MODELS, fit_registration, prepare
from reproduce.store.points import STARS

PIVOT = np.array([1030.0, 770.0])
GENERATOR = np.random.default_rng(3)
SOURCE = GENERATOR.uniform(0, 2000, (30, 2))
# Half of the stars are twenty times as uncertain as the others.
SIGMA = np.where(np.arange(30) % 2, 0.1, 2.0)
NORMAL = GENERATOR.normal(size=(30, 2))
TARGET = 1.0005 * (SOURCE - 1000) + [1001.2, 999.2] + SIGMA[:, None] * NORMAL
FRAME = pd.DataFrame(np.hstack([SOURCE, TARGET]), columns=list(STARS))
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


def point_by_point(likelihood, parameters):
    """Log likelihood from all points, by the normal density of complex residuals."""
    found, centre = [], likelihood.pivot @ [1, 1j]
    offsets, green = (
        likelihood.source @ [1, 1j] - centre,
        likelihood.target @ [1, 1j],
    )
    for k, theta, x, y, noise in parameters:
        residuals = green - k * np.exp(1j * theta) * offsets - centre + x + 1j * y
        parts = residuals.real, residuals.imag
        found.append(sum(stats.norm.logpdf(part, 0, noise).sum() for part in parts))
    return np.array(found)


def test_likelihood_agrees_with_all_points(registration):
    """To far better than the log likelihood varies over the start."""
    points = registration.start(np.random.default_rng(2), 64)
    whole = point_by_point(registration.likelihood, points)
    found = registration.likelihood(points)
    np.testing.assert_allclose(found, whole, rtol=1e-10, atol=1e-7)
    assert np.ptp(whole) > 10


@pytest.mark.parametrize("model", MODELS)
def test_likelihood_of_stars_with_errors_is_the_normal_density(model):
    """SciPy's density of each star, with the weight over its covariance."""
    weights = np.random.default_rng(11).uniform(0.5, 2, 30)
    covariance = np.where(np.arange(30)[:, None, None] % 3, EACH, TILTED)
    data = likelihood(model=model, weights=weights, target_covariance=covariance)
    centre, spread = data.start()
    points = centre + spread * np.random.default_rng(12).normal(size=(4, len(centre)))
    whole = data(points)
    np.testing.assert_allclose(whole, data.pointwise(points).sum(axis=1), rtol=1e-10)
    for point, found in zip(points, whole, strict=True):
        left = TARGET - data.places(point[None])[0]
        each = map(
            stats.multivariate_normal.logpdf,
            left,
            0 * left,
            covariance / weights[:, None, None],
        )
        assert found == pytest.approx(sum(each), rel=1e-10)


def test_errors_of_both_images_give_the_chi_square_of_the_nearest_true_places():
    """The least sum of both images' deviations over the true place of each star, by search."""
    data = likelihood(source_covariance=TILTED, target_covariance=EACH)
    centre, spread = data.start()
    points = centre + 3 * spread * np.random.default_rng(14).normal(size=(2, 4))
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
    fit, found = result.fit, rp.posterior("registration", data, **settings)
    warnings = (one.text for one in result.findings if one.kind != "sensitive")
    assert found.remarks == tuple(warnings)
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
    source = np.random.default_rng(15).uniform(-1, 1, (8, 2))
    target = source + 0.2 * np.random.default_rng(16).normal(size=(8, 2))
    eight = pd.DataFrame(np.hstack([source, target]), columns=list(STARS))
    data, settings = CASES.get(case, (eight, {}))
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
        ("registration-mixture", {"model": "affine"}, "model"),
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
    ):
        with pytest.raises(ValueError, match="exact: "):
            rp.posterior(name, FRAME, **settings).exact(100)
    few = [[0, 0], [1, 0], [0, 1]]
    with pytest.raises(ValueError, match="source: "):
        registration_model(few, few, (0, 0))


def test_simulated_stars_scatter_as_stated():
    data = likelihood(target_covariance=TILTED, weights=np.full(30, 4.0))
    point, generator = data.start()[0], np.random.default_rng(1)
    drawn = np.stack([data.simulate(point, generator) for _ in range(4000)])
    drawn = drawn - data.places(point[None])
    np.testing.assert_allclose(np.cov(drawn.reshape(-1, 2).T), TILTED / 4, atol=0.001)


def test_leaving_a_star_out_agrees_with_its_exact_prediction(tmp_path):
    """The saved log likelihood by ArviZ; exact: the Student-t of a star given all others."""
    pivot = np.array([1000.0, 1000.0])
    target = SOURCE * 1.001 + 0.3 * np.random.default_rng(7).normal(size=SOURCE.shape)
    frame = pd.DataFrame(np.hstack([SOURCE, target]), columns=list(STARS))
    found = rp.posterior("registration", frame, pivot=tuple(pivot))
    tree = xarray.open_datatree(found.save(tmp_path / "p.nc"))
    log = tree["log_likelihood"]["target"].values
    elpd, shape, _ = array_stats.loo(np.moveaxis(log, -1, 0))
    exact = []
    for star in range(30):
        rest, point = np.arange(30) != star, SOURCE[star][None]
        fit = fit_registration(SOURCE[rest], target[rest], pivot)
        freedom = float(fit.degrees_of_freedom)
        noise = fit.chi_square / freedom * np.eye(2)
        spread = fit.prediction_covariance(point)[0] + noise
        law = stats.multivariate_t(fit.transform.apply(point)[0], spread, df=freedom)
        exact.append(law.logpdf(target[star]))
    good = shape < 0.5
    assert good.sum() > 20
    np.testing.assert_allclose(elpd[good], np.array(exact)[good], atol=0.15)
    assert elpd.sum() == pytest.approx(sum(exact), abs=1.0)
    assert found.log_likelihood().shape == (log.size // 30, 30)


def test_distortions_cancel_or_vanish(registration):
    """Equal ones under the identity, and those of zero in any registration."""
    likelihood = distortion_model(registration).likelihood
    back = likelihood.places(np.array([[1.0, 0, 0, 0, 0.1, 3.0, 3.0]]))[0]
    np.testing.assert_allclose(back, likelihood.source, atol=1e-9)
    plain = registration.start(np.random.default_rng(2), 16)
    straight = likelihood(np.column_stack([plain, np.zeros((16, 2))]))
    np.testing.assert_allclose(straight, registration.likelihood(plain), rtol=1e-9)
    bent = likelihood.places(np.array([[1.0, 0, 0, 0, 0.1, 0.0, 3.0]]))[0]
    assert np.hypot(*(bent - likelihood.source).T).max() == pytest.approx(3.0)


def test_an_error_of_the_pivot_moves_the_shift_by_a_small_part():
    """The stars of the book, fitted about a displaced point: by (w - 1) d."""
    data, off = posteriors()["registration"].model().likelihood, 2.0
    plain = data.fit.parameters
    for angle in (0.0, 1.0, 2.5):
        aside = data.pivot + off * np.array([np.cos(angle), np.sin(angle)])
        shift = fit_registration(data.source, data.target, aside).parameters[2:]
        moved = np.hypot(*(shift - plain[2:]))
        expected = off * abs(plain[0] * np.exp(1j * plain[1]) - 1)
        assert moved == pytest.approx(expected, rel=1e-6)
        assert moved < 0.02 * off


def test_the_noise_of_the_book_is_homogeneous():
    """The likeliest growth h of a noise sigma exp(h rho^2) is within two of its errors."""
    data = posteriors()["registration"].model().likelihood
    squares = np.square(data.fit.residuals).sum(axis=1)
    rho = np.square(data.source - data.pivot).sum(axis=1)
    off = (rho - rho.mean()) / rho.max()
    growth = minimize_scalar(lambda h: np.log((squares * np.exp(-2 * h * off)).mean()))
    assert abs(growth.x) < 2 * 0.5 / np.sqrt(off @ off)
