"""A printed number: its digits, and the interval of values that round to them.

The intervals are defined only here, for the ledger and the audit:

* a number without a qualifier was rounded to its last digit: half a unit of it to either side;
* ``about`` leaves open how it was rounded. Either its last digit counts, and it was rounded up or
  down: one unit to either side. Or zeros at its end fill up a format ("about 0.060" is 0.06,
  "about 90 s" is nine tens): half a unit of the last digit that is not zero. The wider one holds;
* ``nominal`` is a design value. An instrument keeps its own to a few per cent, so it stands for
  `_NOMINAL` of itself to either side, however many digits it has;
* a limit (``less``, ``greater``, ``at-least``, ``within``) is the limit itself where it is used,
  and agrees with all that lies on its side;
* a count is exact."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Decimal
from functools import cached_property
from math import pi

from reproduce.units import RADIANS_PER_ARCSEC

# Sums and products of decimal inputs leave a few units of the last binary place; without this
# slack a computed value that lies exactly on a rounding tie would fall on a random side of it.
_FLOAT_SLACK = 1e-9
# More digits than these, and a decimal of the usual precision cannot be rounded.
_MAX_DIGITS = 25
_DIGITS = re.compile(r"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?")

Interval = tuple[float, float]
_BOUNDS = ("less", "greater", "at-least", "within")
# How far an instrument may lie from its design value, as a fraction of the value.
_NOMINAL = 0.05


@dataclass(frozen=True)
class PrintedNumber:
    """A number with its last digit, as printed.

    Parameters
    ----------
    text : str
        The digits as printed, trailing zeros kept: ``"25.0000"``, ``"5.7e-5"``.
    exact : bool
        True for a count: nothing was rounded, the interval is a point.
    qualifier : str, optional
        ``about``, ``nominal``, or a bound: ``less``, ``greater``, ``at-least``, ``within`` (of
        zero).

    Examples
    --------
    >>> number = PrintedNumber("0.50")
    >>> number.value, number.half_unit
    (0.5, 0.005)
    """

    text: str
    exact: bool = False
    qualifier: str | None = None

    def __post_init__(self) -> None:
        """Refuse text that is not a number."""
        if not _DIGITS.fullmatch(self.text):
            raise ValueError(
                f"expected the digits of a number, got {self.text!r}; "
                "write words and dashes as text = ..."
            )

    @cached_property
    def value(self) -> float:
        """The number, in the printed unit."""
        return float(Decimal(self.text))

    @cached_property
    def exponent(self) -> int:
        """The power of ten of the last printed digit."""
        exponent = Decimal(self.text).as_tuple().exponent
        return exponent if isinstance(exponent, int) else 0

    @cached_property
    def half_unit(self) -> float:
        """Half a unit of the last printed digit; zero for a count."""
        return 0.0 if self.exact else float(Decimal(5).scaleb(self.exponent - 1))

    @cached_property
    def half_width(self) -> float:
        """How far a value may lie from the number and still be meant by it; zero for a limit."""
        if self.is_bound or self.exact:
            return 0.0
        if self.qualifier == "nominal":
            return _NOMINAL * abs(self.value)
        if self.qualifier == "about":
            filled = Decimal(self.text).normalize().as_tuple().exponent
            least = filled if isinstance(filled, int) and self.value else self.exponent
            return max(2 * self.half_unit, float(Decimal(5).scaleb(least - 1)))
        return self.half_unit

    @property
    def is_bound(self) -> bool:
        """Whether the number is a limit and not a value."""
        return self.qualifier in _BOUNDS

    def interval(self) -> tuple[float, float]:
        """Return the closed interval of values that agree with the printed number.

        Lower and upper end. A bound reaches to infinity; ``within`` lies around zero. The limit
        itself is taken as stated, not widened by half its last digit.

        Examples
        --------
        >>> PrintedNumber("0.1", qualifier="within").interval()
        (-0.1, 0.1)
        >>> PrintedNumber("2000", qualifier="nominal").interval()
        (1900.0, 2100.0)
        """
        if self.qualifier == "less":
            return float("-inf"), self.value
        if self.qualifier in {"greater", "at-least"}:
            return self.value, float("inf")
        if self.qualifier == "within":
            return -abs(self.value), abs(self.value)
        return self.value - self.half_width, self.value + self.half_width

    def overlaps(self, low: float, high: float) -> bool:
        """Tell whether the interval from `low` to `high` shares a point with the printed one.

        Examples
        --------
        >>> PrintedNumber("0.9976").overlaps(0.99764, 0.99764)
        True
        """
        ours, theirs = self.interval()
        slack = _FLOAT_SLACK * max(self.half_width, abs(self.value) * 1e-3, 1e-12)
        return low <= theirs + slack and high >= ours - slack

    def format(self, value: float, extra: int = 0) -> str:
        """Return `value` with the printed number of decimals, plus `extra`.

        A count stays whole as long as its value is.

        Examples
        --------
        >>> PrintedNumber("5.7e-5").format(5.68e-5)
        '5.7e-5'
        >>> PrintedNumber("8", exact=True).format(12, extra=1)
        '12'
        """
        places = self.exponent
        if not (self.exact and float(value).is_integer()):
            places -= extra
        if abs(value) >= 10.0 ** (_MAX_DIGITS + min(places, 0)):
            return f"{value:.6g}"
        _, exponent_mark, power = self.text.lower().partition("e")
        if not exponent_mark:
            places = min(places, 0)
        rounded = Decimal(value).quantize(
            Decimal(1).scaleb(places), rounding=ROUND_HALF_EVEN
        )
        rounded = rounded or abs(rounded)  # no "-0.00"
        if exponent_mark:
            return f"{rounded.scaleb(-int(power)):f}e{int(power)}"
        return f"{rounded:f}"


# Unit as written in the data files -> (how a page shows it, its SI value). A count is exact; "1" is
# a pure number that was rounded when printed; pixels stay pixels. A test holds them against pint.
UNITS: dict[str, tuple[str, float]] = {
    "1": ("", 1.0),
    "count": ("", 1.0),
    "percent": ("%", 0.01),
    "px": ("px", 1.0),
    "nm": ("nm", 1e-9),
    "um": ("µm", 1e-6),
    "mm": ("mm", 1e-3),
    "m": ("m", 1.0),
    "km": ("km", 1e3),
    "mm^-2": ("mm⁻²", 1e6),
    "deg": ("°", pi / 180),
    "arcsec": ("″", RADIANS_PER_ARCSEC),
    "ms": ("ms", 1e-3),
    "s": ("s", 1.0),
    "min": ("min", 60.0),
    "Hz": ("Hz", 1.0),
    "1/K": ("K⁻¹", 1.0),
    # A magnitude is a logarithm; nothing here computes with it, so it is carried as a bare number.
    "mag": ("mag", 1.0),
}
# Units of one kind, which a user may give for each other. An angle is no pure number here.
ALIKE = (
    ("nm", "um", "mm", "m", "km"),
    ("deg", "arcsec"),
    ("ms", "s", "min"),
    ("1", "percent"),
)


def si_factor(unit: str) -> float:
    """Return the SI value of one `unit`; pixels stay pixels.

    Metres, radians, seconds, hertz per unit; 1 for pixels and pure numbers.

    Examples
    --------
    >>> si_factor("mm")
    0.001
    """
    if unit not in UNITS:
        raise ValueError(
            f"unit {unit!r}: expected one of {', '.join(UNITS)}; check the spelling"
        )
    return UNITS[unit][1]


def symbol(unit: str) -> str:
    """Return how a page shows `unit`.

    Examples
    --------
    >>> symbol("arcsec")
    '″'
    """
    return UNITS[unit][0]
