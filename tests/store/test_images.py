"""Images from arrays, `CCDData` and FITS files, and errors that name the image."""

import bz2
import gzip
import sys

import numpy as np
import pytest
from astropy.io import fits
from astropy.nddata import (
    CCDData,
    InverseVariance,
    NDData,
    StdDevUncertainty,
    UnknownUncertainty,
    VarianceUncertainty,
)
from astropy.table import Table
from astropy.units import adu
from astropy.utils.masked import Masked
from numpy.random import default_rng
from numpy.testing import assert_allclose

import reproduce as rp
from reproduce.store import images
from reproduce.store.images import is_image, read_image

RAMP = np.arange(600, dtype=np.uint16).reshape(20, 30)
PACKED = {"fits": bytes, "fits.gz": gzip.compress, "fits.bz2": bz2.compress}


@pytest.mark.parametrize("ending", PACKED)
def test_whole_numbers_come_back_whatever_the_header_states(tmp_path, ending):
    """SATURATE and BAYERPAT are often wrong: only the pixels count."""
    path = tmp_path / f"ramp.{ending}"
    fits.writeto(
        tmp_path / "plain.fits", RAMP, fits.Header({"SATURATE": 5, "BAYERPAT": "NONE"})
    )
    path.write_bytes(PACKED[ending]((tmp_path / "plain.fits").read_bytes()))
    pixels, saturation, sigma = read_image(path)
    assert (pixels == RAMP).all()
    assert (saturation, sigma) == (np.inf, None)


def test_touching_pixels_that_share_the_highest_number_are_full():
    rng = default_rng(1)
    image = rng.uniform(0, 100, (40, 40))
    image[7, 7] = image[9, 7] = 4000.0
    assert read_image(image)[1] == np.inf
    image[3:6, 3:6] = image[20:23, 30:33] = 4000.0
    assert read_image(image)[1] == 4000
    assert read_image(np.where(image > 200, 255, image).astype(np.uint8))[1] == 255


@pytest.mark.parametrize("kind", [np.ma.array, CCDData, NDData, Masked])
def test_masked_and_missing_pixels_are_not_seen(kind):
    image = RAMP.astype(float)
    image[3, 3] = np.inf
    source = kind(
        image << adu if kind is Masked else image,
        mask=RAMP == 7,
        **{"unit": "adu"} if kind in (CCDData, NDData) else {},
    )
    assert is_image(source)
    missing = np.isnan(read_image(source)[0])
    assert np.argwhere(missing).tolist() == [[0, 7], [3, 3]]


def test_the_uncertainty_of_an_image_is_its_deviation():
    for given in (StdDevUncertainty(2 + RAMP), VarianceUncertainty((2.0 + RAMP) ** 2)):
        found = read_image(CCDData(RAMP, unit="adu", uncertainty=given))[2]
        assert_allclose(found, 2.0 + RAMP)
    for wrong, problem in (
        (StdDevUncertainty(0.0 * RAMP), "from 0"),
        (StdDevUncertainty(np.where(RAMP == 7, np.nan, 1)), "from nan"),
        (StdDevUncertainty(np.ones((3, 30))), r"\(3, 30\)"),
        (UnknownUncertainty(RAMP), "conversion"),
    ):
        with pytest.raises(ValueError, match=f"uncertainty.*{problem}"):
            rp.stars(NDData(RAMP, uncertainty=wrong))
    # An inverse variance of zero marks a pixel without information.
    weights = InverseVariance(np.where(RAMP == 7, 0.0, 1.0))
    missing = np.isnan(read_image(NDData(RAMP, uncertainty=weights))[0])
    assert np.argwhere(missing).tolist() == [[0, 7]]
    milli = StdDevUncertainty(5000.0, unit="mJy")
    assert_allclose(read_image(CCDData(RAMP, unit="Jy", uncertainty=milli))[2], 5)
    constant = read_image(NDData(RAMP, uncertainty=StdDevUncertainty(5.0)))[2]
    assert (constant == 5).all()


