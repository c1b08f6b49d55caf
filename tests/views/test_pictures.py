"""Pictures of stars: found, paired and registered; against the truth and against others' code."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from astropy.io import fits
from astropy.nddata import CCDData
from astropy.table import Table
from click.testing import CliRunner
from photutils.detection import DAOStarFinder
from scipy.spatial import KDTree
from scipy.stats import t as student_t
from skimage.transform import SimilarityTransform

import reproduce as rp
from reproduce.physics.images import Detector, expose, render_frame
from reproduce.physics.registration import Registration
from reproduce.store.points import STARS
from reproduce.views.cli import main

PITCH, SIDE, BACKGROUND = 40, 240, 100.0
TRUTH = Registration.similarity(1.002, 0.003, (1.3, -0.7), (119.5, 119.5))


def exposed(points, light, generator):
    """Return an image of stars, in digital numbers."""
    frame = render_frame(points, light, 1.2, (SIDE, SIDE)) + BACKGROUND
    return expose(frame, Detector(read_noise=5.0, offset=100.0, bits=16), generator)


def simulated(seed, wrong=0.0):
    """Return places and light of stars, and two images; some stars of the second are displaced."""
    generator = np.random.default_rng([26, seed])
    steps = np.arange(0, SIDE, PITCH) + PITCH / 2
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    source = grid + generator.uniform(-8, 8, grid.shape)
    target = TRUTH.apply(source)
    moved = generator.choice(len(source), round(wrong * len(source)), replace=False)
    signs = generator.choice((-1.0, 1.0), (len(moved), 2))
    target[moved] += signs * generator.uniform(0.5, 1.2, (len(moved), 2))
    light = 10 ** generator.uniform(3.3, 4.6, len(source))
    return source, light, *(exposed(one, light, generator) for one in (source, target))


PLACES, LIGHT, RED, GREEN = simulated(0)


def pulls(places, image):
    """Return errors of the centres in their standard deviations."""
    found = rp.stars(image)
    apart, which = KDTree(places).query(found.points)
    sigma = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    return ((found.points - places[which]) / sigma)[apart < 1]


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
    assert len(found) == len(PLACES)
    assert np.median(apart) < 0.1
    assert set(found.frame()) >= {"x", "y", "sigma_x", "sigma_y", "flux"}
    assert f"{len(found)} stars of source" in repr(found)
    assert "gain" in repr(found)


def test_the_light_of_stars_is_theirs():
    found = rp.stars(RED)
    _, which = KDTree(PLACES).query(found.points)
    ratio = found.frame()["flux"] / LIGHT[which]
    assert np.median(ratio) == pytest.approx(1, abs=0.01)
    assert (np.diff(found.frame()["flux"]) <= 0).all()


@pytest.mark.slow
def test_centres_err_as_their_covariance_says():
    """A width of n numbers is known to 1 / sqrt(2 n); what a gain is off by comes on top."""
    fields = [simulated(seed) for seed in range(60)]
    found = np.concatenate([pulls(one[0], one[2]) for one in fields])
    assert found.std() == pytest.approx(1, abs=4 / np.sqrt(2 * found.size) + 0.03)
    assert np.abs(found.mean(axis=0)).max() < 4 / np.sqrt(len(found))


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [0.0, 0.05, 0.2])
def test_parameters_err_as_they_say_with_wrong_matches_too(wrong):
    fits = [rp.register(*simulated(seed, wrong)[2:]) for seed in range(50)]
    found = np.array(
        [
            (fit.parameters - TRUTH.parameters)
            / fit.standard_errors
            / student_t(fit.fit.degrees_of_freedom).std()
            for fit in fits
        ]
    )
    assert found.std() == pytest.approx(1, abs=4 / np.sqrt(2 * found.size))
    for level in (0.6827, 0.95):
        within = [
            (low < TRUTH.parameters) & (TRUTH.parameters < high)
            for low, high in (fit.interval(level).T for fit in fits)
        ]
        error = np.sqrt(level * (1 - level) / found.size)
        assert np.mean(within) == pytest.approx(level, abs=4 * error)


def test_the_transform_is_that_of_scikit_image(fit):
    """On the same pairs, unweighted; and the truth lies within the errors."""
    pairs = fit.pairs[fit.pairs["used"]]
    a, b = (
        pairs[["x", "y"]].to_numpy(),
        pairs[["x_reference", "y_reference"]].to_numpy(),
    )
    theirs = SimilarityTransform.from_estimate(a, b)
    ours = rp.register(a, b, TRUTH.pivot)
    assert ours.parameters[:2] == pytest.approx(
        [theirs.scale, theirs.rotation], abs=1e-9
    )
    assert np.abs(fit.parameters - TRUTH.parameters).max() < 0.05
    assert (
        np.abs(fit.parameters - TRUTH.parameters) < 5 * fit.fit.standard_errors
    ).all()


def test_a_mirror_image_is_named():
    mirrored = rp.match(rp.stars(RED[:, ::-1]), rp.stars(GREEN))
    assert mirrored.attrs["mirrored"]
    assert not rp.match(RED, GREEN).attrs["mirrored"]
    assert len(mirrored) > 30
    assert list(mirrored.columns[:4]) == list(STARS)
    assert f"{len(mirrored)} pairs" in mirrored.attrs["log"]
    with pytest.raises(ValueError, match=r"mirror each other: flip one"):
        rp.register(RED[:, ::-1], GREEN)
    affine = rp.register(RED[:, ::-1], GREEN, model="affine")
    assert np.linalg.det(affine.transform.matrix) == pytest.approx(
        -(1.002**2), abs=1e-3
    )


def test_scatter_beyond_the_errors_is_found():
    """A deviation of 2 n numbers is known to 1 / sqrt(4 n)."""
    rng, count = np.random.default_rng(7), 400
    source = pd.DataFrame(rng.uniform(0, 999, (count, 2)), columns=["x", "y"]).assign(
        sigma=0.02
    )
    target = source + np.column_stack([rng.normal(0, 0.1, (count, 2)), np.zeros(count)])
    found = rp.register(rp.stars(source), rp.stars(target))
    expected = np.sqrt(0.1**2 - 2 * 0.02**2)
    assert found.extra_scatter == pytest.approx(expected, rel=4 / np.sqrt(4 * count))


def test_a_start_gives_neighbours():
    found = rp.match(rp.stars(RED), rp.stars(GREEN), start=TRUTH, radius=2)
    assert len(found) == len(PLACES)
    same = rp.match(rp.stars(RED), rp.stars(GREEN), start=TRUTH.parameters, radius=2)
    pd.testing.assert_frame_equal(same, found)
    for start in ("x", (1, 0), (0, 0, 0, 0), (1, np.nan, 0, 0)):
        with pytest.raises((TypeError, ValueError), match=r"start|parameters"):
            rp.match(RED, GREEN, start=start)
    with pytest.raises(ValueError, match="start"):
        rp.register(RED, GREEN, start=(1, 0, 1000, 0))


def test_fields_without_common_stars_are_told():
    stranger = simulated(9)[2]
    with pytest.raises(ValueError, match="common stars"):
        rp.register(stranger, RED)


def test_dropped_stars_have_their_reason():
    image = RED.copy()
    x, y = PLACES[7].round().astype(int)
    image[y - 2 : y + 3, x - 2 : x + 3] = 65535
    lost = PLACES[12].round().astype(int)
    image[lost[1] - 6 : lost[1] + 7, lost[0] - 6 : lost[0] + 7] = np.nan
    found = rp.stars(image)
    gone = found.rejected.set_index("dropped")
    apart = np.hypot(gone["x"] - x, gone["y"] - y)
    assert apart.idxmin() == "saturated"
    assert any("saturated" in line and "dropped" in line for line in found.log)
    assert found.facts["missing"] == 169
    assert KDTree(found.points).query(PLACES[12])[0] > 5


def test_a_few_missing_pixels_do_not_bias_a_star():
    image, rng = RED.copy(), np.random.default_rng(3)
    image[rng.random(image.shape) < 0.02] = np.nan
    found = rp.stars(image)
    _, which = KDTree(PLACES).query(found.points)
    pulls = (found.points - PLACES[which]) / np.sqrt(
        np.diagonal(found.covariance, axis1=1, axis2=2)
    )
    assert len(found) > 30
    assert pulls.std() == pytest.approx(1, abs=4 / np.sqrt(2 * pulls.size))


def test_hot_pixels_are_no_stars():
    """Ten thousand in a million pixels: stars with one are dropped, and a field of them fails."""
    rng = np.random.default_rng(4)
    image = np.tile(RED, (4, 4))
    hot = rng.choice(image.size, 10_000, replace=False)
    image.ravel()[hot] += rng.uniform(100, 30_000, hot.size)
    found = rp.stars(image)
    tiles = np.stack(np.meshgrid(np.arange(4), np.arange(4)), axis=-1).reshape(-1, 1, 2)
    true = (PLACES + SIDE * tiles).reshape(-1, 2)
    apart, _ = KDTree(true).query(found.points)
    assert (apart > 1).mean() < 0.02
    assert len(found) > 0.25 * len(true)
    dark = 200 + 5 * rng.standard_normal(RED.shape)
    dark.ravel()[rng.choice(dark.size, 600, replace=False)] += 5000.0
    with pytest.raises(ValueError, match="expected") as caught:
        rp.register(dark, RED)
    assert "\n" not in str(caught.value)


def test_centroids_of_each_picture_as_tables(tmp_path):
    for name, stars in (("red", rp.stars(RED)), ("green", rp.stars(GREEN))):
        stars.frame().sample(frac=1, random_state=1).to_csv(
            tmp_path / f"{name}.csv", index=False
        )
    fit = rp.register(tmp_path / "red.csv", tmp_path / "green.csv", pivot=TRUTH.pivot)
    assert fit.parameters == pytest.approx(rp.register(RED, GREEN).parameters, abs=1e-5)


def test_positions_of_stars_have_the_covariance_of_transform_and_centre(fit):
    """The part of the transform by differences of its parameters."""
    points, covariance = fit.source_stars.points, fit.source_stars.covariance
    matrix = fit.transform.matrix
    found = fit.fit.prediction_covariance(points) + matrix @ covariance @ matrix.T
    own = np.diagonal(covariance, axis1=1, axis2=2)
    part = np.zeros_like(own)
    roots = np.linalg.cholesky(fit.covariance)
    for root in roots.T:
        moved = type(fit.transform)(
            "similarity", fit.parameters + root, fit.transform.pivot
        )
        part += np.square(moved.apply(points) - fit.transform.apply(points))
    expected = np.sqrt(1.002**2 * own + part)
    sigma = np.sqrt(np.diagonal(found, axis1=1, axis2=2))
    assert sigma == pytest.approx(expected, rel=1e-3)


def test_the_posterior_is_that_of_the_fit(fit):
    """With its weights: without them both mean and deviation would be others."""
    used = fit.pairs.query("used")
    pivot = fit.transform.pivot
    found = rp.posterior("registration", used, pivot, steps=400, seed=1).frame()
    plain = rp.register(used[list(STARS)], pivot=pivot)
    for name, mean, error, other in zip(
        fit.fit.names,
        fit.parameters,
        fit.fit.standard_errors,
        plain.fit.standard_errors,
        strict=True,
    ):
        scale = np.degrees(1) if name == "rotation" else 1.0
        row = found.loc[name, ["mean", "deviation"]].astype(float) / scale
        assert row["mean"] == pytest.approx(mean, abs=0.1 * error)
        assert row["deviation"] == pytest.approx(error, rel=0.1)
        assert other > 1.1 * error


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("pictures")
    for name, image in (("red", RED), ("green", GREEN)):
        fits.writeto(made / f"{name}.fits", image.astype(np.uint16))
    return made


def test_two_images_with_one_command(folder):
    """The first is mapped onto the second, and nothing is written."""
    files = [folder / f"{name}.fits" for name in ("red", "green")]
    found = json.loads(run(*files, "--json").stdout)
    assert (found["source"], found["target"]) == tuple(map(str, files))
    shift = {one["parameter"]: one["value"] for one in found["parameters"]}
    assert shift["shift-x"] == pytest.approx(1.3, abs=0.1)
    assert {path.name for path in folder.iterdir()} == {"red.fits", "green.fits"}


def test_options_that_do_not_fit_are_reported_before_the_computation(
    folder, monkeypatch
):
    monkeypatch.setattr(
        "reproduce.views.register.register",
        lambda *_, **__: pytest.fail("computed"),
    )
    red, green = folder / "red.fits", folder / "green.fits"
    for arguments, named in (
        ((red, green, "--picture", "p.svg"), "--picture"),
        ((red, "--posterior"), "--posterior"),
        ((red, green, red), "got 3"),
    ):
        done = run(*arguments)
        assert (done.exit_code, named in done.stderr) == (2, True)


def test_a_start_on_the_command_line(tmp_path):
    """Ten of 600 stars are common, which only a start finds; angles are in degrees."""
    rng = np.random.default_rng(3)
    common = rng.uniform(0, 1000, (10, 2))
    truth = Registration.similarity(1.1, np.pi / 2, (3, -4), (500, 500))
    for name, stars in (("a.csv", common), ("b.csv", truth.apply(common))):
        listed = np.vstack([rng.uniform(0, 1000, (590, 2)), stars])
        np.savetxt(tmp_path / name, listed, delimiter=",", header="x,y", comments="")
    files = tmp_path / "a.csv", tmp_path / "b.csv"
    assert "Give a start" in run(*files).stderr
    start = ("--pivot", 500, 500, "--start", 1.1, 90, 3, -4, "--radius", 0.2)
    found = json.loads(run(*files, "--json", *start).stdout)
    values = [one["value"] for one in found["parameters"]]
    assert values == pytest.approx([1.1, np.pi / 2, 3, -4], abs=0.05)
    assert "start" in run(*files, "--start", 0, 90, 3, -4).stderr


def test_the_extension_and_the_mask_of_an_image_count(tmp_path):
    """The first extension contains no stars, and stars of a masked part do not appear."""
    flat = fits.ImageHDU(np.ones(RED.shape) + 1e-3 * (GREEN > 300), name="WHT")
    for name, image in (("red", RED), ("green", GREEN)):
        units = [fits.PrimaryHDU(), flat, fits.ImageHDU(image, name="SCI")]
        fits.HDUList(units).writeto(tmp_path / f"{name}.fits")
    found = rp.register(*(f"{tmp_path / name}.fits[SCI]" for name in ("red", "green")))
    np.testing.assert_array_equal(found.parameters, rp.register(RED, GREEN).parameters)
    left = np.zeros(RED.shape, bool)
    left[:, :90] = True
    masked = CCDData(RED, unit="adu", mask=left)
    assert rp.stars(masked).points[:, 0].min() > 85
    fit = rp.register(
        masked, CCDData(GREEN, unit="adu", mask=np.zeros(GREEN.shape, bool))
    )
    assert (
        np.abs(fit.parameters - TRUTH.parameters) < 5 * fit.fit.standard_errors
    ).all()


def test_fits_tables_of_sources_are_registered(tmp_path):
    """With the ending of astrometry.net, and with that of an image."""
    places = np.random.default_rng(1).uniform(0, 1000, (60, 2))
    for name, (x, y) in (
        ("one.xyls", places.T),
        ("two.fits", (places + np.array([3, -2])).T),
    ):
        Table({"X": x, "Y": y, "FLUX": np.arange(60.0)}).write(
            tmp_path / name, format="fits"
        )
    found = rp.register(str(tmp_path / "one.xyls"), str(tmp_path / "two.fits"))
    np.testing.assert_allclose(found.parameters, [1, 0, -3, 2], atol=1e-6)


def test_a_bad_image_is_reported_in_one_line(folder, tmp_path):
    rng = np.random.default_rng(0)
    fits.writeto(tmp_path / "dark.fits", 200 + 5 * rng.standard_normal(RED.shape))
    # The start of a TIFF with packed samples of 12 bits.
    (tmp_path / "packed.tif").write_bytes(b"II*\0\x08\x18\0\0" + bytes(range(128)))
    cases = {
        "dark.fits": "expected stars",
        "packed.tif": "expected one column x",
        "nowhere.fits": "No such file",
        "nowhere.csv": "No such file",
        "nowhere.fits[SCI]": "No such file",
    }
    for name, problem in cases.items():
        done = run(tmp_path / name, folder / "green.fits")
        assert (done.exit_code, type(done.exception)) == (2, SystemExit), name
        (line,) = [one for one in done.stderr.splitlines() if one.startswith("Error:")]
        assert name.partition("[")[0] in line
        assert problem in line


def test_numbers_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="threshold: expected"):
        rp.stars(RED, threshold=-3)
    with pytest.raises(ValueError, match="row 1, column sigma"):
        rp.stars(pd.DataFrame({"x": [1.0, 2], "y": [1.0, 2], "sigma": [1, -1]}))
    for empty in ([], np.zeros((0, 2)), pd.DataFrame({"x": [], "y": []})):
        with pytest.raises(ValueError, match="expected"):
            rp.stars(empty)


def test_weights_of_a_list_beside_a_picture_count():
    """A star of weight zero is dropped; the others keep the weights of their errors."""
    listed = rp.stars(RED).frame().drop(columns="flux")
    plain, same, less = (
        rp.register(rp.stars(one), rp.stars(GREEN), robust=False)
        for one in (
            listed,
            listed.assign(weight=3.0),
            listed.assign(weight=1.0 * (listed.x > 60)),
        )
    )
    np.testing.assert_allclose(same.parameters, plain.parameters, rtol=1e-12)
    out = (less.pairs["x"] <= 60).to_numpy()
    assert 0 < out.sum() < len(out)
    np.testing.assert_array_equal(less.fit.weights == 0, out)


def test_settings_of_pictures_are_refused_beside_pairs():
    square = np.array([[0.0, 0], [99, 0], [0, 99], [99, 99]])
    with pytest.raises(ValueError, match="threshold"):
        rp.register(square, square + 1, threshold=5)
    with pytest.raises(ValueError, match=r"^weights: "):
        rp.register(RED, GREEN, weights=[1, 2])


def test_a_fit_of_stars_loads_nothing_that_pictures_need():
    code = (
        "import sys, reproduce as rp\n"
        "rp.register([[0, 0], [9, 0], [4, 5]], [[0, 1], [9, 1], [4, 6]])\n"
        "print([n for n in ('astropy', 'photutils', 'scipy.ndimage',"
        " 'scipy.spatial', 'reproduce.views.pictures') if n in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_stars_of_another_shape_give_a_warning_and_a_wider_interval(fit):
    """The truth of a trail is its centre of gravity; the fitted centre differs from it."""
    tail = np.array([0.45, 0.25, 0.15, 0.1, 0.05])
    trailed = sum(part * np.roll(GREEN, i, axis=1) for i, part in enumerate(tail))
    found = rp.register(RED, trailed)
    assert "shape" not in [one.kind for one in fit.findings]
    assert not fit.systematic.any()
    assert "shape" in [one.kind for one in found.findings]
    assert found.frame()["standard deviation"].to_numpy() == pytest.approx(
        np.sqrt(np.diagonal(found.covariance))
    )
    x = TRUTH.parameters[2] - tail @ np.arange(5)
    low, high = found.interval()[2]
    assert low < x < high
    low, high = found.fit.interval()[2]
    assert not low < x < high
