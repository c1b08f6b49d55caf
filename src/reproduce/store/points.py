"""A user's own measurements from a CSV file, with errors that say where the file is wrong.

The first line names the columns; every further line holds one number per column. Lines that are
empty or begin with ``#`` are passed over. Columns may stand in any order; others are refused, so
that a misspelt name is not lost.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


class TableFileError(ValueError):
    """A file of measurements is wrong; the message names file, line and column."""


def read_columns(path: Path, columns: Sequence[str]) -> NDArray[np.float64]:
    """Read named columns of numbers.

    Parameters
    ----------
    path : pathlib.Path
        A CSV file in UTF-8.
    columns : sequence of str
        The columns that must be there, and no others.

    Returns
    -------
    ndarray, shape (rows, columns)
        In the order of `columns`.

    Raises
    ------
    TableFileError
        If a column is missing, unknown or named twice, a line is too short or too long, a value
        is not a finite number, or there is no line at all.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise TableFileError(
            f"{path}: expected text in UTF-8, got other bytes ({error})"
        ) from error
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.startswith("#")
    ]
    if not lines:
        raise TableFileError(f"{path}: expected a line of column names, got an empty file")
    order = _order(path, *lines[0], columns)
    rows = [_row(path, number, line, columns, order) for number, line in lines[1:]]
    if not rows:
        raise TableFileError(f"{path}: expected lines of numbers below the names, got none")
    return np.array(rows)


def _order(path: Path, number: int, line: str, columns: Sequence[str]) -> list[int]:
    names = [name.strip() for name in next(csv.reader([line]))]
    wanted = ", ".join(columns)
    for position, name in enumerate(names, start=1):
        if name not in columns:
            raise TableFileError(
                f"{path}, line {number}, column {position}: unknown column {name!r}; expected "
                f"the names {wanted}"
            )
        if names.index(name) != position - 1:
            raise TableFileError(
                f"{path}, line {number}, column {position}: {name!r} is named twice; remove one"
            )
    missing = [name for name in columns if name not in names]
    if missing:
        raise TableFileError(
            f"{path}, line {number}: missing column {', '.join(missing)}; expected {wanted}"
        )
    return [names.index(name) for name in columns]


def _row(
    path: Path, number: int, line: str, columns: Sequence[str], order: list[int]
) -> list[float]:
    entries = next(csv.reader([line]))
    if len(entries) != len(columns):
        raise TableFileError(
            f"{path}, line {number}: expected {len(columns)} values, got {len(entries)}; "
            "separate them with commas and write decimals with a point"
        )
    values = []
    for name, position in zip(columns, order, strict=True):
        try:
            value = float(entries[position])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise TableFileError(
                f"{path}, line {number}, column {position + 1} ({name}): expected a finite number, "
                f"got {entries[position].strip()!r}; correct or remove the line"
            )
        values.append(value)
    return values
