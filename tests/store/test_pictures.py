"""Pictures from files and arrays: what is read, and what is refused in one line."""

import numpy as np
import pytest
import tifffile
from astropy.io import fits
from PIL import Image
from skimage import data

from reproduce.store.pictures import PictureError, is_picture, read_pictures

RAMP = np.arange(600, dtype=np.uint16).reshape(20, 30)


@pytest.mark.parametrize("ending", ["fits", "fits.gz", "tif", "png"])
def test_whole_numbers_come_back(tmp_path, ending):
    path = tmp_path / f"ramp.{ending}"
    if ending.startswith("fits"):
        fits.writeto(path, RAMP)
    elif ending == "tif":
        tifffile.imwrite(path, RAMP)
    else:
        Image.fromarray(RAMP).save(path)
    (name, picture), *others = read_pictures(path).items()
    assert (name, others) == ("", [])
    assert (picture.light == RAMP).all()
    assert picture.step == 1


@pytest.mark.parametrize("gap", [1, 64])
def test_the_step_is_that_of_the_numbers_whatever_their_type(gap):
    noise = np.random.default_rng(1).normal(500, 3, (200, 300))
    (digital,) = read_pictures(gap * noise.round()).values()
    assert digital.step == gap
    (continuous,) = read_pictures(gap * noise).values()
    assert continuous.step < 0.01 * gap


def test_a_colour_tiff_keeps_sixteen_bits(tmp_path):
    """Pillow alone would give eight."""
    path, colours = tmp_path / "rgb.tif", np.stack([RAMP, RAMP + 1, RAMP + 2], axis=-1)
    tifffile.imwrite(path, colours)
    found = read_pictures(path)
    assert list(found) == ["red", "green", "blue"]
    assert (found["blue"].light == RAMP + 2).all()


@pytest.mark.parametrize("mode", ["LA", "P", "RGB"])
def test_a_grey_picture_is_one_channel_however_it_is_written(tmp_path, mode):
    Image.fromarray(RAMP.astype(np.uint8)).convert(mode).save(tmp_path / "grey.png")
    (name, picture), *others = read_pictures(tmp_path / "grey.png").items()
    assert (name, others) == ("", [])
    assert (picture.light == RAMP % 256).all()


def test_a_png_of_sixteen_bits_in_colour_says_what_is_lost(tmp_path):
    import cv2

    cv2.imwrite(str(tmp_path / "deep.png"), np.stack([RAMP * 100, RAMP, RAMP], axis=-1))
    assert "read as 8" in read_pictures(tmp_path / "deep.png")["red"].notes[0]


def test_a_header_says_what_is_full_and_where_the_colours_are(tmp_path):
    header = fits.Header({"SATURATE": 500, "BAYERPAT": "RGGB"})
    fits.writeto(tmp_path / "raw.fits", RAMP, header)
    found = read_pictures(tmp_path / "raw.fits")
    assert np.isfinite(found["red"].light[0, 0])
    assert (found["green"].full == (RAMP >= 500)).all()


def test_a_mosaic_shows_each_channel_under_its_filter():
    found = read_pictures(RAMP, bayer="grbg")
    seen = {name: np.isfinite(one.light) for name, one in found.items()}
    assert (sum(one.astype(int) for one in seen.values()) == 1).all()
    assert seen["green"][0, 0]
    assert seen["red"][0, 1]
    assert seen["blue"][1, 0]
    with pytest.raises(PictureError, match="R, G, G and B"):
        read_pictures(RAMP, bayer="RGBW")


def test_a_jpeg_is_linear_light(tmp_path):
    Image.fromarray(np.repeat(np.arange(256, dtype=np.uint8)[None], 16, 0)).save(
        tmp_path / "ramp.jpg", quality=100
    )
    light = read_pictures(tmp_path / "ramp.jpg")[""].light[8]
    # Of sRGB, 188 is half of the light.
    assert light[188] / light[255] == pytest.approx(0.503, abs=0.02)


def test_touching_pixels_that_share_the_highest_number_are_full():
    rng = np.random.default_rng(1)
    image = rng.uniform(0, 100, (40, 40))
    assert not read_pictures(image)[""].full.any()
    image[3:6, 3:6] = image[20:23, 30:33] = 4000.0
    assert read_pictures(image)[""].full.sum() == 18


def test_masked_and_missing_pixels_are_not_seen():
    image = np.ma.masked_equal(RAMP.astype(float), 7)
    image[3, 3] = np.inf
    assert np.isfinite(read_pictures(image)[""].light).sum() == RAMP.size - 2


def cut(path):
    fits.writeto(path, np.zeros((100, 100)))
    path.write_bytes(path.read_bytes()[:40_000])


BAD = {
    "cut.fits": (cut, "truncated"),
    "cut.png": (lambda p: p.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(50)), "cannot be read"),
    "empty.fits": (lambda p: p.write_bytes(b""), "cannot be read: Empty"),
    "empty.jpg": (lambda p: p.write_bytes(b""), "cannot be read"),
    "words.tif": (lambda p: p.write_text("hello"), "cannot be read"),
    "words.fits": (lambda p: p.write_text("hello"), "cannot be read"),
    "table.fits": (lambda p: fits.HDUList([fits.PrimaryHDU()]).writeto(p), "tables alone"),
    "nan.fits": (lambda p: fits.writeto(p, np.full((30, 30), np.nan)), "got 900 missing and 0 at"),
    "full.fits": (
        lambda p: fits.writeto(p, np.full((30, 30), 65535, np.uint16)),
        "900 at the highest number of 900",
    ),
    "line.fits": (lambda p: fits.writeto(p, np.zeros((3, 900))), "16\\+ px"),
    "cube.fits": (lambda p: fits.writeto(p, np.zeros((5, 30, 30))), "3 channels"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_told_in_one_line(tmp_path, name):
    write, message = BAD[name]
    write(tmp_path / name)
    with pytest.raises(PictureError, match=message) as told:
        read_pictures(tmp_path / name)
    assert str(told.value).startswith(name)
    assert "\n" not in str(told.value)


def test_stars_are_no_picture():
    assert not is_picture(np.zeros((900, 2)))
    assert not is_picture([[0, 0], [1, 1]])
    assert is_picture(data.chelsea())
