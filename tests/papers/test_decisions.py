"""The rules that the posteriors end in, against other ways to the same numbers."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy import stats

from book_facts import of_study
from reproduce.inference.models.bench import _averaging_moments
from reproduce.papers import charts
from reproduce.papers.chen2023 import decisions as camera
from reproduce.papers.chen2023 import published
from reproduce.papers.niu2024 import decisions as sensor
from reproduce.papers.niu2024.posteriors import true_centroids
from reproduce.physics.attitude import scatter_of_averages
from reproduce.physics.registration import fit_registration
from reproduce.printed.inputs import load_inputs
from reproduce.units import ARCSEC_PER_RADIAN

FRAMES = load_inputs(camera._FRAME_INPUTS)
STARS = load_inputs(sensor.INPUTS)


def fact(key, name):
    return of_study(key)[name]


@pytest.fixture(scope="module")
def white_and_floor():
    """Draws of both about X, by weighting draws of the prior with the likelihood of Table IV."""
    generator = default_rng(1)
    white = 0.38 * np.exp(0.12 * (2 * generator.random(60_000) - 1)) / ARCSEC_PER_RADIAN
    floor = generator.uniform(0, 0.1, len(white)) / ARCSEC_PER_RADIAN
    likelihood = published.averaging(FRAMES, "x").likelihood
    logs = likelihood(np.column_stack([white, floor]))
    shares = np.exp(logs - logs.max())
    chosen = generator.choice(len(white), 40_000, p=shares / shares.sum())
    return white[chosen], floor[chosen]


def test_the_law_of_table_4_is_that_of_simulated_series():
    """White noise and a floor that drifts evenly: mean and covariance of all six scatters."""
    generator, counts = default_rng(5), (1, 4, 16, 25, 49, 100)
    drift = np.linspace(-1, 1, 800)
    series = generator.normal(size=(4000, 800)) + 0.1 * drift / drift.std(ddof=1)
    squares = scatter_of_averages(series, counts) ** 2
    white, floor, pairs, bent = _averaging_moments(800, counts)
    assert_allclose(squares.mean(axis=0), white + 0.1**2 * floor, rtol=0.02)
    covariance = 2 * pairs + 4 * 0.1**2 * bent
    assert_allclose(np.cov(squares.T), covariance, rtol=0.15)


def test_the_knee_is_that_of_weighted_draws(white_and_floor):
    white, floor = white_and_floor
    expected = np.quantile((white / floor) ** 2, 0.025)
    assert fact("chen2023/frames", "knee-x") == pytest.approx(expected, rel=0.04)


def test_the_average_of_frames(white_and_floor):
    white, floor = white_and_floor
    expected = np.quantile(np.hypot(white / 10, floor), (0.025, 0.5, 0.975))
    found = camera._averages(FRAMES, "x", np.array([100]))[:, 0]
    assert_allclose(found, expected * ARCSEC_PER_RADIAN, rtol=0.02)


def test_the_error_at_the_edge_is_that_of_simulated_fits():
    noise = 0.05 * np.hypot(1, 0.9976)
    green, red, _ = true_centroids(STARS)
    pivot = sensor.posteriors.pivot(STARS)
    generator = default_rng(4)
    noisy = green + noise * generator.normal(size=(20_000, *green.shape))
    transform = fit_registration(red, noisy, pivot).transform
    edge = np.hypot(*(red - pivot).T).argmax()
    errors = np.hypot(*(transform.apply(red)[:, edge] - green[edge]).T)
    expected = np.quantile(errors, charts.LEVELS)
    found = sensor._edge_errors(STARS, np.array([137.0]))[0, :, 0]
    assert_allclose(found, expected, rtol=0.06)


def test_free_distortions_pay_from_their_number_of_stars_on():
    """A similarity predicts better with few stars, and distortions with many stars."""
    equal = fact("niu2024/stars", "free-from")
    for stars, better in (
        (0.8 * equal, "similarity"),
        (1.25 * equal, "distortions free"),
    ):
        [plain], [free], neglected = sensor._at_edge(STARS, np.array([stars]))
        squares = {
            "similarity": np.trace(plain) + np.sum(neglected**2),
            "distortions free": np.trace(free),
        }
        assert min(squares, key=squares.get) == better


def test_sufficient_numbers_of_stars():
    """By the variance of one axis at the edge, 3 (1 + k^2) noise^2 / n, and the neglected part."""
    neglected = np.hypot(*sensor._at_edge(STARS, np.ones(1))[2])
    plain, free = sensor._sufficient(STARS)
    sigma = np.sqrt(3 * (1 + 0.9976**2) / plain) * 0.05
    below = stats.rice.cdf(0.05, neglected / sigma, scale=sigma)
    assert below == pytest.approx(0.975, abs=0.003)
    assert free == fact("niu2024/stars", "distortions-enough") == 66
    # No number of stars removes the neglected part.
    quiet = STARS.changed({sensor.NOISE: 0.9 * neglected})
    assert np.isinf(sensor._sufficient(quiet)[0])
