"""Spots of whole images: the noise, the gain, the shape and the memory against the truth."""

import tracemalloc

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.spatial import KDTree

from reproduce.physics.images import find_spots, render_frame, shape_finding

SIDE, ROWS, READ_NOISE = 400, 6, 5.0
TAIL = ((0.0, 0.6), *((step, 0.05) for step in np.linspace(0.5, 4, 8)))
PLAIN = ((0.0, 1.0),)
TRAIL = tuple((step, 1 / 7) for step in np.linspace(-1.5, 1.5, 7))


def stars(seed):
    """Return places and light of stars on a grid with random offsets."""
    rng = default_rng([3, seed])
    steps = (np.arange(ROWS) + 0.5) * SIDE / ROWS
    places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    return places + rng.uniform(-9, 9, places.shape), 10 ** rng.uniform(
        3.8, 5, len(places)
    )


def plain(places, light):
    """Return an image of spots of one shape."""
    return render_frame(places, light, 1.2, (SIDE, SIDE))


def winged(places, light):
    """Return an image of spots with wide wings."""
    return sum(
        part * render_frame(places, light, radius, (SIDE, SIDE))
        for part, radius in ((0.7, 1.0), (0.25, 1.8), (0.05, 4.0))
    )


def exposed(image, rng, slope=0.0):
    """Return digital numbers: photon and read noise on a sky that increases along x."""
    photons = image + 1000 + slope * np.arange(SIDE) / SIDE
    noisy = rng.poisson(photons) + READ_NOISE * rng.standard_normal(image.shape)
    return np.round(noisy + 100)


def pulls(spots, places, light):
    """Return errors of the centres in their standard deviations, and the light."""
    kept = spots.reasons == ""
    apart, which = KDTree(places).query(spots.centre[kept])
    error = spots.centre[kept] - places[which]
    sigma = np.sqrt(np.diagonal(spots.covariance[kept], axis1=1, axis2=2))
    assert apart.max() < 1
    return error / sigma, light[which]


@pytest.mark.parametrize("slope", [0.0, 300.0, 2000.0])
def test_a_slope_of_the_background_is_no_noise(slope):
    all_pulls = []
    for seed in range(5):
        places, light = stars(seed)
        frame = plain(places, light)
        spots = find_spots(exposed(frame, default_rng(seed), slope))
        assert (spots.reasons == "").sum() == len(places)
        noise = np.sqrt(1000 + slope / 2 + READ_NOISE**2)
        assert spots.facts["noise"] == pytest.approx(noise, rel=0.1)
        assert 0.5 < spots.facts["gain"] < 2
        assert spots.findings == ()
        pull, flux = pulls(spots, places, light)
        all_pulls.append(pull[np.argsort(flux)])
    for part in (slice(None, 18), slice(18, None)):
        pull = np.concatenate([one[part] for one in all_pulls])
        error = 4 / np.sqrt(2 * pull.size) + 0.03
        assert pull.std() == pytest.approx(1, abs=error)


def undersampled(places, light):
    """Return an image of spots in a few pixels."""
    return render_frame(places, light, 0.45, (SIDE, SIDE))


def blended(places, light):
    """Return an image in which a fifth of the spots are two stars."""
    both = places, places[::5] + np.array([3.0, 1.0])
    fluxes = light, 0.5 * light[::5]
    return render_frame(np.concatenate(both), np.concatenate(fluxes), 1.2, (SIDE, SIDE))


def few(places, light):
    """Return an image of three spots, which do not determine a common shape."""
    return render_frame(places[:3], light[:3], 0.6, (SIDE, SIDE))


def dead(image):
    """Return an image in which numbers of missing pixels are no NaN."""
    image[::7, ::5] = -32768
    return image


def clipped(image):
    """Return an image whose sky was subtracted before it was stored as whole numbers."""
    return np.maximum(image - 1100, 0)


def coarse(image):
    """Return an image whose noise is smaller than a step."""
    return 60 * np.round(image / 60)


@pytest.mark.parametrize(
    ("image", "stored", "most"),
    [
        (winged, np.round, 2),
        (undersampled, np.round, 2.5),
        (blended, np.round, 2),
        (few, np.round, 2),
        (plain, dead, 2),
        (plain, clipped, 2),
        (plain, coarse, 2),
    ],
)
def test_shapes_and_stored_numbers_are_no_photon_noise(image, stored, most):
    """The gain is the true one, and the centres have the errors that they state."""
    all_pulls = []
    for seed in range(4):
        places, light = stars(seed)
        spots = find_spots(stored(exposed(image(places, light), default_rng(seed))))
        assert 1 / most < spots.facts["gain"] < most
        assert np.mean(spots.reasons == "") > 0.7
        all_pulls.append(pulls(spots, places, light)[0])
    pull = np.concatenate(all_pulls)
    assert pull.std() == pytest.approx(1, abs=4 / np.sqrt(2 * pull.size) + 0.03)


