"""Printed cells with their addresses, read from the data files."""

from __future__ import annotations

import fnmatch
import hashlib
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from reproduce.locate import data_folders, papers
from reproduce.printed.number import PrintedNumber
from reproduce.printed.schema import (
    CellEntry,
    Line,
    PrintedFile,
    PrintedFileError,
    QuotedCell,
    Role,
    Traits,
    parse,
)
from reproduce.printed.units import si_factor, symbol

PAPERS = tuple(papers())
# A no-break space keeps sign and digits on one line.
_SIGNS = {"less": "<", "greater": ">", "at-least": "≥", "within": "±", "about": "≈"}


@dataclass(frozen=True)
class Cell:
    """One printed cell with its address and all that the print says of it.

    Parameters
    ----------
    key : str
        The table or group, such as ``niu2024/table-1``.
    name : str
        The cell in it: ``row.column`` in a table, one id in a group.
    label : str
        What the number is, in our words.
    content : PrintedNumber or str
        The digits, or a text such as a dash.
    unit : str
        The unit of print, empty for text.
    role : str
        What the number is in the paper: setting, specification, measurement, ...
    place : str
        Table or text, with page or section.
    sigma : int, optional
        1 or 3 where the print gives the number as that many standard deviations.
    unit_assumed, spelled, misprint : str, optional
        Why the unit is ours; the word that stands for the digits; the misprint we claim.
    """

    key: str
    name: str
    label: str
    content: PrintedNumber | str
    unit: str
    role: Role
    place: str
    sigma: int | None = None
    unit_assumed: str | None = None
    spelled: str | None = None
    misprint: str | None = None

    @property
    def address(self) -> str:
        """``key#name``, the only name of the cell."""
        return f"{self.key}#{self.name}"

    @property
    def anchor(self) -> str:
        """The address as an HTML anchor."""
        return anchor(self.address)

    @property
    def number(self) -> PrintedNumber:
        """The printed number; raises TypeError on a cell of text."""
        if isinstance(self.content, str):
            raise TypeError(f"{self.address}: expected a number, the cell prints {self.content!r}")
        return self.content

    @property
    def is_number(self) -> bool:
        """Whether the cell holds a number."""
        return isinstance(self.content, PrintedNumber)

    @property
    def text(self) -> str:
        """The cell as printed, without its unit."""
        return self.content if isinstance(self.content, str) else self.content.text

    @property
    def si(self) -> float:
        """The number in SI units (pixels stay pixels)."""
        return self.number.value * si_factor(self.unit)

    @cached_property
    def allowed(self) -> tuple[float, float]:
        """The values that print so by the usual rounding, in SI units, without slack."""
        factor = si_factor(self.unit)
        return self.number.low * factor, self.number.high * factor

    @property
    def si_interval(self) -> tuple[float, float]:
        """The values that agree with the print, lower and upper end in SI units."""
        low, high = self.number.interval()
        return low * si_factor(self.unit), high * si_factor(self.unit)

    @property
    def shown(self) -> str:
        """The cell as a reader sees it: qualifier, digits, unit."""
        if isinstance(self.content, str):
            return self.content
        sign = _SIGNS.get(self.content.qualifier or "", "")
        lead = f"{sign}\u00a0" if sign else ""
        unit = symbol(self.unit)
        gap = "" if unit in {"", "°", "″"} else "\u202f"
        return f"{lead}{self.text.replace('-', '−')}{gap}{unit}"


@dataclass(frozen=True)
class PrintedTable:
    """A table or a group of quoted numbers, cell by cell.

    Parameters
    ----------
    key : str
        ``paper/table-n`` or ``paper/text-topic``.
    title, place : str
        What it holds, in our words; where it stands.
    rows, columns : tuple of Line
        Ids and labels in the order of print; a group of quoted numbers has no columns.
    cells : tuple of Cell
        All cells in the order of print.
    """

    key: str
    title: str
    place: str
    rows: tuple[Line, ...]
    columns: tuple[Line, ...]
    cells: tuple[Cell, ...]

    @cached_property
    def by_name(self) -> dict[str, Cell]:
        """The cells by their names."""
        return {cell.name: cell for cell in self.cells}

    def __getitem__(self, name: str) -> Cell:
        """Return the cell called `name`, or raise KeyError naming the nearest ones."""
        try:
            return self.by_name[name]
        except KeyError:
            raise KeyError(
                f"{self.key} has no cell {name!r}; its cells: {list(self.by_name)}"
            ) from None


def anchor(address: str) -> str:
    """Return the HTML anchor of an address.

    Examples
    --------
    >>> anchor("niu2024/table-3#scale.red")
    'niu2024-table-3-scale-red'
    """
    return address.replace("/", "-").replace("#", "-").replace(".", "-")


def read(path: Path, key: str) -> PrintedTable:
    """Read one file of printed numbers."""
    source = f"{path.parent.name}/{path.name}"
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise PrintedFileError(f"{source}: not valid TOML: {error}") from error
    return build(parse(content, source), key)


