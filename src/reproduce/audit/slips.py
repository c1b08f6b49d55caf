"""Slips of the pen: what one small mistake can turn a printed number, row or column into."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from reproduce.audit.quantity import Interval, Quantity, Sheet, allowed
from reproduce.printed.units import UNITS

Kind = Literal["digit", "swap", "drop", "extra", "sign", "unit", "cells", "rows", "columns"]

# How large a slip is, in slips of one digit. Only the order matters: a mistake in one character
# is smaller than one that moves a cell, and that is smaller than one that moves a whole line.
COSTS: Mapping[Kind, float] = {
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


@dataclass(frozen=True)
class Slip:
    """One supposed mistake, and what the cells should have been.

    Parameters
    ----------
    kind : str
        What sort of slip.
    told : str
        In words.
    changes : tuple of (str, Quantity)
        Address and corrected number of every cell that it touches.
    """

    kind: Kind
    told: str
    changes: tuple[tuple[str, Quantity], ...]

    @property
    def cost(self) -> float:
        """How large a slip it is."""
        return COSTS[self.kind]

    @functools.cached_property
    def addresses(self) -> frozenset[str]:
        """The cells that it touches."""
        return frozenset(address for address, _ in self.changes)

    def undone(self, cells: Sheet) -> dict[str, Quantity]:
        """Return the sheet with the slip corrected."""
        return {**cells, **dict(self.changes)}


def of_digits(text: str) -> Iterator[tuple[Kind, str]]:
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


def of_cell(printed: Quantity) -> Iterator[Slip]:
    """Yield all slips in one cell: in its digits and in its unit."""
    seen = {printed.number.text}
    for kind, text in of_digits(printed.number.text):
        if text in seen or not readable(text):
            continue
        seen.add(text)
        told = f"{printed.address}: {printed.number.text} → {text}"
        yield Slip(kind, told, ((printed.address, printed.printing(text)),))
    for unit in _units_like(printed.unit):
        told = f"{printed.address}: {printed.unit} → {unit}"
        yield Slip("unit", told, ((printed.address, replace(printed, unit=unit)),))


def readable(text: str) -> bool:
    """Tell whether a number could be printed so: it starts with a digit, without idle zeros."""
    body = text.removeprefix("-").partition("e")[0]
    return body[:1].isdigit() and not (len(body) > 1 and body[0] == "0" and body[1] != ".")


@functools.cache
def _units_like(unit: str) -> tuple[str, ...]:
    import pint

    registry = pint.application_registry

    def dimension(name: str) -> object:
        return registry.Quantity(1.0, UNITS[name][0]).dimensionality

    angles = {"deg", "arcsec"}  # to pint an angle is a pure number, but no pen confuses the two
    if unit in angles:
        return tuple(angles - {unit})
    if unit in {"1", "count", "mag", "px", "percent"}:
        return ()
    return tuple(u for u in UNITS if u != unit and dimension(u) == dimension(unit))


def reaching(printed: Quantity, wanted: Iterable[Interval]) -> Iterator[Slip]:
    """Yield the slips in a cell whose correction can reach one of the wanted intervals."""
    goals = list(wanted)
    for slip, (low, high) in _with_intervals(printed):
        if any(low <= end and high >= start for start, end in goals):
            yield slip


@functools.lru_cache(maxsize=5_000)
def _with_intervals(printed: Quantity) -> tuple[tuple[Slip, Interval], ...]:
    """Keep the slips of a cell: a search asks for the same ones again and again."""
    return tuple((slip, allowed(slip.changes[0][1])) for slip in of_cell(printed))


@dataclass(frozen=True)
class Line:
    """Two cells, rows or columns of one table that could be interchanged.

    Parameters
    ----------
    kind : str
        ``cells``, ``rows`` or ``columns``.
    told : str
        In words.
    pairs : tuple of (str, str)
        Addresses of the cells that would change places.
    """

    kind: Kind
    told: str
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
        changes = _interchanged(pairs)
        if len(changes) <= (0 if self.kind == "cells" else 2):
            return None
        return Slip(self.kind, self.told, changes)


def lines(cells: Sheet, keys: Iterable[str]) -> list[Line]:
    """Return what could be interchanged in some tables.

    Two cells within their row, column or group; two rows or two columns of a table.
    """
    found: list[Line] = []
    for key in keys:
        table = {a: q for a, q in cells.items() if q.key == key}
        found += [*_two_cells(table), *_two_lines(table, "columns"), *_two_lines(table, "rows")]
    return found


def _two_cells(table: Sheet) -> Iterator[Line]:
    for one, two in itertools.combinations(table.values(), 2):
        if (one.row and one.row == two.row) or one.column == two.column or not one.row:
            yield Line("cells", f"{one.address} ↔ {two.address}", ((one.address, two.address),))


def _two_lines(table: Sheet, kind: Kind) -> Iterator[Line]:
    found: dict[str, dict[str, str]] = {}
    for q in table.values():
        if q.row:
            line, along = (q.column, q.row) if kind == "columns" else (q.row, q.column)
            found.setdefault(line, {})[along] = q.address
    for (name, one), (other, two) in itertools.combinations(found.items(), 2):
        pairs = tuple((one[at], two[at]) for at in one if at in two)
        if len(pairs) > 1:
            key = pairs[0][0].partition("#")[0]
            yield Line(kind, f"{key}: {kind} {name} ↔ {other}", pairs)


def _interchanged(
    pairs: Iterable[tuple[Quantity, Quantity]],
) -> tuple[tuple[str, Quantity], ...]:
    changes: list[tuple[str, Quantity]] = []
    for one, two in pairs:
        if one.number != two.number:
            changes += [
                (one.address, replace(one, number=two.number)),
                (two.address, replace(two, number=one.number)),
            ]
    return tuple(changes)
