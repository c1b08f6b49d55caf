"""One noise model for `register` and the posterior of your stars."""

import numpy as np
import pandas as pd
import pytest
import xarray
from arviz_stats.base import array_stats
from errors import mcse_deviation, mcse_mean
from scipy.optimize import minimize
from scipy.stats import multivariate_normal, multivariate_t

import reproduce as rp
from reproduce.inference import Normal
from reproduce.inference.models import GaussianRegistration
from reproduce.physics.registration import MODELS, fit_registration
from reproduce.store.points import STARS

GENERATOR = np.random.default_rng(3)
SOURCE = GENERATOR.uniform(0, 2000, (30, 2))
# Half of the stars are twenty times as uncertain as the others.
SIGMA = np.where(np.arange(30) % 2, 0.1, 2.0)
TARGET = (
    (SOURCE - 1000) * 1.0005
    + 1000
    + [1.2, -0.8]
    + SIGMA[:, None] * GENERATOR.normal(size=(30, 2))
)
FRAME = pd.DataFrame(np.hstack([SOURCE, TARGET]), columns=list(STARS))
TILTED = np.array([[0.3, 0.1], [0.1, 0.2]])
EACH = (SIGMA**2)[:, None, None] * np.eye(2)


def likelihood(**settings):
    return GaussianRegistration(SOURCE, TARGET, np.array([900.0, 1100.0]), **settings)


CASES = {
    "sigma": (FRAME.assign(sigma=SIGMA), {}),
    "sigma of each axis": (FRAME.assign(sigma_x=SIGMA, sigma_y=1.1 * SIGMA), {}),
    "errors of both images": (
        FRAME,
        {"source_covariance": TILTED / 9, "target_covariance": EACH},
    ),
    "weights and affine": (FRAME.assign(weight=SIGMA**-2), {"model": "affine"}),
    "radial": (FRAME.assign(sigma=SIGMA), {"model": "similarity+radial"}),
}


@pytest.mark.parametrize("case", CASES)
def test_posterior_and_fit_agree(case):
    """In means and standard deviations, within Monte Carlo errors, and in what is doubtful."""
    data, settings = CASES[case]
    fit = rp.register(data, **settings)
    found = rp.posterior("registration", data, **settings)
    warnings = (one.text for one in fit.findings if one.kind != "sensitive")
    assert found.remarks == tuple(warnings)
    freedom = float(fit.fit.degrees_of_freedom)
    # Of an unknown noise the posterior is a Student-t, which is wider.
    wider = 1.0 if fit.fit.errors_known else np.sqrt(freedom / (freedom - 2))
    assert ("noise" in found.model.names) != fit.fit.errors_known
    errors = wider * fit.fit.standard_errors
    for i, (value, error) in enumerate(zip(fit.parameters, errors, strict=True)):
        chain = found.sampled.chain[..., i]
        assert abs(chain.mean() - value) < 4 * mcse_mean(chain) + 0.02 * error
        assert abs(chain.std() - error) < 5 * mcse_deviation(chain) + 0.01 * error


@pytest.mark.parametrize("model", MODELS)
def test_likelihood_is_the_normal_density_star_by_star(model):
    """SciPy's density of each star, with the weight over its covariance."""
    weights = np.random.default_rng(11).uniform(0.5, 2, 30)
    covariance = np.where(np.arange(30)[:, None, None] % 3, EACH, TILTED)
    data = likelihood(model=model, weights=weights, target_covariance=covariance)
    centre, spread = data.start()
    points = centre + spread * np.random.default_rng(12).normal(size=(4, len(centre)))
    np.testing.assert_allclose(
        data(points), data.pointwise(points).sum(axis=1), rtol=1e-10
    )
    for point, found in zip(points, data(points), strict=True):
        left = TARGET - data.places(point[None])[0]
        each = [
            multivariate_normal(np.zeros(2), one / weight).logpdf(off)
            for off, one, weight in zip(left, covariance, weights, strict=True)
        ]
        assert found == pytest.approx(sum(each), rel=1e-10)


def test_errors_of_both_images_give_the_chi_square_of_the_nearest_true_places():
    """The least sum of both images' deviations over the true place of each star, by search."""
    data = likelihood(source_covariance=TILTED, target_covariance=EACH)
    centre, spread = data.start()
    points = centre + 3 * spread * np.random.default_rng(14).normal(size=(2, 4))
    inverse, squares = np.linalg.inv(TILTED), []
    for point in points:
        total = 0.0
        for star in range(6):
            error = np.linalg.inv(EACH[star])

            def both(place, star=star, point=point, error=error):
                moved = data.problem.transformed(point, place[None])[0]
                off, left = SOURCE[star] - place, TARGET[star] - moved
                return off @ inverse @ off + left @ error @ left

            total += minimize(both, SOURCE[star], tol=1e-12).fun
        squares.append(total)
    found = -2 * data.pointwise(points)[:, :6].sum(axis=1)
    assert found[0] - found[1] == pytest.approx(squares[0] - squares[1], rel=1e-5)


