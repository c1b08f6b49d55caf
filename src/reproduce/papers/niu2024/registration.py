"""The registration parameters that follow from the imaging parameters (niu2024, section 2)."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.physics.optics import chromatic
from reproduce.printed.given import Given

__all__ = ["IMAGING", "scale_factors"]

IMAGING = "niu2024/table-1"
CHANNELS = ("red", "blue")


def scale_factors(given: Given, table: str = IMAGING) -> dict[str, float]:
    """Return the ratio of green's focal length in a table to that of each channel."""
    green = given[f"{table}#focal-length.green"]
    lengths = {channel: given[f"{table}#focal-length.{channel}"] for channel in CHANNELS}
    return {c: float(chromatic.scale_factor(green, length)) for c, length in lengths.items()}


@reproduces(
    "niu2024/table-2",
    cells=["scale.*"],
    given=[f"{IMAGING}#focal-length.*"],
    equations=["6"],
)
def true_scale(given: Given) -> Results:
    """Scale factors as ratios of the focal lengths of Table 1."""
    return {f"scale.{channel}": scale for channel, scale in scale_factors(given).items()}


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
