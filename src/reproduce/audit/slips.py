"""Slips of the pen: what one small mistake can turn a printed number, row or column into."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from reproduce.audit.rounding import Sheet, reprinted
from reproduce.printed.cells import Cell

SlipKind = Literal["digit", "swap", "drop", "extra", "sign", "unit", "cells", "rows", "columns"]

# How large a slip is, in slips of one digit. Only the order matters: a mistake in one character
# is smaller than one that moves a cell, and that is smaller than one that moves a whole line.
COSTS: Mapping[SlipKind, float] = {
    "digit": 1.0,
    "swap": 1.0,
    "sign": 1.0,
    "drop": 1.25,
    "extra": 1.25,
    "unit": 1.5,
    "cells": 1.5,
    "rows": 2.0,
    "columns": 2.0,
}

# Units that a pen confuses. To a computer an angle is a pure number, but not to a pen.
_ALIKE = (("nm", "um", "mm", "m", "km"), ("deg", "arcsec"), ("ms", "s", "min"))


@dataclass(frozen=True)
class Slip:
    """One supposed mistake in words, and the cells as they should have been, by address."""

    kind: SlipKind
    label: str
    changes: tuple[tuple[str, Cell], ...]

    @property
    def cost(self) -> float:
        """How large a slip it is."""
        return COSTS[self.kind]

    @functools.cached_property
    def addresses(self) -> frozenset[str]:
        """The cells that it touches."""
        return frozenset(address for address, _ in self.changes)

    def undone(self, cells: Sheet) -> dict[str, Cell]:
        """Return the sheet with the slip corrected."""
        return {**cells, **dict(self.changes)}


def of_digits(text: str) -> Iterator[tuple[SlipKind, str]]:
    """Yield what the digits may have been before a slip.

    Examples
    --------
    >>> sorted(set(before for kind, before in of_digits("1.2") if kind in {"swap", "sign"}))
    ['-1.2', '2.1']
    """
    mantissa, mark, power = text.partition("e")
    sign = "-" if mantissa.startswith("-") else ""
    body = mantissa.removeprefix("-")
    tail = mark + power
    places = [i for i, character in enumerate(body) if character.isdigit()]
    for i in places:
        for digit in "0123456789":
            if digit != body[i]:
                yield "digit", f"{sign}{body[:i]}{digit}{body[i + 1 :]}{tail}"
    for i, j in itertools.pairwise(places):
        if body[i] != body[j]:
            swapped = body[:i] + body[j] + body[i + 1 : j] + body[i] + body[j + 1 :]
            yield "swap", f"{sign}{swapped}{tail}"
    for i in range(len(body) + 1):
        for digit in "0123456789":
            yield "drop", f"{sign}{body[:i]}{digit}{body[i:]}{tail}"
    # Without its last decimal a number only gets vaguer, and that would "mend" anything.
    for i in places[:-1] if "." in body else places:
        if len(places) > 1:
            yield "extra", f"{sign}{body[:i]}{body[i + 1 :]}{tail}"
    if any(character in "123456789" for character in body):
        yield "sign", ("" if sign else "-") + body + tail


def of_cell(cell: Cell) -> Iterator[Slip]:
    """Yield all slips in one cell: in its digits and in its unit."""
    address, printed = cell.address, cell.number.text
    seen = {printed}
    for kind, text in of_digits(printed):
        if text not in seen and readable(text):
            seen.add(text)
            label = f"{address}: {printed} → {text}"
            yield Slip(kind, label, ((address, reprinted(cell, text)),))
    for unit in next((alike for alike in _ALIKE if cell.unit in alike), ()):
        if unit != cell.unit:
            label = f"{address}: {cell.unit} → {unit}"
            yield Slip("unit", label, ((address, replace(cell, unit=unit)),))


def readable(text: str) -> bool:
    """Tell whether a number could be printed so: it starts with a digit, without idle zeros."""
    body = text.removeprefix("-").partition("e")[0]
    return body[:1].isdigit() and not (len(body) > 1 and body[0] == "0" and body[1] != ".")


@dataclass(frozen=True)
class Interchange:
    """Two cells, rows or columns of one table that could change places, pair by pair."""

    kind: SlipKind
    label: str
    pairs: tuple[tuple[str, str], ...]

    @functools.cached_property
    def addresses(self) -> frozenset[str]:
        """All cells that would move."""
        return frozenset(itertools.chain.from_iterable(self.pairs))

    def slip(self, cells: Sheet) -> Slip | None:
        """Return the interchange, or None if it would change nothing or mix units.

        A row or column must change at least two pairs of cells; with one pair it is no more
        than an interchange of two cells.
        """
        pairs = [(cells[one], cells[two]) for one, two in self.pairs]
        if any(one.unit != two.unit for one, two in pairs):
            return None
        changes: list[tuple[str, Cell]] = []
        for one, two in pairs:
            if one.number != two.number:
                changes.append((one.address, replace(one, content=two.number)))
                changes.append((two.address, replace(two, content=one.number)))
        if len(changes) <= (0 if self.kind == "cells" else 2):
            return None
        return Slip(self.kind, self.label, tuple(changes))


def interchanges(cells: Sheet, keys: Iterable[str]) -> list[Interchange]:
    """Return what could be interchanged in some tables.

    Two cells within their row, column or group; two rows or two columns of a table.
    """
    found: list[Interchange] = []
    for key in keys:
        table = [cell for cell in cells.values() if cell.key == key]
        found += [*_two_cells(table), *_two_lines(table, "columns"), *_two_lines(table, "rows")]
    return found


def _place(cell: Cell) -> tuple[str, str]:
    """Return the row, empty in a group, and the column of a cell."""
    row, _, column = cell.name.rpartition(".")
    return row, column


def _two_cells(table: list[Cell]) -> Iterator[Interchange]:
    for one, two in itertools.combinations(table, 2):
        (row, column), (other_row, other_column) = _place(one), _place(two)
        if not row or row == other_row or column == other_column:
            label = f"{one.address} ↔ {two.address}"
            yield Interchange("cells", label, ((one.address, two.address),))


def _two_lines(table: list[Cell], kind: SlipKind) -> Iterator[Interchange]:
    lines: dict[str, dict[str, str]] = {}
    for cell in table:
        row, column = _place(cell)
        if row:
            line, along = (column, row) if kind == "columns" else (row, column)
            lines.setdefault(line, {})[along] = cell.address
    for (name, one), (other, two) in itertools.combinations(lines.items(), 2):
        pairs = tuple((one[at], two[at]) for at in one if at in two)
        if len(pairs) > 1:
            yield Interchange(kind, f"{table[0].key}: {kind} {name} ↔ {other}", pairs)
