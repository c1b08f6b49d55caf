"""Simulated images: spots where the geometry puts them, errors that theory predicts."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from reproduce.papers.catalogue import studies
from reproduce.papers.niu2024 import experiment, images
from reproduce.physics.images import cramer_rao_variance, window_corners
from reproduce.physics.optics import channel_centroids
from reproduce.printed.given import given
from reproduce.store.stars import spectra

DOOR = given(images.READS)
LIKELY = images.LIKELY
DARK = images.SENSOR.noise_electrons()
ETA = images.SENSOR.quantum_efficiency


@pytest.fixture(scope="module")
def stored():
    return images.stored().arrays


@pytest.fixture(scope="module")
def sky():
    generator = np.random.default_rng(4)
    half = 0.95 * np.array(experiment.half_field(DOOR))
    # On a grid, so that no two spots meet.
    x, y = np.meshgrid(np.linspace(-1, 1, 8), np.linspace(-1, 1, 5))
    angles = np.stack([x.ravel(), y.ravel()], axis=-1) * half
    magnitude, temperature = generator.uniform(2, 5, 40), generator.uniform(3500, 12000, 40)
    return images.frames(DOOR, angles, magnitude, temperature, seed=2)


def spots(place):
    angles = place * np.array(experiment.half_field(DOOR))
    return channel_centroids(images.cameras(DOOR), experiment.rotations(DOOR), angles[None])[:, 0]


def photons(magnitude, star="solar"):
    return images.light_of(DOOR, star, magnitude)


def test_a_magnitude_4_star_by_hand():
    """1.005e8 photons/(s m^2 nm) at V = 0; 100 nm, 100 ms, 12.5 mm, 80 %; about flat in green."""
    by_hand = 1.005e8 * 10**-1.6 * 100 * 0.1 * np.pi / 4 * 12.5e-3**2 * 0.8
    assert photons(4.0)[0] == pytest.approx(by_hand, rel=0.03)


def test_frames_have_the_printed_size_and_the_light_of_their_stars(sky):
    for image, light in zip(sky.images, sky.photons, strict=True):
        assert image.shape == (1544, 2064)
        noise = np.sqrt(image.size) * DARK + np.sqrt(light.sum())
        assert image.sum() == pytest.approx(ETA * light.sum(), abs=5 * noise)


def test_registration_brings_all_stars_to_green(sky):
    layers = images.register(sky.images, images.similarities(DOOR))
    alone = images.matched_errors(images.extract(sky.images[0], 1), sky.positions[0])
    plain = images.matched_errors(images.extract(np.sum(sky.images, axis=0), 3), sky.positions[0])
    joined = images.matched_errors(images.extract(np.sum(layers, axis=0), 3), sky.positions[0])
    for errors in (alone, plain, joined):
        assert np.isfinite(errors).all()
    size = [float(np.sqrt(np.square(e).sum(axis=1).mean())) for e in (alone, plain, joined)]
    assert size[2] < 0.75 * size[0]
    assert size[1] > 0.5
    # Each moved channel alone lands where it should, the distortion that is left included.
    for layer in layers[1:]:
        errors = images.matched_errors(images.extract(layer, 1), sky.positions[0])
        assert np.abs(np.nanmedian(errors, axis=0)).max() < 0.01


def test_stars_that_are_not_found_are_not_numbers():
    errors = images.matched_errors(np.array([[5.0, 5.0]]), np.array([[5.5, 5.0], [90.0, 5.0]]))
    np.testing.assert_array_equal(np.isnan(errors[:, 0]), [False, True])
    assert np.isnan(images.matched_errors(np.empty((0, 2)), np.zeros((2, 2)))).all()
    assert images.extract(np.zeros((50, 50)), 1).shape == (0, 2)


def test_bright_stars_saturate():
    generator = np.random.default_rng(1)
    image = images.exposed(np.full((50, 50), 1e6), generator)
    detector = images.SENSOR
    assert image.max() <= (2**detector.bits - 1) / detector.gain
    assert np.ptp(image) < 100


def test_stars_are_blackbodies_cool_solar_and_hot_and_tables():
    heats = [value for value in images.STARS.values() if not isinstance(value, str)]
    assert min(heats) < 4000 < 5500 < 6000 < 10000 < max(heats)
    assert sum(isinstance(value, str) for value in images.STARS.values()) == 2
    np.testing.assert_array_equal(
        photons(2.5), images.star_photons(DOOR, [2.5], [images.TEMPERATURE])[:, 0]
    )


def test_light_of_the_tabulated_stars_by_hand():
    """Vega in red by the trapezoid over its table, V = 0.03 of its own; the same optics."""
    wavelength, table = spectra()["vega"]
    inside = (wavelength > 579.9e-9) & (wavelength < 680.1e-9)
    flux = np.trapezoid(table[inside], wavelength[inside])
    by_hand = flux * np.pi / 4 * 12.5e-3**2 * 0.8 * 0.1
    assert photons(0.03, "Vega")[1] == pytest.approx(by_hand, rel=0.02)
    faint, bright = photons(5.0, "Vega"), photons(2.5, "Vega")
    np.testing.assert_allclose(bright / faint, 10.0)


def test_vega_has_the_colours_of_a_blackbody_hotter_than_itself():
    """As the book says; its effective temperature is 9,600 K. The Sun's are near 5,800 K."""
    ratios = [light[1:] / light[0] for light in (photons(0, "Vega"), photons(0, "Sun"))]
    own, hotter, sun = images.star_photons(DOOR, np.zeros(3), [9600, 13000, 5770]).T
    assert ratios[0][0] < (hotter[1] / hotter[0]) < (own[1] / own[0])
    assert ratios[0][1] > (own[2] / own[0])
    np.testing.assert_allclose(ratios[1], sun[1:] / sun[0], rtol=0.04)


