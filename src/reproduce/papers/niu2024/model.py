"""The registration parameters that follow from the imaging parameters (niu2024, section 2)."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.physics import chromatic
from reproduce.printed.given import Given

IMAGING = "niu2024/table-1"
CHANNELS = ("red", "blue")


@reproduces(
    "niu2024/table-2",
    cells=["scale.*"],
    given=[f"{IMAGING}#focal-length.*"],
    equations=["6"],
)
def true_scale(given: Given) -> Results:
    """Scale factors as ratios of the focal lengths of Table 1."""
    green = given[f"{IMAGING}#focal-length.green"]
    return {
        f"scale.{channel}": float(
            chromatic.scale_factor(green, given[f"{IMAGING}#focal-length.{channel}"])
        )
        for channel in CHANNELS
    }


@reproduces(
    "niu2024/table-2",
    cells=["translation-*"],
    given=[f"{IMAGING}#principal-point-*"],
    equations=["14"],
)
def true_translation(given: Given) -> Results:
    """Translations as differences of the principal points of Table 1."""
    return {
        f"translation-{axis}.{channel}": given[f"{IMAGING}#principal-point-{axis}.{channel}"]
        - given[f"{IMAGING}#principal-point-{axis}.green"]
        for axis in "xy"
        for channel in CHANNELS
    }


@reproduces(
    "niu2024/text-approximations",
    given=[
        f"{IMAGING}#focal-length.*",
        "niu2024/text-approximations#parameters-per-channel",
        "niu2024/text-context#detectors",
    ],
    equations=["6"],
)
def approximations(given: Given) -> Results:
    """The scale factor farthest from one, and the count of parameters."""
    green = given[f"{IMAGING}#focal-length.green"]
    scales = [
        float(chromatic.scale_factor(green, given[f"{IMAGING}#focal-length.{channel}"]))
        for channel in CHANNELS
    ]
    registered = given.count("niu2024/text-context#detectors") - 1  # green is the reference
    per_channel = given.count("niu2024/text-approximations#parameters-per-channel")
    return {
        "scale-approximation": max(scales, key=lambda scale: abs(scale - 1)),
        "parameters": float(registered * per_channel),
    }