def test_a_file_of_several_images_asks_for_the_extension(tmp_path):
    path = tmp_path / "mef.fits"
    units = [
        fits.ImageHDU(RAMP + i, name=name)
        for i, name in enumerate(["WHT", "SCI", "A", "A"])
    ]
    table = fits.table_to_hdu(Table({"x": [1.0], "y": [2.0]}))
    fits.HDUList([fits.PrimaryHDU(), *units, table]).writeto(path)
    with pytest.raises(
        ValueError, match=r"mef.fits.* 1 \(WHT\), 2 \(SCI\), 3 \(A\), 4 \(A\)"
    ):
        rp.stars(path)
    for name, image in (("SCI", RAMP + 1), ("sci", RAMP + 1), ("4", RAMP + 3)):
        assert (read_image(f"{path}[{name}]")[0] == image).all()
    for wrong in ("ERR", "9", "5", "0", "A", " a "):
        with pytest.raises(ValueError, match=rf"mef.fits\[{wrong}\]"):
            rp.stars(f"{path}[{wrong}]")


def test_a_huge_image_is_refused_before_its_pixels_are_read(tmp_path, monkeypatch):
    fits.writeto(tmp_path / "a.fits", RAMP)
    monkeypatch.setattr(images, "_MAX_PIXELS", 599)
    monkeypatch.setattr(
        fits.PrimaryHDU, "data", property(lambda unit: pytest.fail("read"))
    )
    with pytest.raises(ValueError, match="599 px"):
        read_image(tmp_path / "a.fits")


def header(bits, *sides):
    """Write the header of an image without its pixels."""

    def write(path):
        sizes = {f"NAXIS{i}": side for i, side in enumerate(sides, start=1)}
        cards = {"SIMPLE": True, "BITPIX": bits, "NAXIS": len(sides)} | sizes
        content = fits.Header(cards).tostring().encode()
        is_packed = path.suffix == ".gz"
        path.write_bytes(
            gzip.compress(content + bytes(10**6)) if is_packed else content
        )

    return write


def damaged(path):
    """Write a compressed image with three wrong bytes, which still decompress."""
    noise = default_rng(1).integers(0, 99, (200, 200)).astype(np.uint8)
    unit = fits.PrimaryHDU(noise)
    unit.writeto(path.with_suffix(""))
    content = bytearray(gzip.compress(path.with_suffix("").read_bytes()))
    content[-8] ^= 255
    path.write_bytes(content)


def cut(path):
    fits.writeto(path, np.zeros((100, 100)))
    path.write_bytes(path.read_bytes()[:40_000])


BAD = {
    "cut.fits": (cut, "truncated"),
    "empty.fits": (lambda p: p.write_bytes(b""), "empty"),
    "none.fits": (lambda p: fits.HDUList([fits.PrimaryHDU()]).writeto(p), "none"),
    "nan.fits": (
        lambda p: fits.writeto(p, np.full((30, 30), np.nan)),
        "different pixels",
    ),
    "cube.fits": (lambda p: fits.writeto(p, np.zeros((5, 30, 30))), "shape"),
    "huge.fits": (header(-64, 10**5, 10**5), "truncated"),
    "bomb.fits.gz": (header(-64, 30_000, 30_000), "30000, 30000"),
    "damaged.fits.gz": (damaged, "CRC"),
    "cut.fits.gz": (
        lambda p: p.write_bytes(gzip.compress(RAMP.tobytes())[:50]),
        "expected",
    ),
    "large.fits": (lambda p: fits.writeto(p, 1e155 * RAMP), "1e\\+30"),
    "tiny.fits": (lambda p: fits.writeto(p, 1e-155 * RAMP), "different pixels"),
    "zero.fits": (lambda p: p.symlink_to("/dev/zero"), "regular file"),
    "missing.fits": (lambda p: None, "No such file"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_raises_one_line_with_its_name(tmp_path, name):
    write, problem = BAD[name]
    write(tmp_path / name)
    with pytest.raises(ValueError, match=problem) as caught:
        rp.stars(tmp_path / name)
    assert type(caught.value) is ValueError
    assert str(caught.value).startswith(f"{tmp_path / name}: expected ")
    assert str(caught.value).count(f"{name}:") == 1
    assert "\n" not in str(caught.value)


def test_stars_are_no_image():
    assert not is_image(Table({"x": np.zeros(99)}))
    assert is_image(np.zeros((30, 40, 3)))


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    fits.writeto(tmp_path / "a.fits", RAMP)
    monkeypatch.setitem(sys.modules, "astropy.io", None)
    with pytest.raises(ValueError, match=r"a\.fits: .* astropy and photutils"):
        rp.stars(tmp_path / "a.fits")
