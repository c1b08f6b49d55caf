"""Printed cells with their addresses, and the format of the files of printed numbers."""

from __future__ import annotations

import fnmatch
import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    StringConstraints,
    model_validator,
)

from reproduce.locate import data_folders, papers, read_toml
from reproduce.printed.number import (
    UNITS,
    PrintedNumber,
    minus,
    quantity,
    si_factor,
    symbol,
)

PAPERS = tuple(papers())
# Role of a number in the paper, which does not depend on its use here.
Role = Literal[
    "setting", "specification", "measurement", "simulation", "derived", "citation"
]
_Qualifier = Literal["about", "nominal", "less", "greater", "at-least", "within"]
# A no-break space keeps sign and digits on one line.
_SIGNS = {
    "less": "<\u00a0",
    "greater": ">\u00a0",
    "at-least": "≥\u00a0",
    "within": "±\u00a0",
    "about": "≈\u00a0",
}


class _Traits(BaseModel):
    """Traits of a cell, or of all cells of its row, column or file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    # pydantic evaluates the list of units; mypy accepts only written literals.
    unit: Literal[tuple(UNITS)] | None = None  # type: ignore[valid-type]  # from data
    unit_assumed: str = ""
    role: Role | None = None
    qualifier: _Qualifier | None = None
    sigma: Literal[1, 3] | None = None
    section: str = ""
    page: str = ""
    spelled: str = ""
    misprint: str = ""
    unpublished: str = ""

    @property
    def position(self) -> str:
        """Page or section; empty without either."""
        if self.page:
            return f"page {self.page}"
        return f"section {self.section}" if self.section else ""


# The place of a cell contains its section and page.
_TRAITS = set(_Traits.model_fields) - {"section", "page", "spelled"}


class _Entry(_Traits):
    """One cell of a table: digits or text, and traits that its row and column do not have."""

    value: Annotated[str, AfterValidator(lambda text: PrintedNumber(text).text)] = ""
    text: str = ""

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, entry: Any) -> Any:
        """Accept quoted digits in place of an entry, and require digits or text."""
        if not isinstance(entry, dict):
            return {"value": entry}
        if ("value" in entry) == ("text" in entry):
            raise ValueError("expected either value (digits) or text (words, a dash)")
        return entry


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
        if not self.position:
            raise ValueError("expected a page or section, got none. Add the position.")
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
    """One printed cell.

    Parameters
    ----------
    key : str
        The table or group, such as ``niu2024/table-1``.
    name : str
        Name in the table: ``row.column``, or one id in a group.
    label : str
        Description of the number.
    content : PrintedNumber or str
        The digits, or a text such as a dash.
    place : str
        Position in the paper: table or text, with page or section.
    unit : str
        The printed unit, empty for text.
    role : str
        Role of the number in the paper: setting, specification, measurement, ...
    sigma : int, optional
        1 or 3 if the paper gives the number as one or three standard deviations.
    unit_assumed, misprint : str, optional
        Reason for an assumed unit, and for a suspected typographical error.
    unpublished : str, optional
        Data that the number needs, and that the paper does not publish.
    """

    key: str
    name: str
    label: str
    content: PrintedNumber | str
    place: str
    unit: str = ""
    role: Role = "specification"
    sigma: int | None = None
    unit_assumed: str = ""
    misprint: str = ""
    unpublished: str = ""

    @property
    def address(self) -> str:
        """Address of the cell, ``key#name``."""
        return f"{self.key}#{self.name}"

    @property
    def anchor(self) -> str:
        """The address as an HTML anchor."""
        return anchor(self.address)

    @property
    def number(self) -> PrintedNumber:
        """The printed number; raises TypeError for a cell of text."""
        if isinstance(self.content, str):
            raise TypeError(
                f"{self.address}: expected a number, got the printed text {self.content!r}"
            )
        return self.content

    @property
    def is_number(self) -> bool:
        """Whether the cell contains a number."""
        return isinstance(self.content, PrintedNumber)

    @property
    def text(self) -> str:
        """The cell as printed, without its unit."""
        return self.content if isinstance(self.content, str) else self.content.text

    @property
    def si_unit(self) -> float:
        """SI value of its unit (1 for pixels)."""
        return si_factor(self.unit)

    @property
    def si(self) -> float:
        """The number in SI units (pixels stay pixels)."""
        return self.number.value * self.si_unit

    @property
    def symbol(self) -> str:
        """Symbol of the unit on a page; empty for text."""
        return symbol(self.unit) if self.unit else ""

    @property
    def shown(self) -> str:
        """The cell with qualifier, digits and unit, as a page shows it."""
        if isinstance(self.content, str):
            return self.content
        sign = _SIGNS.get(self.content.qualifier, "")
        return quantity(sign + minus(self.text), self.symbol)


