"""A user's own measurements, from a file, a DataFrame or arrays: one table, one way to name rows.

The first line of a file names the columns; every further line holds a value for each. Columns may
stand in any order and in any case, between commas, semicolons, tabs or blanks; further ones are
kept. Lines that are empty or begin with ``#`` are passed over. Rows of a file are named by their
line, counted from one as an editor does; rows of arrays and DataFrames by their place, counted from
zero as Python does.

Spots of lights are images in which a lost spot is NaN. In a table a row is a spot, in px: ``group``
(0 at the zero point, 1 at the present), ``laser`` (from 1), ``x``, ``y``, and ``frame`` (or
``image``, or ``time``), any number that the spots of an image share. Without it every image must be
whole, and one come after the other.
"""

from __future__ import annotations

import csv
import difflib
import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
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
_LARGEST = 1e30
# What may stand between values, the likelier first, with its name in the plural.
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "blanks"}
# Stars of one channel: their places there and in the reference channel, in px.
STARS = ("x", "y", "x_reference", "y_reference")
_MASK = "mask"
_MASKED = {"": 0.0, "false": 0.0, "true": 1.0}
_PIXELS = ("px", "pix", "pixel", "pixels", "css_pixel")  # the last is what Pint calls px
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
    names : tuple of str
        All columns, in their order.
    columns : tuple of str
        Those asked for, in the order asked for.
    values : ndarray, shape (rows, columns)
        The numbers; rows that a mask drops are left out.
    lines : ndarray of int, shape (rows,)
        The line of each row, from one; or its place in arrays, from zero.
    kind : {"line", "row"}
        What a row is called.
    optional : mapping
        The numbers of those optional columns that there are.
    notes : tuple of str
        What a user should hear of the reading.
    """

    path: str
    names: tuple[str, ...]
    columns: tuple[str, ...]
    values: FloatArray
    lines: NDArray[np.int64]
    kind: str = "row"
    optional: Mapping[str, FloatArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    _entry: Callable[[int, str], str] | None = None
    _content: bytes | None = None

    def column(self, name: str) -> FloatArray:
        """Return one column, shape (rows,)."""
        return np.asarray(self.values[:, self.columns.index(name)])

    def text(self, row: int, name: str) -> str:
        """Return one entry as it is written, also of a column that nobody asked for."""
        if self._entry is None:
            return f"{self.column(name)[row]:g}"
        return self._entry(int(self.lines[row]), name)

    @cached_property
    def sha256(self) -> str:
        """Hash of the file, or of the numbers where there is none."""
        return sha256(self.values.tobytes() if self._content is None else self._content).hexdigest()

    def named(self, rows: Sequence[int] | NDArray[np.int64]) -> str:
        """Name rows for a reader: "lines 3, 4"."""
        labels = self.lines[np.asarray(rows, dtype=int)]
        shown = ", ".join(map(str, labels[:NAMED].tolist()))
        return f"{self.kind}{'s' * (len(labels) > 1)} {shown}{', ...' * (len(labels) > NAMED)}"

    def at(self, row: int, name: str) -> str:
        """Return where one number stands: file, line and column."""
        place = self.names.index(name) + 1
        return f"{self.path}, {self.kind} {self.lines[row]}, column {place} ({name})"

    def wrong(self, row: int, name: str, problem: str) -> TableFileError:
        """Return the error that names file, line and column of one number."""
        text = self.text(row, name)[:40]
        return TableFileError(f"{self.at(row, name)}: {problem}, got {text!r}")


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
    if not isinstance(source, str | Path):
        table = _framed(source, columns, optional)
    elif str(source) == "-":
        table = _File("standard input", sys.stdin.buffer.read(), columns).table(optional)
    else:
        table = _File(str(source), Path(source).read_bytes(), columns).table(optional)
    if not len(table.values):
        raise TableFileError(
            f"{table.path}: expected {table.kind}s of numbers below the names, got none"
        )
    gone = np.zeros(len(table.values), bool)
    if _MASK in table.columns:
        flags = table.column(_MASK)
        if len(odd := np.flatnonzero((flags != 0) & (flags != 1))):
            raise table.wrong(int(odd[0]), _MASK, "expected 0, or 1 to drop the row")
        gone = flags == 1
    return _kept(table, len(columns), gone)


def table_of(columns: Sequence[str], *blocks: tuple[str, Any]) -> Table:
    """Return arrays, named and of shape (n, 2), side by side as one table.

    Rows that a mask drops in any of them are left out; units other than px are refused.
    """
    arrays, dropped = zip(*_measured(*blocks), strict=True)
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
    names = tuple(columns)
    table = Table("the arrays", names, names, np.hstack(arrays), np.arange(len(gone)))
    return _kept(table, len(names), gone)


def _measured(*named: tuple[str, Any]) -> list[tuple[FloatArray, NDArray[np.bool_]]]:
    """Return arrays in px, each with its mask; one in another unit is refused."""
    units = {name: str(getattr(one, "units", getattr(one, "unit", "px"))) if hasattr(one, "to")
             else "px" for name, one in named}  # fmt: skip
    if any(unit not in _PIXELS for unit in units.values()):
        came = ", ".join(f"{name} in {unit or 'no unit'}" for name, unit in units.items())
        raise ValueError(f"expected measurements in px, got {came}; convert them to px first")
    found = []
    for name, one in named:
        bare = getattr(one, "magnitude", getattr(one, "value", one)) if hasattr(one, "to") else one
        bare = bare.to_numpy() if hasattr(bare, "iloc") else bare
        try:
            array = np.ma.asarray(bare, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise TypeError(f"{name}: expected an array of numbers, got something else; give each "
                            "row as many numbers, without text") from None  # fmt: skip
        found.append((array.data, np.ma.getmaskarray(array)))
    return found


def _kept(table: Table, count: int, gone: NDArray[np.bool_]) -> Table:
    """Return a table without some rows, the columns after so many being optional ones."""
    kind, lost = table.kind, int(gone.sum())
    if lost and lost == len(gone):
        raise TableFileError(
            f"{table.path}: expected {kind}s that are not masked, got all {lost} masked"
        )
    bad = ~(np.abs(table.values) < _LARGEST) & ~gone[:, None]
    if bad.any():
        row, place = (int(i) for i in np.argwhere(bad)[0])
        finite = math.isfinite(table.values[row, place])
        wanted = f"a number below {_LARGEST:g}" if finite else "a finite number"
        error = table.wrong(row, table.columns[place], f"expected {wanted}")
        raise TableFileError(f"{error}; correct, remove or mask the {kind}")
    notes: tuple[str, ...] = ()
    if lost:
        verb, which = "are" if lost > 1 else "is", table.named(np.flatnonzero(gone))
        notes = (f"{lost} of {len(gone)} {kind}s {verb} masked ({which}) and left out",)
    values = table.values[~gone] if lost else table.values
    optional = {n: values[:, i] for i, n in enumerate(table.columns) if i >= count and n != _MASK}
    return replace(
        table,
        columns=table.columns[:count],
        values=values[:, :count],
        lines=table.lines[~gone],
        optional=optional,
        notes=notes,
    )


def _plain(name: object) -> str:
    """Return a column's name without its case, blanks around it, and a unit of pixels."""
    bare = re.sub(r"\s*[\[(](px|pixels?)[\])]$", "", str(name).strip().lower())
    return re.sub(r"[\s-]+", "_", bare)


