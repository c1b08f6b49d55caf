"""Spots of whole images: the noise, the gain, the shape and the memory against the truth."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial import KDTree

from reproduce.physics.images import find_spots, render_frame, shape_finding

SIDE, ROWS, READ_NOISE = 400, 6, 5.0
TAIL = ((0.0, 0.6), *((step, 0.05) for step in np.linspace(0.5, 4, 8)))
TRAIL = tuple((step, 1 / 7) for step in np.linspace(-1.5, 1.5, 7))


def stars(seed, rows=ROWS):
    """Return places and light of stars on a grid with random offsets."""
    rng = np.random.default_rng([3, seed])
    steps = (np.arange(rows) + 0.5) * SIDE / rows
    places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    return places + rng.uniform(-9, 9, places.shape), 10 ** rng.uniform(
        3.8, 5, len(places)
    )


def moffat(places, light, width=1.5, beta=2.5):
    """Return an image of spots with wide wings."""
    image = np.zeros((SIDE, SIDE))
    sub = (np.arange(5) - 2) / 5
    y, x = (axis + sub[:, None, None, None] for axis in np.indices((41, 41))[:, None])
    y, x = y, np.moveaxis(x, 0, 1)
    scale = 2.355 * width / 2 / np.sqrt(2 ** (1 / beta) - 1)
    padded = np.pad(image, 40)
    for place, one in zip(places, light, strict=True):
        first = np.round(place).astype(int) - 20
        square = (x - place[0] + first[0]) ** 2 + (y - place[1] + first[1]) ** 2
        spot = (1 + square / scale**2) ** -beta * (beta - 1) / (np.pi * scale**2)
        padded[first[1] + 40 : first[1] + 81, first[0] + 40 : first[0] + 81] += (
            one * spot.mean(axis=(0, 1))
        )
    return padded[40:-40, 40:-40]


def exposed(image, rng, slope=0.0, gain=1.0):
    """Return digital numbers: photon and read noise on a sky that increases along x."""
    photons = image + 1000 + slope * np.arange(SIDE) / SIDE
    noisy = rng.poisson(photons) + READ_NOISE * rng.standard_normal(image.shape)
    return np.round(noisy / gain + 100)


def found(image):
    return find_spots(image)


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
        frame = render_frame(places, light, 1.2, (SIDE, SIDE))
        spots = found(exposed(frame, np.random.default_rng(seed), slope))
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


def test_wings_of_the_spots_are_no_photon_noise():
    """The gain is the true one, and the centres have the errors that they state."""
    all_pulls = []
    for seed in range(4):
        places, light = stars(seed)
        spots = found(exposed(moffat(places, light), np.random.default_rng(seed)))
        assert 0.5 < spots.facts["gain"] < 2
        all_pulls.append(pulls(spots, places, light)[0])
    pull = np.concatenate(all_pulls)
    assert pull.std() == pytest.approx(1, abs=4 / np.sqrt(2 * pull.size) + 0.03)


def test_implausible_gains_are_reported():
    places, light = stars(0)
    image = exposed(
        render_frame(places, light, 1.2, (SIDE, SIDE)), np.random.default_rng(0)
    )
    for scale in (1 / 65535, 1000):
        (remark,) = find_spots(scale * image).findings
        assert remark.kind == "gain"


def pair(seed, kernel=((0.0, 1.0),), radius=1.2):
    """Return the spots of two images, the second smeared along x, and the error of the shift."""
    rng = np.random.default_rng([5, seed])
    places, light = stars(seed)
    first = render_frame(places, light, 1.2, (SIDE, SIDE))
    second = sum(
        part * render_frame(places + np.array([step, 0.3]), light, radius, first.shape)
        for step, part in kernel
    )
    both = [found(exposed(one, rng)) for one in (first, second)]
    kept = [one.centre[one.reasons == ""] for one in both]
    moved = np.array([sum(step * part for step, part in kernel), 0.3])
    apart, which = KDTree(kept[1]).query(kept[0] + moved)
    error = np.median((kept[1][which] - kept[0] - moved)[apart < 2], axis=0)
    return both[0].shapes, both[1].shapes, error


def test_equal_shapes_give_no_warning():
    warned = [shape_finding(*pair(seed)[:2])[0] is not None for seed in range(10)]
    assert sum(warned) == 0


@pytest.mark.parametrize(
    "change", [{"kernel": TRAIL}, {"kernel": TAIL}, {"radius": 1.5}]
)
def test_trailed_and_defocused_images_are_reported(change):
    source, target, error = pair(0, **change)
    finding, covariance = shape_finding(source, target)
    assert finding.kind == "shape"
    # Twice the systematic error, and 0.02 px for the noise of 36 stars.
    assert (np.abs(error) < 2 * np.sqrt(np.diag(covariance)) + 0.02).all()
    assert (
        np.sqrt(np.diag(covariance)) < 0.45
    ).all()  # half the displacement of the tail


def test_shapes_turn_with_the_image():
    source, target, _ = pair(0, TRAIL)
    turn = np.array([[0.0, -1], [1, 0]])
    turned = target @ turn.T
    turned[:, 1:] = turn @ turned[:, 1:]
    assert shape_finding(target, turned)[0] is not None
    assert shape_finding(target, turned, turn)[0] is None
    larger = source * np.array([[2.0], [4], [4]])
    assert shape_finding(larger, source)[0] is not None
    assert shape_finding(larger, source, np.eye(2) / 2)[0] is None


def test_the_memory_is_at_most_20_bytes_per_pixel():
    places, light = stars(0)
    image = exposed(
        render_frame(places, light, 1.2, (SIDE, SIDE)), np.random.default_rng(0)
    )
    image = np.tile(image, (4, 4)).astype(np.float32)
    tracemalloc.start()
    found_spots = find_spots(image)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(found_spots.reasons) > 500
    assert peak < 20 * image.size
