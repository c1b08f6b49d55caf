"""Measurements as named columns of numbers, from a file, a table or an array.

pandas reads text files with named columns, and Astropy reads ECSV, FITS tables, VOTable and
SExtractor catalogues, all also compressed by gzip. Rows are counted from zero, below the names of a
file.
"""

from __future__ import annotations

import gzip
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from reproduce.physics.validate import (
    BoolArray,
    FloatArray,
    number_array,
    without_none,
)
from reproduce.store.files import FilePath

# Largest length in px or angle in arcsec. Squares of squares of larger numbers overflow.
_LARGEST_NUMBER = 1e30
_PIXEL_UNITS = ("px", "pix", "pixel", "pixels")
# Formats that Astropy reads, by the end of a file name, and by the first seven bytes of a file.
_ASTROPY_FORMATS = {".vot": "votable", ".xml": "votable", ".cat": "ascii.sextractor"}
_SIGNATURES = {b"SIMPLE ": "fits", b"# %ECSV": "ascii.ecsv"}
# Stars of one channel: their places there and in the reference channel, and their errors, in px.
STARS = ("x", "y", "x_reference", "y_reference")
SIGMAS = ("sigma", "sigma_x", "sigma_y")
# Columns that an error names, at most.
_MAX_NAMES = 12


@dataclass(frozen=True, eq=False)
class DataTable:
    """Named columns of numbers.

    Parameters
    ----------
    path : str
        Name of the file or other source.
    values : ndarray, shape (rows, columns)
        Required columns, in the requested order.
    numbers : mapping
        Required and optional columns by name, each of shape (rows,).
    """

    path: str
    values: FloatArray
    numbers: Mapping[str, FloatArray]
    _content: bytes | None = None

    @property
    def sha256(self) -> str:
        """SHA-256 of the file, or of all numbers of another source."""
        content = self._content
        if content is None:
            content = np.stack([*self.numbers.values()]).tobytes()
        return sha256(content).hexdigest()

    def check(self, name: str, right: BoolArray, expected: str) -> None:
        """Raise the error that names source, row and column of the first wrong number."""
        for row in np.flatnonzero(~right)[:1].tolist():
            raise ValueError(
                f"{self.path}, row {row}, column {name}: expected {expected}, got "
                f"{self.numbers[name][row]:g}. Correct or remove the row"
            )


@contextmanager
def computing(path: FilePath) -> Iterator[None]:
    """Raise an error of the file if its numbers overflow or divide by zero."""
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            yield
    except (FloatingPointError, np.linalg.LinAlgError) as error:
        raise ValueError(
            f"{path}: expected other numbers, got an error ({error}). Look for values that are "
            "huge, zero or equal"
        ) from error


def is_table(source: object) -> bool:
    """Return whether `source` is a path, a mapping or table of columns, or a structured array.

    Examples
    --------
    >>> is_table("stars.csv"), is_table({"x": [1, 2]}), is_table([[1, 2]])
    (True, True, False)
    """
    return isinstance(source, FilePath) or _headings(source) is not None


def _headings(source: Any) -> Sequence[Any] | None:
    """Return the names of the columns of a table, or None for another object."""
    if isinstance(source, Mapping):
        return list(source)
    names = getattr(getattr(source, "dtype", None), "names", None)
    columns = names or getattr(source, "columns", None)
    return None if columns is None else list(columns)


def read_table(
    source: Any,
    columns: Sequence[str],
    optional: Sequence[str] = (),
    sep: str | None = None,
    name: str = "the table",
) -> DataTable:
    """Return columns of numbers from a file, standard input ("-"), a table or an array.

    `sep` separates the columns of a text file, as in `pandas.read_csv`. Default: a comma. An array
    contains the columns in their order. Errors use `name` for a source that is not a file.
    """
    content = None
    if isinstance(source, FilePath):
        name = "standard input" if str(source) == "-" else str(source)
        content = _content(name, source)
        source = _parsed(name, content, sep)
    if (headings := _headings(source)) is None:
        values = _numbers(name, columns[0], source, width=(len(columns),))
        numbers = dict(zip(columns, values.T, strict=True))
    else:
        names = [_plain(heading) for heading in headings]
        if "mask" in names:
            raise ValueError(
                f"{name}: expected no column mask, got one. Remove it and the masked rows"
            )
        extra = (column for column in optional if column in names)
        numbers = {}
        for column in (*columns, *extra):
            # pandas calls the second column with the name x in a file x.1.
            if names.count(column) != 1 or f"{column}.1" in names:
                shown = ", ".join(repr(one[:40]) for one in names[:_MAX_NAMES])
                raise ValueError(
                    f"{name}: expected one column {column} among the names in the first line, got "
                    f"{shown or 'none'}. Lengths are in px. Give sep if no comma separates the "
                    "columns"
                )
            heading = headings[names.index(column)]
            numbers[column] = _numbers(
                f"{name}, column {heading}", column, source[heading]
            )
        if len(lengths := {len(given) for given in numbers.values()}) > 1:
            raise ValueError(
                f"{name}: expected columns of one length, got {sorted(lengths)}. Row i of each "
                "column is the same observation"
            )
        values = np.column_stack([numbers[column] for column in columns])
    table = DataTable(name, values, numbers, content)
    for column, given in numbers.items():
        right = np.abs(given) < _LARGEST_NUMBER  # false for NaN
        expected = (
            f"a finite number below {_LARGEST_NUMBER:g} with a decimal point (text and dates are "
            "nan)"
        )
        table.check(column, right, expected)
    return table