def _wanted(where: str, names: Sequence[str], columns: Sequence[str], optional: Sequence[str]
            ) -> tuple[str, ...]:  # fmt: skip
    """Return the columns and those optional ones that there are; refuse missing or double ones."""
    for place, name in enumerate(names):
        if name and name in names[:place]:
            raise TableFileError(
                f"{where}, column {place + 1}: {name!r} is named twice; remove one"
            )
    if missing := [name for name in columns if name not in names]:
        others = [name for name in names[: 10 * LISTED] if name not in columns]
        near = {one: difflib.get_close_matches(one, others, 1) for one in missing}
        hint = "".join(f"; did you mean column {names.index(found[0]) + 1}, {found[0]!r}, by {one}?"
                       for one, found in near.items() if found)  # fmt: skip
        came = ", ".join(repr(name[:40]) for name in names[:LISTED])
        raise TableFileError(
            f"{where}: missing column {', '.join(missing)}{hint}; expected {', '.join(columns)}, "
            f"got {came}{', ...' * (len(names) > LISTED)}"
        )
    return (*columns, *(one for one in (*optional, _MASK) if one in names))


def _framed(frame: pd.DataFrame, columns: Sequence[str], optional: Sequence[str]) -> Table:
    import pandas as pd

    names = tuple(map(_plain, frame.columns))
    there = _wanted("the DataFrame", names, columns, optional)
    values = np.column_stack(
        [pd.to_numeric(frame.iloc[:, names.index(one)], errors="coerce").to_numpy(
            float, na_value=np.nan) for one in there]
    )  # fmt: skip

    def entry(row: int, column: str) -> str:
        return str(frame.iloc[row, names.index(column)])

    return Table("the DataFrame", names, there, values, np.arange(len(values)), _entry=entry)


