"""Images of stars: detection, matching and registration, against the truth and other software."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from astropy.io import fits
from astropy.table import Table
from commands import run
from numpy.random import default_rng
from numpy.testing import assert_allclose
from photutils.detection import DAOStarFinder
from scipy.spatial import KDTree
from scipy.stats import t as student_t

import reproduce as rp
from reproduce.physics.images import Detector, expose, render_frame
from reproduce.physics.registration import Registration

PITCH, SIDE, BACKGROUND = 40, 240, 100.0
TRUTH = Registration.similarity(1.002, 0.003, (1.3, -0.7), (119.5, 119.5))


def simulated(seed, wrong=0.0):
    """Return positions and fluxes of stars, and two images; displace some stars of the second."""
    generator = default_rng([26, seed])
    steps = np.arange(0, SIDE, PITCH) + PITCH / 2
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    source = grid + generator.uniform(-8, 8, grid.shape)
    target = TRUTH.apply(source)
    moved = generator.choice(len(source), round(wrong * len(source)), replace=False)
    signs = generator.choice((-1.0, 1.0), (len(moved), 2))
    target[moved] += signs * generator.uniform(0.5, 1.2, (len(moved), 2))
    flux = 10 ** generator.uniform(3.3, 4.6, len(source))
    frames = (render_frame(p, flux, 1.2, (SIDE, SIDE)) for p in (source, target))
    detector = Detector(read_noise=5.0, offset=100.0, bits=16)
    images = (expose(frame + BACKGROUND, detector, generator) for frame in frames)
    return source, flux, *images


PLACES, FLUX, RED, GREEN = simulated(0)


def pulls(places, found):
    """Return the errors of the centres that are near a star, in standard deviations."""
    distance, index = KDTree(places).query(found.points)
    sigma = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    return ((found.points - places[index]) / sigma)[distance < 1]


@pytest.fixture(scope="module")
def fit():
    return rp.register(RED, GREEN)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("images")
    for name, image in (("red", RED), ("green", GREEN)):
        fits.writeto(path / f"{name}.fits", image.astype(np.uint16))
    return path


def test_detected_stars_agree_with_photutils_and_have_the_true_flux(fit):
    found = fit.source_stars
    frame = found.frame()
    others = DAOStarFinder(threshold=60.0, fwhm=2.8)(RED - np.median(RED))
    places = np.column_stack([others["x_centroid"], others["y_centroid"]])
    assert len(found) == len(PLACES)
    assert np.median(KDTree(places).query(found.points)[0]) < 0.1
    assert set(frame) >= {"x", "y", "sigma_x", "sigma_y", "flux"}
    _, index = KDTree(PLACES).query(found.points)
    assert np.median(frame["flux"] / FLUX[index]) == pytest.approx(1, abs=0.01)
    assert (np.diff(frame["flux"]) <= 0).all()
    for text in (f"{len(found)} stars", "gain"):
        assert text in repr(found)


@pytest.mark.slow
def test_errors_of_parameters_are_as_stated_with_wrong_matches():
    fits = [rp.register(*simulated(seed, 0.2)[2:]) for seed in range(20)]
    student = [student_t(fit.fit.degrees_of_freedom).std() for fit in fits]
    error = [(f.parameters - TRUTH.parameters) / f.standard_errors for f in fits]
    found = np.array(error) / np.array(student)[:, None]
    assert found.std() == pytest.approx(1, abs=4 / np.sqrt(2 * found.size))
    for level in (0.6827, 0.95):
        ends = np.array(
            [fit.interval(level) - TRUTH.parameters[:, None] for fit in fits]
        )
        inside = np.mean((ends[..., 0] < 0) & (ends[..., 1] > 0))
        sigma = np.sqrt(level * (1 - level) / found.size)
        assert inside == pytest.approx(level, abs=4 * sigma)


def test_the_transform_is_the_true_one(fit):
    error = np.abs(fit.parameters - TRUTH.parameters)
    assert error.max() < 0.05
    assert (error < 5 * fit.fit.standard_errors).all()
    # The table of pairs has the errors of the stars: without them the errors are larger.
    again = rp.register(fit.pairs.query("used"), pivot=fit.transform.pivot).fit
    assert_allclose(again.standard_errors, fit.fit.standard_errors, rtol=0.1)


def test_a_rerun_with_another_threshold_finds_other_stars(fit):
    brighter = fit.rerun(threshold=100.0)
    assert 10 < len(brighter.source_stars) < len(fit.source_stars)
    assert brighter.parameters == pytest.approx(fit.parameters, abs=0.1)


def test_the_error_of_a_position_is_that_of_the_parameters(fit):
    """By differences of the parameters."""
    points, expected = fit.source_stars.points, 0.0
    for root in np.linalg.cholesky(fit.covariance).T:
        moved = Registration("similarity", fit.parameters + root, fit.transform.pivot)
        expected = expected + (moved.apply(points) - fit.transform.apply(points)) ** 2
    found = np.diagonal(fit.fit.prediction_covariance(points), axis1=1, axis2=2)
    assert_allclose(found, expected, rtol=2e-3)


def test_a_mirror_image_is_reported(fit):
    source, target = rp.stars(RED[:, ::-1]), fit.target_stars
    mirrored = rp.match(source, target)
    assert mirrored.attrs["mirrored"]
    assert not rp.match(fit.source_stars, target).attrs["mirrored"]
    assert len(mirrored) > 30
    with pytest.raises(ValueError, match="mirror"):
        rp.register(source, target)
    affine = rp.register(source, target, model="affine").transform.matrix
    assert np.linalg.det(affine) == pytest.approx(-(1.002**2), abs=1e-3)


def test_scatter_beyond_the_stated_errors_is_estimated():
    """A deviation of 2 n numbers is known to 1 / sqrt(4 n)."""
    rng, count = default_rng(7), 400
    source = pd.DataFrame(rng.uniform(0, 999, (count, 2)), columns=["x", "y"])
    target = source + rng.normal(0, 0.1, (count, 2))
    listed = (rp.stars(one.assign(sigma=0.02)) for one in (source, target))
    expected = np.sqrt(0.1**2 - 2 * 0.02**2)
    assert rp.register(*listed).extra_scatter == pytest.approx(expected, rel=0.1)


def test_a_radius_that_leaves_out_pairs_is_reported():
    """Two coordinates with the noise of 1.4 px differ by more than 3 px in 10 % of pairs."""
    rng = default_rng(8)
    source = rng.uniform(0, 999, (60, 2))
    listed = map(rp.stars, (source, source + rng.normal(0, 1.4, source.shape)))
    found = rp.register(*listed)
    for fit, reported in ((found, True), (found.rerun(radius=10.0), False)):
        assert ("radius" in {one.kind for one in fit.findings}) is reported


def test_a_start_gives_the_nearest_stars(fit, tmp_path):
    red, green = fit.source_stars, fit.target_stars
    found = rp.match(red, green, start=TRUTH, radius=2)
    assert len(found) == len(PLACES)
    same = rp.match(red, green, start=pd.Series(TRUTH.parameters), radius=2)
    pd.testing.assert_frame_equal(same, found)
    for start in ("x", (1, 0, 0), (0, 0, 0, 0), (1, np.nan, 0, 0)):
        with pytest.raises((TypeError, ValueError), match=r"start|parameters"):
            rp.match(red, green, start=start)
    with pytest.raises(ValueError, match="start"):
        rp.register(red, green, start=(1, 0, 1000, 0))
    # Ten of 600 stars are common. On the command line angles are in degrees.
    rng = default_rng(3)
    common = rng.uniform(0, 1000, (10, 2))
    truth = Registration.similarity(1.1, np.pi / 2, (3, -4), (500, 500))
    files = tmp_path / "a.csv", tmp_path / "b.csv"
    for file, stars in zip(files, (common, truth.apply(common)), strict=True):
        listed = np.vstack([rng.uniform(0, 1000, (590, 2)), stars])
        np.savetxt(file, listed, delimiter=",", header="x,y", comments="")
    start = ("--pivot", 500, 500, "--start", 1.1, 90, 3, -4, "--radius", 0.2)
    record = json.loads(run(["register", *files, "--json", *start]).stdout)
    values = [parameter["value"] for parameter in record["parameters"]]
    assert values == pytest.approx([1.1, np.pi / 2, 3, -4], abs=0.05)
    # A file and a table in another order of rows.
    rows, start = pd.read_csv(files[1])[::-1], (1.1, np.pi / 2, 3, -4)
    mixed = rp.register(files[0], rows, (500, 500), start=start, radius=0.2)
    assert mixed.parameters == pytest.approx(values)


def test_fields_without_stars_or_without_common_stars_are_rejected():
    dark = 200 + 5 * default_rng(4).standard_normal(RED.shape)
    dark.ravel()[::96] += 5000.0  # hot pixels
    for wrong in (dark, simulated(9)[2]):
        with pytest.raises(ValueError, match=r"stars") as caught:
            rp.register(wrong, RED)
        assert "\n" not in str(caught.value)
        assert "readable" not in str(caught.value)


def test_stars_with_saturated_missing_or_hot_pixels():
    image, rng = RED.copy(), default_rng(3)
    x, y = PLACES[7].round().astype(int)
    image[y - 2 : y + 3, x - 2 : x + 3] = 65535
    x0, y0 = PLACES[12].round().astype(int)
    image[y0 - 6 : y0 + 7, x0 - 6 : x0 + 7] = np.nan
    found = rp.stars(image)
    dropped = found.rejected.set_index("dropped")
    assert np.hypot(dropped["x"] - x, dropped["y"] - y).idxmin() == "saturated"
    assert found.facts["missing"] == 13**2
    assert KDTree(found.points).query(PLACES[12])[0] > 5
    # Missing pixels do not bias a star.
    image = RED.copy()
    image[rng.random(image.shape) < 0.02] = np.nan
    error = pulls(PLACES, rp.stars(image))
    assert len(error) > 30
    assert error.std() == pytest.approx(1, abs=4 / np.sqrt(2 * error.size))
    # One pixel of a hundred is hot: stars with a hot pixel are dropped.
    image = np.tile(RED, (4, 4))
    hot = rng.choice(image.size, image.size // 100, replace=False)
    image.ravel()[hot] += rng.uniform(100, 30_000, hot.size)
    found = rp.stars(image)
    tiles = np.stack(np.meshgrid(np.arange(4), np.arange(4)), axis=-1).reshape(-1, 1, 2)
    distance, _ = KDTree((PLACES + SIDE * tiles).reshape(-1, 2)).query(found.points)
    assert (distance > 1).mean() < 0.02
    assert len(found) > 0.25 * 16 * len(PLACES)


def test_the_command_registers_two_images_and_writes_nothing(folder):
    files = [folder / f"{name}.fits" for name in ("red", "green")]
    record = json.loads(run(["register", *files, "--json"]).stdout)
    assert [record["source"], record["target"]] == [*map(str, files)]
    shift = {one["parameter"]: one["value"] for one in record["parameters"]}
    assert shift["shift-x"] == pytest.approx(1.3, abs=0.1)
    assert {path.name for path in folder.iterdir()} == {"red.fits", "green.fits"}


def test_tables_of_stars_give_the_fit_of_the_images(fit, tmp_path):
    files = [str(tmp_path / name) for name in ("red.csv", "green.csv")]
    for file, stars in zip(files, (fit.source_stars, fit.target_stars), strict=True):
        mixed = stars.frame().sample(frac=1, random_state=1)
        mixed.to_csv(file, index=False)
    found = rp.register(*files, pivot=fit.transform.pivot)
    assert found.parameters == pytest.approx(fit.parameters, abs=1e-5)
    # With the ending of astrometry.net, and with that of an image.
    places = default_rng(1).uniform(0, 1000, (60, 2))
    files = [str(tmp_path / name) for name in ("one.xyls", "two.fits")]
    for file, (x, y) in zip(files, (places.T, np.add(places, [3, -2]).T), strict=True):
        Table({"X": x, "Y": y, "FLUX": np.arange(60.0)}).write(file, format="fits")
    assert_allclose(rp.register(*files).parameters, [1, 0, -3, 2], atol=1e-6)
    listed = rp.stars(places).frame()
    pd.testing.assert_frame_equal(rp.stars(listed).frame(), listed)


def test_wrong_arguments_are_named():
    square = np.array([[0.0, 0], [99, 0], [0, 99], [99, 99]])
    wrong = pd.DataFrame({"x": [1.0, 2], "y": [1.0, 2], "sigma": [1, -1]})
    for call, named in (
        (lambda: rp.stars(RED, threshold=-3), "threshold: expected"),
        (lambda: rp.stars(RED, threshold=[5, 6]), "threshold: .* one number"),
        (lambda: rp.stars(square, threshold=-3), "^threshold: expected none"),
        (lambda: rp.register(*[rp.stars(RED)] * 2, threshold=5), "^threshold: .* none"),
        (lambda: rp.stars(RED.tolist()), "^source: .* image as a NumPy array"),
        (lambda: rp.stars(wrong), "row 1, column sigma"),
        (lambda: rp.stars(wrong.assign(sigma=1, weight=1)), "column weight"),
        (lambda: rp.register(square, square + 1, threshold=5), "threshold"),
        (lambda: rp.match(square, square + 1, radius=0), "^source and target: radius"),
        (lambda: rp.register(RED, GREEN, weights=[1, 2]), "^weights: "),
        (lambda: rp.register(None, square), "^source: .* got None"),
        (lambda: rp.stars(None), "^source: .* got None"),
        (lambda: rp.stars({}), "^source: .* got none"),
        (lambda: rp.match(square, None), "^target: .* got None"),
        (lambda: rp.misalignment(None), "^spots: .* got None"),
        (
            lambda: rp.match(*map(rp.stars, (RED, simulated(9)[2]))),
            "^source and target: ",
        ),
    ):
        with pytest.raises((TypeError, ValueError), match=named):
            call()


def test_different_shapes_give_a_warning_and_a_wider_interval(fit):
    """The true position of a trail is its centre of gravity; a fitted centre differs."""
    tail = np.array([0.45, 0.25, 0.15, 0.1, 0.05])
    trailed = sum(part * np.roll(GREEN, i, axis=1) for i, part in enumerate(tail))
    found = rp.register(RED, trailed)
    assert "shape" not in [finding.kind for finding in fit.findings]
    assert not np.any(fit.fit.systematic)
    assert "shape" in [finding.kind for finding in found.findings]
    x = TRUTH.parameters[2] - tail @ np.arange(5)
    wide, narrow = found.interval()[2], replace(found.fit, systematic=0.0).interval()[2]
    assert wide[0] < x < wide[1]
    assert not narrow[0] < x < narrow[1]
