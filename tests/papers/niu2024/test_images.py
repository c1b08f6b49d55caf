"""Simulated images: spots where the geometry puts them, errors that theory predicts."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import fusion
from reproduce.papers.catalogue import studies
from reproduce.papers.niu2024 import experiment, images
from reproduce.physics.images import cramer_rao_variance, window_corners
from reproduce.printed.inputs import load_inputs
from reproduce.store.measured import spectra

INPUTS = load_inputs(images.READS)
DARK = images.SENSOR.noise_electrons()
ETA = images.SENSOR.quantum_efficiency


@pytest.fixture(scope="module")
def stored():
    return images._stored().arrays


def spots(place):
    angles = place * np.array(experiment.half_field(INPUTS))
    return images._instrument(INPUTS).imaged(angles[None])[:, 0]


def photons(magnitude, star="solar"):
    return images.light_of(INPUTS, star, magnitude)


def test_a_magnitude_4_star_by_hand():
    """1.005e8 photons/(s m^2 nm) at V = 0; 100 nm, 100 ms, 12.5 mm, 80 %; about flat in green."""
    by_hand = 1.005e8 * 10**-1.6 * 100 * 0.1 * np.pi / 4 * 12.5e-3**2 * 0.8
    assert photons(4.0)[0] == pytest.approx(by_hand, rel=0.03)


def test_light_of_the_tabulated_stars_by_hand():
    """Vega in red by the trapezoid over its table, V = 0.03 of its own; the same optics."""
    wavelength, table = spectra()["vega"]
    inside = (wavelength > 579.9e-9) & (wavelength < 680.1e-9)
    flux = np.trapezoid(table[inside], wavelength[inside])
    by_hand = flux * np.pi / 4 * 12.5e-3**2 * 0.8 * 0.1
    assert photons(0.03, "Vega")[1] == pytest.approx(by_hand, rel=0.02)
    faint, bright = photons(5.0, "Vega"), photons(2.5, "Vega")
    np.testing.assert_allclose(bright / faint, 10.0)


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
            np.testing.assert_allclose(
                found, expected, rtol=0.12, err_msg=f"{star}, {magnitude}"
            )


def test_without_registration_the_centre_lies_between_the_spots(stored):
    """By hand: the mean of the three positions, weighted with their light; it knows the colour."""
    for i, star in enumerate(images.STARS):
        for j, place in enumerate(images.PLACES.values()):
            where, light = spots(place), photons(4.0, star)
            expected = np.hypot(
                *((light[:, None] * where).sum(axis=0) / light.sum() - where[0])
            )
            found = stored["bias"][i, j, :, 1]
            np.testing.assert_allclose(
                found, expected, rtol=0.12, err_msg=f"{star}, {place}"
            )
    corner = stored["bias"][:, -1, :, 1].mean(axis=-1)
    assert (
        corner[list(images.STARS).index("cool")]
        > 1.25 * corner[list(images.STARS).index("hot")]
    )


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


@pytest.mark.parametrize("star", ["solar", "Vega"])
def test_one_cell_is_recomputed_whole(stored, star):
    row = list(images.STARS).index(star)
    seed = np.random.SeedSequence(fusion.SEED, spawn_key=(row, 2, 3))
    light = photons(images.MAGNITUDES[3], star)
    found = images.cell(INPUTS, images.PLACES["corner"], light, fusion.TRIALS, seed)
    for name, array in zip(images.RESULTS, found, strict=True):
        np.testing.assert_allclose(array, stored[name][row, 2, 3], atol=1e-9)


def test_a_run_on_threads_is_the_run_of_every_cell():
    with ThreadPoolExecutor(2) as pool:
        found = fusion.simulate(pool, 6)
    seed = np.random.SeedSequence(fusion.SEED, spawn_key=(1, 2, 3))
    light = photons(images.MAGNITUDES[3])
    cell = images.cell(INPUTS, images.PLACES["corner"], light, 6, seed)
    for name, array in zip(images.RESULTS, cell, strict=True):
        np.testing.assert_array_equal(found[name][1, 2, 3], array)


def test_the_table_shows_the_stored_arrays(stored):
    table = studies()["niu2024/fusion"]()
    assert len(table) == stored["error"].size
    row = table.query("Star == 'Vega' and Place == 'corner'").iloc[-1]
    assert row["Bias (px)"] == stored["bias"][-1, -1, -1, -1]
    assert row["Signal over noise"] == stored["signal_to_noise"][-1, -1, -1, -1]


def test_a_wrong_shift_of_red_costs_its_share_of_the_light():
    """As the book says: half a pixel, times red over all light."""
    shift, light = "niu2024/table-4#translation-x.red", photons(2.0)
    wrong = images.similarities(INPUTS.changed({shift: INPUTS[shift] + 0.5}))
    seed = np.random.SeedSequence(3)
    _, bias, _ = images.cell(INPUTS, 0.95, light, 6, seed, wrong)
    assert bias[2] == pytest.approx(0.5 * light[1] / light.sum(), rel=0.1)
