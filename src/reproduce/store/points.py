"""A user's own measurements, from a file, a DataFrame or arrays: one table, one way to name rows.

The first line of a file names the columns; every further line holds a value for each. Columns may
stand in any order and in any case, between commas, semicolons, tabs or blanks; further ones are
kept. Lines that are empty or begin with ``#`` are passed over. Rows of a file are named by their
line, counted from one as an editor does; rows of arrays and DataFrames by their place, counted from
zero as Python does.
"""

from __future__ import annotations

import csv
import difflib
import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

# Beyond this, squares of squares overflow; no length in px or angle in arcsec comes near.
LARGEST = 1e30
# What may stand between values, the likelier first, with its name in the plural.
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "blanks"}
# Stars of one channel: their places there and in the reference channel, in px.
STARS = ("x", "y", "x_reference", "y_reference")
MASK = "mask"
MASKED = {"": False, "0": False, "0.0": False, "false": False, "1": True, "1.0": True, "true": True}
PIXELS = ("px", "pix", "pixel", "pixels", "css_pixel")  # the last is what Pint calls px
# So many rows are named in one remark, and so many columns in one error.
NAMED, LISTED = 5, 12
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")

FloatArray = NDArray[np.float64]


class TableFileError(ValueError):
    """Measurements are wrong; the message names the file, line and column."""


@dataclass(frozen=True, eq=False)
class Table:
    """Named columns of numbers, and where each stands.

    Parameters
    ----------
    path : str
        The file, or what else the numbers come from.
    columns : tuple of str
        The columns, in the order asked for.
    values : ndarray, shape (rows, columns)
        The numbers; rows that a mask drops are left out.
    lines : ndarray of int, shape (rows,)
        The line of each row, from one; or its place in arrays, from zero.
    positions : tuple of int
        The place of each column, counted from one.
    kind : {"line", "row"}
        What a row is called.
    optional : mapping
        The numbers of those optional columns that there are.
    names : tuple of str
        All columns, in their order.
    notes : tuple of str
        What a user should hear of the reading.
    """

    path: str
    columns: tuple[str, ...]
    values: FloatArray
    lines: NDArray[np.int64]
    positions: tuple[int, ...]
    kind: str = "row"
    optional: Mapping[str, FloatArray] = field(default_factory=dict)
    names: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    _entry: Callable[[int, str], str] | None = None
    _content: bytes | None = None

    def column(self, name: str) -> FloatArray:
        """Return one column, shape (rows,)."""
        return np.asarray(self.values[:, self.columns.index(name)])

    def text(self, row: int, name: str) -> str:
        """Return one entry as it is written, also of a column that nobody asked for."""
        if self._entry is None:
            return repr(float(self.column(name)[row]))
        return self._entry(int(self.lines[row]), name)

    def extra(self, name: str) -> tuple[str, ...]:
        """Return one of ``names`` as text, such as those of the stars."""
        return tuple(self.text(row, name) for row in range(len(self.lines)))

    @cached_property
    def sha256(self) -> str:
        """Hash of the file, or of the numbers where there is none."""
        return sha256(self.values.tobytes() if self._content is None else self._content).hexdigest()

    def named(self, rows: Sequence[int] | NDArray[np.int64]) -> str:
        """Name rows for a reader: "lines 3, 4"."""
        return _named(self.kind, self.lines[np.asarray(rows, dtype=int)])

    def at(self, row: int, name: str) -> str:
        """Return where one number stands: file, line and column."""
        position = self.positions[self.columns.index(name)] if name in self.columns else (
            self.names.index(name) + 1
        )  # fmt: skip
        return f"{self.path}, {self.kind} {self.lines[row]}, column {position} ({name})"

    def wrong(self, row: int, name: str, problem: str) -> TableFileError:
        """Return the error that names file, line and column of one number."""
        return TableFileError(f"{self.at(row, name)}: {problem}, got {self.text(row, name)!r}")


@contextmanager
def computing(path: str | Path) -> Iterator[None]:
    """Turn a number that overflows or divides by nothing into an error of the file."""
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            yield
    except FloatingPointError as error:
        raise TableFileError(
            f"{path}: the numbers lead to an {error}; look for values that are huge, zero or alike"
        ) from error


