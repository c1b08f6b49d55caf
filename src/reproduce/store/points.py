"""Measurements of a user as a table of numbers, from a file, a DataFrame, a table or arrays.

pandas reads text files with named columns, and Astropy reads ECSV, FITS tables, VOTable and
SExtractor catalogues. Rows are counted from zero, below the names of a file.

Spots of fiducial lights are images in which a lost spot is NaN. In a table a row is a spot, in px:
``group`` (0 at the zero point, 1 at the present), ``laser`` (from 1), ``x``, ``y``, and ``frame``
(or ``image``, or ``time``), a number that the spots of an image share. Without it every image must
be whole, and the images follow each other.
"""

from __future__ import annotations

import difflib
import re
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
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
# Stars of one channel: their places there and in the reference channel, in px.
STARS = ("x", "y", "x_reference", "y_reference")
_MASK = "mask"
_PIXELS = ("px", "pix", "pixel", "pixels", "css_pixel")  # the last is the name in Pint
# Columns that are lengths on the detector.
_LENGTHS = re.compile(r"(x|y)(_reference)?|sigma(_[xy])?")
# Formats that Astropy reads, by the end of a file name.
_ASTROPY = {
    ".ecsv": "ascii.ecsv",
    ".fits": "fits",
    ".fit": "fits",
    ".fits.gz": "fits",
    ".vot": "votable",
    ".xml": "votable",
    ".cat": "ascii.sextractor",
}
_FITS_START = b"SIMPLE  ="
# Rows that a remark names at most, and columns that an error names.
NAMED, LISTED = 5, 12

FloatArray = NDArray[np.float64]


class TableFileError(ValueError):
    """Measurements are wrong; the message names the file, row and column."""


