"""Registration (niu2024, section 2): scales and translations that Table 1 implies."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.papers.niu2024.simulation import IMAGING, REGISTERED, numbers, points
from reproduce.physics import optics
from reproduce.printed.inputs import Inputs


def scale_factors(inputs: Inputs, table: str = IMAGING) -> dict[str, float]:
    """Return the ratio of green's focal length in a table to that of each channel."""
    lengths = numbers(inputs, f"{table}#focal-length")
    ratios = optics.scale_factor(lengths[0], lengths[1:]).tolist()
    return dict(zip(REGISTERED, ratios, strict=True))


@reproduces(
    "niu2024/table-2",
    cells=["scale.*"],
    inputs=[f"{IMAGING}#focal-length.*"],
    equations=["6"],
)
def true_scale(inputs: Inputs) -> Results:
    """Scale factors as ratios of the focal lengths of Table 1."""
    return {f"scale.{channel}": k for channel, k in scale_factors(inputs).items()}


@reproduces(
    "niu2024/table-2",
    cells=["translation-*"],
    inputs=[f"{IMAGING}#principal-point-*"],
    equations=["14"],
)
def true_translation(inputs: Inputs) -> Results:
    """Translations as differences of the principal points of Table 1."""
    green, *others = points(inputs, f"{IMAGING}#principal-point")
    return {
        f"translation-{axis}.{channel}": float(shift)
        for channel, point in zip(REGISTERED, others, strict=True)
        for axis, shift in zip("xy", point - green, strict=True)
    }