class _File:
    """A file of columns: where its lines are, and how they are written."""

    def __init__(self, name: str, content: bytes, columns: Sequence[str]) -> None:
        self.name, self.content, self.columns = name, content, columns
        self.text = self._decoded()
        letters = np.frombuffer(self.text, np.uint8)
        ends = np.flatnonzero(letters == ord("\n")) + 1
        self._starts = np.concatenate([[0], ends, [len(letters) + 1]])
        first = letters[self._starts[:-1][self._starts[:-1] < len(letters)]]
        written = first > ord(" ")
        for line in np.flatnonzero(~written).tolist():
            written[line] = bool(self._line(line + 1).strip())
        comment = first == ord("#")
        comments, plain = (np.flatnonzero(written & one) + 1 for one in (comment, ~comment))
        if len(plain) and re.fullmatch(r"\"?sep=.\"?", self._line(plain[0])):
            plain = plain[1:]
        if not len(plain):
            raise TableFileError(f"{name}: expected a line of column names, got an empty file")
        self.head, numbers = int(plain[0]), plain[1:]
        # `numpy.savetxt` writes the names as a comment.
        for number in [] if self._told(self.head) else comments[comments < plain[0]].tolist():
            if self._told(number):
                self.head, numbers = number, plain
        text = self._line(self.head).lstrip("#")[:100_000]
        ranks = {
            one: (self._known(text, one), one != " " and text.count(one)) for one in _SEPARATORS
        }
        self.separator = max(ranks, key=ranks.__getitem__)
        self.lines = np.asarray(numbers, dtype=np.int64)
        self.names = tuple(map(_plain, self._entries(self.head)))

    def _decoded(self) -> bytes:
        """Return the file in UTF-8, each line ended by a line feed."""
        data = self.content
        try:
            if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
                data = data.decode("utf-16").encode()
            data.decode()
            if b"\0" in data:
                raise UnicodeError("binary data")
        except UnicodeError as error:
            raise TableFileError(
                f"{self.name}: expected text in UTF-8, got {error}; save it as CSV in UTF-8"
            ) from error
        if b"\r" in data:
            data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        return data.removeprefix(b"\xef\xbb\xbf")

    def _line(self, number: int) -> str:
        """Return one line, counted from one."""
        start, end = self._starts[number - 1 : number + 1]
        return self.text[start : end - 1].decode()

    def _known(self, line: str, separator: str) -> int:
        """Count the columns that are named in a line by their separator."""
        parts = line.split(separator if separator.strip() or separator == "\t" else None)
        return len({*self.columns} & {*map(_plain, parts)})

    def _told(self, number: int) -> bool:
        """Tell whether a line names all columns."""
        line = self._line(number).lstrip("#")[:100_000]
        return any(self._known(line, one) == len({*self.columns}) for one in _SEPARATORS)

    def _entries(self, number: int) -> list[str]:
        line = self._line(number)
        line = line.lstrip("#") if number == self.head else line
        line = " ".join(line.split()) if self.separator == " " else line
        try:
            rows = csv.reader([line], delimiter=self.separator, skipinitialspace=True)
            return [entry.strip() for entry in next(rows)]
        except csv.Error as error:
            raise TableFileError(
                f"{self.name}, line {number}: expected values separated by "
                f"{_SEPARATORS[self.separator]}, got what is none ({error}); check the line for a "
                "missing separator or quote"
            ) from error

    def _decimal(self) -> str:
        """Return the sign before decimals; what could be a comma between thousands is none."""
        if self.separator == "," or b"," not in self.text:
            return "."
        places = [self.names.index(name) for name in self.columns]
        for number in self.lines.tolist():
            entries = self._entries(number)
            for entry in (entries[place] for place in places if place < len(entries)):
                if {",", "."} & {*entry} and not _THOUSANDS.fullmatch(entry):
                    return "," if "," in entry else "."
        return "."

    def table(self, optional: Sequence[str]) -> Table:
        """Return the columns, and those optional ones that there are, before any row is dropped."""
        there = _wanted(f"{self.name}, line {self.head}", self.names, self.columns, optional)
        places = {name: self.names.index(name) for name in there}
        decimal = self._decimal()
        values, lines = self._at_once(places, decimal), self.lines
        if values is None:
            lines, values = self._one_by_one(places, decimal)

        def entry(number: int, column: str) -> str:
            return self._entries(number)[self.names.index(column)]

        return Table(self.name, self.names, there, values, lines, "line",
                     _entry=entry, _content=self.content)  # fmt: skip

    def _at_once(self, places: Mapping[str, int], decimal: str) -> FloatArray | None:
        """Return all numbers at once; None where one of them, or a line, is in doubt."""
        import pandas as pd

        if not len(self.lines) or len(self._entries(int(self.lines[0]))) != len(self.names):
            return None
        last = len(self.names) - 1
        passed = np.ones(self.lines[-1], bool)
        passed[self.lines - 1] = False
        others = np.flatnonzero(passed).tolist()
        # Exact by default from pandas 3.1 on, which no longer takes the word.
        old = tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1)
        exact: dict[str, Any] = {"float_precision": "round_trip"} if old else {}
        types = dict.fromkeys(range(last + 1), str) | dict.fromkeys(places.values(), np.float64)
        try:
            frame = pd.read_csv(
                BytesIO(self.text), header=None, dtype=types, skiprows=others,
                sep=r"\s+" if self.separator == " " else self.separator, decimal=decimal,
                skipinitialspace=True, engine="c", **exact,
            )  # fmt: skip
        except (ValueError, OverflowError):  # pandas' own errors of parsing are ValueErrors
            return None
        # A line that ends early lacks its last value.
        if len(frame) != len(self.lines) or frame[last].isna().any():
            return None
        return np.asarray(frame[list(places.values())], dtype=np.float64)

    def _one_by_one(
        self, places: Mapping[str, int], decimal: str
    ) -> tuple[NDArray[np.int64], FloatArray]:
        """Return the lines, and the same line by line, with NaN for what is no number."""
        rows: dict[int, list[float]] = {}
        for number in self.lines.tolist():
            entries = self._entries(number)
            if not any(entries):  # a spreadsheet writes so what was cleared
                continue
            if len(entries) != len(self.names):
                raise TableFileError(
                    f"{self.name}, line {number}: expected {len(self.names)} values, got "
                    f"{len(entries)}; separate them with {_SEPARATORS[self.separator]} as line "
                    f"{self.head} does, and write decimals with a point"
                )
            rows[number] = [_number(n, entries[at], decimal) for n, at in places.items()]
        return np.array(list(rows), dtype=np.int64), np.array(list(rows.values()))


