"""What a registration foretells of stars that it was not fitted to, and what of pointing."""

import numpy as np
import pytest
from exact import registration_posterior
from scipy import stats

from reproduce.inference.models import NewStars, distortion_model
from reproduce.papers.chen2023.posteriors import _OnTheGround
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import Registration, fit_registration
from reproduce.units import ARCSEC_PER_RADIAN

PIVOT = np.array([1030.0, 770.0])
ALTITUDE = 500e3
MODELS = list(posteriors())


@pytest.fixture(scope="module")
def draws(registration):
    """Exact draws of the registration's posterior."""
    data = registration.likelihood
    exact = registration_posterior(data.source, data.target, data.pivot)
    return exact.draw(np.random.default_rng(1), 6000)


def test_rmse_at_new_stars_is_the_chi_square_one(registration, draws):
    """Known transform, known noise: the squared sum is chi square with two degrees per star."""
    source = np.random.default_rng(3).uniform((0, 0), (2064, 1544), (52, 2))
    truth = np.repeat(draws[:1], 4000, axis=0)
    k, theta, *shift = truth[0, :4]
    registered = Registration.similarity(k, theta, shift, PIVOT).apply(source)
    found = NewStars(registration.likelihood, source, registered, 1.0)(truth)[
        "test points, RMSE"
    ].values
    law = stats.chi2(2 * len(source))
    scaled = np.square(found / truth[0, 4]) * len(source)
    assert stats.kstest(scaled, law.cdf).pvalue > 0.001


def test_consequences_at_new_stars_follow_the_noise_and_the_error_of_the_transform(
    registration, draws
):
    data = registration.likelihood
    fit = fit_registration(data.source, data.target, data.pivot)
    source = np.random.default_rng(3).uniform((0, 0), (2064, 1544), (52, 2))
    consequence = NewStars(data, source, fit.transform.apply(source), 28.5)
    found = consequence(draws)
    rmse = found["test points, RMSE"].values
    # Noise of both axes, and a little more: four fitted numbers over so many stars.
    expected = np.sqrt(2) * draws[:, 4].mean()
    assert 1 < np.sqrt(np.square(rmse).mean()) / expected < 1.03
    angle = found["test points, pointing error"].values
    np.testing.assert_allclose(angle / rmse, 28.5)
    assert (consequence(draws)["test points, RMSE"].values == rmse).all()


def test_a_variant_knows_its_places_elsewhere(registration):
    """The edge of the field does not follow the new stars."""
    likelihood = distortion_model(registration).likelihood
    rows = np.append(likelihood.start()[0][:5], (0.6, 0.4))[None]
    some = likelihood.source[:7]
    places = likelihood.places(rows)[0, :7]
    np.testing.assert_array_equal(likelihood.places(rows, some)[0], places)
    plain = registration.likelihood.places(rows[:, :5])[0, :7]
    assert 0.001 < np.abs(places - plain).max() < 2.0


@pytest.mark.parametrize("name", MODELS)
def test_every_posterior_has_a_pointing_error(name):
    """In arcsec; and of the satellite's, in metres on the ground."""
    declared = posteriors()[name]
    model = declared.model()
    points = model.start(np.random.default_rng(1), 20)
    found = model.consequences(points)
    assert all(quantity.values.shape == (20,) for quantity in found.values())
    assert all(np.isfinite(quantity.values).all() for quantity in found.values())
    units = {quantity.unit for quantity in found.values()}
    assert units >= {"arcsec"} | ({"m"} if declared.paper == "chen2023" else set())


def test_ground_error_of_a_misalignment():
    angles = np.random.default_rng(4).normal((1e-4, -5e-5, 2e-4), 1e-6, (1000, 3))
    found = _OnTheGround(ALTITUDE)(np.pad(angles, ((0, 0), (3, 0))))
    off = angles[:, :2] - angles[:, :2].mean(axis=0)
    np.testing.assert_allclose(
        found["pointing error"].values, np.hypot(*off.T) * ARCSEC_PER_RADIAN
    )
    np.testing.assert_allclose(
        found["position error"].values, np.hypot(*off.T) * ALTITUDE
    )
    ignored = found["position error uncorrected"].values
    np.testing.assert_allclose(
        ignored.mean(), np.hypot(1e-4, 5e-5) * ALTITUDE, rtol=1e-3
    )
