"""A printed number as the audit sees it, and the values that print so under each rounding rule.

What a print means is said in `reproduce.printed.number`. Here a plain number may also have been
rounded by other rules: half up and half to even differ on a tie alone, so both give the closed
interval of half a unit of the last digit to either side; truncation (towards zero) and ceiling
(upwards) give one unit to one side.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_DOWN, ROUND_HALF_EVEN, ROUND_HALF_UP, Decimal
from typing import Literal

from reproduce.printed.cells import Cell
from reproduce.printed.number import PrintedNumber
from reproduce.printed.units import si_factor

Rule = Literal["nearest", "truncation", "ceiling"]
ROUNDINGS = {
    "half-up": ROUND_HALF_UP,
    "half-even": ROUND_HALF_EVEN,
    "truncation": ROUND_DOWN,
    "ceiling": ROUND_CEILING,
}
# Binary arithmetic on decimal inputs leaves noise in the sixteenth digit; a tie is looked for
# in the twelfth.
_DIGITS = 12
Interval = tuple[float, float]


@dataclass(frozen=True)
class Quantity:
    """One printed number with its address and unit.

    Parameters
    ----------
    address : str
        Its only name; in a table ``KEY#row.column``.
    number : PrintedNumber
        The digits, with their qualifier.
    unit : str
        The unit of print.
    """

    address: str
    number: PrintedNumber
    unit: str

    @functools.cached_property
    def nearest(self) -> Interval:
        """The values that print so when they are rounded to nearest, in SI units."""
        return _in_si(self, "nearest")

    @property
    def si(self) -> float:
        """The printed number in SI units (pixels stay pixels)."""
        return self.number.value * si_factor(self.unit)

    @property
    def last_digit(self) -> float:
        """One unit of the last printed digit, in SI units; one for a count."""
        return 10.0**self.number.exponent * si_factor(self.unit)

    @property
    def key(self) -> str:
        """The table or group."""
        return self.address.partition("#")[0]

    @property
    def row(self) -> str:
        """The row of the table; empty in a group."""
        return self.address.partition("#")[2].rpartition(".")[0]

    @property
    def column(self) -> str:
        """The column of the table, or the name in a group."""
        return self.address.partition("#")[2].rpartition(".")[2]

    def printing(self, text: str) -> Quantity:
        """Return the same quantity with other digits."""
        number = PrintedNumber(text, self.number.exact, self.number.qualifier)
        return Quantity(self.address, number, self.unit)


Sheet = Mapping[str, Quantity]


def quantity(address: str, text: str, unit: str = "1", qualifier: str | None = None) -> Quantity:
    """Make a quantity from what stands on paper.

    Examples
    --------
    >>> allowed(quantity("t#1.a", "0.50", "mm"))
    (0.000495, 0.000505)
    """
    si_factor(unit)
    return Quantity(address, PrintedNumber(text, unit == "count", qualifier), unit)


def sheet(cells: Iterable[Cell]) -> dict[str, Quantity]:
    """Return the numbers among printed cells by address.

    Address to quantity.
    """
    return {c.address: Quantity(c.address, c.number, c.unit) for c in cells if c.is_number}


@functools.lru_cache(maxsize=200_000)
def _printed(number: PrintedNumber, rule: Rule) -> Interval:
    value, step = number.value, 2 * number.half_unit
    if number.qualifier or not step or rule == "nearest":
        return number.low, number.high
    if rule == "ceiling":
        return value - step, value
    return (value - step if value <= 0 else value), (value + step if value >= 0 else value)


def allowed(printed: Quantity, rule: Rule = "nearest") -> Interval:
    """Return the values that print so.

    A closed interval, in SI units.
    """
    return printed.nearest if rule == "nearest" else _in_si(printed, rule)


def _in_si(printed: Quantity, rule: Rule) -> Interval:
    factor = si_factor(printed.unit)
    low, high = _printed(printed.number, rule)
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
