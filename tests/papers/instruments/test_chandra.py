"""Chandra's lights: SciPy and photutils agree, noise is as simulated, no year sees itself."""

from dataclasses import replace

import numpy as np
import pytest
from astropy.table import Table
from photutils.psf import GaussianPRF, PSFPhotometry
from scipy.spatial.transform import Rotation

from reproduce.papers.instruments import chandra
from reproduce.physics.images import centre_of_gravity, spot_windows
from reproduce.store.measured import Windows, windows
from reproduce.units import ARCSEC_PER_RADIAN


def test_angles_are_those_of_scipy():
    seen = chandra.lights()
    before, now = (seen.platform.seen(one) for one in (seen.spots.mean(axis=0), seen.spots[::100]))
    for turned, angles in zip(now, seen.angles[::100], strict=True):
        rotation, _ = Rotation.align_vectors(turned, before)
        expected = rotation.as_rotvec() * ARCSEC_PER_RADIAN
        # Directions of some minutes of arc leave SciPy fewer digits about Z.
        np.testing.assert_allclose(angles, expected, atol=1e-5)


@pytest.mark.parametrize("slot", chandra.LIGHTS)
def test_lights_move_as_photutils_sees_them(slot):
    """Means of ten parts of the series, fitted by least squares with the same spot."""
    images = windows(slot).images
    parts = [one.mean(axis=0) for one in np.array_split(images, 10)]
    model = GaussianPRF(x_fwhm=chandra.RADIUS * 2.3548, y_fwhm=chandra.RADIUS * 2.3548)
    fit = PSFPhotometry(model, (7, 7), aperture_radius=3)
    start = Table({"x": [3.5], "y": [3.5]})
    places = []
    for part in parts:
        found = fit(part - np.sort(images.mean(axis=0), axis=None)[:16].mean(), init_params=start)
        places.append([found["x_fit"][0], found["y_fit"][0]])
    ours = [one.mean(axis=0) for one in np.array_split(chandra.lights().spots[:, slot], 10)]
    moved, expected = (np.array(one) - one[0] for one in (ours, places))
    assert np.abs(moved).max() > 0.02
    # Weights differ, and the spot is no Gaussian: a fifth of the drift at most.
    np.testing.assert_allclose(moved, expected, atol=0.005)


@pytest.mark.parametrize("slot", chandra.LIGHTS)
def test_noise_of_a_place_is_that_of_simulated_windows(slot):
    known, seen = chandra.transfer(), chandra.lights()
    mean, generator = windows(slot).images.mean(axis=0), np.random.default_rng(slot)
    light = generator.poisson(mean * known.gain, (2000, *mean.shape)) / known.gain
    drawn = light + known.noise * generator.standard_normal(light.shape)
    places = chandra._fitted(windows(slot), drawn, chandra.RADIUS)
    expected = np.sqrt(seen.foretold[slot])
    # The scatter of 2000 is known to 1.6 %, here at four standard errors.
    np.testing.assert_allclose(places.std(axis=0), expected, rtol=0.065)


def test_covariance_of_the_angles_is_that_of_drawn_spots():
    seen = chandra.lights()
    variance = seen.foretold
    draws = np.random.default_rng(4).standard_normal((4000, 3, 2)) * np.sqrt(variance)
    spots = seen.platform.spots + draws
    angles = seen.platform.misalignment(spots, seen.platform.reference) * ARCSEC_PER_RADIAN
    expected = seen.covariance(variance)
    spread = np.sqrt(np.diag(expected))
    found = np.cov(angles.T) / np.outer(spread, spread)
    # Four standard errors of variances and correlations of 4000.
    np.testing.assert_allclose(found, expected / np.outer(spread, spread), atol=0.09)


def test_gain_and_noise_of_simulated_windows_are_found(monkeypatch):
    generator, light = np.random.default_rng(2), np.geomspace(20, 7000, 64).reshape(8, 8)

    class Drawn:
        times = np.arange(600)
        images = generator.poisson(light * 4.0, (600, 8, 8)) / 4.0 + generator.normal(
            0, 3.0, (600, 8, 8)
        )

    monkeypatch.setattr(chandra, "windows", lambda slot: Drawn)
    found = chandra.transfer.__wrapped__()
    assert found.gain == pytest.approx(4.0, rel=0.05)
    assert found.noise == pytest.approx(3.0, rel=0.1)
    assert found.ends[0] < found.gain < found.ends[1]


