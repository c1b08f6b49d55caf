"""The units that occur in print, and their conversion to SI."""

from __future__ import annotations

from math import pi

from reproduce.units import RADIANS_PER_ARCSEC

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
# Units of one kind, which a reader may give for each other, and a pen confuse. To a computer an
# angle is a pure number, but to neither of these.
ALIKE = (("nm", "um", "mm", "m", "km"), ("deg", "arcsec"), ("ms", "s", "min"))


def si_factor(unit: str) -> float:
    """Return the SI value of one `unit`; pixels stay pixels.

    Metres, radians, seconds, hertz per unit; 1 for pixels and pure numbers.

    Examples
    --------
    >>> si_factor("mm")
    0.001
    """
    if unit not in UNITS:
        raise ValueError(f"unit {unit!r}: expected one of {', '.join(UNITS)}; check the spelling")
    return UNITS[unit][1]


def symbol(unit: str) -> str:
    """Return how a page shows `unit`.

    Examples
    --------
    >>> symbol("arcsec")
    '″'
    """
    return UNITS[unit][0]