def _plain(name: object) -> str:
    """Return the name of a column in lower case, without blanks at its ends and a unit of px."""
    return str(name).lower().removesuffix("(px)").strip().replace(" ", "_")


def _numbers(
    place: str, name: str, column: Any, width: tuple[int, ...] = ()
) -> FloatArray:
    """Return a column, or an array of columns, with NaN for other entries; lengths are in px."""
    given = getattr(column, "unit", getattr(column, "units", None))
    unit = str(given or "px").lower() or "no unit"
    if unit not in _PIXEL_UNITS and name in (*STARS, *SIGMAS):
        raise ValueError(f"{place}: expected px, got {unit}. Convert the lengths to px")
    if hasattr(column, "iloc") and column.dtype not in (float, int, complex):
        import pandas as pd

        column = pd.to_numeric(column.astype(object), errors="coerce").to_numpy()
    plain = getattr(column, "value", getattr(column, "magnitude", None))
    plain = getattr(column, "values", column) if plain is None else plain
    try:
        return number_array(place, plain, shape=(None, *width), exact=True)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{error}. Pass an image as a NumPy array") from error


def _content(name: str, path: FilePath) -> bytes:
    if str(path) == "-":
        return sys.stdin.buffer.read()
    if Path(path).is_char_device():  # it may never end
        raise ValueError(f"{name}: expected a file, got a device. Use - for input")
    return Path(path).read_bytes()


def _parsed(name: str, content: bytes, sep: str | None) -> Any:
    """Return the DataFrame or the Astropy table of the content of a file."""
    form = _ASTROPY_FORMATS.get(Path(name.lower().removesuffix(".gz")).suffix)
    try:
        import pandas as pd

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # units that Astropy does not know
            # pandas drops columns without a name, and Astropy all tables but the first.
            warnings.simplefilter("error", pd.errors.ParserWarning)
            warnings.filterwarnings("error", message=".*(multiple tables|truncated)")
            if packed := content.startswith(b"\x1f\x8b"):
                content = gzip.decompress(content)
            if form := _SIGNATURES.get(content[:7], form):
                from astropy.table import Table as AstropyTable

                return AstropyTable.read(BytesIO(content), format=form)
            # pandas reads a plain file without comments in half of the time.
            plain = Path(name).is_file() and not packed and b"#" not in content
            return pd.read_csv(
                Path(name) if plain else BytesIO(content),
                sep=sep or ",",
                comment=None if plain else "#",
                engine="c",
                skipinitialspace=True,
                index_col=False,
                compression=None,
            )
    except Exception as error:  # pandas, Astropy and XML parsers raise many types
        # The warning of Astropy names the table that it would read.
        reason = " ".join(str(error).split()).partition(", reading in")[0][:200]
        raise ValueError(
            f"{name}: expected columns of numbers ({reason}). Give sep if no comma separates them, "
            "or read another format with pandas or Astropy and pass the table"
        ) from error


def matched_stars(
    source: Any, target: Any = None, *, sep: str | None = None, **settings: Any
) -> tuple[DataTable, dict[str, Any]]:
    """Return the table of the stars, and the arguments of a fit with the points of both images.

    The stars are in one table of matched stars, or in two arrays or tables, row by row. Further
    arguments are the settings, and the errors in columns of the table.
    """
    if (weights := settings.get("weights")) is not None:
        number_array("weights", weights, shape=(None,), exact=True)
    if target is not None:
        first, second = (
            read_table(image, STARS[:2], (*SIGMAS, "weight"), sep, name)
            for name, image in (("source", source), ("target", target))
        )
        if ignored := {*first.numbers, *second.numbers} - {*STARS[:2]}:
            raise ValueError(
                f"{min(ignored)}: expected no column of errors in two tables matched by row, got "
                f"one. Join both into one table with the columns {', '.join(STARS)} and "
                "this column"
            )
        settings |= {"source": first.values, "target": second.values}
        return replace(first, path="the arrays"), settings
    if not is_table(source):
        raise ValueError(
            "target: expected the stars of the other image, got none. Pass them, or a table of "
            f"both images with the columns {', '.join(STARS)}"
        )
    table = read_table(source, STARS, (*SIGMAS, "weight", "flux", "mag"), sep)
    given = without_none(
        {
            "source": table.values[:, :2],
            "target": table.values[:, 2:],
            "weights": table.numbers.get("weight"),
            "target_covariance": covariances(table),
        }
    )
    if twice := given.keys() & settings.keys():
        raise ValueError(
            f"{min(twice)}: expected no argument, got one and a column of the table. Remove one"
        )
    return table, settings | given


def brightness(columns: Any) -> Any:
    """Return a column that increases with the flux of each star, or None if unknown."""
    return -columns["mag"] if "mag" in columns else columns.get("flux")


def covariances(table: DataTable) -> FloatArray | None:
    """Return covariances by columns of standard deviations, (n, 2, 2), or None without them."""
    columns = table.numbers
    if not {*SIGMAS} & {*columns}:
        return None
    names = [
        f"sigma_{axis}" if f"sigma_{axis}" in columns else "sigma" for axis in "xy"
    ]
    for name in names:
        if name not in columns:
            raise ValueError(
                f"{table.path}: expected sigma, or sigma_x and sigma_y, got no {name}. Add a "
                "column"
            )
        table.check(name, columns[name] > 0, "a standard deviation above zero")
    sigma = np.column_stack([columns[name] for name in names])
    return sigma[..., None] ** 2 * np.eye(2)