def _number(column: str, entry: str, decimal: str) -> float:
    if column == _MASK and entry.lower() in _MASKED:
        return _MASKED[entry.lower()]
    if decimal == ",":
        entry = "" if "." in entry else entry.replace(",", ".")
    try:
        return float(entry)
    except ValueError:
        return math.nan


SPOTS = ("group", "laser", "x", "y")
TIME = "time"
IMAGES = ("frame", "image", TIME)
# What arrays of both groups are called.
_GROUPS = ("zero", "spots")

Images = tuple[FloatArray, FloatArray]


def read_images(
    spots: Any, zero: Any, count: int, times: Any = None
) -> tuple[Images, FloatArray | None, list[str]]:
    """Return the images of both groups, times of those at the present, and what to say of it.

    Shape (frames, lights, 2), in px, of so many lights; spots may be a table of both groups.
    """
    if is_table(spots) and zero is None:
        if times is not None:
            raise ValueError(f"times: expected none beside a table; give it a column {TIME}")
        table = read_table(spots, SPOTS, IMAGES)
        pair = images_of(table, count)
        return pair, _times(table, len(pair[1])), [*table.notes, *lost_spots(pair)]
    if isinstance(spots, str | Path):
        raise ValueError("zero: expected nothing beside a file, which holds both groups")
    if zero is None:
        raise ValueError("zero: expected the images at the zero point, or a file of both")
    arrays = _measured(*zip(_GROUPS, (zero, spots), strict=True))
    before, now = (
        _lost(name, np.where(mask, np.nan, one), count)
        for name, (one, mask) in zip(_GROUPS, arrays, strict=True)
    )
    when = None if times is None else np.asarray(times, dtype=np.float64)
    if when is not None and (when.shape != (len(now),) or not np.isfinite(when).all()):
        raise ValueError(f"times: expected {len(now)} finite numbers, one for each image")
    return (before, now), when, lost_spots((before, now))


