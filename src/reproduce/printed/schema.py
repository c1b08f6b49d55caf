"""The form of a file of printed numbers, and errors that say what is wrong with one."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError, field_validator, model_validator

from reproduce.printed.number import PrintedNumber
from reproduce.printed.units import UNITS

# What a number is in the paper (not what we do with it: that is up to each use).
Role = Literal["setting", "specification", "measurement", "simulation", "derived", "citation"]
Qualifier = Literal["about", "nominal", "less", "greater", "at-least", "within"]

_ID = r"[a-z0-9]+(-[a-z0-9]+)*"


class PrintedFileError(ValueError):
    """A file of printed numbers does not follow the format; the message lists every fault."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Traits(_Strict):
    """What can be said of a cell, or once for its row, column or file."""

    unit: str | None = None
    unit_assumed: str | None = None
    role: Role | None = None
    qualifier: Qualifier | None = None
    sigma: Literal[1, 3] | None = None
    section: str | None = None
    page: str | None = None
    spelled: str | None = None
    misprint: str | None = None

    @field_validator("unit")
    @classmethod
    def _known_unit(cls, unit: str | None) -> str | None:
        if unit is not None and unit not in UNITS:
            raise ValueError(f"unknown unit {unit!r}: expected one of {', '.join(UNITS)}")
        return unit


class CellEntry(Traits):
    """One cell of a table: digits or text, with what differs from its row and column."""

    value: str | None = None
    text: str | None = None

    @model_validator(mode="after")
    def _number_or_text(self) -> CellEntry:
        if (self.value is None) == (self.text is None):
            raise ValueError("expected exactly one of value (digits) and text (words, a dash)")
        if self.value is not None:
            PrintedNumber(self.value)
        return self


class Line(Traits):
    """What rows, columns and quoted numbers have in common: an id and a label."""

    id: str
    label: str

    @field_validator("id")
    @classmethod
    def _plain_id(cls, name: str) -> str:
        import re

        if not re.fullmatch(_ID, name):
            raise ValueError(f"expected an id of a-z, 0-9 and single hyphens, got {name!r}")
        return name


class QuotedCell(Line, CellEntry):
    """One number quoted in the text."""


class Row(Line):
    """A row of a table, with its cells in the order of the columns."""

    cells: tuple[CellEntry, ...]

    @field_validator("cells", mode="before")
    @classmethod
    def _cells(cls, cells: Any) -> tuple[Any, ...]:
        if not isinstance(cells, list):
            raise ValueError(f"expected a list of cells, got {type(cells).__name__}")
        return tuple(_entry(position, cell) for position, cell in enumerate(cells, start=1))


def _entry(position: int, cell: Any) -> Any:
    if isinstance(cell, str):
        return {"value": cell}
    if isinstance(cell, int | float):
        raise ValueError(
            f'cell {position}: unquoted number {cell}; write "{cell}" in quotes, with all the '
            "digits of the print, so that trailing zeros survive"
        )
    return cell


class PrintedFile(Traits):
    """One file: a table with rows and columns, or a group of quoted numbers."""

    title: str
    place: str
    column: tuple[Line, ...] = ()
    row: tuple[Row, ...] = ()
    cell: tuple[QuotedCell, ...] = ()

    @field_validator("column", "row", "cell", mode="before")
    @classmethod
    def _as_tuple(cls, lines: Any) -> Any:
        return tuple(lines) if isinstance(lines, list) else lines

    @model_validator(mode="after")
    def _whole(self) -> PrintedFile:
        if self.page is None and self.section is None:
            raise ValueError("missing page or section: say where in the paper the numbers stand")
        if bool(self.cell) == bool(self.row or self.column):
            raise ValueError("expected either [[column]] and [[row]] (a table) or [[cell]]")
        for name, lines in (("column", self.column), ("row", self.row), ("cell", self.cell)):
            _no_duplicates(name, lines)
        for row in self.row:
            if len(row.cells) != len(self.column):
                raise ValueError(
                    f"row {row.id!r}: expected {len(self.column)} cells, one per column, "
                    f"got {len(row.cells)}"
                )
        return self


def _no_duplicates(name: str, lines: tuple[Line, ...]) -> None:
    seen: set[str] = set()
    for line in lines:
        if line.id in seen:
            raise ValueError(f"duplicate {name} {line.id!r}: each id may stand once")
        seen.add(line.id)


def parse(content: dict[str, Any], source: str) -> PrintedFile:
    """Check the content of one file of printed numbers.

    Examples
    --------
    >>> parse({"title": "t", "place": "Text", "section": "1", "cell": [
    ...     {"id": "a", "label": "A", "value": "1.0", "unit": "mm", "role": "setting"}]}, "x").title
    't'
    """
    try:
        return PrintedFile.model_validate(content)
    except ValidationError as error:
        faults = [f"{source}: {_fault(content, fault)}" for fault in error.errors()]
        raise PrintedFileError("\n".join(faults)) from error


def _fault(content: dict[str, Any], fault: Any) -> str:
    """Turn one of pydantic's faults into a line that names the row or cell by its id."""
    words: list[str] = []
    here: Any = content
    for step in fault["loc"]:
        here = (
            here[step]
            if isinstance(step, int) and isinstance(here, list | tuple)
            else (here.get(step) if isinstance(here, dict) else None)
        )
        if isinstance(step, int):
            words[-1:] = [f"{words[-1] if words else 'item'} {_name(here, step)}"]
        else:
            words.append(str(step))
    message = str(fault["msg"]).removeprefix("Value error, ")
    if fault["type"] == "extra_forbidden":
        message = "unknown key; check the spelling against data/README.md"
    elif fault["type"] == "literal_error":
        message = (
            f"unknown {fault['loc'][-1]} {fault['input']!r}: {message[0].lower()}{message[1:]}"
        )
    elif fault["type"] == "string_type":
        message = f"unquoted or missing text: got {fault['input']!r}; write it in quotes"
    return f"{', '.join(words)}: {message}" if words else message


def _name(line: Any, position: int) -> str:
    if isinstance(line, dict) and isinstance(line.get("id"), str):
        return repr(line["id"])
    return str(position + 1)