def is_table(source: object) -> bool:
    """Say whether something is a path, "-" or a DataFrame, and not an array.

    Examples
    --------
    >>> is_table("stars.csv"), is_table([[1, 2]])
    (True, False)
    """
    return isinstance(source, str | Path) or hasattr(source, "iloc")


def read_table(
    source: str | Path | pd.DataFrame, columns: Sequence[str], optional: Sequence[str] = ()
) -> Table:
    """Read named columns of numbers from a file, from "-" (standard input) or from a DataFrame.

    A column ``mask`` drops the rows where it is 1.
    """
    wanted = (*optional, MASK)
    if not isinstance(source, str | Path):
        return _from_frame(source, columns, wanted)
    if str(source) == "-":
        return _TextFile("standard input", sys.stdin.buffer.read(), columns).table(wanted)
    return _TextFile(str(source), Path(source).read_bytes(), columns).table(wanted)


def table_of(columns: Sequence[str], *blocks: tuple[str, Any]) -> Table:
    """Return arrays, named and of shape (n, 2), side by side as one table.

    Rows that a mask drops in any of them are left out; units other than px are refused.
    """
    arrays, dropped = zip(*measured(*blocks), strict=True)
    for (name, _), array in zip(blocks, arrays, strict=True):
        if array.ndim != 2 or array.shape[1] != 2:
            raise ValueError(
                f"{name}: expected one set of stars, shape (n, 2), got {array.shape}; rows are "
                "stars, columns x and y; fit_registration takes many sets at once"
            )
    if len({len(array) for array in arrays}) > 1:
        raise ValueError(
            f"{' and '.join(name for name, _ in blocks)}: expected as many rows, got "
            f"{' and '.join(str(len(array)) for array in arrays)}; row i of both must be the same "
            "observation"
        )
    gone = np.logical_or.reduce([one.any(axis=1) for one in dropped])
    values, lines = np.hstack(arrays), np.arange(len(gone))
    bad = ~(np.abs(values) < LARGEST) & ~gone[:, None]
    if bad.any():
        row, place = (int(i) for i in np.argwhere(bad)[0])
        raise TableFileError(
            f"{blocks[place // 2][0]}, row {row}: expected {_expected(values[row, place])}, got "
            f"{values[row, place]:g} ({int(bad.any(axis=1).sum())} such rows); remove or mask them"
        )
    return Table(
        "the arrays", tuple(columns), values[~gone], lines[~gone],
        tuple(range(1, len(columns) + 1)), names=tuple(columns), notes=_note(gone, "row", lines),
    )  # fmt: skip


