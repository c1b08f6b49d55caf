"""The units that occur in print, and their conversion to SI."""

from __future__ import annotations

from math import pi

from reproduce.units import RADIANS_PER_ARCSEC

# Unit as written in the data files -> (its name in pint, how a page shows it, its SI value).
# A count is exact; "1" is a pure number that was rounded when printed; pixels stay pixels. A test
# holds the values against pint, whose import costs more than everything else in the package.
UNITS: dict[str, tuple[str, str, float]] = {
    "1": ("dimensionless", "", 1.0),
    "count": ("dimensionless", "", 1.0),
    "percent": ("percent", "%", 0.01),
    "px": ("pixel", "px", 1.0),
    "nm": ("nanometer", "nm", 1e-9),
    "um": ("micrometer", "µm", 1e-6),
    "mm": ("millimeter", "mm", 1e-3),
    "m": ("meter", "m", 1.0),
    "km": ("kilometer", "km", 1e3),
    "mm^-2": ("millimeter**-2", "mm⁻²", 1e6),
    "deg": ("degree", "°", pi / 180),
    "arcsec": ("arcsecond", "″", RADIANS_PER_ARCSEC),
    "ms": ("millisecond", "ms", 1e-3),
    "s": ("second", "s", 1.0),
    "min": ("minute", "min", 60.0),
    "Hz": ("hertz", "Hz", 1.0),
    "1/K": ("kelvin**-1", "K⁻¹", 1.0),
    # A magnitude is a logarithm; nothing here computes with it, so it is carried as a bare number.
    "mag": ("dimensionless", "mag", 1.0),
}


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
    return UNITS[unit][2]


def symbol(unit: str) -> str:
    """Return how a page shows `unit`.

    Examples
    --------
    >>> symbol("arcsec")
    '″'
    """
    return UNITS[unit][1]
