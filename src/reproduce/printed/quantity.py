"""Values of a user for a printed number."""

from __future__ import annotations

import math
import re

from reproduce.printed.cells import PrintedCell
from reproduce.printed.number import UNITS, si_factor

_VALUE = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(.*?)\s*", re.IGNORECASE
)
# Largest count as a multiple of the printed count, because of the memory.
_MAX_COUNT_RATIO = 20


def si_value(cell: PrintedCell, value: str | float) -> float:
    """Return a value in SI units from text in the printed format, such as ``"0.2 px"``.

    Raises
    ------
    ValueError
        If the text is not a finite number, its unit is not of the kind of the printed unit, or a
        count is not whole or too large.
    """
    kind = UNITS[cell.unit]["kind"]
    units = {
        name: unit
        for unit, known in UNITS.items()
        for name in (unit, known["symbol"])
        if name and known["kind"] == kind
    }
    if not isinstance(value, str) or cell.unit in {"1", "count"}:
        units[""] = cell.unit
    # A true minus sign, and the Greek letter in place of the micro sign.
    matched = _VALUE.fullmatch(str(value).replace("−", "-").replace("μ", "µ"))
    number, unit = (float(matched[1]), matched[2]) if matched else (math.nan, "")
    limit, expected = _MAX_COUNT_RATIO * cell.number.value, ""
    if not math.isfinite(number):
        expected = f"a finite number in the printed format ({cell.shown})"
    elif unit not in units:
        expected = f"{cell.symbol or 'no unit'} as printed ({cell.shown})"
    elif cell.unit == "count" and not (number.is_integer() and 0 <= number <= limit):
        expected = f"a whole number up to {limit:.0f}"
    if expected:
        raise ValueError(f"{cell.address}: expected {expected}, got {value!r}")
    return number * si_factor(units[unit])
