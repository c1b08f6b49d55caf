"""The camera of niu2024: what its data sheet numbers imply."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.physics import pixel_angles
from reproduce.printed.given import Given

OPTICS = "niu2024/text-optics"


@reproduces(
    OPTICS,
    cells=["field-of-view-*"],
    given=[f"{OPTICS}#focal-length", f"{OPTICS}#pixels-*", f"{OPTICS}#pixel-pitch-*"],
)
def field_of_view(given: Given) -> Results:
    """Field of view from the detector's size and the estimated focal length."""
    focal_length = given[f"{OPTICS}#focal-length"]
    return {
        f"field-of-view-{axis}": float(
            pixel_angles.field_of_view(
                given[f"{OPTICS}#pixels-{axis}"],
                given[f"{OPTICS}#pixel-pitch-{axis}"],
                focal_length,
            )
        )
        for axis in "xy"
    }


@reproduces(OPTICS, cells=["centre-wavelength-*"], given=[f"{OPTICS}#band-*"])
def centre_wavelengths(given: Given) -> Results:
    """Centre wavelengths as the middles of the printed bands."""
    return {
        f"centre-wavelength-{band}": (
            given[f"{OPTICS}#band-{band}-low"] + given[f"{OPTICS}#band-{band}-high"]
        )
        / 2
        for band in ("blue", "green", "red")
    }