def test_an_image_without_noise_is_measured():
    places = default_rng(5).uniform(9, 119, (20, 2))
    spots = find_spots(render_frame(places, 2e4, 1.2, (128, 128)) + 100)
    apart, _ = KDTree(places).query(spots.centre[spots.reasons == ""])
    assert len(apart) > 5
    assert np.median(apart) < 1e-3
    # Without a sky, the background is the far tail of the spot: 1e-100 and less.
    (alone,) = find_spots(render_frame([[30.3, 20.2]], 2e4, 1.4, (60, 60))).centre
    assert_allclose(alone, (30.3, 20.2), atol=1e-3)


def test_deviations_of_pixels_may_contain_the_photon_noise_of_the_spots():
    all_pulls = []
    for seed in range(4):
        places, light = stars(seed)
        frame = plain(places, light)
        sigma = np.sqrt(frame + 1000 + READ_NOISE**2)
        spots = find_spots(exposed(frame, default_rng(seed)), sigma=sigma)
        assert spots.findings == ()
        all_pulls.append(pulls(spots, places, light)[0])
    # Four standard errors of some 460 pulls, and 3 % of the model.
    assert np.concatenate(all_pulls).std() == pytest.approx(1, abs=0.16)


def test_spots_without_a_centre_have_a_reason():
    """Peaks of the noise."""
    spots = find_spots(exposed(plain(*stars(0)), default_rng(0)), threshold=1)
    lost = np.isnan(spots.centre[:, 0])
    assert lost.sum() > 5
    assert (spots.reasons[lost] != "").all()


def test_spots_are_measured_if_most_are_trailed():
    places, light = stars(0)
    image = sum(
        render_frame(np.add(places, (step, 0)), light / 7, 1.2, (SIDE, SIDE))
        for step in np.linspace(-2.5, 2.5, 7)
    )
    spots = find_spots(exposed(image, default_rng(0)))
    assert set(spots.reasons) == {"", "not the shape of a spot"}
    assert np.abs(pulls(spots, places, light)[0]).max() < 4


def test_errors_do_not_depend_on_the_unit_of_an_image():
    """An image in electrons, or a sum of images, has large numbers."""
    places, light = stars(2)
    frame = exposed(plain(places, light), default_rng(2))
    once = find_spots(frame)
    for unit in (1e-9, 1e9):
        spots = find_spots(unit * frame)
        assert_allclose(spots.covariance, once.covariance, rtol=0.01)
        assert spots.facts["gain"] == pytest.approx(once.facts["gain"] / unit, rel=0.1)


def test_implausible_gains_are_reported():
    places, light = stars(0)
    image = exposed(plain(places, light), default_rng(0))
    for scale in (1 / 65535, 1000):
        (remark,) = find_spots(scale * image).findings
        assert remark.kind == "gain"


def pair(seed, kernel=((0.0, 1.0),), radius=1.2):
    """Return the shapes of two images, the second smeared along x, and its displacement."""
    rng = default_rng([5, seed])
    places, light = stars(seed)
    first = plain(places, light)
    second = sum(
        part * render_frame(np.add(places, (step, 0)), light, radius, first.shape)
        for step, part in kernel
    )
    both = [find_spots(exposed(image, rng)) for image in (first, second)]
    centres = [spots.centre[spots.reasons == ""] for spots in both]
    apart, which = KDTree(centres[1]).query(centres[0])
    moved = np.median((centres[1][which] - centres[0])[apart < 3], axis=0)
    return (both[0].shapes, both[1].shapes, np.eye(2)), moved


def test_equal_shapes_give_no_warning():
    assert not any(shape_finding(*pair(seed)[0])[0] for seed in range(10))


@pytest.mark.parametrize(
    ("kernel", "radius", "high"),
    [(TRAIL, 1.2, 1.1), (TAIL, 1.2, 2.0), (PLAIN, 1.5, 0.01)],
)
def test_trailed_and_defocused_images_are_reported(kernel, radius, high):
    """The stated error covers the displacement of the centres, and is not much larger."""
    shapes, moved = pair(0, kernel, radius)
    (finding,), covariance = shape_finding(*shapes)
    assert finding.kind == "shape"
    error = np.sqrt(np.diag(covariance))
    assert (np.abs(moved) < 2 * error + 0.02).all()
    assert (error < (high, 0.1)).all()


def test_shapes_rotate_with_the_image():
    (source, target, unit), _ = pair(0, TRAIL)
    quarter = np.array([[0.0, -1], [1, 0]])
    rotated = quarter @ target @ quarter.T
    assert shape_finding(target, rotated, unit)[0]
    assert not shape_finding(target, rotated, quarter)[0]
    assert shape_finding(4 * source, source, unit)[0]
    assert not shape_finding(4 * source, source, unit / 2)[0]
    along = shape_finding(source, target, unit)[1]
    across = shape_finding(source, rotated, unit)[1]
    assert_allclose(across, quarter @ along @ quarter.T, atol=0.1)


def test_the_memory_is_at_most_20_bytes_per_pixel():
    places, light = stars(0)
    frame = exposed(plain(places, light), default_rng(0))
    image = np.tile(frame, (4, 4)).astype(np.float32)
    tracemalloc.start()
    found_spots = find_spots(image)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(found_spots.reasons) > 500
    assert peak < 20 * image.size
