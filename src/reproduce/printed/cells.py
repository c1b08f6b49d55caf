"""Printed cells with their addresses, read from the data files, and the form of such a file."""

from __future__ import annotations

import fnmatch
import hashlib
import tomllib
from collections import Counter
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    StringConstraints,
    ValidationError,
    model_validator,
)

from reproduce.locate import data_folders, papers
from reproduce.printed.number import PrintedNumber, si_factor, symbol

PAPERS = tuple(papers())
# What a number is in the paper (not what we do with it: that is up to each use).
Role = Literal[
    "setting", "specification", "measurement", "simulation", "derived", "citation"
]
_Qualifier = Literal["about", "nominal", "less", "greater", "at-least", "within"]
# A no-break space keeps sign and digits on one line.
_SIGNS = {"less": "<", "greater": ">", "at-least": "≥", "within": "±", "about": "≈"}


class PrintedFileError(ValueError):
    """A file of printed numbers does not follow the format; the message lists every fault."""


def _known(unit: str) -> str:
    si_factor(unit)
    return unit


class _Traits(BaseModel):
    """What can be said of a cell, or once for its row, column or file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    unit: Annotated[str, AfterValidator(_known)] | None = None
    unit_assumed: str | None = None
    role: Role | None = None
    qualifier: _Qualifier | None = None
    sigma: Literal[1, 3] | None = None
    section: str | None = None
    page: str | None = None
    spelled: str | None = None
    misprint: str | None = None


class _Entry(_Traits):
    """One cell of a table: digits or text, with what differs from its row and column."""

    value: str | None = None
    text: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _digits(cls, entry: Any) -> Any:
        if isinstance(entry, int | float):
            raise ValueError(
                f'unquoted number: write "{entry}", with all the digits of the print'
            )
        return {"value": entry} if isinstance(entry, str) else entry

    @model_validator(mode="after")
    def _number_or_text(self) -> _Entry:
        if (self.value is None) == (self.text is None):
            raise ValueError(
                "expected exactly one of value (digits) and text (words, a dash)"
            )
        if self.value is not None:
            PrintedNumber(self.value)
        return self


class _Line(_Traits):
    """What rows, columns and quoted numbers have in common: an id and a label."""

    id: Annotated[str, StringConstraints(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$")]
    label: str


class _Quoted(_Line, _Entry):
    """One number quoted in the text."""


class _Row(_Line):
    """A row of a table, with its cells in the order of the columns."""

    cells: list[_Entry]


class _File(_Traits):
    """One file: a table with rows and columns, or a group of quoted numbers."""

    title: str
    place: str
    column: list[_Line] = []
    row: list[_Row] = []
    cell: list[_Quoted] = []

    @model_validator(mode="after")
    def _whole(self) -> _File:
        if self.page is None and self.section is None:
            raise ValueError(
                "missing page or section: say where in the paper the numbers stand"
            )
        if bool(self.cell) == bool(self.row or self.column):
            raise ValueError(
                "expected either [[column]] and [[row]] (a table) or [[cell]]"
            )
        for name, lines in (
            ("column", self.column),
            ("row", self.row),
            ("cell", self.cell),
        ):
            if twice := [
                i for i, n in Counter(line.id for line in lines).items() if n > 1
            ]:
                raise ValueError(
                    f"duplicate {name} {', '.join(twice)}: each id may stand once"
                )
        for row in self.row:
            if len(row.cells) != len(self.column):
                raise ValueError(
                    f"row {row.id!r}: expected {len(self.column)} cells, one per column, "
                    f"got {len(row.cells)}"
                )
        return self


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
    unit_assumed, misprint : str, optional
        Why the unit is ours; the misprint we claim.
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
            raise TypeError(
                f"{self.address}: expected a number, the cell prints {self.content!r}"
            )
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
    rows, columns : tuple of _Line
        Ids and labels in the order of print; a group of quoted numbers has no columns.
    cells : tuple of Cell
        All cells in the order of print.
    """

    key: str
    title: str
    place: str
    rows: tuple[_Line, ...]
    columns: tuple[_Line, ...]
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
        return build(tomllib.loads(path.read_text(encoding="utf-8")), key, source)
    except tomllib.TOMLDecodeError as error:
        raise PrintedFileError(f"{source}: not valid TOML: {error}") from error


