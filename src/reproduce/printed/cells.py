"""Printed cells with their addresses, read from the data files, and the form of such a file."""

from __future__ import annotations

import fnmatch
import hashlib
import tomllib
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


def _known_unit(unit: str) -> str:
    si_factor(unit)
    return unit


class _Traits(BaseModel):
    """Traits of a cell, or of all cells of its row, column or file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    unit: Annotated[str, AfterValidator(_known_unit)] | None = None
    unit_assumed: str | None = None
    role: Role | None = None
    qualifier: _Qualifier | None = None
    sigma: Literal[1, 3] | None = None
    section: str | None = None
    page: str | None = None
    spelled: str | None = None
    misprint: str | None = None


_TRAITS = set(_Traits.model_fields)


class _Entry(_Traits):
    """One cell of a table: digits or text, and traits that its row and column do not have."""

    value: Annotated[str, AfterValidator(lambda text: PrintedNumber(text).text)] | None
    text: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, entry: Any) -> Any:
        """Accept quoted digits in place of an entry, and require digits or text."""
        if isinstance(entry, int | float):
            raise ValueError(
                f'unquoted number: write "{entry}", with all the digits of the print'
            )
        fields = (
            {"value": entry} if isinstance(entry, str) else {"value": None, **entry}
        )
        if (fields["value"] is None) == ("text" not in fields):
            raise ValueError(
                "expected exactly one of value (digits) and text (words, a dash)"
            )
        return fields


class _Line(_Traits):
    """Id and label of a row, of a column or of a quoted number."""

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
    def _is_complete(self) -> _File:
        if self.page is None and self.section is None:
            raise ValueError(
                "missing page or section: state where in the paper the numbers are"
            )
        if bool(self.cell) == bool(self.row or self.column):
            raise ValueError(
                "expected either [[column]] and [[row]] (a table) or [[cell]]"
            )
        for row in self.row:
            if len(row.cells) != len(self.column):
                raise ValueError(
                    f"row {row.id!r}: expected {len(self.column)} cells, one per column, "
                    f"got {len(row.cells)}"
                )
        return self


@dataclass(frozen=True)
class PrintedCell:
    """One printed cell with its address and its attributes.

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
        The printed unit, empty for text.
    role : str
        What the number is in the paper: setting, specification, measurement, ...
    place : str
        Table or text, with page or section.
    sigma : int, optional
        1 or 3 if the paper gives the number as one or three standard deviations.
    unit_assumed, misprint : str, optional
        Reason for an assumed unit, and for a suspected typographical error.
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
        Ids and labels in printed order; a group of quoted numbers has no columns.
    cells : tuple of Cell
        All cells in printed order.
    """

    key: str
    title: str
    place: str
    rows: tuple[_Line, ...]
    columns: tuple[_Line, ...]
    cells: tuple[PrintedCell, ...]

    @cached_property
    def by_name(self) -> dict[str, PrintedCell]:
        """The cells by their names."""
        return {cell.name: cell for cell in self.cells}

    def __getitem__(self, name: str) -> PrintedCell:
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
    lines: list[tuple[str, str, list[Any]]] = [
        (quoted.id, quoted.label, [quoted]) for quoted in file.cell
    ]
    for row in file.row:
        for column, entry in zip(file.column, row.cells, strict=True):
            label = row.label
            if len(file.column) > 1:
                label += f", {column.label}"
            lines.append((f"{row.id}.{column.id}", label, [column, row, entry]))
    cells = {
        name: _cell(key, name, label, file, traits) for name, label, traits in lines
    }
    if len(cells) < len(lines):
        raise PrintedFileError(f"{source}: expected each id once, got a duplicate")
    return PrintedTable(
        key=key,
        title=file.title,
        place=_place(file, file),
        rows=tuple(file.row or file.cell),
        columns=tuple(file.column),
        cells=tuple(cells.values()),
    )


def _cell(
    key: str, name: str, label: str, file: _File, owners: list[Any]
) -> PrintedCell:
    """Return a cell with the traits of its file, column and row if its entry has none."""
    traits: dict[str, Any] = {}
    for owner in (file, *owners):
        traits |= owner.model_dump(include=_TRAITS, exclude_none=True)
    entry = owners[-1]
    content: PrintedNumber | str = entry.text or ""
    if entry.value is not None:
        if missing := {"unit", "role"} - set(traits):
            raise PrintedFileError(
                f"{key}#{name}: missing {missing.pop()}; give it to the cell or row"
            )
        is_count = traits["unit"] == "count"
        content = PrintedNumber(entry.value, is_count, traits.get("qualifier"))
    return PrintedCell(
        key=key,
        name=name,
        label=label,
        content=content,
        unit=traits["unit"] if entry.value is not None else "",
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
    """Return the files of printed numbers that differ from the list of checksums."""
    altered: list[str] = []
    for folder in (one / "printed" for one in data_folders()):
        recorded = (folder / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
        found = {
            f"{hashlib.sha256(path.read_bytes()).hexdigest()}  "
            f"{path.relative_to(folder).as_posix()}"
            for path in folder.rglob("*")
            if path.suffix in {".toml", ".csv"}
        }
        altered += sorted(
            {line.split()[-1] for line in found.symmetric_difference(recorded)}
        )
    return tuple(altered)


def find(pattern: str) -> tuple[PrintedCell, ...]:
    """Return the printed cells whose addresses match `pattern`, in printed order.

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
