"""A printed number: its digits, and the interval of values that round to them.

The intervals are defined only here, for the ledger and the audit:

* a number without a qualifier was rounded to its last digit: half a unit of the last digit to
  either side;
* ``about`` does not determine the rounding. If the last digit counts, the number was rounded up or
  down: one unit to either side. Zeros at its end may also complete a format ("about 0.060" is 0.06,
  "about 90 s" has one digit): half a unit of the last nonzero digit. The wider interval applies;
* ``nominal`` is a design value. Instruments agree with their design within a few per cent: the
  fraction `NOMINAL_FRACTION` of the value to either side, for any number of digits;
* a limit (``less``, ``greater``, ``at-least``, ``within``) is the limit itself as an input, and
  agrees with all values on its side;
* a count is exact.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Any

# Decimal inputs have an error of a few units of the last binary digit. With this relative tolerance
# a computed value at the end of an interval agrees on every processor.
_FLOAT_TOLERANCE = 1e-9
# Larger values are written with an exponent.
_MAX_PLAIN = 1e20
_DIGITS = re.compile(r"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?")
# A number with an exponent in a text.
_EXPONENT = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)[eE]([−+-]?)0*(\d+)(?!\w|\.\d)")
# Digits and minus signs of an exponent.
_SUPERSCRIPTS = str.maketrans("−-0123456789", "⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# A hyphen that is the sign of a number or of its exponent, not part of a word or a range.
_HYPHEN = re.compile(r"(?<![\w.)])-(?=\.?\d|inf)|(?<=\d[eE])-(?=\d)")

Interval = tuple[float, float]
_LIMITS = ("less", "greater", "at-least", "within")
# Distance of an instrument from its design value, as a fraction of the value.
NOMINAL_FRACTION = 0.05


@dataclass(frozen=True)
class PrintedNumber:
    """A number with its last digit, as printed.

    Parameters
    ----------
    text : str
        Printed digits with trailing zeros: ``"25.0000"``, ``"5.7e-5"``.
    exact : bool
        Whether the number is a count, which is not rounded.
    qualifier : str, optional
        ``about``, ``nominal``, or a limit: ``less``, ``greater``, ``at-least``, ``within`` (of
        zero).

    Examples
    --------
    >>> number = PrintedNumber("0.50")
    >>> number.value, number.half_unit
    (0.5, 0.005)
    """

    text: str
    exact: bool = False
    qualifier: str = ""

    def __post_init__(self) -> None:
        """Raise ValueError for text that is not a number."""
        if not _DIGITS.fullmatch(self.text):
            raise ValueError(
                f"text: expected the digits of a number, got {self.text!r}. Write words and "
                "dashes as text = ..."
            )

    @cached_property
    def value(self) -> float:
        """The number, in the printed unit."""
        return float(Decimal(self.text))

    @cached_property
    def exponent(self) -> int:
        """The power of ten of the last printed digit."""
        return int(Decimal(self.text).as_tuple().exponent)

    @cached_property
    def half_unit(self) -> float:
        """Half a unit of the last printed digit; zero for a count."""
        return 0.0 if self.exact else float(Decimal(5).scaleb(self.exponent - 1))

    @cached_property
    def half_width(self) -> float:
        """Half the width of the interval around the number; zero for a limit."""
        if self.is_bound or self.exact:
            return 0.0
        if self.qualifier == "nominal":
            return NOMINAL_FRACTION * abs(self.value)
        if self.qualifier == "about":
            nonzero = Decimal(self.text).normalize().as_tuple().exponent
            last = int(nonzero) if self.value else self.exponent
            return max(2 * self.half_unit, float(Decimal(5).scaleb(last - 1)))
        return self.half_unit

    @property
    def is_bound(self) -> bool:
        """Whether the number is a limit and not a value."""
        return self.qualifier in _LIMITS

    def interval(self) -> Interval:
        """Return the closed interval of values that agree with the printed number.

        A limit has an infinite interval; ``within`` is an interval around zero. The limit itself
        is not widened by half its last digit.

        Examples
        --------
        >>> PrintedNumber("0.1", qualifier="within").interval()
        (-0.1, 0.1)
        >>> PrintedNumber("2000", qualifier="nominal").interval()
        (1900.0, 2100.0)
        """
        value = self.value
        match self.qualifier:
            case "less":
                return -inf, value
            case "greater" | "at-least":
                return value, inf
            case "within":
                return -abs(value), abs(value)
        return value - self.half_width, value + self.half_width

    def overlaps(self, low: float, high: float) -> bool:
        """Return whether the interval from `low` to `high` overlaps the printed interval.

        Examples
        --------
        >>> PrintedNumber("0.9976").overlaps(0.99764, 0.99764)
        True
        """
        start, end = self.interval()
        size = max(self.half_width, abs(self.value) * 1e-3, 1e-12)
        tolerance = _FLOAT_TOLERANCE * size
        return low <= end + tolerance and high >= start - tolerance

    def rounds(self, value: float) -> bool:
        """Return whether `value` rounds to the printed digits, without the word *about*.

        Examples
        --------
        >>> PrintedNumber("44.6", qualifier="about").rounds(44.69)
        False
        """
        return replace(self, qualifier="").overlaps(value, value)

    def format(self, value: float, extra: int = 1) -> str:
        """Return `value` with `extra` decimals more than the printed number.

        A whole value of a count has no decimals.

        Examples
        --------
        >>> PrintedNumber("5.7e-5").format(5.68e-5)
        '5.68e-5'
        >>> PrintedNumber("8", exact=True).format(12)
        '12'
        """
        _, mark, power = self.text.lower().partition("e")
        shift = int(power or 0)
        if self.exact and float(value).is_integer():
            extra = 0
        if abs(value) >= _MAX_PLAIN * 10.0**shift:
            return f"{value:.6g}"
        scaled = Decimal(value).scaleb(-shift)
        decimals = max(0, shift - self.exponent) + extra
        return f"{scaled:z.{decimals}f}" + (f"e{shift}" if mark else "")


# Unit in the data files to its symbol on a page, its SI value and its kind.
UNITS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("units.toml").read_text(encoding="utf-8")
)


def si_factor(unit: str) -> float:
    """Return the SI value of one `unit`; pixels stay pixels.

    Metres, radians, seconds, hertz per unit; 1 for pixels and pure numbers.

    Examples
    --------
    >>> si_factor("mm")
    0.001
    """
    return float(UNITS[unit]["si"])


def quantity(value: str, mark: str) -> str:
    """Return a number with the symbol of its unit; nothing without a number.

    Examples
    --------
    >>> quantity("0.04", "px"), quantity("2", "″")
    ('0.04\u202fpx', '2″')
    """
    gap = "" if mark in {"", "°", "″"} else "\u202f"
    return f"{value}{gap}{mark}" if value else ""


def symbol(unit: str) -> str:
    """Return the symbol of a unit on a page.

    Examples
    --------
    >>> symbol("arcsec")
    '″'
    """
    return str(UNITS[unit]["symbol"])


def minus(text: str) -> str:
    """Return a text whose numbers have a true minus sign.

    Examples
    --------
    >>> minus("from -0.3 to -.1 (-2e-11) in II-B, fig-4 and 2-1")
    'from −0.3 to −.1 (−2e−11) in II-B, fig-4 and 2-1'
    """
    return _HYPHEN.sub("−", text)


def powers(text: str) -> str:
    """Return a text whose exponents are powers of ten.

    Examples
    --------
    >>> powers("from 1e−6 to −5.7e+12 px, not 2e-05.")
    'from 10⁻⁶ to −5.7\u202f×\u202f10¹² px, not 2\u202f×\u202f10⁻⁵.'
    """

    def power(match: re.Match[str]) -> str:
        digits, sign, size = match.groups()
        raised = f"10{f'{sign}{size}'.lstrip('+').translate(_SUPERSCRIPTS)}"
        return raised if digits == "1" else f"{digits}\u202f×\u202f{raised}"

    return _EXPONENT.sub(power, text)
