"""Figures 1 and 2 of niu2024: the sensor's workflow, and one image plane against another.

Drawn from the captions and the text; the papers' own pictures were not at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.niu2024.sketch import (
    BLUE,
    GREEN,
    RED,
    ChannelLook,
    Point,
    arrow,
    box,
    canvas,
    group,
    turning,
)
from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_workflow(figure: Figure, printed: Mapping[str, float]) -> None:
    """Workflow of a 3CMOS star sensor, from starlight to attitude.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure.
    """
    figure.set_size_inches(6.4, 3.6)
    axes = canvas(figure, 17.0, 9.4)
    box(axes, (1.3, 6.2), "starlight", (2.2, 1.2))
    box(axes, (4.3, 6.2), "lens and\nprism", (2.2, 1.6))
    arrow(axes, (2.4, 6.2), (3.2, 6.2))
    for look, y in ((RED, 8.4), (GREEN, 6.2), (BLUE, 4.0)):
        box(axes, (7.9, y), f"{look.name} detector\nimage and spots", (3.4, 1.5), look)
        arrow(axes, (5.4, 6.2 + (y - 6.2) / 8), (6.2, y), look)
    box(axes, (12.0, 6.2), "registration\nonto green", (2.8, 1.8))
    for look, y in ((RED, 8.4), (GREEN, 6.2), (BLUE, 4.0)):
        arrow(axes, (9.6, y), (10.6, 6.2 + (y - 6.2) / 4), look)
    box(axes, (15.4, 6.2), "fusion", (2.2, 1.2))
    arrow(axes, (13.4, 6.2), (14.3, 6.2))
    _to_attitude(axes)


def _to_attitude(axes: Axes) -> None:
    box(axes, (15.4, 3.4), "centroids", (2.4, 1.2))
    arrow(axes, (15.4, 5.6), (15.4, 4.0))
    group(axes, (5.9, 3.0), (4.0, 6.35))
    box(axes, (7.9, 1.1), "ratio of brightness:\nthe star's colour", (3.8, 1.5))
    arrow(axes, (7.9, 3.0), (7.9, 1.85))
    box(axes, (12.4, 1.1), "star\nidentification", (2.8, 1.5))
    arrow(axes, (9.8, 1.1), (11.0, 1.1))
    arrow(axes, (14.5, 2.8), (13.6, 1.85))
    box(axes, (15.8, 1.1), "attitude", (2.0, 1.2))
    arrow(axes, (13.8, 1.1), (14.8, 1.1))
    axes.text(12.0, 7.5, "this paper", ha="center", fontsize=8.5, style="italic")


def draw_planes(figure: Figure, printed: Mapping[str, float]) -> None:
    """Rotation and translation of the blue image plane against the green one.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure. Angle and shift are drawn much enlarged.
    """
    figure.set_size_inches(5.2, 4.4)
    axes = canvas(figure, 13.0, 11.0)
    green, blue, angle = np.array([5.6, 5.0]), np.array([7.4, 6.1]), np.radians(14.0)
    for look, origin, turn in ((GREEN, green, 0.0), (BLUE, blue, angle)):
        _plane(axes, origin, float(turn), look)
    _shift(axes, green, blue)
    axes.plot([blue[0], blue[0] + 4.6], [blue[1], blue[1]], color="#000000", linewidth=0.7)
    turning(axes, pair(blue), 3.9, (0.0, 14.0))
    axes.text(blue[0] + 4.05, blue[1] + 0.42, "θ", ha="left", va="center")


def pair(point: FloatArray) -> Point:
    """Return a point as two plain numbers, as matplotlib's annotations want them."""
    return float(point[0]), float(point[1])


def _plane(axes: Axes, origin: FloatArray, turn: float, look: ChannelLook) -> None:
    """Draw a detector about its principal point, with its axes."""
    cosine, sine = np.cos(turn), np.sin(turn)
    matrix = np.array([[cosine, -sine], [sine, cosine]])
    corners = np.array([[-4, -3], [4, -3], [4, 3], [-4, 3], [-4, -3]]) @ matrix.T + origin
    axes.plot(*corners.T, color=look.colour, linestyle=look.line, label=look.name)
    axes.plot(*origin, look.marker, color=look.colour, markersize=7)
    letter = look.name[0]
    for direction, name in (((3.2, 0.0), "X"), ((0.0, 2.4), "Y")):
        tip = matrix @ direction + origin
        arrow(axes, pair(origin), pair(tip), look)
        offset = matrix @ (np.array(direction) / np.hypot(*direction) * 0.45)
        axes.text(*pair(tip + offset), f"${name}_{letter}$", ha="center", va="center")
    below = origin + matrix @ np.array([-0.55, -0.5])
    axes.text(*pair(below), f"$O_{letter}$", ha="center", va="center")
    corner = matrix @ np.array([-3.8, 2.6]) + origin
    axes.text(
        *pair(corner), look.name, ha="left", va="center", rotation=np.degrees(turn), fontsize=9
    )


def _shift(axes: Axes, green: FloatArray, blue: FloatArray) -> None:
    """Mark the translation from one principal point to the other."""
    y = green[1] - 1.5
    for x in (green[0], blue[0]):
        top = green[1] if x == green[0] else blue[1]
        axes.plot([x, x], [y - 0.2, top], color="#000000", linewidth=0.6)
    arrow(axes, (green[0], y), (blue[0], y), style="<|-|>")
    axes.text((green[0] + blue[0]) / 2, y - 0.4, "Δx", ha="center", va="center")
    x = blue[0] + 1.4
    for height, start in ((green[1], green[0]), (blue[1], blue[0])):
        axes.plot([start, x + 0.2], [height, height], color="#000000", linewidth=0.6)
    arrow(axes, (x, green[1]), (x, blue[1]), style="<|-|>")
    axes.text(x + 0.25, (green[1] + blue[1]) / 2, "Δy", ha="left", va="center")
