"""Tests of fitted centres against another solver that starts from the brightest pixel."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.optimize import minimize, minimize_scalar

from reproduce.physics.images import cramer_rao_variance, fitted_spots, spot_windows
from reproduce.physics.images.spots import _gradient

RADIUS, NOISE = 0.8, 10.0
CENTRAL = float(spot_windows([0.0, 0.0], 1.0, RADIUS, [0, 0], 1)[0, 0])


def scene(kind, size, count):
    """Windows with read noise: faint spots, a neighbour as bright 3 px away, or light missing."""
    generator = default_rng(size)
    middle = np.full(2, size // 2) + generator.uniform(-0.5, 0.5, (count, 2))
    light = generator.uniform(5, 8, count) * NOISE / CENTRAL
    if kind == "too much background taken away":
        light = np.full(count, 1e4)
    windows = spot_windows(middle, light, RADIUS, [0, 0], size)
    if kind == "neighbour":
        angle = generator.uniform(0, 2 * np.pi, count)
        beside = middle + 3 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        windows += spot_windows(beside, light, RADIUS, [0, 0], size)
    noisy = generator.poisson(windows) + NOISE * generator.standard_normal(
        windows.shape
    )
    return noisy - 100.0 if kind == "too much background taken away" else noisy


def model(state, size):
    return spot_windows(state[:2], max(state[2], 0.0), RADIUS, [0, 0], size)


def brightest(window):
    y, x = np.unravel_index(window.argmax(), window.shape)
    return np.array([x, y, window.max() / CENTRAL])


def cost(state, window):
    """Return the negative log-likelihood and its slopes."""
    size = len(window)
    mean = model(state, size) + NOISE**2
    rows = _gradient(state, np.array(RADIUS), size, size)
    slopes = (rows * (1 - (window + NOISE**2) / mean)).sum(axis=(-2, -1))
    slopes[2] /= state[2]  # by the flux instead of its logarithm
    return (mean - (window + NOISE**2) * np.log(mean)).sum(), slopes


def least(window):
    """Return the optimum of SciPy from the brightest pixel."""
    scale = np.array([0.1, 0.1, 10.0])  # so that the first step is a small one

    def scaled(state):
        value, slopes = cost(state * scale, window)
        return value, slopes * scale

    found = minimize(
        scaled, brightest(window) / scale, jac=True, options={"gtol": 1e-7}
    )
    return found.x * scale, found.fun


def brightened(centre, window):
    """Return a centre with the light that the likelihood finds there."""
    found = minimize_scalar(
        lambda light: cost(np.array([*centre, light]), window)[0],
        bounds=(0, 1e5),
        method="bounded",
    )
    return np.array([*centre, found.x])


@pytest.mark.parametrize(
    "kind", ["faint", "neighbour", "too much background taken away"]
)
@pytest.mark.parametrize("size", [5, 9, 11])
def test_no_window_is_fitted_worse_than_from_the_brightest_pixel_by_scipy(kind, size):
    windows = scene(kind, size, 60)
    fit = fitted_spots(windows, [0, 0], RADIUS, read_noise=NOISE).centre
    for row, window in enumerate(windows):
        other, value = least(window)
        if np.isnan(fit[row]).any():
            assert (np.abs(other[:2] - size // 2) > size / 2 + 0.9).any(), other
            continue
        assert cost(brightened(fit[row], window), window)[0] <= value + 1e-9 * abs(
            value
        )
        assert_allclose(fit[row], other[:2], rtol=0, atol=1e-4)
    assert np.isfinite(fit[:, 0]).mean() > 0.98


def test_a_bad_window_is_named_and_spoils_no_other():
    windows = scene("faint", 7, 5)
    alone = fitted_spots(windows, [3, 4], RADIUS).centre
    spoiled = windows.copy()
    spoiled[1], spoiled[2], spoiled[3] = 0.0, -5.0, np.nan
    fit = fitted_spots(spoiled, [3, 4], RADIUS).centre
    assert np.isnan(fit[1:4]).all()
    assert_allclose(fit[[0, 4]], alone[[0, 4]], rtol=0, atol=1e-9)


def test_a_spot_outside_its_window_does_not_count_as_a_fit():
    outside = spot_windows([-3.0, 2.0], 1e4, 1.2, [0, 0], 5)
    assert np.isnan(fitted_spots(outside, [0, 0], 1.2).centre).all()
    window = scene("faint", 7, 1)[0]
    assert np.isfinite(fitted_spots(window, [0, 0], RADIUS).centre).all()


@pytest.mark.parametrize("missing", [np.nan, np.inf])
def test_pixels_that_are_not_finite_do_not_count(missing):
    """A missing column at the edge is as good as a narrower window."""
    windows = scene("faint", 9, 20)
    narrow = fitted_spots(windows[..., 1:], [1, 0], RADIUS, NOISE).centre
    windows[..., 0] = missing
    found = fitted_spots(windows, [0, 0], RADIUS, NOISE).centre
    inside = (found[:, 0] > 1) & (narrow[:, 0] > 1)
    assert inside.sum() > 15
    assert_allclose(found[inside], narrow[inside], rtol=0, atol=1e-6)


def test_errors_of_any_flux_follow_its_root():
    """Squares of the larger flux overflow."""
    dim, bright = (
        fitted_spots(spot_windows([4.2, 4.1], flux, 1.0, [0, 0], 9), (0, 0), 1.0)
        for flux in (1e20, 1e200)
    )
    assert_allclose(bright.centre, [4.2, 4.1])
    assert_allclose(
        1e180 * np.diagonal(bright.covariance), np.diagonal(dim.covariance), rtol=1e-6
    )
    least = cramer_rao_variance([4.2, 4.1], 1e200, 1.0, [0, 0], 9)
    assert_allclose(np.diagonal(bright.covariance), least, rtol=1e-6)


def test_few_narrow_spots_with_missing_pixels_have_no_fit():
    """Full steps or half steps alternate between two places for 0.8 % of them."""
    rng = default_rng(2)
    places = rng.uniform(2, 4, (5000, 2))
    windows = rng.poisson(spot_windows(places, 1000.0, 0.3, [0, 0], 7))
    windows = windows + rng.normal(0, 3, windows.shape)
    windows[rng.random(windows.shape) < 0.2] = np.nan
    fitted = fitted_spots(windows, (0, 0), 0.3, 3.0)
    assert np.isnan(fitted.light).sum() < 30


def test_one_column_of_pixels_does_not_determine_x():
    window = np.where(np.arange(9) == 4, scene("faint", 9, 1)[0], np.nan)
    wide, narrow = fitted_spots(window, [0, 0], RADIUS, NOISE).covariance.diagonal()
    assert wide > 1e6 * narrow
