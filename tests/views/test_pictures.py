"""Pictures of stars: found, paired and registered; against the truth and against others' code."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from astropy.io import fits
from click.testing import CliRunner
from photutils.detection import DAOStarFinder
from PIL import Image
from scipy.spatial import KDTree
from skimage import data
from skimage.transform import SimilarityTransform

import pictures as evidence
import reproduce as rp
from reproduce.store.points import STARS
from reproduce.views.cli import main

FIELD = evidence.simulated(0)
RED, GREEN = FIELD.pictures
TRUTH = evidence.TRUTH


def run(*arguments):
    return CliRunner().invoke(main, ["register", *map(str, arguments)])


@pytest.fixture(scope="module")
def fit():
    return rp.register(RED, GREEN)


def test_stars_are_those_that_photutils_finds():
    found = rp.stars(RED)
    others = DAOStarFinder(threshold=60.0, fwhm=2.8)(RED - np.median(RED))
    places = np.column_stack([others["x_centroid"], others["y_centroid"]])
    apart, _ = KDTree(places).query(found.points)
    assert len(found) == len(FIELD.source)
    assert np.median(apart) < 0.1
    assert set(found.frame()) >= {"x", "y", "sigma_x", "sigma_y", "flux"}


def test_the_light_of_stars_is_theirs():
    found = rp.stars(RED)
    _, which = KDTree(FIELD.source).query(found.points)
    ratio = found.frame()["flux"] / FIELD.light[which]
    assert np.median(ratio) == pytest.approx(1, abs=0.01)
    assert (np.diff(found.frame()["flux"]) <= 0).all()


@pytest.mark.slow
def test_centres_err_as_their_covariance_says():
    """A width of n numbers is known to 1 / sqrt(2 n); what a gain is off by comes on top."""
    pulls = np.concatenate([evidence.centre_pulls(evidence.simulated(i)) for i in range(60)])
    error = 1 / np.sqrt(2 * pulls.size)
    assert pulls.std() == pytest.approx(1, abs=4 * error + 0.03)
    assert np.abs(pulls.mean(axis=0)).max() < 4 / np.sqrt(len(pulls))


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [0.0, 0.05, 0.2])
def test_parameters_err_as_they_say_with_wrong_matches_too(wrong):
    count = 50
    found = evidence.summary(range(count), wrong)
    numbers = 4 * count
    assert found["width"] == pytest.approx(1, abs=4 / np.sqrt(2 * numbers))
    for name, level in (("68 %", 0.6827), ("95 %", 0.95)):
        error = 100 * np.sqrt(level * (1 - level) / numbers)
        assert found[name] == pytest.approx(100 * level, abs=4 * error)


def test_our_centres_beat_those_of_the_library():
    """Over 8 fields: by a third those of segments, and never worse than a fitted Gaussian."""
    found = evidence.errors(range(8))
    ours = found.pop("ours")
    assert ours < 0.75 * found["photutils, isophotal"]
    assert ours < 1.02 * min(found.values())


def test_the_transform_is_that_of_scikit_image(fit):
    """On the same pairs, unweighted; and the truth lies within the errors."""
    pairs = fit.pairs[fit.pairs["used"]]
    a, b = pairs[["x", "y"]].to_numpy(), pairs[["x_reference", "y_reference"]].to_numpy()
    theirs = SimilarityTransform.from_estimate(a, b)
    ours = rp.register(a, b, evidence.TRUTH.pivot)
    assert ours.parameters[:2] == pytest.approx([theirs.scale, theirs.rotation], abs=1e-9)
    assert np.abs(fit.parameters - TRUTH.parameters).max() < 0.05
    assert (np.abs(fit.parameters - TRUTH.parameters) < 5 * fit.fit.standard_errors).all()


def test_a_mirror_image_is_named():
    mirrored = rp.match(rp.stars(RED[:, ::-1]), rp.stars(GREEN))
    assert mirrored.attrs["mirrored"]
    assert not rp.match(RED, GREEN).attrs["mirrored"]
    assert len(mirrored) > 30
    with pytest.raises(ValueError, match=r"mirror each other: flip one"):
        rp.register(RED[:, ::-1], GREEN)
    affine = rp.register(RED[:, ::-1], GREEN, model="affine")
    assert np.linalg.det(affine.transform.matrix) == pytest.approx(-(1.002**2), abs=1e-3)


def test_a_picture_that_is_turned_and_larger_is_matched():
    turned = rp.register(np.rot90(RED).copy(), GREEN)
    assert abs(turned.transform.rotation) == pytest.approx(np.pi / 2, abs=0.01)


def test_scatter_beyond_the_errors_is_found():
    """A deviation of 2 n numbers is known to 1 / sqrt(4 n)."""
    rng, count = np.random.default_rng(7), 400
    source = pd.DataFrame(rng.uniform(0, 999, (count, 2)), columns=["x", "y"]).assign(sigma=0.02)
    target = source + np.column_stack([rng.normal(0, 0.1, (count, 2)), np.zeros(count)])
    found = rp.register(rp.stars(source), rp.stars(target))
    expected = np.sqrt(0.1**2 - 2 * 0.02**2)
    assert found.beyond == pytest.approx(expected, rel=4 / np.sqrt(4 * count))


def test_a_start_gives_neighbours():
    found = rp.match(rp.stars(RED), rp.stars(GREEN), start=TRUTH, radius=2)
    assert len(found) == len(FIELD.source)
    assert "the start" in found.attrs["log"]


def test_pairs_are_a_table_that_register_takes():
    found = rp.match(rp.stars(RED), rp.stars(GREEN), radius=2)
    assert len(found) == len(FIELD.source)
    assert "triangles" in found.attrs["log"]
    assert list(found.columns[:4]) == list(STARS)


def test_fields_without_common_stars_are_told():
    stranger = evidence.simulated(9).pictures[0]
    with pytest.raises(ValueError, match="expected the same stars in both pictures"):
        rp.register(stranger, RED)


def test_dropped_stars_have_their_reason():
    image = RED.copy()
    x, y = FIELD.source[7].round().astype(int)
    image[y - 2 : y + 3, x - 2 : x + 3] = 65535
    lost = FIELD.source[12].round().astype(int)
    image[lost[1] - 6 : lost[1] + 7, lost[0] - 6 : lost[0] + 7] = np.nan
    found = rp.stars(image)
    gone = found.dropped.set_index("dropped")
    apart = np.hypot(gone["x"] - x, gone["y"] - y)
    assert apart.idxmin() == "saturated"
    assert any("saturated" in line and "dropped" in line for line in found.log)
    assert any("169 pixels are missing" in line for line in found.log)
    assert KDTree(found.points).query(FIELD.source[12])[0] > 5


def test_a_few_missing_pixels_do_not_bias_a_star():
    image, rng = RED.copy(), np.random.default_rng(3)
    image[rng.random(image.shape) < 0.02] = np.nan
    found = rp.stars(image)
    _, which = KDTree(FIELD.source).query(found.points)
    pulls = (found.points - FIELD.source[which]) / np.sqrt(
        np.diagonal(found.covariance, axis1=1, axis2=2)
    )
    assert len(found) > 30
    assert pulls.std() == pytest.approx(1, abs=4 / np.sqrt(2 * pulls.size))


def test_hot_pixels_are_no_stars():
    """Ten thousand in a picture of a million pixels, and every star is found."""
    rng = np.random.default_rng(4)
    image = np.tile(RED, (4, 4))
    hot = rng.choice(image.size, 10_000, replace=False)
    image.ravel()[hot] += rng.uniform(100, 30_000, hot.size)
    found = rp.stars(image)
    tiles = np.stack(np.meshgrid(np.arange(4), np.arange(4)), axis=-1).reshape(-1, 1, 2)
    true = (FIELD.source + evidence.SIDE * tiles).reshape(-1, 2)
    apart, _ = KDTree(true).query(found.points)
    assert (apart > 1).mean() < 0.02
    assert len(found) > 0.25 * len(true)


def test_hot_pixels_alone_are_told():
    rng = np.random.default_rng(4)
    image = 200 + 5 * rng.standard_normal(RED.shape)
    image.ravel()[rng.choice(image.size, 10_000, replace=False)] += 5000.0
    with pytest.raises(ValueError, match="expected") as told:
        rp.register(image, RED)
    assert "\n" not in str(told.value)


def test_a_mosaic_gives_the_transforms_of_its_channels():
    """Each channel is exposed on its own; the mosaic takes one pixel in four of red and blue."""
    rng = np.random.default_rng(5)
    back = TRUTH.inverse()
    places = (back.apply(FIELD.source), FIELD.source, TRUTH.apply(FIELD.source))
    shots = [evidence.exposed(points, 4 * FIELD.light, rng) for points in places]
    mosaic = shots[1].copy()
    mosaic[0::2, 0::2], mosaic[1::2, 1::2] = shots[0][0::2, 0::2], shots[2][1::2, 1::2]
    found = rp.register(mosaic, bayer="RGGB")
    assert list(found.fits) == ["red", "blue"]
    for name, truth in (("red", TRUTH), ("blue", back)):
        fit = found[name]
        assert len(fit.pairs) > 30
        off = (fit.parameters - truth.parameters) / fit.fit.standard_errors
        assert np.abs(off).max() < 5, name


def test_a_jpeg_gives_the_transform(tmp_path):
    """Of full chroma at quality 95; the scatter says what the compression does."""
    rng = np.random.default_rng(6)
    light = [
        evidence.exposed(p, FIELD.light, rng) for p in (FIELD.source, FIELD.target, FIELD.source)
    ]
    linear = np.clip((np.stack(light, axis=-1) - 150) / 4000, 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    path = tmp_path / "shot.jpg"
    Image.fromarray((255 * encoded).round().astype(np.uint8)).save(path, quality=95, subsampling=0)
    fit = rp.register(path)["red"]
    assert any("sRGB" in line for line in fit.log)
    assert np.abs(fit.transform.apply(FIELD.source) - FIELD.target).max() < 0.1


def test_a_smooth_dark_sky_of_a_jpeg_is_not_taken_for_stars(tmp_path):
    """Compression takes the noise of the sky away; what is left are steps of one number."""
    rng = np.random.default_rng(7)
    for name, place in (("red", FIELD.source), ("green", FIELD.target)):
        light = (evidence.exposed(place, FIELD.light, rng) - 100) / 20
        path = tmp_path / f"{name}.jpg"
        Image.fromarray(np.clip(light, 0, 255).astype(np.uint8)).save(path, quality=95)
    found = rp.stars(tmp_path / "red.jpg")
    apart, _ = KDTree(FIELD.source).query(found.points)
    assert np.count_nonzero(apart < 0.3) > len(FIELD.source) - 2
    assert np.count_nonzero(apart > 1) < 2
    fit = rp.register(tmp_path / "red.jpg", tmp_path / "green.jpg")
    assert np.abs(fit.transform.apply(FIELD.source) - FIELD.target).max() < 0.1


def test_centroids_of_each_picture_as_tables(tmp_path):
    for name, stars in (("red", rp.stars(RED)), ("green", rp.stars(GREEN))):
        stars.frame().sample(frac=1, random_state=1).to_csv(tmp_path / f"{name}.csv", index=False)
    fit = rp.register(tmp_path / "red.csv", tmp_path / "green.csv", pivot=TRUTH.pivot)
    assert fit.parameters == pytest.approx(rp.register(RED, GREEN).parameters, abs=1e-5)


def test_landed_stars_have_the_covariance_of_transform_and_centre(fit):
    landed = fit.landed()
    own = np.diagonal(fit.source_stars.covariance, axis1=1, axis2=2)
    points = fit.source_stars.points
    # The transform's part by differences of its parameters.
    part = np.zeros_like(own)
    roots = np.linalg.cholesky(fit.covariance)
    for root in roots.T:
        moved = type(fit.transform)("similarity", fit.parameters + root, fit.transform.pivot)
        part += np.square(moved.apply(points) - fit.transform.apply(points))
    expected = np.sqrt(1.002**2 * own + part)
    assert landed[["sigma_x", "sigma_y"]].to_numpy() == pytest.approx(expected, rel=1e-3)


def test_the_registered_picture_lies_on_the_target(fit, tmp_path):
    path = fit.write(tmp_path / "red.fits")
    header = fits.getheader(path)
    assert header["register scale"] == pytest.approx(float(fit.transform.scale))
    assert header["register stars"] == int(fit.pairs["used"].sum())
    again = rp.register(rp.stars(path), rp.stars(GREEN), pivot=TRUTH.pivot)
    assert np.abs(again.parameters - (1, 0, 0, 0)).max() < 0.02
    pixels = np.stack(np.meshgrid(*2 * [np.arange(evidence.SIDE)]), axis=-1).reshape(-1, 2)
    came = fit.transform.inverse().apply(pixels).reshape(*RED.shape, 2)
    within = np.minimum(came, evidence.SIDE - 1 - came).min(axis=-1)
    lost = np.isnan(fits.getdata(path))
    assert lost[within < -0.01].all()
    assert not lost[within > 0.01].any()
    with pytest.raises(OSError, match="already exists"):
        fit.write(path)


def test_the_posterior_is_that_of_the_fit(fit):
    """With its weights: without them both mean and deviation would be others."""
    found = fit.posterior(steps=400, seed=1).frame()
    used = fit.pairs[fit.pairs["used"]]
    plain = rp.register(used[list(STARS)], pivot=fit.transform.pivot)
    for name, mean, error, other in zip(
        fit.fit.names, fit.parameters, fit.fit.standard_errors, plain.fit.standard_errors,
        strict=True,
    ):  # fmt: skip
        scale = np.degrees(1) if name == "rotation" else 1.0
        row = found.loc[name, ["mean", "deviation"]].astype(float) / scale
        assert row["mean"] == pytest.approx(mean, abs=0.1 * error)
        assert row["deviation"] == pytest.approx(error, rel=0.1)
        assert other > 1.1 * error
    with pytest.raises(ValueError, match="expected the model similarity"):
        fit.rerun(model="affine").posterior()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("pictures")
    blue = evidence.exposed(FIELD.source + np.array([2, 1]), FIELD.light, np.random.default_rng(8))
    for name, image in (("red", RED), ("green", GREEN), ("blue", blue)):
        fits.writeto(made / f"{name}.fits", image.astype(np.uint16))
    return made


def test_three_pictures_with_one_command(folder, tmp_path):
    files = [folder / f"{name}.fits" for name in ("red", "green", "blue")]
    done = run(*files, "--json", "--picture", tmp_path / "arrows.png", "--write", tmp_path / "out")
    found = json.loads(done.stdout)
    assert found["reference"] == "green.fits"
    assert list(found["pictures"]) == ["red.fits", "blue.fits"]
    shift = {p["parameter"]: p["value"] for p in found["pictures"]["red.fits"]["parameters"]}
    assert shift["shift-x"] == pytest.approx(1.3, abs=0.1)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "red-registered.fits", "blue-registered.fits"}  # fmt: skip
    assert (tmp_path / "arrows-red.png").stat().st_size > 5000
    told = run(*files[:2], "--write", tmp_path / "two").stdout
    assert "red.fits on green.fits: similarity" in told
    assert (tmp_path / "two" / "red-registered.fits").is_file()
    other = json.loads(run(*files, "--json", "--reference", "red.fits").stdout)
    assert list(other["pictures"]) == ["green.fits", "blue.fits"]
    assert "expected one of red.fits" in run(*files, "--reference", "cyan.fits").stderr


def test_a_bad_picture_is_told_in_one_line(folder, tmp_path):
    rng = np.random.default_rng(0)
    fits.writeto(tmp_path / "dark.fits", 200 + 5 * rng.standard_normal(RED.shape))
    fits.writeto(tmp_path / "small.fits", RED[:200])
    Image.fromarray(data.chelsea()).save(tmp_path / "cat.jpg")
    Image.fromarray(data.chelsea()[..., 1]).save(tmp_path / "cat.png")
    fits.writeto(tmp_path / "nan.fits", np.full(RED.shape, np.nan))
    (tmp_path / "empty.fits").write_bytes(b"")
    cases = {
        "dark.fits": "expected stars, got nothing above 5",
        "small.fits": "expected shape (240, 240) as green.fits, got (200, 240)",
        "cat.jpg": "expected one channel beside other pictures",
        "cat.png": "expected",
        "nan.fits": "got 57600 missing and 0 at the highest number of 57600",
        "empty.fits": "empty.fits: cannot be read",
    }
    for name, message in cases.items():
        done = run(tmp_path / name, folder / "green.fits")
        assert done.exit_code == 2, name
        (line,) = [one for one in done.stderr.splitlines() if one.startswith("Error:")]
        assert message in line
        assert "Traceback" not in done.stderr
    alone = run(tmp_path / "cat.jpg")
    assert "cat.jpg, red: expected stars" in alone.stderr


def test_numbers_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="threshold: expected"):
        rp.stars(RED, threshold=-3)
    with pytest.raises(ValueError, match=r"row 1, column 3 .*above zero"):
        rp.stars(pd.DataFrame({"x": [1.0, 2], "y": [1.0, 2], "sigma": [1, -1]}))


def test_weights_of_a_list_beside_a_picture_count():
    """A star of weight zero is dropped; the others keep the weights of their errors."""
    listed = rp.stars(RED).frame().drop(columns="flux")
    plain, same, less = (
        rp.register(rp.stars(one), rp.stars(GREEN), robust=False)
        for one in (listed, listed.assign(weight=3.0), listed.assign(weight=1.0 * (listed.x > 60)))
    )
    np.testing.assert_allclose(same.parameters, plain.parameters, rtol=1e-12)
    out = (less.pairs["x"] <= 60).to_numpy()
    assert 0 < out.sum() < len(out)
    np.testing.assert_array_equal(less.fit.weights == 0, out)


def test_settings_of_pictures_are_refused_beside_pairs():
    square = np.array([[0.0, 0], [99, 0], [0, 99], [99, 99]])
    with pytest.raises(ValueError, match="bayer: expected pictures"):
        rp.register(square, square + 1, bayer="RGGB")
    with pytest.raises(ValueError, match="weights: expected none beside pictures"):
        rp.register(RED, GREEN, weights=[1, 2])
    with pytest.raises(ValueError, match="channel: expected one of red, green, blue"):
        rp.stars(data.chelsea(), "violet")


def test_a_fit_of_stars_loads_nothing_that_pictures_need():
    code = (
        "import sys, reproduce as rp\n"
        "rp.register([[0, 0], [9, 0], [4, 5]], [[0, 1], [9, 1], [4, 6]])\n"
        "print([n for n in ('astropy', 'photutils', 'PIL', 'tifffile', 'scipy.ndimage',"
        " 'scipy.spatial', 'reproduce.views.pictures') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_same_pictures_give_the_same_numbers(fit):
    again = rp.register(RED, GREEN)
    assert (again.parameters == fit.parameters).all()
    pd.testing.assert_frame_equal(again.pairs, fit.pairs)
