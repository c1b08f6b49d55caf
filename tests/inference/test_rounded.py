"""Boxes of correlated printed numbers, and digits as a variance, against plainer integrals."""

import numpy as np
import pytest
from scipy import stats

from reproduce.inference.models import by_column, centroid_noise
from reproduce.papers.chen2023.posteriors import COLUMNS
from reproduce.papers.posteriors import posteriors


@pytest.fixture(scope="module")
def table_4():
    return posteriors()["frame-averaging"].model()


@pytest.mark.parametrize("column", range(4))
def test_digits_of_table_4_are_nearly_the_integral_of_the_density(table_4, column):
    """Against SciPy's integral of the same Gaussian over the box, but for a constant."""
    likelihood = by_column(table_4)[column].likelihood
    white, floor = likelihood.start()[0]
    points = np.array([[white, 0.01 * white], [white, floor], [1.03 * white, 2 * floor]])
    printed, half = likelihood.printed[0], likelihood.half_unit
    found = []
    for mean, covariance in zip(*likelihood.distribution(points), strict=True):
        scale = np.sqrt(np.diagonal(covariance[0]))
        share = stats.multivariate_normal.cdf(
            (printed + half - mean[0]) / scale, np.zeros(6), covariance[0] / np.outer(scale, scale),
            lower_limit=(printed - half - mean[0]) / scale,
            maxpts=500_000, abseps=1e-14, releps=1e-3, rng=np.random.default_rng(1),
        )  # fmt: skip
        found.append(np.log(share))
    less = likelihood(points) - found
    assert np.ptp(less) < 0.03
    assert abs(less).max() < 0.1


def test_columns_multiply(table_4):
    """The likelihood of all columns is the product of theirs."""
    points = table_4.start(np.random.default_rng(1), 8)
    parts = by_column(table_4)
    logs = sum(part.log_posterior(points[:, 2 * i : 2 * i + 2]) for i, part in enumerate(parts))
    np.testing.assert_allclose(table_4.log_posterior(points), logs, rtol=1e-13)
    names = [name for part in parts for name in part.names]
    assert names == list(table_4.names) == [f"{c}-{k}" for c in COLUMNS for k in ("white", "floor")]


def test_columns_are_simulated_one_by_one(table_4):
    """White noise and floor of a column shape that column alone."""
    truth = table_4.likelihood.start()[0] * np.array([1, 0, 2, 0, 1, 0, 1, 9])
    data = table_4.simulate(truth, np.random.default_rng(1))
    over = data / table_4.likelihood.printed
    assert np.abs(over[1, 0] / over[0, 0] - 2) < 0.2
    assert over[3, -1] > 1.5 > over[0, -1]


def test_result_is_smooth_where_intervals_change_sides():
    covariance = 0.7 + 0.3 * np.eye(3)
    low, high = np.array([-1.0, -2.0, -0.5]), np.array([2.0, 1.5, 1.0])
    mean = np.linspace(-1, 1, 2001)[:, None] * np.array([1.0, 0.7, 0.4])
    root = np.linalg.cholesky(np.repeat(covariance[None], len(mean), axis=0))
    found = centroid_noise.log_box(mean, root, low, high, centroid_noise.quasi_random(3))
    # Bends of a smooth function are as small as the square of the step.
    assert np.abs(np.diff(found, 2)).max() < 10 * (mean[1, 0] - mean[0, 0]) ** 2


@pytest.mark.parametrize("size", [2, 5])
def test_independent_numbers_multiply(size):
    generator = np.random.default_rng(size)
    scatter, mean = generator.uniform(0.2, 3, size), generator.normal(size=(4, size))
    low = generator.normal(size=size)
    high = low + generator.uniform(0.05, 4, size)
    root = np.repeat(np.diag(scatter)[None], 4, axis=0)
    found = centroid_noise.log_box(mean, root, low, high, centroid_noise.quasi_random(size))
    exact = centroid_noise.log_interval((low - mean) / scatter, (high - mean) / scatter).sum(axis=1)
    np.testing.assert_allclose(found, exact, atol=1e-10)
