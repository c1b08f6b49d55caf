"""Registration (niu2024, section 2): scales and translations that Table 1 implies."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.papers.niu2024.simulation import IMAGING, REGISTERED
from reproduce.physics import optics
from reproduce.printed.given import Given


def scale_factors(given: Given, table: str = IMAGING) -> dict[str, float]:
    """Return the ratio of green's focal length in a table to that of each channel."""
    green = given[f"{table}#focal-length.green"]
    lengths = {
        channel: given[f"{table}#focal-length.{channel}"] for channel in REGISTERED
    }
    return {
        c: float(optics.scale_factor(green, length)) for c, length in lengths.items()
    }


@reproduces(
    "niu2024/table-2",
    cells=["scale.*"],
    given=[f"{IMAGING}#focal-length.*"],
    equations=["6"],
)
def true_scale(given: Given) -> Results:
    """Scale factors as ratios of the focal lengths of Table 1."""
    return {
        f"scale.{channel}": scale for channel, scale in scale_factors(given).items()
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
        f"translation-{axis}.{channel}": given[
            f"{IMAGING}#principal-point-{axis}.{channel}"
        ]
        - given[f"{IMAGING}#principal-point-{axis}.green"]
        for axis in "xy"
        for channel in REGISTERED
    }
