"""Registration (niu2024, section 2): what Table 1 implies, and Figure 2.

Figure 2 is drawn from the caption and the text; the paper's own picture was not at hand. Angle and
shift are drawn far too large, or nothing would be seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import Results, draws, reproduces
from reproduce.papers.niu2024.diagrams import BLUE, GREEN
from reproduce.papers.niu2024.simulation import IMAGING, REGISTERED
from reproduce.papers.sketch import Look, Point, Sketch, turned
from reproduce.physics import optics
from reproduce.printed.given import Given

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def scale_factors(given: Given, table: str = IMAGING) -> dict[str, float]:
    """Return the ratio of green's focal length in a table to that of each channel."""
    green = given[f"{table}#focal-length.green"]
    lengths = {channel: given[f"{table}#focal-length.{channel}"] for channel in REGISTERED}
    return {c: float(optics.scale_factor(green, length)) for c, length in lengths.items()}


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
        for channel in REGISTERED
    }


# Angle in degrees and principal points of Figure 2, in units of the canvas.
_PLANE_ANGLE = 14.0
_PRINCIPAL_POINTS = {"green": (5.4, 5.0), "blue": (7.8, 6.4)}


@draws("niu2024/fig-2")
def _draw_planes(figure: Figure) -> None:
    """Rotation and translation of the blue image plane against the green one."""
    sketch = Sketch.on(figure, 14.0, 11.6, 5.6)
    green, blue = _PRINCIPAL_POINTS["green"], _PRINCIPAL_POINTS["blue"]
    (left, low), (right, high) = green, blue
    _plane(sketch, green, 0.0, GREEN)
    _plane(sketch, blue, _PLANE_ANGLE, BLUE)
    sketch.arc(blue, 4.8, (0.0, _PLANE_ANGLE), head=True)
    sketch.label((right + 5.2, high + 0.65), "θ")
    # The step from one principal point to the other, along each axis.
    sketch.line([green, (left, low - 1.6)], 0.6)
    sketch.line([(right, low - 1.6), blue, (right + 5.4, high)], 0.6)
    sketch.line([(left + 3.8, low), (right + 2.3, low)], 0.6)
    sketch.arrow((left, low - 1.4), (right, low - 1.4), style="<|-|>")
    sketch.label(((left + right) / 2, low - 1.0), "Δx")
    sketch.arrow((right + 2.1, low), (right + 2.1, high), style="<|-|>")
    sketch.label((right + 2.6, (low + high) / 2), "Δy")


def _plane(sketch: Sketch, origin: Point, turn: float, look: Look) -> None:
    """Draw a detector about its principal point, with its axes."""
    corners = turned([[-4, -3], [4, -3], [4, 3], [-4, 3], [-4, -3]], turn) + origin
    sketch.axes.plot(*corners.T, color=look.colour, linestyle=look.line, label=look.name)
    sketch.mark(origin, look, 7)
    letter = look.name[0]
    for tip, name in zip(turned([[3.0, 0.0], [0.0, 2.2]], turn), "XY", strict=True):
        sketch.arrow(origin, origin + tip, look)
        sketch.label(origin + tip + 0.38 * tip / np.hypot(*tip), f"${name}_{letter}$")
    below, corner = turned([[-0.55, -0.5], [2.1, -2.35]], turn) + origin
    sketch.label(below, f"$O_{letter}$")
    sketch.label(corner, look.name, ha="left", rotation=turn)
