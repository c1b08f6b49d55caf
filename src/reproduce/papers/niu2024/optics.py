"""The optics of niu2024: what the data sheet numbers of its camera imply."""

from __future__ import annotations

from reproduce.papers.declare import Results, blocked, reproduces, words
from reproduce.physics import optics
from reproduce.printed.given import Given

_OPTICS = "niu2024/text-optics"
_OUTCOME = "niu2024/text-experiment"
# What a centre wavelength can be.
_WORDS = words(_OPTICS)


@reproduces(
    _OPTICS,
    cells=["field-of-view-*"],
    given=[f"{_OPTICS}#focal-length", f"{_OPTICS}#pixels-*", f"{_OPTICS}#pixel-pitch-*"],
)
def field_of_view(given: Given) -> Results:
    """Field of view from the detector's size and the estimated focal length."""
    found = optics.field_of_view(
        given.array(f"{_OPTICS}#pixels-?"),
        given.array(f"{_OPTICS}#pixel-pitch-?"),
        given[f"{_OPTICS}#focal-length"],
    )
    return {f"field-of-view-{axis}": float(one) for axis, one in zip("xy", found, strict=True)}


def _middles(given: Given, band: str) -> tuple[float, float]:
    """Return the centre wavelength of a channel as the text can be read.

    The middle of the channel's band, and that of its third of the starlight's band, in metres.
    """
    low, high = (given[f"{_OUTCOME}#simulator-band-{end}"] for end in ("low", "high"))
    third = ("blue", "green", "red").index(band)
    middle = (given[f"{_OPTICS}#band-{band}-low"] + given[f"{_OPTICS}#band-{band}-high"]) / 2
    return middle, low + (high - low) * (2 * third + 1) / 6


@reproduces(
    _OPTICS,
    cells=["centre-wavelength-*"],
    given=[f"{_OPTICS}#band-*", f"{_OUTCOME}#simulator-band-*"],
    options=_WORDS.options,
)
def centre_wavelengths(given: Given) -> Results:
    """Centre wavelengths as the middles of the bands, or of thirds of the starlight's band."""
    [name] = _WORDS.readings
    bands = ("blue", "green", "red")
    return {f"{name}-{band}": blocked(_WORDS, name, _middles(given, band)) for band in bands}