def test_simulated_stars_scatter_as_stated():
    data = likelihood(target_covariance=TILTED, weights=np.full(30, 4.0))
    point, generator = data.start()[0], np.random.default_rng(1)
    drawn = np.stack([data.simulate(point, generator) for _ in range(4000)])
    drawn = drawn - data.places(point[None])
    np.testing.assert_allclose(np.cov(drawn.reshape(-1, 2).T), TILTED / 4, atol=0.001)


@pytest.mark.parametrize(
    ("name", "settings", "argument"),
    [
        ("registration-mixture", {"model": "affine"}, "model"),
        ("registration", {"model": "spline"}, "model"),
        ("registration", {"target_covariance": -np.eye(2)}, "target_covariance"),
        ("registration", {"platform": "platform.toml"}, "platform"),
    ],
)
def test_an_argument_of_another_model_is_refused(name, settings, argument):
    with pytest.raises(ValueError, match=f"{argument}: "):
        rp.posterior(name, FRAME, **settings)


@pytest.mark.parametrize(
    "case", ["book", "sigma of each axis", "weights and affine", "eight"]
)
def test_emcee_agrees_with_exact_draws(case):
    """Means, standard deviations and quantiles, within Monte Carlo errors of both."""
    if (
        case == "eight"
    ):  # noisy stars, of which flat in the scale is not flat in its parts
        source = np.random.default_rng(15).uniform(-1, 1, (8, 2))
        rows = np.hstack(
            [source, source + 0.2 * np.random.default_rng(16).normal(size=(8, 2))]
        )
        found = rp.posterior("registration", pd.DataFrame(rows, columns=list(STARS)))
    else:
        data, settings = CASES.get(case, (None, {}))
        found = rp.posterior("registration", data, **settings)
    exact = found.exact(100_000, seed=1).to_numpy()
    assert list(found.exact(10)) == list(found.draws)
    for i, one in enumerate(found.model.parameters):
        chain, direct = found.sampled.chain[..., i] * one.shown, exact[:, i]
        error = np.hypot(mcse_mean(chain), direct.std() / np.sqrt(len(direct)))
        assert abs(chain.mean() - direct.mean()) < 4.5 * error
        spread = np.hypot(mcse_deviation(chain), mcse_deviation(direct[None, :, None]))
        assert abs(chain.std() - direct.std()) < 5 * spread


@pytest.mark.parametrize(
    ("name", "data", "settings"),
    [
        ("registration-mixture", None, {}),
        ("registration", FRAME, {"model": "similarity+radial"}),
        ("registration", FRAME, {"source_covariance": TILTED}),
        ("registration", FRAME, {"priors": {"scale": (3.0, 4.0)}}),
        ("registration", FRAME, {"priors": {"scale": Normal(1.0, 0.1, "a test")}}),
    ],
)
def test_exact_draws_of_other_models_are_refused(name, data, settings):
    with pytest.raises(ValueError, match="exact: expected"):
        rp.posterior(name, data, **settings).exact(100)


def test_leaving_a_star_out_agrees_with_its_exact_prediction(tmp_path):
    """The saved log likelihood by ArviZ; exact: the Student-t of a star given all others."""
    pivot = np.array([1000.0, 1000.0])
    target = SOURCE * 1.001 + 0.3 * np.random.default_rng(7).normal(size=SOURCE.shape)
    frame = pd.DataFrame(np.hstack([SOURCE, target]), columns=list(STARS))
    found = rp.posterior("registration", frame, pivot=tuple(pivot))
    tree = xarray.open_datatree(found.save(tmp_path / "p.nc"))
    log = tree["log_likelihood"]["target"]
    assert log.dims == ("chain", "draw", "star")
    elpd, shape, _ = array_stats.loo(np.moveaxis(log.values, -1, 0))
    exact = []
    for star in range(30):
        rest = np.arange(30) != star
        fit = fit_registration(SOURCE[rest], target[rest], pivot)
        freedom = float(fit.degrees_of_freedom)
        noise = fit.chi_square / freedom * np.eye(2)
        spread = fit.prediction_covariance(SOURCE[star][None])[0] + noise
        place = fit.transform.apply(SOURCE[star][None])[0]
        exact.append(multivariate_t(place, spread, df=freedom).logpdf(target[star]))
    good = shape < 0.5
    assert good.sum() > 20
    np.testing.assert_allclose(elpd[good], np.array(exact)[good], atol=0.15)
    assert elpd.sum() == pytest.approx(sum(exact), abs=1.0)
    assert found.log_likelihood().shape == (log.sizes["chain"] * log.sizes["draw"], 30)