def build(file: PrintedFile, key: str) -> PrintedTable:
    """Give every cell of a checked file its address and its inherited traits."""
    cells: list[Cell] = []
    for row in file.row:
        for column, entry in zip(file.column, row.cells, strict=True):
            name, label = f"{row.id}.{column.id}", _label(row, column, file)
            cells.append(_cell(key, name, label, entry, (row, column, file)))
    cells += [_cell(key, quoted.id, quoted.label, quoted, (file,)) for quoted in file.cell]
    place = f"{file.place}, {_where(file)}"
    return PrintedTable(key, file.title, place, file.row or file.cell, file.column, tuple(cells))


def _label(row: Line, column: Line, file: PrintedFile) -> str:
    return row.label if len(file.column) == 1 else f"{row.label}, {column.label}"


def _cell(
    key: str, name: str, label: str, entry: CellEntry | QuotedCell, above: tuple[Traits, ...]
) -> Cell:
    def trait(which: str) -> object:
        return next((v for t in (entry, *above) if (v := getattr(t, which)) is not None), None)

    traits = {which: trait(which) for which in ("unit", "role", "sigma", "unit_assumed")}
    if entry.text is None and (traits["unit"] is None or traits["role"] is None):
        missing = "unit" if traits["unit"] is None else "role"
        raise PrintedFileError(f"{key}#{name}: missing {missing}; give it to the cell or its row")
    content: PrintedNumber | str = entry.text or ""
    if entry.value is not None:
        qualifier = trait("qualifier")
        content = PrintedNumber(
            entry.value,
            traits["unit"] == "count",
            qualifier if isinstance(qualifier, str) else None,
        )
    file = above[-1]
    where = entry if entry.section or entry.page else file
    return Cell(
        key=key,
        name=name,
        label=label,
        content=content,
        unit=str(traits["unit"] or "") if entry.text is None else "",
        # The schema has checked the role; looking it up by name loses its type.
        role=traits["role"] or "specification",  # type: ignore[arg-type]
        place=f"{getattr(file, 'place', '')}, {_where(where)}",
        sigma=traits["sigma"] if isinstance(traits["sigma"], int) else None,
        unit_assumed=None if traits["unit_assumed"] is None else str(traits["unit_assumed"]),
        spelled=entry.spelled,
        misprint=entry.misprint,
    )


def _where(traits: Traits) -> str:
    return f"page {traits.page}" if traits.page else f"section {traits.section}"


class Library(Mapping[str, PrintedTable]):
    """All printed tables and groups of quoted numbers by key; each file is read when asked for."""

    def __init__(self, paths: Mapping[str, Path]) -> None:
        self._paths = paths
        self._read: dict[str, PrintedTable] = {}

    def __getitem__(self, key: str) -> PrintedTable:
        """Return a table, or raise PrintedFileError if its file does not follow the format."""
        if key not in self._read:
            self._read[key] = read(self._paths[key], key)
        return self._read[key]

    def __contains__(self, key: object) -> bool:
        """Tell whether there is a file of this key, without reading it."""
        return key in self._paths

    def __iter__(self) -> Iterator[str]:
        """Go through the keys."""
        return iter(self._paths)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._paths)


@cache
def library() -> Library:
    """Return all printed tables and groups of all papers.

    Examples
    --------
    >>> library()["niu2024/table-3"]["scale.red"].text
    '0.9973'
    """
    return Library(
        {
            f"{paper}/{path.stem}": path
            for paper, folder in papers().items()
            for path in sorted((folder / "printed" / paper).glob("*.toml"))
        }
    )


def altered_files() -> tuple[str, ...]:
    """Return the files of printed numbers that are not those of their checksums."""
    return tuple(name for folder in data_folders() for name in _altered(folder / "printed"))


def _altered(folder: Path) -> list[str]:
    try:
        lines = (folder / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
        recorded = {name: digest for digest, name in (line.split("  ", 1) for line in lines)}
    except (FileNotFoundError, ValueError) as error:
        raise PrintedFileError(
            f"{folder / 'SHA256SUMS'}: expected lines of a checksum and a file's name, got "
            f"{error}; restore the file"
        ) from error
    found = {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.suffix in {".toml", ".csv"}
    }
    names = sorted(recorded.keys() | found.keys())
    return [name for name in names if recorded.get(name) != found.get(name)]


def find(pattern: str) -> tuple[Cell, ...]:
    """Return the printed cells whose addresses match `pattern`, in order of print.

    Examples
    --------
    >>> [cell.text for cell in find("niu2024/table-2#scale.*")]
    ['0.9976', '1.0020']
    """
    key, _, name = pattern.partition("#")
    table = library().get(key)
    cells = () if table is None else table.cells
    found = tuple(c for c in cells if not name or fnmatch.fnmatchcase(c.name, name))
    if not found:
        raise KeyError(f"no printed cell matches {pattern!r}; see `reproduce list` for the keys")
    return found
