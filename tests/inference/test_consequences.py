"""Consequences of a registration at new stars, and of a misalignment on the ground."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy import stats

from reproduce.papers.chen2023.posteriors import _on_the_ground
from reproduce.units import ARCSEC_PER_RADIAN

ALTITUDE = 500e3
SOURCE = default_rng(3).uniform((0, 0), (2064, 1544), (52, 2))


def test_rmse_at_new_stars_of_a_known_transform_is_a_chi_square(registration):
    """With known noise too: two degrees of freedom per star."""
    likelihood = registration.likelihood
    truth = np.repeat(likelihood.start()[0][None], 4000, axis=0)
    found = likelihood.new_stars(truth, SOURCE, 1.0)
    scaled = np.square(found["test points, RMSE"].values / truth[0, 4]) * len(SOURCE)
    assert stats.kstest(scaled, stats.chi2(2 * len(SOURCE)).cdf).pvalue > 0.001


def test_consequences_at_new_stars_contain_the_error_of_the_transform(registration):
    """The RMSE exceeds the noise of both axes, since stars determine four parameters."""
    draws = registration.exact(6000, default_rng(1))
    data = registration.likelihood
    found = data.new_stars(draws, SOURCE, 28.5)
    rmse = found["test points, RMSE"].values
    expected = np.sqrt(2) * draws[:, 4].mean()
    assert 1 < np.sqrt(np.square(rmse).mean()) / expected < 1.03
    angle = found["test points, pointing error"].values
    assert_allclose(angle / rmse, 28.5)
    again = data.new_stars(draws, SOURCE, 28.5)
    assert (again["test points, RMSE"].values == rmse).all()


def test_ground_error_of_a_misalignment():
    angles = default_rng(4).normal((1e-4, -5e-5, 2e-4), 1e-6, (1000, 3))
    found = _on_the_ground(np.pad(angles, ((0, 0), (3, 0))), ALTITUDE)
    error = np.hypot(*(angles[:, :2] - angles[:, :2].mean(axis=0)).T)
    ignored = found["position error uncorrected"].values.mean()
    for name, unit in (("pointing", ARCSEC_PER_RADIAN), ("position", ALTITUDE)):
        assert_allclose(found[f"{name} error"].values, error * unit)
    assert_allclose(ignored, np.hypot(1e-4, 5e-5) * ALTITUDE, rtol=1e-3)
