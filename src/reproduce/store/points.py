"""A user's own measurements from a CSV file, with errors that say where the file is wrong.

The first line names the columns; every further line holds one number per column. Lines that are
empty or begin with ``#`` are passed over. Columns may stand in any order; others are refused, so
that a misspelt name is not lost.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["Table", "TableFileError", "computing", "last_place", "read_table"]

# Significant digits that tell any two doubles apart.
DIGITS = 17
# Beyond this, squares of squares overflow; no length in px or angle in arcsec comes near.
LARGEST = 1e30


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

        In the unit of the columns: 0.01 if no number has more than two decimals; see `last_place`
        for numbers with an exponent.
        """
        chosen = range(len(self.texts)) if rows is None else rows
        places = [self.columns.index(name) for name in names]
        least = min(last_place(self.texts[row][place]) for row in chosen for place in places)
        return float(Decimal(1).scaleb(least))


@contextmanager
def computing(path: Path) -> Iterator[None]:
    """Turn a number that overflows or divides by nothing into an error of the file."""
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            yield
    except FloatingPointError as error:
        raise TableFileError(
            f"{path}: the numbers lead to an {error}; look for values that are huge, zero or alike"
        ) from error


def last_place(text: str) -> int:
    """Return the power of ten of the last digit that is written.

    A number with more digits than a double holds was not measured so: its last digit is that of the
    shortest number that reads alike, as `numpy.savetxt` was given it.

    Examples
    --------
    >>> last_place("0.0710"), last_place("7.1e-2"), last_place("1e-3"), last_place("12")
    (-4, -3, -3, 0)
    >>> last_place("7.099999999999999367e-02")
    -3
    """
    number = Decimal(text)
    _, digits, place = number.as_tuple()
    if not isinstance(place, int):
        raise ValueError(f"expected a finite number, got {text!r}")
    if (len(digits) if number else 1 - place) > DIGITS:
        shortest = Decimal(repr(float(text))).normalize()
        return min(0, int(shortest.as_tuple().exponent))
    return int(place)


def read_table(path: Path, columns: Sequence[str]) -> Table:
    """Read named columns of numbers."""
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
    if len(lines) == 1:
        raise TableFileError(f"{path}: expected lines of numbers below the names, got none")
    texts = [_row(path, number, line, order) for number, line in lines[1:]]
    values = [_values(path, number, row, columns, order)
              for (number, _), row in zip(lines[1:], texts, strict=True)]  # fmt: skip
    places = tuple(position + 1 for position in order)
    numbers = tuple(number for number, _ in lines[1:])
    return Table(path, tuple(columns), np.array(values), numbers, places, tuple(texts))


def _entries(path: Path, number: int, line: str) -> list[str]:
    try:
        return [entry.strip() for entry in next(csv.reader([line]))]
    except csv.Error as error:
        raise TableFileError(
            f"{path}, line {number}: expected values separated by commas, got what is none "
            f"({error}); check the line for a missing comma or quote"
        ) from error


def _order(path: Path, number: int, line: str, columns: Sequence[str]) -> list[int]:
    names = _entries(path, number, line)
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


def _row(path: Path, number: int, line: str, order: list[int]) -> tuple[str, ...]:
    entries = _entries(path, number, line)
    if len(entries) != len(order):
        raise TableFileError(
            f"{path}, line {number}: expected {len(order)} values, got {len(entries)}; "
            "separate them with commas and write decimals with a point"
        )
    return tuple(entries[position] for position in order)


def _values(
    path: Path, number: int, texts: tuple[str, ...], columns: Sequence[str], order: list[int]
) -> list[float]:
    values = []
    for name, position, text in zip(columns, order, texts, strict=True):
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not abs(value) < LARGEST:
            expected = f"a number below {LARGEST:g}" if math.isfinite(value) else "a finite number"
            raise TableFileError(
                f"{path}, line {number}, column {position + 1} ({name}): expected {expected}, "
                f"got {text[:40]!r}; correct or remove the line"
            )
        values.append(value)
    return values
