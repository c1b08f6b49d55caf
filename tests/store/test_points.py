"""A user's CSV: what is read, and how errors name the place."""

import io

import numpy as np
import pandas as pd
import pint
import pytest

import reproduce as rp
from reproduce.physics.registration import fit_registration
from reproduce.store.points import TableFileError, read_table

COLUMNS = ("x", "y")


def write(tmp_path, text):
    path = tmp_path / "spots.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_in_any_order_with_comments(tmp_path):
    path = write(tmp_path, "# from the bench\n y , x\n\n2, 1\n4.5,-3e2\n")
    np.testing.assert_array_equal(read_table(path, COLUMNS).values, [[1, 2], [-300, 4.5]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "got an empty file"),
        ("x,y\n", "lines of numbers below"),
        ("x,z\n1,2\n", r"line 1: missing column y; expected x, y, got 'x', 'z'"),
        ("x,x\n1,2\n", r"line 1, column 2: 'x' is named twice"),
        ("x\n1\n", "line 1: missing column y"),
        ("x,y\n1,2\n3\n", "line 3: expected 2 values, got 1"),
        ("x,y\n1,2\n3,4,5\n", "line 3: expected 2 values, got 3"),
        ("x,y\n1,2\n\n3,four\n", r"line 4, column 2 \(y\): expected a finite number, got 'four'"),
        ("y,x\n1,nan\n", r"line 2, column 2 \(x\): expected a finite number, got 'nan'"),
        ("x,y\n1,2e40\n", r"line 2, column 2 \(y\): expected a number below 1e\+30, got '2e40'"),
        ("x,y\n1," + 140_000 * "7" + "\n", r"line 2: expected values separated by commas"),
        (140_000 * "x" + ",y\n1,2\n", r"line 1: expected values separated by commas"),
        ("x,y\n1,\n", r"line 2, column 2 \(y\): expected a finite number, got ''"),
    ],
)
def test_errors_name_file_line_and_column(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(TableFileError, match=message) as caught:
        read_table(path, COLUMNS)
    assert str(path) in str(caught.value)


def test_other_bytes(tmp_path):
    path = tmp_path / "spots.csv"
    path.write_bytes(b"x,y\n\xff\xfe,1\n")
    with pytest.raises(TableFileError, match="UTF-8"):
        read_table(path, COLUMNS)


@pytest.mark.parametrize("form", ["%.18e", "%.3e", "%g", "%.4f", "pandas", "repr"])
def test_what_numpy_and_pandas_write_is_read_to_the_last_bit(tmp_path, form):
    values = np.array([[1, 0.0712], [4, 0.0300], [16, 0.0251]])
    path = tmp_path / "spots.csv"
    if form == "pandas":
        pd.DataFrame(values, columns=["x", "y"]).to_csv(path, index=False)
    elif form == "repr":
        path.write_text("x,y\n" + "\n".join(f"{x},{y}" for x, y in values.tolist()))
    else:
        np.savetxt(path, values, fmt=form, delimiter=",", header="x,y", comments="")
    table = read_table(path, COLUMNS)
    np.testing.assert_array_equal(table.values, values)


STARS = pd.DataFrame(
    np.random.default_rng(1).uniform(0, 2000, (30, 4)).round(3),
    columns=["x", "y", "x_reference", "y_reference"],
)
NAMED = STARS.assign(name=[f'HD "{i}", a' for i in range(30)], magnitude=5.0)
MASKED = pd.concat([STARS, STARS[:1].assign(x=np.nan)]).assign(mask=[0] * 30 + [1])


@pytest.mark.parametrize(
    ("frame", "settings"),
    [
        (STARS, {}),
        (STARS, {"index": True}),
        *((STARS, {"sep": sep, "decimal": mark}) for sep in ";\t " for mark in ".,"),
        (STARS, {"encoding": "utf-16", "sep": "\t"}),
        (STARS, {"encoding": "utf-8-sig", "lineterminator": "\r\n"}),
        (STARS.rename(columns={"x": " X (px)", "y": "Y", "x_reference": "X reference"}), {}),
        (STARS[STARS.columns[::-1]], {}),
        (NAMED[NAMED.columns[::-1]], {}),
        (MASKED, {}),
    ],
)
def test_files_as_people_write_them(tmp_path, frame, settings):
    """The same numbers from each file, and from the DataFrame that it was written of."""
    path = tmp_path / "stars.csv"
    frame.to_csv(path, **{"index": False, **settings})
    for source in (path, frame):
        table = read_table(source, STARS.columns)
        np.testing.assert_array_equal(table.values, STARS)
    if frame.columns[0] == "magnitude":
        table = read_table(path, STARS.columns)
        assert [table.text(row, "name") for row in range(30)] == NAMED["name"].tolist()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x;y\n1,234;2,345\n", r"line 2, column 1 \(x\): expected a finite number, got '1,234'"),
        ("x;y\n1,23;2.345\n", r"line 2, column 2 \(y\): expected a finite number, got '2.345'"),
        ("x,yy\n1,2\n", r"line 1: missing column y; did you mean column 2, 'yy'"),
        ("x,y,mask\n1,2,3\n", r"line 2, column 3 \(mask\): expected 0, or 1"),
        ("x,y\n1,2\n3,4,5\n6\n", "line 3: expected 2 values, got 3"),
        ("x,y,name\n1,2,a\n3,4\n", "line 3: expected 3 values, got 2"),
        ("x,y\n1,2\n" + "3," * 10**6 + "4\n", "line 3: expected 2 values, got 1000001"),
        ("x,y\0\n1,2\n", "got binary data"),
    ],
)
def test_what_cannot_be_told_is_refused(tmp_path, text, message):
    with pytest.raises(TableFileError, match=message):
        read_table(write(tmp_path, text), COLUMNS)


