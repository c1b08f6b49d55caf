"""The page on Chandra: photutils agrees with its cells, and noise is as simulated."""

import json
import re

import numpy as np
import pytest
from astropy.table import Table
from astropy.time import Time
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from photutils.psf import GaussianPRF, PSFPhotometry

from page_cells import BOOK, execute
from reproduce.locate import data_folder
from reproduce.physics.images import centre_of_gravity, spot_windows
from reproduce.units import ARCSEC_PER_RADIAN

PAGE = BOOK / "instruments/laser-metrology.md"
FOLDER = data_folder() / "instruments/chandra"
LIGHTS = (0, 1, 2)
RADIUS = 0.7  # standard deviation of the Gaussian that the page fits, in px


@pytest.fixture(scope="module")
def page():
    """Return the variables that the cells of the page define."""
    return execute(PAGE)[1]


def test_sentences_quote_all_numbers_that_the_page_collects(page):
    text = PAGE.read_text(encoding="utf-8")
    assert set(re.findall(r"\{fact}`instruments/laser-metrology#([^`]+)`", text)) == {
        *page["quoted"].index
    }


def test_rows_and_columns_are_those_of_the_window(page):
    """Where the window of the star jumps, the star goes on smoothly."""
    star = page["read_window"](7)
    corners = np.stack([star["IMGCOL0"], star["IMGROW0"]], axis=-1).astype(float)
    steady = star["TIME"] <= page["times"][-1]
    jumped = np.abs(np.diff(corners[steady], axis=0)) == 1
    images = np.array(star["IMGRAW"], dtype=float)
    places = np.diff(centre_of_gravity(images, corners)[steady], axis=0)
    assert jumped.any(axis=0).all()
    # Background pulls a centre towards the middle, by less than half of a jump.
    assert (np.abs(places[jumped]) < 0.5).mean() > 0.95


def test_lights_move_as_photutils_measures(page):
    """Means of ten parts of the series, fitted by least squares with the same Gaussian."""
    for light in LIGHTS:
        images = page["images"][light]
        parts = [one.mean(axis=0) for one in np.array_split(images, 10)]
        model = GaussianPRF(x_fwhm=RADIUS * 2.3548, y_fwhm=RADIUS * 2.3548)
        fit = PSFPhotometry(model, (7, 7), aperture_radius=3)
        start = Table({"x": [3.5], "y": [3.5]})
        places = []
        for part in parts:
            found = fit(
                part - np.sort(images.mean(axis=0), axis=None)[:16].mean(),
                init_params=start,
            )
            places.append([found["x_fit"][0], found["y_fit"][0]])
        ours = [one.mean(axis=0) for one in np.array_split(page["spots"][:, light], 10)]
        moved, expected = (np.array(one) - one[0] for one in (ours, places))
        assert np.abs(moved).max() > 0.02
        # Weights differ, and the light is no Gaussian: a fifth of the drift at most.
        assert_allclose(moved, expected, atol=0.005)


def test_noise_of_a_position_is_that_of_simulated_windows(page):
    for light in LIGHTS:
        gain, noise = page["gain"], page["noise"]
        mean, generator = (
            page["images"][light].mean(axis=0),
            default_rng(light),
        )
        electrons = generator.poisson(mean * gain, (2000, *mean.shape))
        drawn = electrons / gain + noise * generator.standard_normal(electrons.shape)
        places = page["fit_centres"](light, drawn)
        expected = np.sqrt(page["predicted_variance"](light))
        # The scatter of 2000 is known to 1.6 %, here at four standard errors.
        assert_allclose(places.std(axis=0), expected, rtol=0.065)


def test_covariance_of_the_angles_is_that_of_drawn_spots(page):
    platform = page["platform"]
    draws = default_rng(4).standard_normal((4000, 3, 2)) * np.sqrt(page["variance"])
    angles = (
        platform.misalignment(platform.spots + draws, platform.reference)
        * ARCSEC_PER_RADIAN
    )
    expected = page["covariance"]
    spread = np.sqrt(np.diag(expected))
    found = np.cov(angles.T) / np.outer(spread, spread)
    # Four standard errors of variances and correlations of 4000.
    assert_allclose(found, expected / np.outer(spread, spread), atol=0.09)


