"""A user's own measurements from a CSV file, with errors that say where the file is wrong.

The first line names the columns; every further line holds one number per column. Lines that are
empty or begin with ``#`` are passed over. Columns may stand in any order; others are refused, so
that a misspelt name is not lost.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


class TableFileError(ValueError):
    """A file of measurements is wrong; the message names file, line and column."""


@dataclass(frozen=True, eq=False)
class Table:
    """Named columns of numbers, and where in the file each stands.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    columns : tuple of str
        The columns, in the order asked for.
    values : ndarray, shape (rows, columns)
        The numbers.
    lines : tuple of int
        The line of each row, counted from one.
    positions : tuple of int
        The place of each column in the file, counted from one.
    texts : tuple of tuple of str
        The numbers as they are written.
    """

    path: Path
    columns: tuple[str, ...]
    values: NDArray[np.float64]
    lines: tuple[int, ...]
    positions: tuple[int, ...]
    texts: tuple[tuple[str, ...], ...]

    def column(self, name: str) -> NDArray[np.float64]:
        """Return one column, shape (rows,)."""
        return np.asarray(self.values[:, self.columns.index(name)])

    def wrong(self, row: int, name: str, problem: str) -> TableFileError:
        """Return the error that names file, line and column of one number."""
        column = self.columns.index(name)
        return TableFileError(
            f"{self.path}, line {self.lines[row]}, column {self.positions[column]} ({name}): "
            f"{problem}, got {self.texts[row][column]!r}"
        )

    def last_digit(self, names: Sequence[str], rows: Sequence[int] | None = None) -> float:
        """Return one unit of the last digit that is written in some columns.

        Parameters
        ----------
        names : sequence of str
            The columns.
        rows : sequence of int, optional
            The rows that count; all by default.

        Returns
        -------
        float
            In the unit of the columns: 0.01 if no number has more than two decimals.
        """
        chosen = range(len(self.texts)) if rows is None else rows
        decimals = [
            len(self.texts[row][self.columns.index(name)].partition(".")[2])
            for row in chosen
            for name in names
        ]
        return float(10.0 ** -max(decimals))


def read_columns(path: Path, columns: Sequence[str]) -> NDArray[np.float64]:
    """Read named columns of numbers; as `read_table`, without the places."""
    return read_table(path, columns).values


def read_table(path: Path, columns: Sequence[str]) -> Table:
    """Read named columns of numbers.

    Parameters
    ----------
    path : pathlib.Path
        A CSV file in UTF-8.
    columns : sequence of str
        The columns that must be there, and no others.

    Returns
    -------
    Table
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
    texts = []
    for _, line in lines[1:]:
        entries = next(csv.reader([line]))
        texts.append(tuple(entries[position].strip() for position in order))
    places = tuple(position + 1 for position in order)
    numbers = tuple(number for number, _ in lines[1:])
    return Table(path, tuple(columns), np.array(rows), numbers, places, tuple(texts))


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
