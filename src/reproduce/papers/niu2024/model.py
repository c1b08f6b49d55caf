"""The registration parameters that follow from the imaging parameters (niu2024, section 2)."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.physics.optics import chromatic
from reproduce.printed.given import Given

IMAGING = "niu2024/table-1"
APPROXIMATIONS = "niu2024/text-approximations"
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
    APPROXIMATIONS,
    cells=["scale-approximation"],
    given=[f"{IMAGING}#focal-length.*"],
    equations=["6"],
)
def scale_near_one(given: Given) -> Results:
    """The scale factor of Table 1 that lies farthest from one."""
    green = given[f"{IMAGING}#focal-length.green"]
    scales = [
        float(chromatic.scale_factor(green, given[f"{IMAGING}#focal-length.{channel}"]))
        for channel in CHANNELS
    ]
    return {"scale-approximation": max(scales, key=lambda scale: abs(scale - 1))}


@reproduces(
    APPROXIMATIONS,
    cells=["parameters"],
    given=[f"{APPROXIMATIONS}#parameters-per-channel", "niu2024/text-context#detectors"],
)
def parameter_count(given: Given) -> Results:
    """Parameters of the whole model: those of one channel, for every channel but green."""
    registered = given.count("niu2024/text-context#detectors") - 1
    per_channel = given.count(f"{APPROXIMATIONS}#parameters-per-channel")
    return {"parameters": float(registered * per_channel)}
