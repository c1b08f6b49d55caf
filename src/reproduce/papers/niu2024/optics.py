"""The optics of niu2024: what the data sheet numbers of its camera imply."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.physics import optics
from reproduce.printed.given import Given

_OPTICS = "niu2024/text-optics"
_OUTCOME = "niu2024/text-experiment"


@reproduces(
    _OPTICS,
    cells=["field-of-view-*"],
    given=[
        f"{_OPTICS}#focal-length",
        f"{_OPTICS}#pixels-*",
        f"{_OPTICS}#pixel-pitch-*",
    ],
)
def field_of_view(given: Given) -> Results:
    """Field of view from the detector's size and the estimated focal length."""
    found = optics.field_of_view(
        given.array(f"{_OPTICS}#pixels-?"),
        given.array(f"{_OPTICS}#pixel-pitch-?"),
        given[f"{_OPTICS}#focal-length"],
    )
    return {
        f"field-of-view-{axis}": float(one)
        for axis, one in zip("xy", found, strict=True)
    }


@reproduces(
    _OPTICS,
    cells=["centre-wavelength-*"],
    given=[f"{_OPTICS}#band-*", f"{_OUTCOME}#simulator-band-*"],
)
def centre_wavelengths(given: Given, *, centre: str) -> Results:
    """Centre wavelengths as the middles of the bands, or of thirds of the starlight's band."""
    low, high = given.array(f"{_OUTCOME}#simulator-band-*")
    found = {}
    for third, band in enumerate(("blue", "green", "red")):
        middle = given.array(f"{_OPTICS}#band-{band}-*").mean()
        if centre == "third":
            middle = low + (high - low) * (2 * third + 1) / 6
        found[f"centre-wavelength-{band}"] = float(middle)
    return found
