"""What posteriors mean for pointing and on the ground, against simulations of the instruments."""

import numpy as np
import pytest

from reproduce.papers.chen2023.posteriors import (
    Averaged,
    OnTheGround,
    StageTest,
)
from reproduce.papers.niu2024.posteriors import NoiseAlone
from reproduce.papers.posteriors import posteriors
from reproduce.physics.attitude import scatter_of_averages
from reproduce.units import ARCSEC_PER_RADIAN

ALTITUDE = 500e3
MODELS = list(posteriors())


@pytest.mark.parametrize("name", MODELS)
def test_every_posterior_has_a_pointing_error(name):
    """In arcsec; and of the satellite's, in metres on the ground."""
    declared = posteriors()[name]
    model = declared.model()
    points = model.start(np.random.default_rng(1), 20)
    found = model.derived(points)
    assert all(quantity.values.shape == (20,) for quantity in found.values())
    assert all(np.isfinite(quantity.values).all() for quantity in found.values())
    units = {quantity.unit for quantity in found.values()}
    assert units >= {"arcsec"} | ({"m"} if declared.paper == "chen2023" else set())


def test_bias_and_noise_of_the_stage_test():
    generator = np.random.default_rng(2)
    noise, bias = 0.08 / ARCSEC_PER_RADIAN, np.array([0.05, -0.03]) / ARCSEC_PER_RADIAN
    consequence = StageTest(ALTITUDE, np.array([1e-4, -3e-5]), 2.0)
    found = consequence(np.array([[2.06, noise, *bias, -4.0]]))
    errors = bias + noise * generator.normal(size=(200_000, 2))
    rms = np.sqrt(np.square(errors).sum(axis=1).mean())
    np.testing.assert_allclose(found["pointing error"].values, rms * ARCSEC_PER_RADIAN, rtol=5e-3)
    np.testing.assert_allclose(found["position error"].values, rms * ALTITUDE, rtol=5e-3)
    length = np.hypot(1e-4, 3e-5)
    wrong = (length / 2.0 - length / 2.06) * ARCSEC_PER_RADIAN
    told = found["last state, nominal focal length"].values
    np.testing.assert_allclose(told, wrong, rtol=1e-6)


def test_errors_of_averages_on_the_ground():
    """Three standard deviations of simulated averages, times the altitude."""
    generator = np.random.default_rng(3)
    parameters = np.array([[2e-6, 3e-6, 1e-6, 0.0]])
    told = Averaged(("a", "b"), (1, 25), ALTITUDE)(parameters)
    series = 1e-6 * generator.normal(size=(2000, 800))
    scatter = np.sqrt(np.mean([scatter_of_averages(one, (1, 25)) ** 2 for one in series], axis=0))
    names = ("b, error of 1 frame", "b, error of 25 frames")
    for name, one in zip(names, 3 * scatter, strict=True):
        np.testing.assert_allclose(told[name].values, one * ARCSEC_PER_RADIAN, rtol=0.02)
        np.testing.assert_allclose(told[f"{name}, position"].values, one * ALTITUDE, rtol=0.02)
    floor = told["a, error of 25 frames"].values / ARCSEC_PER_RADIAN
    np.testing.assert_allclose(floor, 3 * np.hypot(2e-6 / 5, 3e-6))


def test_ground_error_of_a_misalignment():
    angles = np.random.default_rng(4).normal((1e-4, -5e-5, 2e-4), 1e-6, (1000, 3))
    found = OnTheGround(ALTITUDE, 0)(angles)
    off = angles[:, :2] - angles[:, :2].mean(axis=0)
    np.testing.assert_allclose(found["pointing error"].values, np.hypot(*off.T) * ARCSEC_PER_RADIAN)
    np.testing.assert_allclose(found["position error"].values, np.hypot(*off.T) * ALTITUDE)
    ignored = found["position error uncorrected"].values
    np.testing.assert_allclose(ignored.mean(), np.hypot(1e-4, 5e-5) * ALTITUDE, rtol=1e-3)


def test_noise_of_two_images_of_a_star():
    pair = 0.3 * np.random.default_rng(5).normal(size=(2, 100_000, 2))
    rmse = np.sqrt(np.square(pair[0] - pair[1]).sum(axis=1).mean())
    found = NoiseAlone(28.5)(np.array([[0.3]]))
    np.testing.assert_allclose(found["registered star, RMSE"].values, rmse, rtol=5e-3)
    angle = found["registered star, pointing error"].values
    np.testing.assert_allclose(angle, 28.5 * rmse, rtol=5e-3)
