"""Colour against colour: known transforms are found again, and other software agrees."""

import itertools

import cv2
import numpy as np
import pytest
from photutils.background import Background2D
from photutils.detection import DAOStarFinder
from scipy.ndimage import gaussian_filter
from scipy.spatial import KDTree
from skimage.registration import phase_cross_correlation
from skimage.transform import SimilarityTransform

from reproduce.papers.catalogue import studies
from reproduce.papers.instruments import colours
from reproduce.physics.images import render_frame
from reproduce.physics.registration import Registration, fit_registration
from reproduce.printed.given import given
from reproduce.store.measured import lenses, mosaic

SHAPE = (721, 720)
NULL = np.array([1.0, 0.0, 0.0, 0.0])


def field(seed, truth):
    """Return two images as crowded as the mosaics: `truth` lies between, stars differ in colour."""
    rng = np.random.default_rng(seed)
    places = rng.uniform((0, 0), SHAPE, (20_000, 2))
    light = 60 * (1 + rng.pareto(1.2, len(places)).clip(0, 300))
    colour = np.exp(0.3 * rng.standard_normal(len(places)))
    landed = Registration("similarity", truth, colours.PIVOT).apply(places)
    frames = [
        render_frame(places, light, colours.RADIUS, SHAPE),
        render_frame(landed, light * colour, colours.RADIUS, SHAPE),
    ]
    return [frame + 100 + 3 * rng.standard_normal(frame.shape) for frame in frames]


@pytest.fixture
def simulated(monkeypatch):
    """Return pairs of a simulated field in place of those of a mosaic."""

    def make(seed, truth):
        frames = dict(zip("jh", field(seed, truth), strict=True))
        monkeypatch.setattr(colours, "mosaic", frames.__getitem__)
        monkeypatch.setattr(colours, "stars", colours.stars.__wrapped__)
        return colours.pairs.__wrapped__("jh")

    return make


@pytest.mark.parametrize("seed", [1, 2])
def test_crowded_fields_that_are_registered_pass_the_null_test(simulated, seed):
    found = simulated(seed, NULL)
    # As many stars as in the mosaics.
    assert 7000 < found.kept.sum() < len(found.source)
    # Four standard deviations: once in four thousand fields of four parameters.
    assert np.abs((found.fit.parameters - NULL) / found.fit.standard_errors).max() < 4
    ratio = colours._blocks(found) / found.fit.standard_errors
    # Of 36 blocks an error of one of four parameters is known to an eighth; three of all of them.
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1, abs=3 / np.sqrt(2 * 35 * 4))


def test_crowded_fields_give_back_most_of_a_shift(simulated):
    """A few stars whose brightest pixel is another one in both images are lost, and with them some
    of the shift: the page says how much.
    """
    truth = np.array([1 + 2e-5, 1e-5, 0.05, -0.05])
    found = simulated(3, truth).fit
    back = found.parameters[2:] / truth[2:]
    assert ((back > 0.9) & (back < 1)).all()
    off = (found.parameters - truth)[:2] / found.standard_errors[:2]
    assert np.abs(off).max() < 4


@pytest.mark.parametrize("name", colours.PAIRS)
def test_other_software_fits_the_same_transforms(name):
    found = colours.pairs(name)
    source, target = found.source[found.kept], found.target[found.kept]
    centred = source - colours.PIVOT, target - colours.PIVOT
    fitted = SimilarityTransform.from_estimate(*centred)
    matrix = found.again().transform.matrix
    np.testing.assert_allclose(matrix, fitted.params[:2, :2], atol=1e-12)
    np.testing.assert_allclose(-found.again().transform.shift, fitted.translation, atol=1e-9)
    design = np.column_stack([centred[0], np.ones(len(source))])
    solved = np.linalg.lstsq(design, centred[1], rcond=None)[0]
    np.testing.assert_allclose(found.again("affine").transform.matrix, solved[:2].T, atol=1e-11)


@pytest.mark.parametrize("name", colours.PAIRS)
def test_a_robust_fit_of_other_software_agrees_within_the_errors(name):
    """OpenCV draws random pairs, and keeps what lies within a distance."""
    found = colours.pairs(name)
    cv2.setRNGSeed(1)
    matrix, _ = cv2.estimateAffinePartial2D(
        found.source - colours.PIVOT, found.target - colours.PIVOT, ransacReprojThreshold=0.3
    )
    off = found.fit.parameters - [matrix[0, 0], matrix[1, 0], -matrix[0, 2], -matrix[1, 2]]
    assert np.abs(off / found.fit.standard_errors).max() < 3


