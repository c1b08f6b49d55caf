"""The optics of niu2024: consequences of the data sheet of its camera."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.physics import optics
from reproduce.printed.inputs import Inputs


@reproduces(
    "niu2024/text-optics",
    cells=["field-of-view-*"],
    inputs=[
        "niu2024/text-optics#focal-length",
        "niu2024/text-optics#pixels-*",
        "niu2024/text-optics#pixel-pitch-*",
    ],
)
def field_of_view(inputs: Inputs) -> Results:
    """Compute the field of view from the size of the detector and the focal length."""
    x, y = optics.field_of_view(
        inputs.array("niu2024/text-optics#pixels-?"),
        inputs.array("niu2024/text-optics#pixel-pitch-?"),
        inputs["niu2024/text-optics#focal-length"],
    )
    return {"field-of-view-x": x, "field-of-view-y": y}


@reproduces(
    "niu2024/text-optics",
    cells=["centre-wavelength-*"],
    inputs=["niu2024/text-optics#band-*", "niu2024/text-experiment#simulator-band-*"],
)
def centre_wavelengths(inputs: Inputs, *, centre: str) -> Results:
    """Compute the middles of the bands, or of thirds of the band of the starlight."""
    low, high = inputs.array("niu2024/text-experiment#simulator-band-*")
    wavelengths = {}
    for third, band in enumerate(("blue", "green", "red")):
        middle = inputs.array(f"niu2024/text-optics#band-{band}-*").mean()
        if centre == "third":
            middle = low + (high - low) * (2 * third + 1) / 6
        wavelengths[f"centre-wavelength-{band}"] = middle
    return wavelengths
