"""Registration (niu2024, section 2): what Table 1 implies, and Figure 2.

Figure 2 is drawn from the caption and the text; the paper's own picture was not at hand. Angle and
shift are drawn far too large, or nothing would be seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import Results, draws, reproduces
from reproduce.papers.niu2024.diagrams import BLUE, GREEN
from reproduce.papers.sketch import (
    Look,
    arc,
    arrow,
    beside,
    diagram,
    label,
    line,
)
from reproduce.physics import optics
from reproduce.physics.registration import Registration, principal_point_shift
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

if TYPE_CHECKING:
    from matplotlib.axes import Axes


IMAGING = "niu2024/table-1"
_CHANNELS = ("red", "blue")


def scale_factors(given: Given, table: str = IMAGING) -> dict[str, float]:
    """Return the ratio of green's focal length in a table to that of each channel."""
    green = given[f"{table}#focal-length.green"]
    lengths = {channel: given[f"{table}#focal-length.{channel}"] for channel in _CHANNELS}
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
        for channel in _CHANNELS
    }


# Angle and principal points of Figure 2, in units of the canvas.
PLANE_ANGLE = float(np.radians(14.0))
PRINCIPAL_POINTS = {"green": np.array([5.4, 5.0]), "blue": np.array([7.8, 6.4])}


@draws("niu2024/fig-2")
@diagram(14.0, 11.6, 5.6)
def _draw_planes(axes: Axes) -> None:
    """Rotation and translation of the blue image plane against the green one."""
    green, blue = PRINCIPAL_POINTS["green"], PRINCIPAL_POINTS["blue"]
    _plane(axes, green, 0.0, GREEN)
    _plane(axes, blue, PLANE_ANGLE, BLUE)
    _shift(axes, green, principal_point_shift(blue, green))
    line(axes, [blue, beside(blue, 5.4, 0.0)], 0.7)
    arc(axes, blue, 4.8, (0.0, float(np.degrees(PLANE_ANGLE))), head=True)
    label(axes, beside(blue, 5.2, 0.65), "θ")


def _plane(axes: Axes, origin: FloatArray, turn: float, look: Look) -> None:
    """Draw a detector about its principal point, with its axes."""
    # A spot of this channel is laid into the other by the same turn that turns the axes.
    turned = Registration.similarity(1.0, turn, (0.0, 0.0), (0.0, 0.0)).apply
    corners = turned([[-4, -3], [4, -3], [4, 3], [-4, 3], [-4, -3]]) + origin
    axes.plot(*corners.T, color=look.colour, linestyle=look.line, label=look.name)
    axes.plot(*origin, look.marker, color=look.colour, markersize=7)
    letter = look.name[0]
    for tip, name in zip(turned([[3.0, 0.0], [0.0, 2.2]]), "XY", strict=True):
        arrow(axes, origin, origin + tip, look)
        away = tip / np.hypot(*tip)
        label(axes, origin + tip + 0.38 * away, f"${name}_{letter}$")
    below, corner = turned([[-0.55, -0.5], [2.1, -2.35]])
    label(axes, origin + below, f"$O_{letter}$")
    label(axes, origin + corner, look.name, ha="left", rotation=np.degrees(turn))


def _shift(axes: Axes, green: FloatArray, shift: FloatArray) -> None:
    """Mark the translation from one principal point to the other."""
    low, right = green - [0.0, 1.4], beside(green, shift[0] + 2.1, 0.0)
    for x, top in ((0.0, 0.0), (shift[0], shift[1])):
        line(axes, [beside(low, x, -0.2), beside(green, x, top)], 0.6)
    arrow(axes, low, beside(low, shift[0], 0.0), style="<|-|>")
    label(axes, beside(low, shift[0] / 2, 0.4), "Δx")
    for y, start in ((0.0, 3.8), (shift[1], shift[0])):
        line(axes, [beside(green, start, y), beside(right, 0.2, y)], 0.6)
    arrow(axes, right, beside(right, 0.0, shift[1]), style="<|-|>")
    label(axes, beside(right, 0.5, shift[1] / 2), "Δy")