def build(content: Any, key: str, source: str = "") -> PrintedTable:
    """Check the content of a file; give every cell its address and its inherited traits."""
    try:
        file = _File.model_validate(content)
    except ValidationError as error:
        faults = [
            f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors()
        ]
        raise PrintedFileError(
            "\n".join(f"{source}: {fault}" for fault in faults)
        ) from error
    cells = [
        _cell(key, quoted.id, quoted.label, (file, quoted)) for quoted in file.cell
    ]
    for row in file.row:
        for column, entry in zip(file.column, row.cells, strict=True):
            label = (
                row.label if len(file.column) == 1 else f"{row.label}, {column.label}"
            )
            cells.append(
                _cell(key, f"{row.id}.{column.id}", label, (file, column, row, entry))
            )
    rows, place = tuple(file.row or file.cell), _place(file, file)
    return PrintedTable(key, file.title, place, rows, tuple(file.column), tuple(cells))


def _cell(key: str, name: str, label: str, above: tuple[Any, ...]) -> Cell:
    """Return a cell with the traits of its file, column and row where its entry has none."""
    traits: dict[str, Any] = {}
    for one in above:
        traits |= one.model_dump(include=set(_Traits.model_fields), exclude_none=True)
    file, entry = above[0], above[-1]
    if entry.value is not None and (missing := {"unit", "role"} - set(traits)):
        raise PrintedFileError(
            f"{key}#{name}: missing {missing.pop()}; give it to the cell or row"
        )
    content: PrintedNumber | str = entry.text or ""
    if entry.value is not None:
        exact = traits["unit"] == "count"
        content = PrintedNumber(entry.value, exact, traits.get("qualifier"))
    return Cell(
        key=key,
        name=name,
        label=label,
        content=content,
        unit=traits["unit"] if entry.text is None else "",
        role=traits.get("role", "specification"),
        place=_place(file, entry if entry.section or entry.page else file),
        sigma=traits.get("sigma"),
        unit_assumed=traits.get("unit_assumed"),
        misprint=entry.misprint,
    )


def _place(file: _File, at: _Traits) -> str:
    return f"{file.place}, {f'page {at.page}' if at.page else f'section {at.section}'}"


@cache
def library() -> dict[str, PrintedTable]:
    """Return all printed tables and groups of all papers.

    Examples
    --------
    >>> library()["niu2024/table-3"]["scale.red"].text
    '0.9973'
    """
    return {
        (key := f"{paper}/{path.stem}"): read(path, key)
        for paper, folder in papers().items()
        for path in sorted((folder / "printed" / paper).glob("*.toml"))
    }


def altered_files() -> tuple[str, ...]:
    """Return the files of printed numbers that are not those of their checksums."""
    return tuple(
        name for folder in data_folders() for name in _altered(folder / "printed")
    )


def _altered(folder: Path) -> list[str]:
    sums = folder / "SHA256SUMS"
    try:
        lines = sums.read_text(encoding="utf-8").splitlines()
        recorded = {
            name: digest for digest, name in (line.split("  ", 1) for line in lines)
        }
    except (FileNotFoundError, ValueError) as error:
        raise PrintedFileError(
            f"{sums} is missing or no list of checksums: restore it, or run `make checksums`"
        ) from error
    found = {
        path.relative_to(folder).as_posix(): hashlib.sha256(
            path.read_bytes()
        ).hexdigest()
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
    cells = library()[key].cells if key in library() else ()
    found = tuple(c for c in cells if not name or fnmatch.fnmatchcase(c.name, name))
    if not found:
        raise KeyError(
            f"no printed cell matches {pattern!r}; see `reproduce list` for the keys"
        )
    return found
