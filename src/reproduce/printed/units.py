"""The units that occur in print, and their conversion to SI by pint."""

from __future__ import annotations

from functools import cache

# Unit as written in the data files -> (its name in pint, how a page shows it).
# A count is exact; "1" is a pure number that was rounded when printed.
UNITS: dict[str, tuple[str, str]] = {
    "1": ("dimensionless", ""),
    "count": ("dimensionless", ""),
    "percent": ("percent", "%"),
    "px": ("pixel", "px"),
    "nm": ("nanometer", "nm"),
    "um": ("micrometer", "µm"),
    "mm": ("millimeter", "mm"),
    "m": ("meter", "m"),
    "km": ("kilometer", "km"),
    "mm^-2": ("millimeter**-2", "mm⁻²"),
    "deg": ("degree", "°"),
    "arcsec": ("arcsecond", "″"),
    "ms": ("millisecond", "ms"),
    "s": ("second", "s"),
    "min": ("minute", "min"),
    "Hz": ("hertz", "Hz"),
    "1/K": ("kelvin**-1", "K⁻¹"),
    # A magnitude is a logarithm; nothing here computes with it, so it is carried as a bare number.
    "mag": ("dimensionless", "mag"),
}

_BASE = {"pixel": "pixel", "percent": "dimensionless"}


@cache
def si_factor(unit: str) -> float:
    """Return the SI value of one `unit`; pixels stay pixels.

    Parameters
    ----------
    unit : str
        A unit as written in the data files, such as ``"arcsec"``.

    Returns
    -------
    float
        Metres, radians, seconds, hertz per unit; 1 for pixels and pure numbers.

    Raises
    ------
    ValueError
        If the unit is not one of the known ones.

    Examples
    --------
    >>> si_factor("mm")
    0.001
    """
    if unit not in UNITS:
        raise ValueError(f"unit {unit!r}: expected one of {', '.join(UNITS)}; check the spelling")
    import pint  # here, because importing it costs more than everything else in the package

    name = UNITS[unit][0]
    quantity = pint.application_registry.Quantity(1.0, name)
    target = _BASE.get(name)
    converted = quantity.to(target) if target else quantity.to_base_units()
    return float(converted.magnitude)


def symbol(unit: str) -> str:
    """Return how a page shows `unit`.

    Parameters
    ----------
    unit : str
        A unit as written in the data files.

    Returns
    -------
    str
        Its symbol, empty for pure numbers and counts.

    Examples
    --------
    >>> symbol("arcsec")
    '″'
    """
    return UNITS[unit][1]
