"""Registration (niu2024, section 2): scales and translations that Table 1 implies."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.papers.niu2024.simulation import REGISTERED, numbers, points
from reproduce.physics import optics
from reproduce.printed.inputs import Inputs


def scale_factors(inputs: Inputs, table: str = "niu2024/table-1") -> dict[str, float]:
    """Return the ratio of green's focal length in a table to the length of each channel."""
    green, *others = numbers(inputs, f"{table}#focal-length")
    return {
        channel: float(optics.scale_factor(green, length))
        for channel, length in zip(REGISTERED, others, strict=True)
    }


@reproduces(
    "niu2024/table-2",
    cells=["scale.*"],
    inputs=["niu2024/table-1#focal-length.*"],
)
def true_scale(inputs: Inputs) -> Results:
    """Compute the scale factors as ratios of the focal lengths of Table 1.

    Implements: niu2024 (6).
    """
    return {f"scale.{channel}": k for channel, k in scale_factors(inputs).items()}


@reproduces(
    "niu2024/table-2",
    cells=["translation-*"],
    inputs=["niu2024/table-1#principal-point-*"],
)
def true_translation(inputs: Inputs) -> Results:
    """Compute the translations as differences of the principal points of Table 1.

    Implements: niu2024 (14).
    """
    green, *others = points(inputs, "niu2024/table-1#principal-point")
    return {
        f"translation-{axis}.{channel}": shift
        for channel, point in zip(REGISTERED, others, strict=True)
        for axis, shift in zip("xy", point - green, strict=True)
    }
