"""Which values print as a number does, under each rounding rule.

What a print means is said in `reproduce.printed.number`. Here a plain number may also have been
rounded by other rules: half up and half to even differ on a tie alone, so both give the closed
interval of half a unit of the last digit to either side; truncation (towards zero) and ceiling
(upwards) give one unit to one side.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from decimal import ROUND_CEILING, ROUND_DOWN, ROUND_HALF_EVEN, ROUND_HALF_UP, Decimal
from typing import Literal

from reproduce.printed.cells import Cell
from reproduce.printed.number import Interval, PrintedNumber
from reproduce.printed.units import si_factor

RoundingRule = Literal["nearest", "truncation", "ceiling"]
ROUNDINGS = {
    "half-up": ROUND_HALF_UP,
    "half-even": ROUND_HALF_EVEN,
    "truncation": ROUND_DOWN,
    "ceiling": ROUND_CEILING,
}
# Binary arithmetic on decimal inputs leaves noise in the sixteenth digit; a tie is looked for
# in the twelfth.
_DIGITS = 12
# Address to printed number.
Sheet = Mapping[str, Cell]


def printed_cell(address: str, text: str, unit: str = "1", qualifier: str | None = None) -> Cell:
    """Make a cell from what stands on paper.

    Examples
    --------
    >>> allowed(printed_cell("t#1.a", "0.50", "mm"))
    (0.000495, 0.000505)
    """
    si_factor(unit)
    key, _, name = address.partition("#")
    number = PrintedNumber(text, unit == "count", qualifier)
    return Cell(key, name, name, number, unit, "derived", key)


def sheet(cells: Iterable[Cell]) -> dict[str, Cell]:
    """Return the numbers among printed cells by address."""
    return {cell.address: cell for cell in cells if cell.is_number}


def reprinted(cell: Cell, text: str) -> Cell:
    """Return the same cell with other digits."""
    return replace(cell, content=replace(cell.number, text=text))


def last_digit(cell: Cell) -> float:
    """Return one unit of the last printed digit, in SI units; one for a count."""
    return 10.0**cell.number.exponent * si_factor(cell.unit)


def allowed(cell: Cell, rule: RoundingRule = "nearest") -> Interval:
    """Return the closed interval of the values that print so, in SI units."""
    return cell.allowed if rule == "nearest" else _allowed(cell.number, cell.unit, rule)


@functools.lru_cache(maxsize=200_000)
def _allowed(number: PrintedNumber, unit: str, rule: RoundingRule) -> Interval:
    value, step, factor = number.value, 2 * number.half_unit, si_factor(unit)
    if number.qualifier or not step:
        low, high = number.low, number.high
    elif rule == "ceiling":
        low, high = value - step, value
    else:
        low = value - step if value <= 0 else value
        high = value + step if value >= 0 else value
    return low * factor, high * factor


def rules_that_print(value: float, number: PrintedNumber) -> frozenset[str]:
    """Return the rounding rules that turn a computed value into the printed digits.

    Examples
    --------
    >>> sorted(rules_that_print(44.691, PrintedNumber("44.6")))
    ['truncation']
    >>> sorted(rules_that_print(0.25, PrintedNumber("0.3")))
    ['ceiling', 'half-up']
    """
    if not math.isfinite(value):
        return frozenset()
    if value != 0:
        value = float(f"{value:.{_DIGITS}g}")
    last = Decimal(1).scaleb(number.exponent)
    printed, exact = Decimal(number.text), Decimal(repr(value))
    if number.exact:
        return frozenset(ROUNDINGS) if exact == printed else frozenset()
    return frozenset(n for n, r in ROUNDINGS.items() if exact.quantize(last, rounding=r) == printed)