@dataclass(frozen=True)
class PrintedTable:
    """A table or a group of quoted numbers.

    Parameters
    ----------
    key : str
        ``paper/table-n`` or ``paper/text-topic``.
    title, place : str
        Title in the words of this project, and position in the paper.
    rows, columns : sequence of _Line
        Ids and labels in printed order; a group of quoted numbers has no columns.
    cells : sequence of PrintedCell
        All cells in printed order.
    """

    key: str
    title: str
    place: str
    rows: Sequence[_Line]
    columns: Sequence[_Line]
    cells: Sequence[PrintedCell]

    @cached_property
    def by_name(self) -> dict[str, PrintedCell]:
        """The cells by their names."""
        return {cell.name: cell for cell in self.cells}

    def __getitem__(self, name: str) -> PrintedCell:
        """Return the cell with a name."""
        if name not in self.by_name:
            raise KeyError(
                f"{self.key} has no cell {name!r}; its cells: {list(self.by_name)}"
            )
        return self.by_name[name]


def anchor(address: str) -> str:
    """Return the HTML anchor of an address.

    Examples
    --------
    >>> anchor("niu2024/table-3#scale.red")
    'niu2024-table-3-scale-red'
    """
    return re.sub("[/#.]", "-", address)


def _build(file: _File, key: str) -> PrintedTable:
    """Return the table of a file.

    Each cell has the traits of its file, column and row that its entry does not have.
    """
    cells = [
        _cell(key, entry.id, entry.label, [file, entry]) for entry in file.cell
    ] + [
        _cell(
            key,
            f"{row.id}.{column.id}",
            row.label + f", {column.label}" * (len(file.column) > 1),
            [file, column, row, entry],
        )
        for row in file.row
        for column, entry in zip(file.column, row.cells, strict=True)
    ]
    if len({cell.name for cell in cells}) < len(cells):
        raise ValueError(f"{key}: expected each id once, got a duplicate")
    place = f"{file.place}, {file.position}"
    return PrintedTable(
        key, file.title, place, file.row or file.cell, file.column, cells
    )


def _cell(key: str, name: str, label: str, owners: list[Any]) -> PrintedCell:
    """Return a cell with the traits of its owners: file, column, row, entry."""
    traits: dict[str, Any] = {}
    for owner in owners:
        traits |= owner.model_dump(include=_TRAITS, exclude_unset=True)
    file, *_, entry = owners
    qualifier = traits.pop("qualifier", "")
    content: PrintedNumber | str = entry.text
    if not entry.value:
        traits["unit"] = ""
    elif missing := {"unit", "role"} - set(traits):
        raise ValueError(f"{key}#{name}: missing {missing.pop()}")
    else:
        content = PrintedNumber(entry.value, traits["unit"] == "count", qualifier)
    place = f"{file.place}, {entry.position or file.position}"
    return PrintedCell(key, name, label, content, place, **traits)


@cache
def library() -> dict[str, PrintedTable]:
    """Return all printed tables and groups of all papers.

    Examples
    --------
    >>> library()["niu2024/table-3"]["scale.red"].text
    '0.9973'
    """
    return {
        (key := f"{paper}/{path.stem}"): _build(read_toml(path, _File), key)
        for paper, folder in papers().items()
        for path in sorted((folder / "printed" / paper).glob("*.toml"))
    }


def altered_files() -> tuple[str, ...]:
    """Return the files of printed numbers that differ from the list of checksums."""
    altered: list[str] = []
    for folder in (data / "printed" for data in data_folders()):
        recorded = (folder / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
        present = {
            f"{hashlib.sha256(path.read_bytes()).hexdigest()}  "
            f"{path.relative_to(folder).as_posix()}"
            for path in folder.rglob("*.*")
            if path.suffix in {".toml", ".csv"}
        }
        altered += sorted({line.split()[-1] for line in present ^ set(recorded)})
    return tuple(altered)


def find(pattern: str) -> list[PrintedCell]:
    """Return the printed cells whose addresses match `pattern`, in printed order.

    Examples
    --------
    >>> [cell.text for cell in find("niu2024/table-2#scale.*")]
    ['0.9976', '1.0020']
    """
    key, _, name = pattern.partition("#")
    cells = library()[key].cells if key in library() else ()
    matching = [c for c in cells if fnmatch.fnmatchcase(c.name, name or "*")]
    if not matching:
        raise KeyError(
            f"address: expected a printed cell, got {pattern!r}, which matches none. "
            "`reproduce contents` lists the keys"
        )
    return matching
