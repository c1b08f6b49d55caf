"""Tables of a user: the sources that are read, and errors that name the row and column."""

import gzip
import io

import numpy as np
import pandas as pd
import pint
import pytest
from astropy import units
from astropy.coordinates import SkyCoord
from astropy.io import fits
from astropy.table import QTable, Table
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

import reproduce as rp
from reproduce.store.points import read_table

COLUMNS = ("x", "y")
STARS = pd.DataFrame(
    default_rng(1).uniform(0, 2000, (30, 4)).round(3),
    columns=["x", "y", "x_reference", "y_reference"],
)


def write(tmp_path, text, name="spots.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def refused(source, *places):
    """Read a wrong table; the error is one line that names the places."""
    with pytest.raises(ValueError, match="expected") as caught:
        read_table(source, COLUMNS)
    message = str(caught.value)
    assert all(place in message for place in places), message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("text", "places"),
    [
        (b"", ()),
        ("x,y\n", ()),
        ("x,z\n1,2\n", ("column y", "'z'")),
        ("x,x,y\n1,2,3\n", ("column x",)),
        ("x,y,Mask\n1,2,0\n", ("column mask",)),
        ("x,y\n1,2,9\n3,4,9\n", ()),
        ("x,y\n1,2\n3,4,5\n", ("line 3",)),
        ("x,y\n1,2\n3\n", ("row 1", "column y")),
        ("x,y\n1,2\n\n3,four\n", ("row 1", "column y")),
        ("y,x\n1,nan\n", ("row 0", "column x")),
        ("y,x\n1,2026-11-27\n", ("row 0", "column x", "dates are nan")),
        ("x,y\n1,2e40\n", ("row 0", "column y")),
        ("x;y\n1,5;2\n", ("sep",)),
        ('x,y\n"1,5",2\n', ("row 0", "column x", "decimal point")),
        ("x,y\0\n1,2\n", ("column y",)),
        (b"x,y\n\xff\xfe,1\n", ("another format",)),
        ("x (arcsec),y (arcsec)\n1,2\n", ("column x", "arcsec")),
        ("# id and x vs y\n7 511.8 950.4 11.9 0.5\n", ("column x", "first line")),
    ],
)
def test_errors_name_the_file_and_the_place(tmp_path, text, places):
    path = write(tmp_path, text)
    refused(path, str(path), *places)


NAMED = STARS.assign(name=[f'HD "{i}", a' for i in range(30)], magnitude=5.0)
HEADS = {"x": " X (px)", "y": "Y", "x_reference": "X reference"}


@pytest.mark.parametrize(
    ("frame", "settings"),
    [
        *((STARS, {"sep": sep}) for sep in ";\t "),
        (STARS, {"encoding": "utf-8-sig", "lineterminator": "\r\n"}),
        (STARS, {"compression": "gzip"}),
        (STARS.rename(columns=HEADS), {}),
        (NAMED[NAMED.columns[::-1]], {}),
    ],
)
def test_a_text_file_and_its_dataframe_give_the_numbers(tmp_path, frame, settings):
    path = tmp_path / ("stars.csv.gz" if "compression" in settings else "stars.csv")
    frame.to_csv(path, **{"index": False, **settings})
    columns = frame.to_dict("list")
    for source in (
        path,
        frame,
        columns,
        frame.convert_dtypes(),
        frame.astype(object),
    ):
        found = read_table(source, STARS.columns, sep=settings.get("sep"))
        assert_array_equal(found.values, STARS)


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("s.ecsv", "ascii.ecsv"),
        ("s.txt", "ascii.ecsv"),
        ("s.fits", "fits"),
        ("s.xyls", "fits"),
        ("s.vot", "votable"),
    ],
)
def test_astropy_tables_and_their_files_are_read_in_px_only(tmp_path, name, form):
    table = Table.from_pandas(STARS.rename(columns=str.upper))
    table["X"].unit = units.pix
    table["RA"] = STARS["x"].to_numpy()
    table["RA"].unit = units.deg
    path, packed = tmp_path / name, tmp_path / f"{name}.gz"
    table.write(path, format=form)
    packed.write_bytes(gzip.compress(path.read_bytes()))
    for source in (path, packed, table, table.as_array(), QTable(table)):
        assert_array_equal(read_table(source, STARS.columns).values, STARS)
    table["Y"].unit = units.arcsec
    table.write(path, format=form, overwrite=True)
    for source in (path, table):
        refused(source, "column Y", "arcsec")


def test_a_file_of_several_tables_is_refused(tmp_path):
    path = tmp_path / "two.fits"
    catalogue = fits.table_to_hdu(Table.from_pandas(STARS))
    catalogue.header["TUNIT1"] = "PIXEL"
    fits.HDUList([fits.PrimaryHDU(), catalogue]).writeto(path)
    assert_array_equal(read_table(path, COLUMNS).values, STARS[["x", "y"]])
    fits.append(path, catalogue.data)
    refused(path, "multiple tables")


