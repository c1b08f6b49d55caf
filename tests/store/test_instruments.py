"""The files of real instruments are those of their origin."""

import hashlib
import re
import sys

import numpy as np
import pytest

from reproduce.locate import data_folder
from reproduce.store.instruments import lenses, mosaic

FOLDER = data_folder() / "instruments"
FILES = [("2mass", f"2MASS_{band}.fits") for band in "jhk"] + [("lensfun", "tca.csv")]


@pytest.mark.parametrize(("folder", "name"), FILES)
def test_files_are_those_that_the_readme_names(folder, name):
    said = (FOLDER / folder / "README.md").read_text(encoding="utf-8")
    found = hashlib.sha256((FOLDER / folder / name).read_bytes()).hexdigest()
    assert re.search(rf"`{re.escape(name)}`.*`{found}`", said)


@pytest.mark.parametrize("band", "jhk")
def test_a_mosaic_is_whole_and_cannot_be_changed(band):
    image = mosaic(band)
    assert image.shape == (720, 721)
    assert np.isfinite(image).all()
    with pytest.raises(ValueError, match="read-only"):
        image[0, 0] = 1.0


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "astropy.io", None)
    with pytest.raises(ImportError, match=r"reproduce-pointing\[images\]"):
        mosaic.__wrapped__("j")


def test_lenses_have_scales_near_one():
    table = lenses()
    assert len(table) == 2888
    assert len(table.groupby(["maker", "lens"])) == 684
    assert (table[["vr", "vb"]] - 1).abs().to_numpy().max() < 0.01
