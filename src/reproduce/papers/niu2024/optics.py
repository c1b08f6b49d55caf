"""The optics of niu2024: what the data sheet numbers of its camera imply."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.physics import optics
from reproduce.printed.inputs import Inputs

_OPTICS = "niu2024/text-optics"
_OUTCOME = "niu2024/text-experiment"


@reproduces(
    _OPTICS,
    cells=["field-of-view-*"],
    inputs=[
        f"{_OPTICS}#focal-length",
        f"{_OPTICS}#pixels-*",
        f"{_OPTICS}#pixel-pitch-*",
    ],
)
def field_of_view(inputs: Inputs) -> Results:
    """Field of view from the detector's size and the estimated focal length."""
    found = optics.field_of_view(
        inputs.array(f"{_OPTICS}#pixels-?"),
        inputs.array(f"{_OPTICS}#pixel-pitch-?"),
        inputs[f"{_OPTICS}#focal-length"],
    )
    return {
        f"field-of-view-{axis}": float(one)
        for axis, one in zip("xy", found, strict=True)
    }


@reproduces(
    _OPTICS,
    cells=["centre-wavelength-*"],
    inputs=[f"{_OPTICS}#band-*", f"{_OUTCOME}#simulator-band-*"],
)
def centre_wavelengths(inputs: Inputs, *, centre: str) -> Results:
    """Centre wavelengths as the middles of the bands, or of thirds of the starlight's band."""
    low, high = inputs.array(f"{_OUTCOME}#simulator-band-*")
    found = {}
    for third, band in enumerate(("blue", "green", "red")):
        middle = inputs.array(f"{_OPTICS}#band-{band}-*").mean()
        if centre == "third":
            middle = low + (high - low) * (2 * third + 1) / 6
        found[f"centre-wavelength-{band}"] = float(middle)
    return found
