"""Pieces of the drawings of chen2023: instruments, mirrors, rays and frames.

Laser light is drawn dashed and vermilion, starlight solid and green, light of the landscape dotted
and blue, so that they stay apart without colour. All else takes the page's own colour.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Point = tuple[float, float]
INK = "#000000"


@dataclass(frozen=True)
class Beam:
    """How one kind of light is drawn."""

    name: str
    colour: str
    line: str


LASER = Beam("laser", "#D55E00", "--")
STAR = Beam("starlight", "#009E73", "-")
SCENE = Beam("landscape", "#0072B2", ":")


def canvas(figure: Figure, width: float, height: float, inches: float = 6.4) -> Axes:
    """Return axes without ticks that reach from (0, 0) to (width, height), to scale."""
    figure.set_size_inches(inches, inches * height / width)
    axes = figure.add_subplot()
    axes.set(xlim=(0, width), ylim=(0, height), aspect="equal")
    axes.set_axis_off()
    return axes


def box(
    axes: Axes, centre: Point, size: Point, text: str = "", *, turn: float = 0.0, line: str = "-"
) -> None:
    """Draw a labelled rectangle about a centre, turned by some degrees."""
    from matplotlib.patches import Polygon

    half = np.array(size) / 2
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    patch = Polygon(turned(corners, turn) + centre, closed=True)
    patch.set(facecolor="none", edgecolor=INK, linewidth=1.3, linestyle=line)
    axes.add_patch(patch)
    label(axes, centre, text)


def turned(points: ArrayLike, degrees: float) -> FloatArray:
    """Return points turned about the origin."""
    angle = np.radians(degrees)
    matrix = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    result: FloatArray = np.asarray(points, dtype=np.float64) @ matrix.T
    return result


def label(axes: Axes, place: Point, text: str, *, size: float = 8.5, side: str = "center") -> None:
    """Write a label."""
    axes.text(*place, text, ha=side, va="center", fontsize=size)


def ray(axes: Axes, points: Sequence[Point], beam: Beam) -> None:
    """Draw light along a path of straight pieces, an arrow at the end of each."""
    for start, end in pairwise(points):
        arrow(axes, start, end, beam.colour, beam.line)


def arrow(
    axes: Axes, start: Point, end: Point, colour: str = INK, line: str = "-", style: str = "-|>"
) -> None:
    """Draw an arrow."""
    look = {
        "arrowstyle": style,
        "color": colour,
        "linestyle": line,
        "linewidth": 1.3,
        "shrinkA": 0,
        "shrinkB": 0,
        "mutation_scale": 9,
    }
    axes.annotate("", end, start, arrowprops=look)


def mirror(axes: Axes, centre: Point, length: float, degrees: float, line: str = "-") -> None:
    """Draw a mirror as a thick line."""
    ends = turned([[-length / 2, 0], [length / 2, 0]], degrees) + centre
    axes.plot(*ends.T, color=INK, linewidth=3, linestyle=line, solid_capstyle="butt")


def lens(axes: Axes, centre: Point, height: float, degrees: float = 0.0) -> None:
    """Draw a lens, its axis turned from the horizontal by some degrees."""
    t = np.linspace(-1, 1, 30)
    bulge = 0.12 * height * (1 - t**2)
    for side in (-1, 1):
        outline = np.stack([side * bulge, t * height / 2], axis=-1)
        axes.plot(*(turned(outline, degrees) + centre).T, color=INK, linewidth=1.2)


def frame(
    axes: Axes, origin: Point, name: str, length: float = 1.0, turn: float = 0.0, up: str = "Z"
) -> None:
    """Draw a frame's two axes in the plane of the drawing: X, and the one that `up` names."""
    for axis, direction in (("X", [length, 0]), (up, [0, length])):
        end = turned(direction, turn) + origin
        arrow(axes, origin, (float(end[0]), float(end[1])))
        beyond = turned(np.array(direction) * 1.22, turn) + origin
        label(axes, (float(beyond[0]), float(beyond[1])), f"${axis}_{{{name}}}$", size=8)


def arc(axes: Axes, centre: Point, radius: float, angles: Point, text: str = "") -> None:
    """Draw an arc from one angle to another, in degrees, with its label outside."""
    sweep = np.radians(np.linspace(*angles, 60))
    axes.plot(
        centre[0] + radius * np.cos(sweep), centre[1] + radius * np.sin(sweep), color=INK, lw=1
    )
    middle = np.radians(sum(angles) / 2)
    place = (centre[0] + 1.35 * radius * np.cos(middle), centre[1] + 1.35 * radius * np.sin(middle))
    label(axes, (float(place[0]), float(place[1])), text, size=8)


def legend(axes: Axes, beams: Sequence[Beam], place: Point) -> None:
    """Draw a legend of the kinds of light."""
    for beam in beams:
        axes.plot([], [], color=beam.colour, linestyle=beam.line, label=beam.name)
    axes.legend(loc=place, fontsize=8)