@dataclass(frozen=True, eq=False)
class Table:
    """Named columns of numbers.

    Parameters
    ----------
    path : str
        Name of the file or other source.
    columns : tuple of str
        Names of the columns, in the requested order.
    values : ndarray, shape (rows, columns)
        Numbers without masked rows.
    rows : ndarray of int, shape (rows,)
        Number of each row in the source, from zero.
    optional : mapping
        Optional columns that the source contains.
    notes : tuple of str
        Remarks on the input.
    """

    path: str
    columns: tuple[str, ...]
    values: FloatArray
    rows: NDArray[np.int64]
    optional: Mapping[str, FloatArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    _content: bytes | None = None

    def column(self, name: str) -> FloatArray:
        """Return one column, shape (rows,)."""
        return np.asarray(self.values[:, self.columns.index(name)])

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the file, or of the numbers of another source."""
        return sha256(
            self.values.tobytes() if self._content is None else self._content
        ).hexdigest()

    def named(self, rows: Sequence[int] | NDArray[np.int64]) -> str:
        """Return the numbers of rows as text: "rows 3, 4"."""
        labels = self.rows[np.asarray(rows, dtype=int)]
        shown = ", ".join(map(str, labels[:NAMED].tolist()))
        return f"row{'s' * (len(labels) > 1)} {shown}{', ...' * (len(labels) > NAMED)}"

    def wrong(self, row: int, name: str, problem: str) -> TableFileError:
        """Return the error that names the source, row and column of one number."""
        column = self.optional[name] if name in self.optional else self.column(name)
        place = f"{self.path}, row {self.rows[row]}, column {name}"
        return TableFileError(f"{place}: {problem}, got {column[row]:g}")


@contextmanager
def computing(path: str | Path) -> Iterator[None]:
    """Raise an error of the file if its numbers overflow or divide by zero."""
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            yield
    except FloatingPointError as error:
        raise TableFileError(
            f"{path}: the numbers lead to an {error}; look for values that are huge, zero or equal"
        ) from error


def is_table(source: object) -> bool:
    """Return whether `source` is a path, a DataFrame, an Astropy table or a structured array.

    Examples
    --------
    >>> is_table("stars.csv"), is_table([[1, 2]])
    (True, False)
    """
    named = hasattr(source, "columns")
    return isinstance(source, str | Path) or named or _fields(source) is not None


def _fields(source: object) -> Any:
    return getattr(getattr(source, "dtype", None), "names", None)


def read_table(
    source: Any,
    columns: Sequence[str],
    optional: Sequence[str] = (),
    sep: str | None = None,
    name: str | None = None,
) -> Table:
    """Return named columns of numbers from a file, standard input ("-"), or a table.

    Rows with 1 in a column ``mask`` are left out. `sep` separates the columns of a text file, as
    in `pandas.read_csv`. Default: a comma. Errors use `name` for a source that is not a file.
    """
    label, frame, content = _loaded(source, sep)
    name = label if name is None or isinstance(source, str | Path) else name
    names = [_plain(one) for one in frame.columns]
    remedy = (
        ""
        if content is None
        else " Write them in the first line, and give sep if not a comma"
    )
    found = _wanted(name, names, columns, (*optional, _MASK), remedy)
    values = np.column_stack(
        [_numbers(frame.iloc[:, names.index(one)]) for one in found]
    )
    if not len(values):
        raise TableFileError(
            f"{name}: expected rows of numbers below the names, got none"
        )
    table = Table(name, found, values, np.arange(len(values)), _content=content)
    gone = np.zeros(len(values), bool)
    if _MASK in found:
        flags = table.column(_MASK)
        if len(odd := np.flatnonzero((flags != 0) & (flags != 1))):
            raise table.wrong(int(odd[0]), _MASK, "expected 0, or 1 to drop the row")
        gone = flags == 1
    return _kept(table, len(columns), gone)


def _numbers(column: pd.Series) -> FloatArray:
    """Return a column as numbers, with NaN for other entries."""
    import pandas as pd

    if column.dtype.kind in "cmM":  # complex numbers, times
        return np.full(len(column), np.nan)
    plain = (
        column.astype(object)
        if isinstance(column.dtype, pd.CategoricalDtype)
        else column
    )
    return pd.to_numeric(plain, errors="coerce").to_numpy(float, na_value=np.nan)


def _loaded(source: Any, sep: str | None) -> tuple[str, pd.DataFrame, bytes | None]:
    """Return the name, the columns and the content of a source."""
    import pandas as pd

    if isinstance(source, str | Path):
        name = "standard input" if str(source) == "-" else str(source)
        if Path(source).is_char_device():  # it may never end
            raise TableFileError(
                f"{name}: expected a file, got a device. Use - for standard input"
            )
        content = (
            sys.stdin.buffer.read() if str(source) == "-" else Path(source).read_bytes()
        )
        form = next(
            (f for end, f in _ASTROPY.items() if name.lower().endswith(end)), ""
        )
        form = "fits" if content.startswith(_FITS_START) else form
        zipped = name.lower().endswith(".gz")
        if not form and not zipped and b"\0" in content:
            raise _other_format(name)
        try:
            if form:
                return (
                    name,
                    _from_astropy(name, _astropy_file(BytesIO(content), form)),
                    content,
                )
            with warnings.catch_warnings():
                # pandas drops columns without a name with this warning.
                warnings.simplefilter("error", pd.errors.ParserWarning)
                frame = pd.read_csv(
                    BytesIO(content),
                    sep=sep or ",",
                    comment="#",
                    engine="c",
                    skipinitialspace=True,
                    index_col=False,
                    compression="gzip" if zipped else None,
                )
        except ImportError as error:
            raise TableFileError(
                f"{name}: this format needs Astropy, which is not installed"
            ) from error
        except TableFileError:
            raise
        except UnicodeDecodeError as error:
            raise _other_format(name) from error
        except Exception as error:  # pandas, Astropy and XML parsers raise many types
            told = " ".join(str(error).split())[:200]
            raise TableFileError(
                f"{name}: expected columns of numbers ({told}). "
                "Separate them with a comma, or give sep"
            ) from error
        return name, frame, content
    if hasattr(source, "colnames"):
        return "the table", _from_astropy("the table", source), None
    if hasattr(source, "iloc"):
        return "the DataFrame", source, None
    return "the array", _frame({n: source[n] for n in _fields(source)}), None


def _other_format(name: str) -> TableFileError:
    return TableFileError(
        f"{name}: expected a table or a FITS image, got another format. Read the file with "
        "another library, such as Pillow or pandas, and pass an array or a DataFrame"
    )


def _astropy_file(content: BytesIO, form: str) -> Any:
    from astropy.table import Table as AstropyTable

    return AstropyTable.read(content, format=form)


def _from_astropy(name: str, table: Any) -> pd.DataFrame:
    """Return the columns of an Astropy table; lengths must be in px."""
    found = {}
    for column in table.colnames:
        unit = getattr(table[column], "unit", None)
        if (
            unit is not None
            and str(unit).lower() not in _PIXELS
            and _LENGTHS.fullmatch(_plain(column))
        ):
            raise _other_unit(name, column, unit)
        values = np.ma.asarray(getattr(table[column], "value", table[column]))
        number = values.dtype.kind in "iufb"
        found[column] = np.ma.filled(values.astype(float), np.nan) if number else values
    return _frame(found)


def _frame(columns: Mapping[str, Any]) -> pd.DataFrame:
    """Return the one-dimensional columns as a DataFrame."""
    import pandas as pd

    return pd.DataFrame(
        {name: one for name, one in columns.items() if np.ndim(one) == 1}
    )


def _other_unit(name: str, column: str, unit: object) -> TableFileError:
    return TableFileError(
        f"{name}, column {column}: expected px, got {unit}. Convert the column to px"
    )


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
    table = Table("the arrays", tuple(columns), np.hstack(arrays), np.arange(len(gone)))
    return _kept(table, len(columns), gone)


def _measured(*named: tuple[str, Any]) -> list[tuple[FloatArray, NDArray[np.bool_]]]:
    """Return arrays in px, each with its mask; one in another unit is refused."""
    units = {
        name: str(getattr(one, "units", getattr(one, "unit", "px")))
        if hasattr(one, "to")
        else "px"
        for name, one in named
    }
    if any(unit not in _PIXELS for unit in units.values()):
        came = ", ".join(
            f"{name} in {unit or 'no unit'}" for name, unit in units.items()
        )
        raise ValueError(
            f"expected measurements in px, got {came}; convert them to px first"
        )
    found = []
    for name, one in named:
        bare = (
            getattr(one, "magnitude", getattr(one, "value", one))
            if hasattr(one, "to")
            else one
        )
        bare = bare.to_numpy() if hasattr(bare, "iloc") else bare
        try:
            array = np.ma.asarray(bare, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise TypeError(
                f"{name}: expected an array of numbers, got something else; give each "
                "row as many numbers, without text"
            ) from None
        found.append((array.data, np.ma.getmaskarray(array)))
    return found


def _kept(table: Table, count: int, gone: NDArray[np.bool_]) -> Table:
    """Return a table without some rows, the columns after so many being optional ones."""
    lost = int(gone.sum())
    if lost and lost == len(gone):
        raise TableFileError(
            f"{table.path}: expected rows that are not masked, got none"
        )
    bad = ~(np.abs(table.values) < _LARGEST) & ~gone[:, None]
    if bad.any():
        row, place = (int(i) for i in np.argwhere(bad)[0])
        finite = np.isfinite(table.values[row, place])
        wanted = f"a number below {_LARGEST:g}" if finite else "a finite number"
        error = table.wrong(row, table.columns[place], f"expected {wanted}")
        raise TableFileError(f"{error}. Correct, remove or mask the row")
    notes: tuple[str, ...] = ()
    if lost:
        verb, which = "are" if lost > 1 else "is", table.named(np.flatnonzero(gone))
        notes = (f"{lost} of {len(gone)} rows {verb} masked ({which}) and left out",)
    values = table.values[~gone] if lost else table.values
    optional = {
        n: values[:, i]
        for i, n in enumerate(table.columns)
        if i >= count and n != _MASK
    }
    return replace(
        table,
        columns=table.columns[:count],
        values=values[:, :count],
        rows=table.rows[~gone],
        optional=optional,
        notes=notes,
    )


def _plain(name: object) -> str:
    """Return a column's name without its case, blanks around it, and a unit of pixels."""
    bare = re.sub(r"\s*[\[(](px|pixels?)[\])]$", "", str(name).strip().lower())
    return re.sub(r"[\s-]+", "_", bare)


def _wanted(
    where: str,
    names: Sequence[str],
    columns: Sequence[str],
    optional: Sequence[str],
    remedy: str = "",
) -> tuple[str, ...]:
    """Return the columns and the optional columns that a source contains."""
    wanted = (*columns, *(one for one in optional if one in names))
    # pandas calls the second column with the name x in a file x.1.
    if twice := [
        name for name in wanted if names.count(name) > 1 or f"{name}.1" in names
    ]:
        raise TableFileError(f"{where}: column {twice[0]!r} appears twice. Remove one")
    if missing := [name for name in columns if name not in names]:
        unit = re.compile(re.escape(missing[0]) + r"_?[\[(](.*)[\])]")
        if found := next(filter(None, map(unit.fullmatch, names)), None):
            raise _other_unit(where, missing[0], found[1])
        near = difflib.get_close_matches(missing[0], names[: 10 * LISTED], 1)
        hint = f" Did you mean {near[0]!r} by {missing[0]!r}?" if near else ""
        came = ", ".join(repr(name[:40]) for name in names[:LISTED])
        raise TableFileError(
            f"{where}: expected the columns {', '.join(columns)}, got {came}"
            f"{', ...' * (len(names) > LISTED)}.{hint}{remedy}"
        )
    return wanted


SPOTS = ("group", "laser", "x", "y")
TIME = "time"
IMAGES = ("frame", "image", TIME)
# What arrays of both groups are called.
_GROUPS = ("zero", "spots")

Images = tuple[FloatArray, FloatArray]


def read_images(
    count: int, spots: Any, zero: Any = None, times: Any = None, sep: str | None = None
) -> tuple[Images, FloatArray | None, list[str]]:
    """Return the images of both groups, times of those at the present, and what to say of it.

    Shape (frames, lights, 2), in px, of so many lights; spots may be a table of both groups.
    """
    if is_table(spots) and zero is None:
        if times is not None:
            raise ValueError(
                f"times: expected none beside a table; give it a column {TIME}"
            )
        table = read_table(spots, SPOTS, IMAGES, sep)
        pair = images_of(table, count)
        return pair, _times(table, len(pair[1])), [*table.notes, *lost_spots(pair)]
    if isinstance(spots, str | Path):
        raise ValueError(
            "zero: expected nothing beside a file, which holds both groups"
        )
    if zero is None:
        raise ValueError(
            "zero: expected the images at the zero point, or a file of both"
        )
    arrays = _measured(*zip(_GROUPS, (zero, spots), strict=True))
    before, now = (
        _lost(name, np.where(mask, np.nan, one), count)
        for name, (one, mask) in zip(_GROUPS, arrays, strict=True)
    )
    when = None if times is None else np.asarray(times, dtype=np.float64)
    if when is not None and (when.shape != (len(now),) or not np.isfinite(when).all()):
        raise ValueError(
            f"times: expected {len(now)} finite numbers, one for each image"
        )
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
        raise ValueError(
            f"{name}: expected numbers below {_LARGEST:g}, or NaN for a lost spot"
        )
    lost = np.isnan(images).any(axis=-1, keepdims=True)
    return np.where(lost, np.nan, images)


def images_of(table: Table, count: int) -> Images:
    """Return the images of a table, of both groups."""
    for name, least, most in (("group", 0, 1), ("laser", 1, count)):
        values = table.column(name)
        wrong = (values != np.round(values)) | (values < least) | (values > most)
        for row in np.flatnonzero(wrong)[:1].tolist():
            raise table.wrong(
                row, name, f"expected a whole number from {least} to {most}"
            )
    named = next((one for one in IMAGES if one in table.optional), None)
    images = []
    for group in range(2):
        rows = np.flatnonzero(table.column("group") == group)
        if not len(rows):
            raise TableFileError(
                f"{table.path}: expected spots of the groups 0 (the zero point) "
                f"and 1 (the present), got none of group {group}"
            )
        light = table.column("laser")[rows].astype(int) - 1
        if named is None:
            frame = _in_order(table, rows, light)
        else:
            frame = np.unique(table.optional[named][rows], return_inverse=True)[
                1
            ].reshape(-1)
        place = frame * count + light
        again = np.setdiff1d(
            np.arange(len(rows)), np.unique(place, return_index=True)[1]
        )
        if len(again):
            raise table.wrong(
                int(rows[again[0]]), "laser", "expected each light once in an image"
            )
        spots = np.full((int(frame.max()) + 1, count, 2), np.nan)
        spots[frame, light] = table.values[rows, 2:4]
        images.append(spots)
    return images[0], images[1]


def _in_order(
    table: Table, rows: NDArray[np.int64], light: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the image of each spot of a group, which come image after image."""
    shown = np.unique(light)
    images = light[: len(light) // len(shown) * len(shown)].reshape(-1, len(shown))
    whole = (np.sort(images, axis=1) == shown).all(axis=1)
    if images.size == light.size and whole.all():
        return np.arange(len(rows)) // len(shown)
    first = int(np.append(whole, False).argmin()) * len(shown)
    raise TableFileError(
        f"{table.path}, row {table.rows[rows[min(first, len(rows) - 1)]]}: expected a spot of each "
        "light in every image, image after image, got an image without a light. If spots are lost "
        f"or in another order, add a column {IMAGES[0]}, a number for each image"
    )


def lost_spots(pair: Images) -> list[str]:
    """Say how many spots are lost, and of which light."""
    gone = [np.isnan(one[..., 0]) for one in pair]
    of_light = sum(one.sum(axis=0) for one in gone)
    if not np.any(of_light):
        return []
    named = ", ".join(
        f"{lost} of light {number}"
        for number, lost in enumerate(of_light, start=1)
        if lost
    )
    size = sum(one.size for one in gone)
    return [
        f"{sum(of_light)} of {size} spots are lost ({named}): an image counts the less the "
        "fewer it shows"
    ]
