"""A user's CSV: what is read, and how errors name the place."""

import numpy as np
import pytest

from reproduce.store.points import TableFileError, read_columns

COLUMNS = ("x", "y")


def write(tmp_path, text):
    path = tmp_path / "spots.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_in_any_order_with_comments(tmp_path):
    path = write(tmp_path, "# from the bench\n y , x\n\n2, 1\n4.5,-3e2\n")
    np.testing.assert_array_equal(read_columns(path, COLUMNS), [[1, 2], [-300, 4.5]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "got an empty file"),
        ("x,y\n", "lines of numbers below"),
        ("x,z\n1,2\n", r"line 1, column 2: unknown column 'z'"),
        ("x,x\n1,2\n", r"line 1, column 2: 'x' is named twice"),
        ("x\n1\n", "line 1: missing column y"),
        ("x,y\n1,2\n3\n", "line 3: expected 2 values, got 1"),
        ("x,y\n1,2\n3,4,5\n", "line 3: expected 2 values, got 3"),
        ("x,y\n1,2\n\n3,four\n", r"line 4, column 2 \(y\): expected a finite number, got 'four'"),
        ("y,x\n1,nan\n", r"line 2, column 2 \(x\): expected a finite number, got 'nan'"),
        ("x,y\n1,\n", r"line 2, column 2 \(y\): expected a finite number, got ''"),
    ],
)
def test_errors_name_file_line_and_column(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(TableFileError, match=message) as caught:
        read_columns(path, COLUMNS)
    assert str(path) in str(caught.value)


def test_other_bytes(tmp_path):
    path = tmp_path / "spots.csv"
    path.write_bytes(b"x,y\n\xff\xfe,1\n")
    with pytest.raises(TableFileError, match="UTF-8"):
        read_columns(path, COLUMNS)