def test_a_sextractor_catalogue_is_read(tmp_path):
    text = "# 1 X Object position [pixel]\n# 2 Y Object position [pixel]\n 1.5 2.5\n"
    found = read_table(write(tmp_path, text, "s.cat"), COLUMNS)
    assert found.values.tolist() == [[1.5, 2.5]]


def test_masked_entries_and_columns_of_other_kinds():
    columns = {"x": [1.0, 2], "y": [3.0, 4], "image": np.zeros((2, 5))}
    table = Table(columns, masked=True)
    table["sky"] = SkyCoord([1, 2], [3, 4], unit="deg")
    assert read_table(table, COLUMNS).values.tolist() == [[1, 3], [2, 4]]
    table["y"].mask[1] = True
    refused(table, "row 1", "column y")
    complex_numbers = 1j * np.ones(2)
    for odd in (complex_numbers, complex_numbers.astype(object), np.zeros(2, "M8[s]")):
        refused(pd.DataFrame({"x": [1.0, 2], "y": odd}), "column y")
    refused(STARS.to_records()[0], "column x")
    refused({"x": [1.0], "y": [1.0, 2]}, "one length")


def test_two_tables_of_matched_stars_give_the_fit_of_one():
    table = Table.from_pandas(STARS)
    source, target = table["x", "y"], table["x_reference", "y_reference"]
    with pytest.raises(ValueError, match=r"^target: .* x "):
        rp.register(source, target)
    wanted = rp.register(STARS).parameters
    assert_array_equal(rp.register(table.as_array()).parameters, wanted)
    target.rename_columns(target.colnames, COLUMNS)
    assert_array_equal(rp.register(source, target).parameters, wanted)
    with pytest.raises(ValueError, match="source and target"):
        rp.register(source[3:], target)
    for name in ("sigma", "weight"):
        with pytest.raises(ValueError, match=f"^{name}: expected"):
            rp.register(source, target.to_pandas().assign(**{name: 1.0}))


def test_arrays_with_masks_units_or_other_shapes_are_refused():
    source = STARS[["x", "y"]].to_numpy()
    for odd, place in (
        (np.ma.masked_equal(source, source[2, 1]), "row 2, column y"),
        (pint.UnitRegistry().Quantity(source.tolist(), "mm"), "millimeter"),
        (source * units.mm, "px, got mm"),
        ([*source * units.mm], "a quantity"),
        (source * units.dimensionless_unscaled, "px, got no unit"),
        (1j * source, "real numbers"),
        (source.astype(str), "real numbers"),
        (source[:, :1], "shape"),
        (source[:0], "shape"),
        (source[None], "shape"),
        (np.where(source == source[2, 1], None, source), "row 2, column y"),
        ([[1, 2], [3]], "unequal length"),
    ):
        with pytest.raises(ValueError, match=f"^source.*{place}"):
            read_table(odd, COLUMNS, name="source")


def test_sigma_and_weight_columns_are_those_of_the_fit(tmp_path):
    # sigma_x comes before sigma.
    sigma, weights = np.linspace(0.1, 0.3, 30), np.arange(30) % 2
    sides = {"sigma": sigma, "weight": weights}
    found = rp.register(STARS.assign(**sides, sigma_x=3 * sigma))
    covariance = np.square(sigma)[:, None, None] * np.diag([9, 1])
    expected = rp.register(STARS, weights=weights, target_covariance=covariance)
    assert_allclose(found.covariance, expected.covariance, rtol=1e-12)
    for wrong, place in (
        ({"sigma": -sigma}, "row 0, column sigma"),
        ({"sigma_x": sigma}, "sigma_y"),
    ):
        with pytest.raises(ValueError, match=place):
            rp.register(STARS.assign(**wrong))
    with pytest.raises(ValueError, match=r"^weights: "):
        rp.register(STARS.assign(**sides), weights=weights)
    # Errors are weights already.
    with pytest.raises(ValueError, match=r"^weights: expected 0 or 1"):
        rp.register(STARS.assign(sigma=sigma, weight=sigma**-2.0))


def test_the_hash_of_a_table_covers_its_errors():
    one, other = (
        read_table(STARS.assign(sigma=sigma), STARS.columns, ("sigma",)).sha256
        for sigma in (0.1, 0.2)
    )
    assert one != other


def test_standard_input(monkeypatch):
    monkeypatch.setattr(
        "sys.stdin", io.TextIOWrapper(io.BytesIO(b"x,y\n1,2\n3,four\n"))
    )
    refused("-", "standard input, row 1, column y")