def test_gain_and_noise_of_simulated_windows_are_found(page):
    generator, light = (
        default_rng(2),
        np.geomspace(20, 7000, 64).reshape(8, 8),
    )
    drawn = generator.poisson(light * 4.0, (3, 600, 8, 8)) / 4.0
    gain, ends, noise = page["fit_gain"](drawn + generator.normal(0, 3.0, drawn.shape))
    assert gain == pytest.approx(4.0, rel=0.05)
    assert noise == pytest.approx(3.0, rel=0.1)
    assert ends[0] < gain < ends[1]


def test_the_response_to_a_true_gaussian_is_correct(page):
    """With another radius of the fit it is not."""
    for radius in [0.7, 0.9]:
        places = np.arange(-0.55, 0.6, 0.1)
        down, along = np.meshgrid(places, places, indexing="ij")
        images = spot_windows(
            3.5 + np.stack([along, down], axis=-1), 1.0, 0.7, (0, 0), 8
        )
        found = page["responses"](images, places, radius)
        assert (np.ptp(found) < 1e-3) == (radius == 0.7)
        assert found.min() < 1.001
        assert found.max() > 0.999


def drift_model(drifts):
    """Return the drift (y, z) of the flight model for the observations, in arcsec."""
    told = json.loads((FOLDER / "aca_drift_model.json").read_text(encoding="utf-8"))
    years, axes = drifts["year"].to_numpy(), []
    for one in (told["dy"], told["dz"]):
        warmth = (1.8 * drifts["temperature"].to_numpy() + 32 - one["offset"]) * one[
            "scale"
        ]
        dates = Time([date for date, _ in one["jumps"]], format="yday").decimalyear
        jumps = (years[:, None] >= dates) @ [size for _, size in one["jumps"]]
        axes.append(warmth + (years - one["year0"]) * one["trend"] + jumps)
    return np.stack(axes, axis=-1)


CORRECTION, OFFSET = (["correction y", "correction z"], ["offset y", "offset z"])


def test_the_correction_is_the_flight_model(page):
    """Two sources of one number, until the first jump that the pointing did not contain yet."""
    drifts = page["drifts"]
    early = (drifts["year"] < 2022.8).to_numpy()
    assert len(early) == 28
    assert early.sum() == 16
    expected = drift_model(drifts)[early]
    assert_allclose(drifts.loc[early, CORRECTION], expected, atol=0.025)


def test_the_measured_drift_has_the_sign_of_the_model(page):
    """With the other sign the residual is larger: jumps entered the model later."""
    drifts = page["drifts"]
    correction, offset = drifts[CORRECTION].to_numpy(), drifts[OFFSET].to_numpy()
    right, wrong = (
        np.sqrt(np.square(correction + sign * offset - drift_model(drifts)).mean())
        for sign in (1, -1)
    )
    assert right < 0.6 * wrong
    measured, _ = page["predict"](drifts)
    assert_array_equal(measured, (correction + offset)[-len(measured) :])


def test_no_year_predicts_itself(page):
    """Other measurements of the last year change no prediction from the years before."""
    true = page["drifts"]
    last = true["year"] >= 2025
    other = true.copy()
    other.loc[last, OFFSET] += 100.0
    measured, before = page["predict"](true)
    changed, after = page["predict"](other)
    for name in before:
        assert_allclose(after[name], before[name])
    kept = (~last[-len(measured) :]).to_numpy()
    assert_array_equal((changed == measured).all(axis=1), kept)
    assert 0 < kept.sum() < len(kept)


def test_a_trend_and_a_temperature_are_predicted(page):
    """A simulated drift of both has no error, and the trend without temperature has one."""
    made = page["drifts"].copy()
    years, temperatures = made["year"] - 2019, made["temperature"]
    drift = 3 + np.outer(years, [-1.5, 0.3]) + np.outer(temperatures, [4, 2])
    made[CORRECTION] = drift
    made[OFFSET] = 0.0
    measured, found = page["predict"](made)
    assert_allclose(found["temperature"], measured, atol=1e-8)
    assert np.abs(found["trend"] - measured).max() > 1
    angle = 2 * np.pi * made["year"].to_numpy()
    made[CORRECTION] = np.outer(years, [-1.5, 0.3]) + np.stack(
        [np.cos(angle), np.sin(2 * angle)], axis=1
    )
    measured, found = page["predict"](made)
    assert_allclose(found["periodic"], measured, atol=1e-8)