def _times(table: Table, count: int) -> FloatArray | None:
    """Return the mean time of the spots of each image at the present, where a table tells it."""
    if TIME not in table.optional:
        return None
    rows = table.column("group") == 1
    named = next(one for one in IMAGES if one in table.optional)
    image = np.unique(table.optional[named][rows], return_inverse=True)[1].reshape(-1)
    sums = np.bincount(image, table.optional[TIME][rows], count)
    return np.asarray(sums / np.bincount(image, minlength=count))


def _lost(name: str, images: FloatArray, count: int) -> FloatArray:
    """Return an array of images with NaN for both coordinates of a spot that is lost."""
    if images.ndim != 3 or images.shape[1:] != (count, 2) or not len(images):
        raise ValueError(
            f"{name}: expected images of {count} lights, shape (frames, {count}, 2), got "
            f"{images.shape}; another instrument goes to platform"
        )
    if (np.abs(images) >= _LARGEST).any():
        raise ValueError(f"{name}: expected numbers below {_LARGEST:g}, or NaN for a lost spot")
    lost = np.isnan(images).any(axis=-1, keepdims=True)
    return np.where(lost, np.nan, images)


def images_of(table: Table, count: int) -> Images:
    """Return the images of a table, of both groups."""
    for name, least, most in (("group", 0, 1), ("laser", 1, count)):
        values = table.column(name)
        wrong = (values != np.round(values)) | (values < least) | (values > most)
        for row in np.flatnonzero(wrong)[:1].tolist():
            raise table.wrong(row, name, f"expected a whole number from {least} to {most}")
    named = next((one for one in IMAGES if one in table.optional), None)
    images = []
    for group in range(2):
        rows = np.flatnonzero(table.column("group") == group)
        if not len(rows):
            raise TableFileError(f"{table.path}: expected spots of the groups 0 (the zero point) "
                                 f"and 1 (the present), got none of group {group}")  # fmt: skip
        light = table.column("laser")[rows].astype(int) - 1
        if named is None:
            frame = _in_order(table, rows, light)
        else:
            frame = np.unique(table.optional[named][rows], return_inverse=True)[1].reshape(-1)
        place = frame * count + light
        again = np.setdiff1d(np.arange(len(rows)), np.unique(place, return_index=True)[1])
        if len(again):
            raise table.wrong(int(rows[again[0]]), "laser", "expected each light once in an image")
        spots = np.full((int(frame.max()) + 1, count, 2), np.nan)
        spots[frame, light] = table.values[rows, 2:4]
        images.append(spots)
    return images[0], images[1]


def _in_order(table: Table, rows: NDArray[np.int64], light: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the image of each spot of a group, which come image after image."""
    shown = np.unique(light)
    images = light[: len(light) // len(shown) * len(shown)].reshape(-1, len(shown))
    whole = (np.sort(images, axis=1) == shown).all(axis=1)
    if images.size == light.size and whole.all():
        return np.arange(len(rows)) // len(shown)
    first = int(np.append(whole, False).argmin()) * len(shown)
    raise TableFileError(
        f"{table.at(int(rows[min(first, len(rows) - 1)]), 'laser')}: expected a spot of each light "
        "in every image, image after image, got none of one in the image that begins here; add a "
        f"column {IMAGES[0]}, a number for each image, where spots are lost or in another order"
    )


def lost_spots(pair: Images) -> list[str]:
    """Say how many spots are lost, and of which light."""
    gone = [np.isnan(one[..., 0]) for one in pair]
    of_light = sum(one.sum(axis=0) for one in gone)
    if not np.any(of_light):
        return []
    named = ", ".join(
        f"{lost} of light {number}" for number, lost in enumerate(of_light, start=1) if lost
    )
    size = sum(one.size for one in gone)
    return [f"{sum(of_light)} of {size} spots are lost ({named}): an image counts the less the "
            "fewer it shows"]  # fmt: skip
