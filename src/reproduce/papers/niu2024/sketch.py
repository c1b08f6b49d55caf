"""Pieces of the drawings of niu2024: boxes, arrows, and channels told apart without colour."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Point = tuple[float, float]


@dataclass(frozen=True)
class ChannelLook:
    """How a channel is drawn wherever it appears: colour, line and marker all differ."""

    name: str
    colour: str
    line: str
    marker: str


RED = ChannelLook("red", "#D55E00", "--", "s")
GREEN = ChannelLook("green", "#009E73", "-", "o")
BLUE = ChannelLook("blue", "#0072B2", ":", "^")
LOOKS = {look.name: look for look in (RED, GREEN, BLUE)}


def canvas(figure: Figure, width: float, height: float) -> Axes:
    """Return axes without ticks that reach from (0, 0) to (width, height), to scale."""
    axes = figure.add_subplot()
    axes.set(xlim=(0, width), ylim=(0, height), aspect="equal")
    axes.set_axis_off()
    return axes


def box(axes: Axes, centre: Point, text: str, size: Point, look: ChannelLook | None = None) -> None:
    """Draw a labelled box about a centre; in a channel's look, or in the page's own colour."""
    from matplotlib.patches import FancyBboxPatch

    x, y = centre[0] - size[0] / 2, centre[1] - size[1] / 2
    colour, line = (look.colour, look.line) if look else ("#000000", "-")
    patch = FancyBboxPatch((x, y), *size, boxstyle="round,pad=0,rounding_size=0.15")
    patch.set(facecolor="none", edgecolor=colour, linestyle=line, linewidth=1.4)
    axes.add_patch(patch)
    axes.text(*centre, text, ha="center", va="center", fontsize=8.5)


def arrow(
    axes: Axes, start: Point, end: Point, look: ChannelLook | None = None, style: str = "-|>"
) -> None:
    """Draw an arrow, in a channel's look or in the page's own colour."""
    colour, line = (look.colour, look.line) if look else ("#000000", "-")
    axes.annotate(
        "",
        end,
        start,
        arrowprops={
            "arrowstyle": style,
            "color": colour,
            "linestyle": line,
            "linewidth": 1.2,
            "shrinkA": 0,
            "shrinkB": 0,
            "mutation_scale": 9,
        },
    )


def group(axes: Axes, corner: Point, size: Point) -> None:
    """Draw a thin dotted frame around pieces that belong together."""
    from matplotlib.patches import Rectangle

    frame = Rectangle(corner, *size, facecolor="none", edgecolor="#000000", linewidth=0.8)
    frame.set(linestyle=(0, (1, 3)))
    axes.add_patch(frame)


def turning(axes: Axes, centre: Point, radius: float, angles: Point) -> None:
    """Draw a curved arrow from the first angle to the second, in degrees, about a centre."""
    import numpy as np

    turn = np.radians(np.linspace(*angles, 60))
    x, y = centre[0] + radius * np.cos(turn), centre[1] + radius * np.sin(turn)
    axes.plot(x, y, color="#000000", linewidth=1.2)
    # From a few points back: over the last step alone the head would not know its direction.
    arrow(axes, (x[-6], y[-6]), (x[-1], y[-1]))
