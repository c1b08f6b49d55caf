"""Simulated images: spots where the geometry puts them, errors that theory predicts."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fusion
from reproduce.papers.declare import study
from reproduce.papers.niu2024 import experiment, images
from reproduce.physics.images import cramer_rao_variance, window_corners
from reproduce.physics.optics import channel_centroids
from reproduce.printed.inputs import load_inputs
from reproduce.store.measured import spectra

INPUTS = load_inputs(images.INPUTS)
DARK = images.SENSOR.noise_electrons()
ETA = images.SENSOR.quantum_efficiency


@pytest.fixture(scope="module")
def stored():
    arrays, _ = images._stored()
    return arrays


def spots(place):
    angles = place * np.array(experiment.half_field(INPUTS))
    return channel_centroids(images._instrument(INPUTS), angles[None])[:, 0]


def photons(magnitude, star="solar"):
    return images.photons_from(INPUTS, star, magnitude)


def test_a_magnitude_4_star_by_hand():
    """1.005e8 photons/(s m^2 nm) at V = 0; 100 nm, 100 ms, 12.5 mm, 80 %; about flat in green."""
    by_hand = 1.005e8 * 10**-1.6 * 100 * 0.1 * np.pi / 4 * 12.5e-3**2 * 0.8
    assert photons(4.0)[0] == pytest.approx(by_hand, rel=0.03)


def test_light_of_the_tabulated_stars_by_hand():
    """Integrate the spectrum of Vega over red by the trapezoid rule, with V = 0.03."""
    wavelength, table = spectra()["vega"]
    inside = (wavelength > 579.9e-9) & (wavelength < 680.1e-9)
    flux = np.trapezoid(table[inside], wavelength[inside])
    by_hand = flux * np.pi / 4 * 12.5e-3**2 * 0.8 * 0.1
    assert photons(0.03, "Vega")[1] == pytest.approx(by_hand, rel=0.02)
    faint, bright = photons(5.0, "Vega"), photons(2.5, "Vega")
    assert_allclose(bright / faint, 10.0)


def test_green_alone_reaches_the_cramer_rao_bound(stored):
    """Root mean square over both axes, at the middle of the field, within the trials' luck."""
    for i, star in enumerate(images.STARS):
        for j, magnitude in enumerate(images.MAGNITUDES):
            offsets = np.random.default_rng(1).uniform(0, 1, (64, 2))
            at = 20 + offsets
            corners = window_corners(at, images._WINDOW_PIXELS)
            light = np.full(64, ETA * photons(magnitude, star)[0])
            bound = cramer_rao_variance(
                at, light, images.RADIUS, corners, images._WINDOW_PIXELS, DARK
            )
            expected = np.sqrt(bound.sum(axis=-1).mean())
            # 480 trials of two axes: 2.3 % by chance; rounding and few photons add some.
            found = stored["error"][i, :, j, 0]
            assert_allclose(found, expected, rtol=0.12, err_msg=f"{star}, {magnitude}")


def test_without_registration_the_centre_lies_between_the_spots(stored):
    """By hand: the mean of the three positions, weighted with their flux, depends on the colour."""
    corner = {}
    for i, star in enumerate(images.STARS):
        flux = photons(4.0, star)
        for j, place in enumerate(images.PLACES.values()):
            positions = spots(place)
            expected = np.hypot(*(flux @ positions / flux.sum() - positions[0]))
            found = stored["bias"][i, j, :, 1]
            assert_allclose(found, expected, rtol=0.12)
        corner[star] = found.mean()
    assert corner["cool"] > 1.25 * corner["hot"]


def test_with_registration_the_gain_is_the_root_of_the_light(stored):
    """Photon noise by hand, for every star; dark pixels take a little of it away."""
    for i, star in enumerate(images.STARS):
        light = photons(4.0, star)
        expected = np.sqrt(light.sum() / light[0])
        gain = (
            stored["signal_to_noise"][i, ..., 2] / stored["signal_to_noise"][i, ..., 0]
        )
        # 18 ratios of two scatters from 480 trials each: 5 % apiece, 1.1 % for their mean.
        assert gain.mean() == pytest.approx(expected, rel=0.05), star
    assert (stored["error"][..., 2] < 0.75 * stored["error"][..., 0]).all()
    assert stored["bias"][..., 2].max() < 0.015


def test_two_cells_are_recomputed(stored):
    for star in ("solar", "Vega"):
        place = (list(images.STARS).index(star), 2, 3)
        seed = np.random.SeedSequence(fusion.SEED, spawn_key=place)
        arrays = images.compare_images(
            INPUTS, 0.95, photons(4.0, star), fusion.TRIALS, seed
        )
        for name, array in zip(images.RESULTS, arrays, strict=True):
            assert_allclose(array, stored[name][place], atol=1e-9)


def test_the_table_shows_the_stored_arrays(stored):
    table = study("niu2024/fusion")(load_inputs(()))
    assert len(table) == stored["error"].size
    last = [stored[name].flat[-1] for name in images.RESULTS]
    assert table.iloc[-1, -3:].tolist() == last


def test_a_wrong_shift_of_red_costs_its_share_of_the_light():
    """The error is half a pixel, times the fraction of red photons."""
    shift, light = "niu2024/table-4#translation-x.red", photons(2.0)
    wrong = images.similarities(INPUTS.changed({shift: INPUTS[shift] + 0.5}))
    seed = np.random.SeedSequence(3)
    _, bias, _ = images.compare_images(INPUTS, 0.95, light, 6, seed, wrong)
    assert bias[2] == pytest.approx(0.5 * light[1] / light.sum(), rel=0.1)
