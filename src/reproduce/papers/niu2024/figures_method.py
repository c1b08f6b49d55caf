"""Figures 1 and 2 of niu2024: the sensor's workflow, and one image plane against another.

Drawn from the captions and the text; the papers' own pictures were not at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import draws
from reproduce.papers.niu2024.sketch import BLUE, GREEN, LOOKS
from reproduce.papers.sketch import SIZE, Look, arc, arrow, beside, box, diagram, label, line
from reproduce.physics.registration.transforms import Registration, principal_point_shift
from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Angle and shift of Figure 2, drawn much enlarged, in units of the canvas.
ANGLE = float(np.radians(14.0))
PRINCIPAL_POINTS = {"green": np.array([5.4, 5.0]), "blue": np.array([7.8, 6.4])}


@draws("niu2024/fig-1")
@diagram(17.0, 9.6)
def draw_workflow(axes: Axes) -> None:
    """Workflow of a 3CMOS star sensor, from starlight to attitude."""
    box(axes, (1.3, 6.2), (2.4, 1.2), "starlight")
    box(axes, (4.2, 6.2), (2.2, 1.6), "lens and\nprism")
    arrow(axes, (2.5, 6.2), (3.1, 6.2))
    box(axes, (12.1, 6.2), (3.2, 1.8), "registration\nonto green")
    for look, y in zip(LOOKS.values(), (8.4, 6.2, 4.0), strict=True):
        box(axes, (8.0, y), (3.6, 1.5), f"{look.name} detector\nimage and spots", look)
        arrow(axes, (5.3, 6.2 + (y - 6.2) / 8), (6.2, y), look)
        arrow(axes, (9.8, y), (10.5, 6.2 + (y - 6.2) / 4), look)
    box(axes, (15.6, 6.2), (2.2, 1.2), "fusion")
    arrow(axes, (13.7, 6.2), (14.5, 6.2))
    _to_attitude(axes)


def _to_attitude(axes: Axes) -> None:
    box(axes, (15.5, 3.6), (2.6, 1.2), "centroids")
    arrow(axes, (15.6, 5.6), (15.6, 4.2))
    box(axes, (8.0, 6.2), (4.2, 6.3), style=":", width=0.8)
    box(axes, (7.6, 1.1), (4.2, 1.5), "ratio of brightness:\nthe star's colour")
    arrow(axes, (7.6, 3.05), (7.6, 1.85))
    box(axes, (12.4, 1.1), (3.2, 1.5), "star\nidentification")
    arrow(axes, (9.7, 1.1), (10.8, 1.1))
    arrow(axes, (14.5, 3.0), (13.4, 1.85))
    box(axes, (15.8, 1.1), (2.2, 1.2), "attitude")
    arrow(axes, (14.0, 1.1), (14.7, 1.1))
    label(axes, (12.1, 7.6), "this paper", style="italic")


@draws("niu2024/fig-2")
@diagram(14.0, 11.6, 5.6)
def draw_planes(axes: Axes) -> None:
    """Rotation and translation of the blue image plane against the green one."""
    green, blue = PRINCIPAL_POINTS["green"], PRINCIPAL_POINTS["blue"]
    _plane(axes, green, 0.0, GREEN)
    _plane(axes, blue, ANGLE, BLUE)
    _shift(axes, green, principal_point_shift(blue, green))
    line(axes, [blue, beside(blue, 5.4, 0.0)], 0.7)
    arc(axes, blue, 4.8, (0.0, float(np.degrees(ANGLE))), head=True)
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
    below, corner = turned([[-0.55, -0.5], [-3.75, -2.6]])
    label(axes, origin + below, f"$O_{letter}$")
    label(axes, origin + corner, look.name, ha="left", rotation=np.degrees(turn), size=SIZE)


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
