"""What others measured: stars where anyone can look them up, files of instruments as published."""

import hashlib
import json
import re
import sys

import numpy as np
import pytest
from astropy.table import Table
from astropy.time import Time

from reproduce.locate import data_folder
from reproduce.store import measured
from reproduce.store.images import ImageError
from reproduce.store.measured import aimpoints, lenses, mosaic, star_images, windows

# Hipparcos places (J2000, degrees) of four bright stars by Bright Star number.
KNOWN = {
    2491: (101.2872, -16.7161, -1.46),  # Sirius
    7001: (279.2347, 38.7837, 0.03),  # Vega
    424: (37.9546, 89.2641, 2.02),  # Polaris
    2061: (88.7929, 7.4071, 0.50),  # Betelgeuse
}


@pytest.mark.parametrize("number", KNOWN)
def test_known_stars_stand_where_they_should(number):
    found = measured.bright_stars()
    (row,) = np.flatnonzero(found.number == number)
    alpha, delta, magnitude = KNOWN[number]
    expected = [
        np.cos(np.radians(delta)) * np.cos(np.radians(alpha)),
        np.cos(np.radians(delta)) * np.sin(np.radians(alpha)),
        np.sin(np.radians(delta)),
    ]
    assert np.degrees(np.arccos(found.directions[row] @ expected)) < 0.002
    assert found.magnitude[row] == pytest.approx(magnitude, abs=0.06)


def test_the_catalogue_is_whole():
    found = measured.bright_stars()
    assert len(found.number) == 9096
    np.testing.assert_allclose(np.linalg.norm(found.directions, axis=1), 1.0)
    assert -1.5 < found.magnitude.min() < found.magnitude.max() < 8.0


def test_a_damaged_file_is_refused(tmp_path, monkeypatch):
    (tmp_path / "stars").mkdir()
    (tmp_path / "stars" / "bsc5.dat").write_bytes(b"\0" * 100)
    monkeypatch.setattr(measured, "data_folder", lambda: tmp_path)
    with pytest.raises(ValueError, match="multiple of element size"):
        measured.bright_stars.__wrapped__()


def test_vega_is_as_bright_as_its_calibration_says():
    """3.47e-9 erg/(s cm^2 angstrom) at 555.6 nm (Megessier 1995), in photons; V of the Sun."""
    wavelength, vega = measured.spectra()["vega"]
    expected = 3.47e-2 / (6.62607015e-34 * 299792458 / 555.6e-9)
    at = np.interp(555.6e-9, wavelength, vega)
    assert at == pytest.approx(expected, rel=0.01)
    _, sun = measured.spectra()["sun"]
    ratio = np.interp(550e-9, wavelength, sun) / np.interp(550e-9, wavelength, vega)
    assert -2.5 * np.log10(ratio) == pytest.approx(-26.75 - 0.03, abs=0.06)


def test_the_spectra_have_the_lines_of_their_stars():
    """H-beta is deep in Vega at 486 nm, and shallow in the Sun."""
    for name, depth in (("vega", (0.3, 0.7)), ("sun", (0.0, 0.3))):
        wavelength, table = measured.spectra()[name]
        line, near = np.interp([486.3e-9, 475e-9], wavelength, table)
        assert depth[0] < 1 - line / near < depth[1], name


def test_a_spoiled_table_of_spectra_is_refused(tmp_path, monkeypatch):
    (tmp_path / "stars").mkdir()
    (tmp_path / "stars" / "spectra.csv").write_text("wavelength_nm,vega,sun\n390,1\n391,2\n")
    monkeypatch.setattr(measured, "data_folder", lambda: tmp_path)
    with pytest.raises(ValueError, match="2 columns instead of 3"):
        measured.spectra.__wrapped__()


FOLDER = data_folder() / "instruments"
FILES = [("2mass", f"2MASS_{band}.fits") for band in "jhk"] + [("lensfun", "tca.csv")]
CHANDRA = FOLDER / "chandra"
FILES += [("chandra", one.name) for one in CHANDRA.iterdir() if one.suffix not in {".md", ".txt"}]


@pytest.mark.parametrize(("folder", "name"), FILES)
def test_files_are_those_that_the_readme_names(folder, name):
    said = (FOLDER / folder / "README.md").read_text(encoding="utf-8")
    found = hashlib.sha256((FOLDER / folder / name).read_bytes()).hexdigest()
    assert re.search(rf"`{re.escape(name)}`.*`{found}`", said)


