"""The optics of niu2024: consequences of the data sheet of its camera."""

from __future__ import annotations

import numpy as np

from reproduce.papers.declare import Results, by_cell, reproduces
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
    angles = optics.field_of_view(
        inputs.array("niu2024/text-optics#pixels-?"),
        inputs.array("niu2024/text-optics#pixel-pitch-?"),
        inputs["niu2024/text-optics#focal-length"],
    )
    return by_cell("field-of-view-{}", angles, "xy")


@reproduces(
    "niu2024/text-optics",
    cells=["centre-wavelength-*"],
    inputs=["niu2024/text-optics#band-*", "niu2024/text-experiment#simulator-band-*"],
)
def centre_wavelengths(inputs: Inputs, *, centre: str) -> Results:
    """Compute the middles of the bands, or of thirds of the band of the starlight."""
    bands = "blue", "green", "red"
    if centre == "third":
        low, high = inputs.array("niu2024/text-experiment#simulator-band-*")
        middles = np.linspace(low, high, 7)[1::2]
    else:
        middles = inputs.pairs("niu2024/text-optics#band-*").mean(axis=1)
    return by_cell("centre-wavelength-{}", middles, bands)