def test_green_alone_reaches_the_cramer_rao_bound(stored):
    """Root mean square over both axes, at the middle of the field, within the trials' luck."""
    for i, star in enumerate(images.STARS):
        for j, magnitude in enumerate(images.MAGNITUDES):
            offsets = np.random.default_rng(1).uniform(0, 1, (64, 2))
            at = 20 + offsets
            corners = window_corners(at, images.WINDOW)
            light = np.full(64, ETA * photons(magnitude, star)[0])
            bound = cramer_rao_variance(at, light, images.RADIUS, corners, images.WINDOW, DARK)
            expected = np.sqrt(bound.sum(axis=-1).mean())
            # 480 trials of two axes: 2.3 % by chance; rounding and few photons add some.
            found = stored["error"][i, :, j, 0, LIKELY]
            np.testing.assert_allclose(found, expected, rtol=0.12, err_msg=f"{star}, {magnitude}")


def test_without_registration_the_centre_lies_between_the_spots(stored):
    """By hand: the mean of the three positions, weighted with their light; it knows the colour."""
    for i, star in enumerate(images.STARS):
        for j, place in enumerate(images.PLACES):
            where, light = spots(place), photons(4.0, star)
            expected = np.hypot(*((light[:, None] * where).sum(axis=0) / light.sum() - where[0]))
            found = stored["bias"][i, j, :, 1, LIKELY]
            np.testing.assert_allclose(found, expected, rtol=0.12, err_msg=f"{star}, {place}")
    corner = stored["bias"][:, -1, :, 1, LIKELY].mean(axis=-1)
    assert corner[list(images.STARS).index("cool")] > 1.25 * corner[list(images.STARS).index("hot")]


def test_with_registration_the_gain_is_the_root_of_the_light(stored):
    """Photon noise by hand, for every star; dark pixels take a little of it away."""
    for i, star in enumerate(images.STARS):
        light = photons(4.0, star)
        expected = np.sqrt(light.sum() / light[0])
        gain = stored["signal_to_noise"][i, ..., 2] / stored["signal_to_noise"][i, ..., 0]
        # 18 ratios of two scatters from 480 trials each: 5 % apiece, 1.1 % for their mean.
        assert gain.mean() == pytest.approx(expected, rel=0.05), star
    assert (stored["error"][..., 2, LIKELY] < 0.75 * stored["error"][..., 0, LIKELY]).all()
    assert stored["bias"][..., 2, LIKELY].max() < 0.015


def test_the_predicted_error_of_the_colour_is_the_one_found(stored):
    truth, scatter, predicted = np.moveaxis(stored["colour"], -1, 0)
    assert np.ptp(truth, axis=(1, 2)).max() < 1e-12
    assert np.ptp(truth[:, 0, 0], axis=0).min() > 0.5, "stars differ in colour"
    # 480 trials: 3 % by chance, four times that allowed.
    np.testing.assert_allclose(scatter, predicted, rtol=0.13)


@pytest.mark.parametrize("star", ["solar", "Vega"])
def test_one_cell_is_recomputed_whole(stored, star):
    row = list(images.STARS).index(star)
    seed = np.random.SeedSequence(images.SEED, spawn_key=(row, 2, 3))
    light = photons(images.MAGNITUDES[3], star)
    found = images.cell(DOOR, images.PLACES[2], light, images.TRIALS, seed)
    for name, array in zip(images.RESULTS, found, strict=True):
        np.testing.assert_allclose(array, stored[name][row, 2, 3], atol=1e-9)


def test_a_smaller_run_says_the_same(stored):
    """With a tenth of the trials, on threads: the same to within its own luck."""
    with ThreadPoolExecutor(2) as pool:
        found = images.simulate(6, executor=pool)
    seed = np.random.SeedSequence(images.SEED, spawn_key=(1, 2, 3))
    place, light = images.PLACES[2], photons(images.MAGNITUDES[3])
    cell = images.cell(DOOR, place, light, 6, seed)
    for name, array in zip(images.RESULTS, cell, strict=True):
        np.testing.assert_array_equal(found[name][1, 2, 3], array)
    large = stored["error"][..., 1, LIKELY]
    np.testing.assert_allclose(found["error"][..., 1, LIKELY], large, rtol=0.1)
    ratio = found["error"][..., 2, LIKELY] / stored["error"][..., 2, LIKELY]
    assert ratio.min() > 0.6
    assert ratio.max() < 1.6
    assert np.median(ratio) == pytest.approx(1, abs=0.1)


def test_the_tables_have_a_row_for_every_star():
    stars, magnitudes = len(images.STARS), len(images.MAGNITUDES)
    centroids, colours = studies()["niu2024/fusion"](), studies()["niu2024/star-colours"]()
    assert len(centroids) == stars * len(images.PLACES) * magnitudes * 3
    assert len(colours) == stars * magnitudes
    names = [images.named(star) for star in images.STARS]
    assert list(centroids["Star"].unique()) == list(colours["Star"].unique()) == names
    row = centroids.query("Star.str.startswith('Vega') and Place == 'corner'").iloc[-1]
    stored = images.stored().arrays
    assert row["Bias, maximum likelihood (px)"] == stored["bias"][-1, -1, -1, -1, LIKELY]
    assert row["Signal over noise"] == stored["signal_to_noise"][-1, -1, -1, -1]