def measured(*named: tuple[str, Any]) -> list[tuple[FloatArray, NDArray[np.bool_]]]:
    """Return arrays in px, each with its mask; one in another unit is refused."""
    units = {name: str(getattr(one, "units", getattr(one, "unit", "px"))) if hasattr(one, "to")
             else "px" for name, one in named}  # fmt: skip
    if any(unit not in PIXELS for unit in units.values()):
        came = ", ".join(f"{name} in {unit or 'no unit'}" for name, unit in units.items())
        raise ValueError(f"expected measurements in px, got {came}; convert them to px first")
    found = []
    for name, one in named:
        bare = getattr(one, "magnitude", getattr(one, "value", one)) if hasattr(one, "to") else one
        if hasattr(bare, "iloc"):
            bare = bare.to_numpy()
        mask = np.array(np.ma.getmaskarray(bare)) if np.ma.isMaskedArray(bare) else None
        try:
            array = np.asarray(np.ma.getdata(bare) if mask is not None else bare, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise TypeError(f"{name}: expected an array of numbers, got something else; give each "
                            "row as many numbers, without text") from None  # fmt: skip
        found.append((array, np.zeros(array.shape, bool) if mask is None else mask))
    return found


def _named(kind: str, labels: NDArray[np.int64]) -> str:
    shown = ", ".join(map(str, labels[:NAMED].tolist()))
    return f"{kind}{'s' * (len(labels) > 1)} {shown}{', ...' * (len(labels) > NAMED)}"


def _note(dropped: NDArray[np.bool_], kind: str, lines: NDArray[np.int64]) -> tuple[str, ...]:
    count = int(dropped.sum())
    if not count:
        return ()
    if count == len(dropped):
        raise TableFileError(f"expected {kind}s that are not masked, got all {count} masked")
    told = _named(kind, lines[dropped])
    return (f"{count} of {len(dropped)} {kind}s {'are' if count > 1 else 'is'} masked ({told}) "
            "and left out",)  # fmt: skip


def _expected(value: float) -> str:
    return f"a number below {LARGEST:g}" if math.isfinite(value) else "a finite number"


def _plain(name: object) -> str:
    """Return a column's name without its case, blanks around it, and a unit of pixels."""
    bare = re.sub(r"\s*[\[(](px|pixels?)[\])]$", "", str(name).strip().lower())
    return re.sub(r"[\s-]+", "_", bare)


def _order(where: str, names: Sequence[str], columns: Sequence[str]) -> list[int]:
    """Return the place of each wanted column; refuse what is missing or named twice."""
    places: dict[str, int] = {}
    for place, name in enumerate(names):
        if name and name in places:
            raise TableFileError(
                f"{where}, column {place + 1}: {name!r} is named twice; remove one"
            )
        places[name] = place
    missing = [name for name in columns if name not in places]
    if missing:
        others = [name for name in names[: 10 * LISTED] if name not in columns]
        near = {one: difflib.get_close_matches(one, others, 1) for one in missing}
        hint = "".join(f"; did you mean column {places[found[0]] + 1}, {found[0]!r}, by {one}?"
                       for one, found in near.items() if found)  # fmt: skip
        came = ", ".join(repr(name[:40]) for name in names[:LISTED])
        raise TableFileError(
            f"{where}: missing column {', '.join(missing)}{hint}; expected {', '.join(columns)}, "
            f"got {came}{', ...' * (len(names) > LISTED)}"
        )
    return [places[name] for name in columns]


def _split(line: str, separator: str) -> list[str]:
    """Return the values of a line."""
    text = " ".join(line.split()) if separator == " " else line
    rows = csv.reader([text], delimiter=separator, skipinitialspace=True)
    return [entry.strip() for entry in next(rows)]


def _from_frame(frame: pd.DataFrame, columns: Sequence[str], optional: Sequence[str]) -> Table:
    import pandas as pd

    name = "the DataFrame"
    names = tuple(map(_plain, frame.columns))
    there = (*columns, *(one for one in optional if one in names))
    order = _order(name, names, there)
    if not len(frame):
        raise TableFileError(f"{name}: expected rows of numbers, got none")
    values = np.column_stack(
        [pd.to_numeric(frame.iloc[:, place], errors="coerce").to_numpy(float, na_value=np.nan)
         for place in order]
    )  # fmt: skip

    def entry(row: int, column: str) -> str:
        return str(frame.iloc[row, names.index(column)])

    table = Table(name, there, values, np.arange(len(values)), tuple(i + 1 for i in order), "row",
                  {}, names, (), entry)  # fmt: skip
    return _sorted_out(table, len(columns))


def _sorted_out(table: Table, count: int) -> Table:
    """Return a table without its masked rows, the columns after so many being optional ones."""
    gone = np.zeros(len(table.values), bool)
    if MASK in table.columns:
        flags = table.column(MASK)
        if len(odd := np.flatnonzero((flags != 0) & (flags != 1))):
            raise table.wrong(int(odd[0]), MASK, "expected 0, or 1 to drop the row")
        gone = flags == 1
    bad = ~(np.abs(table.values) < LARGEST) & ~gone[:, None]
    if bad.any():
        row, place = (int(i) for i in np.argwhere(bad)[0])
        name = table.columns[place]
        raise TableFileError(
            f"{table.at(row, name)}: expected {_expected(table.values[row, place])}, got "
            f"{table.text(row, name)[:40]!r}; correct or remove the {table.kind}"
        )
    try:
        notes = _note(gone, table.kind, table.lines)
    except TableFileError as error:
        raise TableFileError(f"{table.path}: {error}") from error
    kept = slice(None) if not notes else ~gone
    values, columns = table.values[kept], table.columns
    more = {name: values[:, i] for i, name in enumerate(columns) if i >= count and name != MASK}
    return Table(
        table.path, columns[:count], values[:, :count], table.lines[kept], table.positions[:count],
        table.kind, more, table.names, notes, table._entry, table._content,
    )  # fmt: skip


class _TextFile:
    """A file of columns: where its lines are, and how they are written."""

    def __init__(self, name: str, content: bytes, columns: Sequence[str]) -> None:
        self.name, self.content, self.columns = name, content, columns
        self.text = self._bytes()
        ends = np.append(np.flatnonzero(np.frombuffer(self.text, np.uint8) == ord("\n")),
                         len(self.text))  # fmt: skip
        self.starts = np.concatenate([[0], ends + 1])
        self.head, self.lines, self.separator = self._layout()
        self.names = tuple(map(_plain, self._entries(self.head, self.line(self.head).lstrip("#"))))
        _order(f"{name}, line {self.head}", self.names, columns)
        if not len(self.lines):
            raise TableFileError(f"{name}: expected lines of numbers below the names, got none")
        self.decimal = self._decimal()

    def _bytes(self) -> bytes:
        """Return the file in UTF-8, each line ended by a line feed."""
        data = self.content
        if not data.strip():
            raise TableFileError(f"{self.name}: expected a line of column names, got an empty file")
        try:
            if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
                data = data.decode("utf-16").encode()
            data.decode()
        except UnicodeError as error:
            raise TableFileError(
                f"{self.name}: expected text in UTF-8, got other bytes ({error}); save it as CSV "
                "in UTF-8"
            ) from error
        if b"\0" in data:
            raise TableFileError(f"{self.name}: expected text in UTF-8, got binary data; save it "
                                 "as CSV in UTF-8")  # fmt: skip
        if b"\r" in data:
            data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        return data.removeprefix(b"\xef\xbb\xbf")

    def line(self, number: int) -> str:
        """Return one line, counted from one."""
        start, end = self.starts[number - 1 : number + 1]
        return self.text[start : end - 1].decode()

    def _layout(self) -> tuple[int, NDArray[np.int64], str]:
        """Return the line of names, those of values, and what separates them."""
        letters = np.frombuffer(self.text, np.uint8)
        first = letters[np.minimum(self.starts[:-1], len(letters) - 1)]
        full = first != ord("\n")
        for i in np.flatnonzero((first == ord(" ")) | (first == ord("\t"))).tolist():
            full[i] = bool(self.line(i + 1).strip())
        told = first == ord("#")
        numbers = np.flatnonzero(full & ~told) + 1
        said = re.fullmatch(r"\"?sep=(.)\"?", self.line(numbers[0])) if len(numbers) else None
        numbers = numbers[1:] if said else numbers
        if not len(numbers):
            raise TableFileError(f"{self.name}: expected a line of column names, got an empty file")
        head, lines = int(numbers[0]), numbers[1:]
        # `numpy.savetxt` writes the names as a comment.
        before = np.flatnonzero(full & told)[:1] + 1
        if len(before) and before[0] < head and re.match(r"[\s\d.+-]*\d", self.line(head)):
            above = self.line(int(before[0])).lstrip("#")
            if set(self.columns) <= set(map(_plain, re.split(r"[,;\t ]+", above.strip()))):
                head, lines = int(before[0]), numbers
        names = self.line(head).lstrip("#")[:100_000]
        known = {one: len({*self.columns} & {*map(_plain, names.split(one))}) for one in SEPARATORS}
        known[" "] = len({*self.columns} & {*map(_plain, names.split())})
        if not any(known.values()):
            known = {one: names.count(one) for one in ",;\t"}
        return head, lines, max(known, key=lambda one: known[one])

    def _entries(self, number: int, line: str | None = None) -> list[str]:
        try:
            return _split(self.line(number) if line is None else line, self.separator)
        except csv.Error as error:
            raise TableFileError(
                f"{self.name}, line {number}: expected values separated by "
                f"{SEPARATORS[self.separator]}, got what is none ({error}); check the line for a "
                "missing separator or quote"
            ) from error

    def _decimal(self) -> str:
        """Return the sign before decimals; a comma may separate thousands, which is to be told."""
        if self.separator == "," or b"," not in self.text:
            return "."
        places = [self.names.index(name) for name in self.columns]
        doubtful: tuple[int, str] | None = None
        for number in self.lines.tolist():
            entries = self._entries(number)
            for entry in (entries[place] for place in places if place < len(entries)):
                if "." in entry and "," not in entry:
                    return "."
                if "," in entry and not _THOUSANDS.fullmatch(entry):
                    return ","
                doubtful = doubtful or ((number, entry) if "," in entry else None)
        if doubtful is None:
            return "."
        number, entry = doubtful
        raise TableFileError(
            f"{self.name}, line {number}: expected decimals that can be told from thousands, got "
            f"{entry!r}; write {entry.replace(',', '.')!r} or {entry.replace(',', '')!r}"
        )

    def table(self, optional: Sequence[str]) -> Table:
        """Return the columns and those optional ones that there are."""
        columns = (*self.columns, *(one for one in optional if one in self.names))
        order = _order(f"{self.name}, line {self.head}", self.names, columns)
        values = self._bulk(columns, order)
        lines = self.lines
        if values is None:
            values, lines = self._walked(columns, order)
        table = Table(
            self.name, columns, values, lines, tuple(i + 1 for i in order), "line", {},
            self.names, (), self._entry, self.content,
        )  # fmt: skip
        return _sorted_out(table, len(self.columns))

    def _entry(self, number: int, column: str) -> str:
        return self._entries(number)[self.names.index(column)]

    def _bulk(self, columns: Sequence[str], order: list[int]) -> FloatArray | None:
        """Return all numbers at once; None where one of them, or a line, is in doubt."""
        import pandas as pd

        first, last = self.lines[0], len(self.names) - 1
        between = np.arange(first, self.lines[-1])
        passed = np.setdiff1d(between, self.lines, assume_unique=True) - first
        # Exact by default from pandas 3.1 on, which no longer takes the word.
        old = tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1)
        exact: dict[str, Any] = {"float_precision": "round_trip"} if old else {}
        stream = BytesIO(self.text)
        stream.seek(int(self.starts[first - 1]))
        types = dict.fromkeys(range(last + 1), str) | dict.fromkeys(order, np.float64)
        if len(self._entries(int(first))) != len(self.names):
            return None
        try:
            frame = pd.read_csv(
                stream, header=None, dtype=types, skiprows=passed.tolist(),
                sep=r"\s+" if self.separator == " " else self.separator, decimal=self.decimal,
                skipinitialspace=True, engine="c", **exact,
            )  # fmt: skip
        except (ValueError, OverflowError):  # pandas' own errors of parsing are ValueErrors
            return None
        # A line that ends early lacks its last value.
        if len(frame) != len(self.lines) or frame[last].isna().any():
            return None
        return np.asarray(frame[order], dtype=np.float64)

    def _walked(
        self, columns: Sequence[str], order: list[int]
    ) -> tuple[FloatArray, NDArray[np.int64]]:
        """Return the same line by line, with NaN for what is no number, and the lines."""
        rows, kept = [], []
        for number in self.lines.tolist():
            entries = self._entries(number)
            if not any(entries):  # a spreadsheet writes so what was cleared
                continue
            if len(entries) != len(self.names):
                raise TableFileError(
                    f"{self.name}, line {number}: expected {len(self.names)} values, got "
                    f"{len(entries)}; separate them with {SEPARATORS[self.separator]} as line "
                    f"{self.head} does, and write decimals with a point"
                )
            rows.append([self._number(name, entries[place])
                         for name, place in zip(columns, order, strict=True)])  # fmt: skip
            kept.append(number)
        if not rows:
            raise TableFileError(f"{self.name}: expected lines of numbers below the names, "
                                 "got none")  # fmt: skip
        return np.array(rows), np.array(kept)

    def _number(self, column: str, entry: str) -> float:
        if column == MASK and entry.lower() in MASKED:
            return float(MASKED[entry.lower()])
        if self.decimal == ",":
            entry = "" if "." in entry else entry.replace(",", ".")
        try:
            return float(entry)
        except ValueError:
            return math.nan