def test_the_librarys_centroids_find_the_same_registration():
    places = []
    for band in "hk":
        sky = Background2D(mosaic(band), 32, filter_size=3)
        peaks = colours.stars(band).round().astype(int)
        finder = DAOStarFinder(threshold=0, fwhm=1.5, xycoords=peaks)
        found = finder(mosaic(band) - sky.background)
        places.append(np.column_stack([found["x_centroid"], found["y_centroid"]]))
    distance, there = KDTree(places[1]).query(places[0])
    near = distance < 0.5
    theirs = fit_registration(places[0][near], places[1][there[near]], colours.PIVOT, robust=True)
    ours = colours.pairs("hk").fit
    joint = np.hypot(theirs.standard_errors, ours.standard_errors)
    assert near.sum() > 1000
    assert np.abs((theirs.parameters - ours.parameters) / joint).max() < 4
    # Ours are the better ones: the same sky, a smaller scatter.
    scatter = [np.median(np.abs(one.residuals[one.weights > 0])) for one in (ours, theirs)]
    assert scatter[0] < 0.8 * scatter[1]


def _correlated(one, other):
    """Return how far an image must be moved to lie on another, x before y."""
    return phase_cross_correlation(one, other, upsample_factor=500, normalization=None)[0][::-1]


def test_correlated_images_are_shifted_alike_without_any_star_being_found():
    """Each block of two mosaics, the sky and the brightest taken away, is correlated."""
    flat = {}
    for band in "hk":
        image = np.log(mosaic(band) - 0.9 * mosaic(band).min())
        image = image - gaussian_filter(image, 3)
        flat[band] = np.clip(image, *(3 * image.std() * np.array([-1, 1])))
    sides = [slice(start, start + 90) for start in range(0, 720, 90)]
    blocks = list(itertools.product(sides, sides))
    shifts = np.array([_correlated(flat["h"][block], flat["k"][block]) for block in blocks])
    mean, error = shifts.mean(axis=0), shifts.std(axis=0) / np.sqrt(len(shifts))
    assert mean[0] > 3 * error[0]
    # Whole pixels draw a correlation towards no shift: it finds less, never more.
    shift = colours.pairs("hk").fit.parameters[2]
    assert 0 < mean[0] < shift + 3 * colours.pairs("hk").fit.standard_errors[2]


def test_a_wave_is_found_where_there_is_one():
    rng = np.random.default_rng(3)
    places, residuals = rng.uniform(0, 720, 4000), 0.05 * rng.standard_normal((4000, 2))
    waves = np.stack([np.cos(2 * np.pi * places / 80), np.sin(2 * np.pi * places / 80)], axis=-1)
    found = colours.wave(places, residuals + waves * [0.01, -0.005])
    # One over the field's number of turns, and the share of it that noise leaves open.
    assert found.period == pytest.approx(80, abs=1)
    np.testing.assert_allclose(found.amplitude, [0.01, 0.005], atol=4 * 0.05 * np.sqrt(2 / 4000))
    assert found.chance < 1e-6


def test_noise_alone_rarely_has_a_wave():
    rng = np.random.default_rng(4)
    chances = [
        colours.wave(rng.uniform(0, 720, 300), rng.standard_normal((300, 2))).chance
        for _ in range(400)
    ]
    assert np.mean(np.array(chances) < 0.1) < 0.1


def test_the_null_test_holds_but_for_one_shift():
    """The page says so: scale, rotation and the other shift within their errors."""
    frame = studies()["instruments/three-detectors"]()
    far = frame[frame["Distance (σ)"].abs() > 3]
    assert far[["Detectors", "Parameter"]].to_numpy().tolist() == [["H to K", "Shift along x"]]


def test_a_lens_is_registered_as_its_points_are():
    """The scale of a lens is that of a fit to points over the detector."""
    width, height = 2064.0, 1544.0
    row = int(lenses()["br"].abs().argmax())
    terms = lenses().iloc[row]
    x, y = np.meshgrid(*(np.linspace(-side / 2, side / 2, 25) for side in (width, height)))
    green = np.stack([x.ravel(), y.ravel()], axis=-1)
    r = np.hypot(*green.T)[:, None] / (height / 2)
    red = green * (terms["br"] * r**2 + terms["cr"] * r + terms["vr"])
    fit = fit_registration(red, green, (0, 0))
    found = colours._scales(width, height).iloc[row]
    assert found["red"] == pytest.approx(float(fit.transform.scale) - 1, abs=1e-12)


def test_a_red_image_that_is_larger_is_laid_over_green_by_a_scale_below_one():
    table = lenses()
    plain = ((table[["br", "cr"]] == 0).all(axis=1) & (table["vr"] > 1.0001)).to_numpy()
    assert plain.sum() > 100
    found = colours._scales(2064.0, 1544.0)["red"].to_numpy()[plain]
    np.testing.assert_allclose(found, 1 / table["vr"].to_numpy()[plain] - 1, rtol=1e-9)
    assert (found < 0).all()


def test_a_printed_scale_is_counted_among_the_lenses():
    door = given(colours._READS)
    whole = colours._farther(door)
    assert len(colours._on(door)) == 684
    nearer = colours._on(door)["red"].between(-0.0004, 0.0004, inclusive="both").sum()
    assert whole["red", 4] == 684 - nearer
