"""The page on 2MASS and lensfun: its cells find known transforms, and other software agrees."""

import re

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from photutils.background import Background2D
from photutils.detection import DAOStarFinder
from scipy.spatial import KDTree
from skimage.transform import SimilarityTransform

from page_cells import BOOK, execute
from reproduce.physics.images import render_frame
from reproduce.physics.registration import Registration, fit_registration

PAGE = BOOK / "instruments/three-detectors.md"
SHAPE = (721, 720)
RADIUS = 0.35  # standard deviation of a simulated star, in px
PAIRS = ("J to H", "H to K", "J to K")


@pytest.fixture(scope="module")
def page():
    """Return the variables that the cells of the page define."""
    return execute(PAGE)[1]


def test_sentences_quote_all_numbers_that_the_page_collects(page):
    text = PAGE.read_text(encoding="utf-8")
    assert set(re.findall(r"\{fact}`instruments/three-detectors#([^`]+)`", text)) == {
        *page["quoted"].index
    }


def simulated(page, seed, truth):
    """Register a simulated field as crowded as the mosaics: `truth` is its transform.

    The stars differ in colour.
    """
    rng = default_rng(seed)
    places = rng.uniform((0, 0), SHAPE, (20_000, 2))
    light = 60 * (1 + rng.pareto(1.2, len(places)).clip(0, 300))
    colour = np.exp(0.3 * rng.standard_normal(len(places)))
    landed = Registration("similarity", truth, page["PIVOT"]).apply(places)
    frames = [
        render_frame(places, light, RADIUS, SHAPE),
        render_frame(landed, light * colour, RADIUS, SHAPE),
    ]
    noisy = [frame + 100 + 3 * rng.standard_normal(frame.shape) for frame in frames]
    return page["register_stars"](*map(page["find_stars"], noisy))


def test_a_crowded_field_has_its_transform_and_the_errors_of_its_blocks(page):
    """A few stars whose brightest pixel is another star in both images are lost.

    Part of the shift is lost with them: the page states it.
    """
    truth = np.array([1 + 2e-5, 1e-5, 0.05, -0.05])
    source, target, fit = simulated(page, 3, truth)
    # As many stars as in the mosaics.
    assert 7000 < (fit.weights > 0).sum() < len(source)
    back = fit.parameters[2:] / truth[2:]
    assert ((back > 0.9) & (back < 1)).all()
    # Four standard deviations: probability 1/8000 for one field of two parameters.
    off = (fit.parameters - truth)[:2] / fit.standard_errors[:2]
    assert np.abs(off).max() < 4
    ratio = page["block_errors"](source, target, fit) / fit.standard_errors
    # Each error of 36 blocks is known to 1/8; three standard errors of four parameters.
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1, abs=3 / np.sqrt(2 * 35 * 4))


def test_other_software_fits_the_same_transforms(page):
    for name in PAIRS:
        source, target = page["kept"][name]
        pivot = page["PIVOT"]
        centred = source - pivot, target - pivot
        fitted = SimilarityTransform.from_estimate(*centred)
        transform = page["registered"][name][2].transform
        assert_allclose(transform.matrix, fitted.params[:2, :2], atol=1e-12)
        assert_allclose(-transform.shift, fitted.translation, atol=1e-9)


def test_centroids_of_photutils_give_the_same_registration(page):
    places = []
    for band in "hk":
        image = page["mosaics"][band]
        sky = Background2D(image, 32, filter_size=3)
        peaks = page["stars"][band].round().astype(int)
        finder = DAOStarFinder(threshold=0, fwhm=1.5, xycoords=peaks)
        found = finder(image - sky.background)
        places.append(np.column_stack([found["x_centroid"], found["y_centroid"]]))
    distance, there = KDTree(places[1]).query(places[0])
    near = distance < 0.5
    pairs = places[0][near], places[1][there[near]]
    theirs = fit_registration(*pairs, page["PIVOT"], robust=True)
    ours = page["fit"]
    joint = np.hypot(theirs.standard_errors, ours.standard_errors)
    assert near.sum() > 1000
    assert np.abs((theirs.parameters - ours.parameters) / joint).max() < 4
    # The centroids of the page are better: the same sky, a smaller scatter.
    scatter = [
        np.median(np.abs(one.residuals[one.weights > 0])) for one in (ours, theirs)
    ]
    assert scatter[0] < 0.8 * scatter[1]


def test_a_wave_is_found(page):
    rng = default_rng(3)
    places, residuals = rng.uniform(0, 720, 4000), 0.05 * rng.standard_normal((4000, 2))
    angle = 2 * np.pi * places / 80
    basis = np.column_stack([np.cos(angle), np.sin(angle)])
    added = basis @ np.array([[0.01, 0.0], [0.0, -0.005]])
    period, waves, probability = page["fit_wave"](places, residuals + added)
    # One over the number of periods in the field, and its error from noise.
    assert period == pytest.approx(80, abs=1)
    error = 4 * 0.05 * np.sqrt(2 / 4000)
    assert_allclose(np.hypot(*waves.T), [0.01, 0.005], atol=error)
    fitted = page["wave_at"](places, period, waves)
    # Half a period over the field of nine.
    assert np.abs(fitted - added).max() < error + 0.01 * np.pi * 720 / 80 * abs(
        1 - period / 80
    )
    assert probability < 1e-6


def test_noise_rarely_has_a_wave(page):
    rng = default_rng(4)
    chances = [
        page["fit_wave"](rng.uniform(0, 720, 300), rng.standard_normal((300, 2)))[2]
        for _ in range(400)
    ]
    assert np.mean(np.array(chances) < 0.1) < 0.1


def test_the_null_test_holds_except_for_one_shift(page):
    """The page states it: scale, rotation and the other shift within their errors."""
    deviations = page["deviations"]
    far = deviations[deviations["distance (σ)"].abs() > 3]
    assert far.index.tolist() == [("H to K", "shift along x")]


def test_a_lens_is_registered_as_its_points_are(page):
    """The scale of a lens is that of a fit to points over the detector."""
    width, height = page["width"], page["height"]
    assert (width, height) == (2064, 1544)
    lenses = page["lenses"]
    row = int(lenses["br"].abs().argmax())
    terms = lenses.iloc[row]
    x, y = np.meshgrid(
        *(np.linspace(-side / 2, side / 2, 25) for side in (width, height))
    )
    green = np.stack([x.ravel(), y.ravel()], axis=-1)
    r = np.hypot(*green.T)[:, None] / (height / 2)
    red = green * (terms["br"] * r**2 + terms["cr"] * r + terms["vr"])
    fit = fit_registration(red, green, (0, 0))
    found = page["lens_scales"](lenses, width, height).iloc[row]
    assert found["red"] == pytest.approx(float(fit.transform.scale) - 1, abs=1e-12)