def test_pixels_without_noise_of_their_own_have_a_noise(monkeypatch):
    """Where the line falls below zero in the dark, the root is not that of a negative number."""
    generator, light = np.random.default_rng(3), np.geomspace(20, 7000, 64).reshape(8, 8)
    scatter = np.sqrt(np.maximum(light / 4.0 - 4.0, 0.1))
    images = light + scatter * generator.standard_normal((600, 8, 8))
    seen = Windows(np.arange(600.0), np.zeros((600, 2)), images)
    monkeypatch.setattr(chandra, "windows", lambda slot: seen)
    assert chandra.transfer.__wrapped__().noise == 0


@pytest.mark.parametrize("count", [1, 16, 100])
def test_white_noise_scatters_as_foretold(count):
    series = np.random.default_rng(count).standard_normal((3000, 800))
    sums = np.cumsum(np.pad(series, ((0, 0), (1, 0))), axis=1)
    averages = (sums[:, count:] - sums[:, :-count]) / count
    squares = averages.var(axis=1, ddof=1)
    error = squares.std() / np.sqrt(len(squares)) / squares.mean() / 2
    found = np.sqrt(squares.mean()) / chandra.white_scatter(800, count)
    assert found == pytest.approx(1, abs=4 * error)


def test_rows_and_columns_are_those_of_the_window():
    """Where the window of the star jumps, the star goes on smoothly."""
    star, lights = windows(7), windows(chandra.LIGHTS[0])
    steady = star.times <= lights.times[-1]
    jumped = np.abs(np.diff(star.corners[steady], axis=0)) == 1
    places = np.diff(centre_of_gravity(star.images, star.corners)[steady], axis=0)
    assert jumped.any(axis=0).all()
    # Background pulls a centre towards the middle, by less than half of a jump.
    assert (np.abs(places[jumped]) < 0.5).mean() > 0.95


def test_no_year_foretells_itself(monkeypatch):
    """Other measurements of the last year change nothing that was foretold from those before."""
    true = chandra.aimpoints()
    last = true.years >= 2025
    other = replace(true, left=true.left + 100.0 * last[:, None])
    before = chandra.strategies()
    monkeypatch.setattr(chandra, "aimpoints", lambda: other)
    after = chandra.strategies.__wrapped__()
    for name in before:
        same = np.allclose(before[name], after[name])
        assert same != (name == "measured"), name
    before_last = (true.years >= 2022).sum() - last.sum()
    np.testing.assert_allclose(after["measured"][:before_last], before["measured"][:before_last])


def test_a_trend_and_a_temperature_are_foretold(monkeypatch):
    """A made-up drift that both explain is foretold without error, and by the trend alone not."""
    true = chandra.aimpoints()
    drift = 3 + np.outer(true.years - 2019, [-1.5, 0.3]) + np.outer(true.temperatures, [4, 2])
    made = replace(true, foretold=drift, left=0 * drift)
    monkeypatch.setattr(chandra, "aimpoints", lambda: made)
    found = chandra.strategies.__wrapped__()
    np.testing.assert_allclose(found["temperature"], found["measured"], atol=1e-8)
    assert np.abs(found["trend"] - found["measured"]).max() > 1


@pytest.mark.parametrize("radius", [0.7, 0.9])
def test_a_true_gaussian_is_answered_faithfully(monkeypatch, radius):
    """Of another radius than the fit takes, it is not."""
    places = np.arange(-0.55, 0.6, 0.1)
    down, along = np.meshgrid(places, places, indexing="ij")
    images = spot_windows(3.5 + np.stack([along, down], axis=-1), 1.0, 0.7, (0, 0), 8)
    monkeypatch.setattr(chandra, "star_images", lambda: (images, places))
    low, high = chandra.answers.__wrapped__(radius)
    assert (high - low < 1e-3) == (radius == 0.7)
    assert low < 1.001
    assert high > 0.999