@pytest.mark.parametrize("band", "jhk")
def test_a_mosaic_is_whole(band):
    image = mosaic(band)
    assert image.shape == (720, 721)
    assert np.isfinite(image).all()


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "astropy.io", None)
    with pytest.raises(ImageError, match="astropy and photutils"):
        mosaic.__wrapped__("j")
    with pytest.raises(ImageError, match="astropy and photutils"):
        windows.__wrapped__(0)


def test_lenses_have_scales_near_one():
    table = lenses()
    assert len(table) == 2888
    assert len(table.groupby(["maker", "lens"])) == 684
    assert (table[["vr", "vb"]] - 1).abs().to_numpy().max() < 0.01


@pytest.mark.parametrize("slot", [0, 1, 2, 7])
def test_windows_track(slot):
    seen = windows(slot)
    steps = np.diff(seen.times)
    np.testing.assert_allclose(steps, 2.05 if slot == 7 else 4.1, atol=1e-6)
    # The lights are seen at the same times, and so stand on one axis.
    assert slot == 7 or np.array_equal(seen.times, windows(0).times)
    # A light or a star is in the middle of its window in every frame.
    inner = seen.images[:, 1:-1, 1:-1].sum(axis=(1, 2))
    assert (inner > 0.8 * seen.images.sum(axis=(1, 2))).all()


def drift_model():
    """Return the drift (y, z) that the flight model tells of the observations, in arcsec."""
    told = json.loads((CHANDRA / "aca_drift_model.json").read_text(encoding="utf-8"))
    years, axes = aimpoints().years, []
    for one in (told["dy"], told["dz"]):
        warmth = (1.8 * aimpoints().temperatures + 32 - one["offset"]) * one["scale"]
        dates = Time([date for date, _ in one["jumps"]], format="yday").decimalyear
        jumps = (years[:, None] >= dates) @ [size for _, size in one["jumps"]]
        axes.append(warmth + (years - one["year0"]) * one["trend"] + jumps)
    return np.stack(axes, axis=-1)


def test_what_was_foretold_is_the_flight_model():
    """Two sources, one number: until the first jump that the pointing did not know yet."""
    seen = aimpoints()
    early = seen.years < 2022.8
    assert len(early) == 28
    assert early.sum() == 16
    np.testing.assert_allclose(seen.foretold[early], drift_model()[early], atol=0.025)


def test_the_measured_drift_has_the_sign_of_the_model():
    """With the other sign what is left would be larger: jumps were put into the model later."""
    seen = aimpoints()
    told = drift_model()
    right, wrong = (
        np.sqrt(np.square(seen.foretold + sign * seen.left - told).mean()) for sign in (1, -1)
    )
    assert right < 0.6 * wrong
    np.testing.assert_array_equal(seen.measured, seen.foretold + seen.left)


def test_observations_are_those_that_astropy_reads():
    raw = Table.read(CHANDRA / "aimpoint.ecsv")
    years = np.sort(Time(raw["mean_date"].tolist(), format="yday").decimalyear)
    found = aimpoints()
    # Leap seconds and the definition of the year: an hour.
    np.testing.assert_allclose(found.years, years, atol=1e-4)
    assert sorted(found.temperatures) == sorted(raw["mean_t_ccd"])
    lengths = np.linalg.norm(found.left, axis=1)
    # All three lengths are rounded to 0.01.
    np.testing.assert_allclose(sorted(lengths), sorted(raw["dr"]), atol=0.0125)


def test_stars_lie_where_their_images_show_them():
    images, places = star_images()
    y, x = np.mgrid[:8, :8]
    light = images.sum(axis=(-2, -1))
    np.testing.assert_allclose(light, 1, atol=0.02)
    down, along = ((images * one).sum(axis=(-2, -1)) / light for one in (y, x))
    np.testing.assert_allclose(np.diff(down.mean(axis=1)) / np.diff(places), 1, atol=0.3)
    np.testing.assert_allclose(np.diff(along.mean(axis=0)) / np.diff(places), 1, atol=0.3)
    assert np.abs(np.diff(down, axis=1)).max() < 0.05
