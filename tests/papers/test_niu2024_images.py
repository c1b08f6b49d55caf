"""Simulated images: spots where the geometry puts them, errors that theory predicts."""

import numpy as np
import pytest

from reproduce.papers.niu2024 import fusion, images, laboratory
from reproduce.physics.centroid_theory import cramer_rao_variance
from reproduce.physics.simulate import channel_centroids
from reproduce.physics.spots import window_corners
from reproduce.printed.given import given
from reproduce.store import studies

DOOR = given(images.READS)
LIKELY = fusion.METHODS.index("maximum likelihood")
DARK = images.SENSOR.noise_electrons()
ETA = images.SENSOR.quantum_efficiency


@pytest.fixture(scope="module")
def stored():
    return studies.read("niu2024-fusion").arrays


@pytest.fixture(scope="module")
def sky():
    generator = np.random.default_rng(4)
    half = 0.95 * np.array(laboratory.half_field(DOOR))
    # On a grid, so that no two spots meet.
    x, y = np.meshgrid(np.linspace(-1, 1, 8), np.linspace(-1, 1, 5))
    angles = np.stack([x.ravel(), y.ravel()], axis=-1) * half
    magnitude, temperature = generator.uniform(2, 5, 40), generator.uniform(3500, 12000, 40)
    return images.frames(DOOR, angles, magnitude, temperature, seed=2)


def spots(place):
    angles = place * np.array(laboratory.half_field(DOOR))
    return channel_centroids(images.cameras(DOOR), laboratory.rotations(DOOR), angles[None])[:, 0]


def photons(magnitude):
    return images.star_photons(DOOR, [magnitude], [fusion.TEMPERATURE])[:, 0]


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
    plain = images.matched_errors(images.extract(images.fused(sky.images), 3), sky.positions[0])
    joined = images.matched_errors(images.extract(images.fused(layers), 3), sky.positions[0])
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
    assert image.max() <= detector.largest_output / detector.gain
    assert np.ptp(image) < 100


def test_green_alone_reaches_the_cramer_rao_bound(stored):
    """Root mean square over both axes, at the middle of the field, within the trials' luck."""
    for j, magnitude in enumerate(fusion.MAGNITUDES):
        offsets = np.random.default_rng(1).uniform(0, 1, (64, 2))
        at = 20 + offsets
        corners = window_corners(at, images.WINDOW)
        light = np.full(64, ETA * photons(magnitude)[0])
        bound = cramer_rao_variance(at, light, images.RADIUS, corners, images.WINDOW, DARK)
        expected = np.sqrt(bound.sum(axis=-1).mean())
        # 480 trials of two axes: 2.3 % by chance; rounding, saturation and few photons add some.
        for place in range(len(fusion.PLACES)):
            found = stored["error"][place, j, 0, LIKELY]
            assert found == pytest.approx(expected, rel=0.12), (place, magnitude)


def test_without_registration_the_centre_lies_between_the_spots(stored):
    """By hand: the mean of the three positions, weighted with their light."""
    for i, place in enumerate(fusion.PLACES):
        where, light = spots(place), photons(4.0)
        expected = np.hypot(*((light[:, None] * where).sum(axis=0) / light.sum() - where[0]))
        found = stored["bias"][i, :, 1, LIKELY]
        np.testing.assert_allclose(found, expected, rtol=0.12)


def test_with_registration_the_gain_is_the_root_of_the_light(stored):
    """Where photon noise rules: the brightest star. Fainter ones follow the same law here."""
    light = photons(4.0)
    expected = np.sqrt(light.sum() / light[0])
    gain = stored["signal_to_noise"][..., 2] / stored["signal_to_noise"][..., 0]
    # Each ratio has the luck of two scatters from 8 times 60 trials: about 5 %.
    assert gain.mean() == pytest.approx(expected, rel=0.05)
    assert (stored["error"][..., 2, LIKELY] < 0.75 * stored["error"][..., 0, LIKELY]).all()
    assert stored["bias"][..., 2, LIKELY].max() < 0.015


def test_the_predicted_error_of_the_colour_is_the_one_found(stored):
    truth, scatter, predicted = np.moveaxis(stored["colour"], -1, 0)
    assert np.ptp(truth, axis=(0, 1)).max() < 1e-12
    # 480 trials: 3 % by chance, four times that allowed.
    np.testing.assert_allclose(scatter, predicted, rtol=0.13)


def test_one_cell_is_recomputed_whole(stored):
    seed = np.random.SeedSequence(fusion.SEED, spawn_key=(2, 3))
    found = fusion._cell(DOOR, fusion.PLACES[2], fusion.MAGNITUDES[3], fusion.TRIALS, seed)
    for name in ("error", "bias", "signal_to_noise", "colour"):
        np.testing.assert_allclose(getattr(found, name), stored[name][2, 3], rtol=0, atol=1e-9)


def test_a_smaller_run_says_the_same(stored):
    """With a tenth of the trials: the same to within its own luck."""
    found = fusion.simulate(DOOR, 6)
    large = stored["error"][..., 1, LIKELY]
    np.testing.assert_allclose(found.error[..., 1, LIKELY], large, rtol=0.1)
    ratio = found.error[..., 2, LIKELY] / stored["error"][..., 2, LIKELY]
    assert ratio.min() > 0.6
    assert ratio.max() < 1.6
    assert np.median(ratio) == pytest.approx(1, abs=0.1)
