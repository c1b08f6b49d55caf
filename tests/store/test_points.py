"""A user's CSV: what is read, and how errors name the place."""

import numpy as np
import pandas as pd
import pytest

from reproduce.store.points import TableFileError, last_place, read_table

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


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("7.1e-2", -3),
        ("1e-3", -3),
        ("5E-05", -5),
        ("0.0710", -4),
        ("+12", 0),
        ("-.50", -2),
        ("3.", 0),
        ("1.50e+02", 0),
        ("0", 0),
        ("0.00", -2),
        ("1.000000000000000000e+00", 0),
        ("0.000000000000000000e+00", 0),
        ("7.099999999999999367e-02", -3),
        ("1.000000000000000000e+03", 0),
        ("0.30000000000000004", -17),
    ],
)
def test_the_last_digit_is_found_in_every_form(text, place):
    assert last_place(text) == place


@pytest.mark.parametrize("text", ["nan", "inf"])
def test_what_is_no_number_has_no_last_digit(text):
    with pytest.raises(ValueError, match="finite"):
        last_place(text)


@pytest.mark.parametrize("form", ["%.18e", "%.3e", "%g", "%.4f", "pandas", "repr"])
def test_what_numpy_and_pandas_write_of_rounded_numbers_has_their_last_digit(tmp_path, form):
    """Each keeps four decimals, or more significant digits than these numbers have."""
    values = np.array([[1, 0.0712], [4, 0.0300], [16, 0.0251]])
    path = tmp_path / "spots.csv"
    if form == "pandas":
        pd.DataFrame(values, columns=["x", "y"]).to_csv(path, index=False)
    elif form == "repr":
        path.write_text("x,y\n" + "\n".join(f"{x},{y}" for x, y in values.tolist()))
    else:
        np.savetxt(path, values, fmt=form, delimiter=",", header="x,y", comments="")
    table = read_table(path, COLUMNS)
    digits = {"%.3e": 1e-5}
    assert table.last_digit(["y"]) == pytest.approx(digits.get(form, 1e-4), rel=1e-12)
    np.testing.assert_array_equal(table.values, values)