def test_excel_says_its_separator_and_savetxt_comments_its_names(tmp_path):
    for text in ("sep=;\r\nx;y\r\n1,5;2\r\n", "# x y\n1.5 2\n"):
        assert read_table(write(tmp_path, text), COLUMNS).values.tolist() == [[1.5, 2]]


def test_masks_and_units_of_arrays_are_honoured_or_refused():
    source, target = STARS.to_numpy()[:, :2], STARS.to_numpy()[:, 2:]
    masked = np.ma.array(source.copy(), mask=False)  # contiguous, for the quick path
    masked[2, 0] = np.ma.masked
    kept = rp.register(masked, target, weights=np.arange(30.0))
    wanted = rp.register(np.delete(source, 2, 0), np.delete(target, 2, 0),
                         weights=np.delete(np.arange(30.0), 2))  # fmt: skip
    np.testing.assert_array_equal(kept.parameters, wanted.parameters)
    assert "1 of 30 rows is masked (row 2) and left out" in kept.remarks
    unit = pint.UnitRegistry()
    in_px = rp.register(source * unit.px, target * unit.pixel).parameters
    np.testing.assert_array_equal(in_px, rp.register(STARS).parameters)
    with pytest.raises(ValueError, match="in px, got source in pixel, target in millimeter"):
        rp.register(source * unit.pixel, target * unit.mm)
    with pytest.raises(ValueError, match="without a mask, got 1 masked"):
        fit_registration(masked, target, (0, 0))
    with pytest.raises(TypeError, match="plain numbers, got a quantity in millimeter"):
        fit_registration(source * unit.mm, target, (0, 0))


def test_sigma_and_weight_columns_are_those_of_the_fit():
    sides = {"sigma": np.linspace(0.1, 0.3, 30), "weight": np.arange(30.0)}
    found = rp.register(STARS.assign(**sides))
    target_covariance = np.square(sides["sigma"])[:, None, None] * np.eye(2)
    wanted = rp.register(STARS, weights=sides["weight"], target_covariance=target_covariance)
    np.testing.assert_allclose(found.covariance, wanted.covariance, rtol=1e-12)
    assert not np.allclose(found.covariance, rp.register(STARS).covariance)


def test_standard_input(monkeypatch):
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"x,y\n1,2\n3,four\n")))
    with pytest.raises(TableFileError, match=r"standard input, line 3, column 2 \(y\)"):
        read_table("-", COLUMNS)
