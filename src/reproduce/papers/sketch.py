"""Pieces of the drawings of both papers: boxes, arrows, frames in space, looks without colour.

Everything that carries no look of its own is drawn in `INK`, which follows the page's text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.attitude import rotation_from_vector, unit
from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Point = tuple[float, float]
INK = "#000000"
# Points: on a wide page, and the least that a narrow one may have.
SIZE, LEAST = 9.0, 8.0
# Inches: what a phone of 390 CSS pixels shows in full.
NARROW = 3.7


@dataclass(frozen=True)
class Look:
    """How one kind of thing is drawn wherever it appears: colour, line and marker all differ."""

    name: str
    colour: str
    line: str
    marker: str = "o"


_INKED = Look("", INK, "-")


def thin(figure: Figure) -> bool:
    """Tell whether a figure is drawn for a narrow page."""
    return float(figure.get_figwidth()) <= NARROW


def sized(
    figure: Figure, width: float, height: float, narrow: float | None = None
) -> bool:
    """Give a figure its inches, or its height on a narrow page; tell whether it is for one."""
    if narrowed := thin(figure):
        width, height = NARROW, narrow or height
    figure.set_size_inches(width, height)
    return narrowed


def beside(place: ArrayLike, right: float, up: float) -> FloatArray:
    """Return the place so far to the right of another and so far above it."""
    return np.add(place, [right, up], dtype=np.float64)


def turned(points: ArrayLike, degrees: float) -> FloatArray:
    """Return points turned about the origin, counterclockwise."""
    angle = np.radians(degrees)
    matrix = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    result: FloatArray = np.asarray(points, dtype=np.float64) @ matrix.T
    return result


# A box of a diagram: its text, then centre and size on a wide page and on a narrow one.
Block = tuple[str, tuple[Point, Point], tuple[Point, Point]]


@dataclass(frozen=True)
class Sketch:
    """Axes without ticks, to scale, and the pieces that are drawn on them."""

    axes: Axes
    narrow: bool

    @classmethod
    def on(
        cls,
        figure: Figure,
        width: float,
        height: float,
        inches: float = 6.4,
        narrow: Point | None = None,
    ) -> Sketch:
        """Return a sketch from (0, 0) to (width, height), or to `narrow` on a narrow page."""
        narrowed = thin(figure)
        if narrowed:
            (width, height), inches = narrow or (width, height), NARROW
        figure.set_size_inches(inches, inches * height / width)
        axes = figure.add_subplot()
        axes.set(xlim=(0, width), ylim=(0, height), aspect="equal")
        axes.set_axis_off()
        return cls(axes, narrowed)

    def label(
        self, place: ArrayLike, text: str, *, size: float = SIZE, **look: object
    ) -> None:
        """Write a label, centred on its place unless `ha` or `va` say otherwise."""
        size = min(size, LEAST) if self.narrow else size
        settings = {"ha": "center", "va": "center", "fontsize": size, **look}
        # Matplotlib types every property of a text apart; here they are mixed in one mapping.
        x, y = np.asarray(place).tolist()
        self.axes.text(x, y, text, **settings)  # type: ignore[arg-type]

    def line(self, points: ArrayLike, width: float = 1.0, style: str = "-") -> None:
        """Draw a line through points of shape (n, 2)."""
        self.axes.plot(
            *np.asarray(points).T, color=INK, linewidth=width, linestyle=style
        )

    def mark(self, place: ArrayLike, look: Look, size: float) -> None:
        """Draw the markers of a look at one place, or at places of shape (n, 2)."""
        self.axes.plot(
            *np.transpose(place), look.marker, color=look.colour, markersize=size
        )

    def arrow(
        self,
        start: ArrayLike,
        end: ArrayLike,
        look: Look = _INKED,
        *,
        style: str = "-|>",
        width: float = 1.3,
    ) -> None:
        """Draw an arrow, in a look or in ink."""
        from matplotlib.patches import FancyArrowPatch

        ends = np.array([start, end], dtype=np.float64).tolist()
        patch = FancyArrowPatch(
            *ends, arrowstyle=style, shrinkA=0, shrinkB=0, mutation_scale=9
        )
        patch.set(color=look.colour, linestyle=look.line, linewidth=width)
        self.axes.add_patch(patch)

    def path(self, points: Sequence[ArrayLike], look: Look = _INKED) -> None:
        """Draw an arrow over several straight pieces, each with a head."""
        for start, end in pairwise(points):
            self.arrow(start, end, look)

    def box(
        self,
        centre: ArrayLike,
        size: Point,
        text: str = "",
        look: Look | None = None,
        *,
        turn: float = 0.0,
        style: str = "-",
        width: float = 1.3,
    ) -> None:
        """Draw a labelled rectangle about a centre, turned by some degrees."""
        from matplotlib.patches import Polygon

        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2 * size
        patch = Polygon(turned(corners, turn) + np.asarray(centre), closed=True)
        patch.set(facecolor="none", edgecolor=look.colour if look else INK)
        patch.set(linewidth=width, linestyle=look.line if look else style)
        self.axes.add_patch(patch)
        if text:
            self.label(centre, text)

    def _join(
        self, one: tuple[Point, Point], other: tuple[Point, Point], look: Look
    ) -> None:
        """Draw an arrow from one box to another, each a centre and a size, from edge to edge."""
        (start, width), (end, across) = np.array(one), np.array(other)
        way = end - start
        with np.errstate(divide="ignore"):
            out, into = (0.5 * np.min(size / np.abs(way)) for size in (width, across))
        self.arrow(start + out * way, end - into * way, look)

    def blocks(
        self,
        boxes: Mapping[str, Block],
        steps: Sequence[str],
        looks: Mapping[str, Look],
    ) -> None:
        """Draw boxes, dotted where they have no text, and arrows; a step names what it joins."""
        places = {name: layouts[self.narrow] for name, (_, *layouts) in boxes.items()}
        for name, (text, *_) in boxes.items():
            style, width = ("-", 1.3) if text else (":", 0.8)
            self.box(*places[name], text, looks.get(name), style=style, width=width)
        for start, end in map(str.split, steps):
            look = looks.get(start) or looks.get(end) or _INKED
            self._join(places[start], places[end], look)

    def arc(self, centre: ArrayLike, radius: float, angles: Point, text: str) -> None:
        """Draw a turn from one angle to another, in degrees, its label outside."""
        sweep = np.radians(np.linspace(*angles, 60))
        around = np.stack([np.cos(sweep), np.sin(sweep)], axis=-1)
        self._turning(np.asarray(centre) + radius * around)
        middle = np.radians(sum(angles) / 2)
        beyond = (radius + 0.45) * np.array([np.cos(middle), np.sin(middle)])
        self.label(np.asarray(centre) + beyond, text)

    def _turning(self, points: FloatArray) -> None:
        """Draw a curve of shape (n, 2) with a head at its end: the sense of a turn."""
        self.line(points, 1.2)
        # From a few points back: over the last step alone the head would not know its direction.
        self.arrow(points[-6], points[-1], width=1.2)

    def mirror(
        self, centre: ArrayLike, length: float, degrees: float, style: str = "-"
    ) -> None:
        """Draw a mirror as a thick line."""
        ends = turned([[-length / 2, 0], [length / 2, 0]], degrees) + np.asarray(centre)
        (drawn,) = self.axes.plot(*ends.T, color=INK, linewidth=3, linestyle=style)
        drawn.set_solid_capstyle("butt")

    def lens(self, centre: ArrayLike, height: float, degrees: float = 0.0) -> None:
        """Draw a lens, its axis turned from the horizontal by some degrees."""
        t = np.linspace(-1, 1, 30)
        bulge = 0.12 * height * (1 - t**2)
        for side in (-1, 1):
            outline = np.stack([side * bulge, t * height / 2], axis=-1)
            self.line(turned(outline, degrees) + np.asarray(centre), 1.2)

    def key(self, looks: Sequence[Look], place: Point = (0.0, 1.0)) -> None:
        """Name the kinds of lines; the place of the upper left corner is in shares of the axes."""
        for look in looks:
            self.axes.plot(
                [], [], color=look.colour, linestyle=look.line, label=look.name
            )
        size = LEAST if self.narrow else SIZE
        self.axes.legend(
            loc="upper left", bbox_to_anchor=place, borderaxespad=0, fontsize=size
        )

    def triad(
        self,
        view: _View,
        origin: ArrayLike,
        directions: FloatArray,
        names: Sequence[str],
        *,
        look: Look = _INKED,
        width: float = 1.3,
    ) -> None:
        """Draw axes of a frame with their names."""
        start = view.point(origin)
        for direction, name in zip(directions, names, strict=True):
            end = view.point(np.asarray(origin) + direction)
            self.arrow(start, end, look, width=width)
            if name:
                away = (end - start) / np.hypot(*(end - start))
                # Beside an arrow that runs sideways, above or below one that runs up or down.
                side = (
                    "center"
                    if abs(away[0]) < 0.6
                    else "left"
                    if away[0] > 0
                    else "right"
                )
                gap = (0.36 if side == "center" else 0.16) * (
                    1.2 if self.narrow else 1.0
                )
                self.label(end + gap * away, name, ha=side)

    def sense(
        self,
        view: _View,
        origin: ArrayLike,
        axis: ArrayLike,
        start: ArrayLike,
        angle: float,
    ) -> None:
        """Draw the sense of a right-handed turn: the way of a vector that turns about an axis."""
        steps = np.linspace(0.0, angle, 60)[:, np.newaxis] * unit("axis", axis)
        moved = rotation_from_vector(steps) @ np.asarray(start)
        self._turning(view.point(np.asarray(origin) + moved))


def pair(figure: Figure, height: float, narrow: float, quantity: str) -> list[Axes]:
    """Return two panels that share the quantity shown, one below the other on a narrow page."""
    narrowed = sized(figure, 6.4, height, narrow)
    panels = list(figure.subplots(*((2, 1) if narrowed else (1, 2)), sharey=True))
    for axes in panels if narrowed else panels[:1]:
        axes.set_ylabel(quantity)
    return panels


def named_below(figure: Figure, columns: int) -> None:
    """Put the legend of the first panel below all, in half as many columns on a narrow page."""
    handles = figure.axes[0].get_legend_handles_labels()
    columns = (columns + 1) // 2 if thin(figure) else columns
    figure.legend(*handles, loc="outside lower center", ncols=columns)


def banded(
    axes: Axes,
    x: ArrayLike,
    ends: FloatArray,
    colour: str,
    line: str = "-",
    label: str = "",
) -> None:
    """Draw a median within the band of its low and high ends, of shape (3, n)."""
    band = axes.fill_between(
        x, ends[0], ends[2], facecolor=(colour, 0.2), edgecolor=colour
    )
    band.set(linewidth=0.6, linestyle=line)
    axes.plot(x, ends[1], line, color=colour, label=label)


def logarithmic(axes: Axes, x: Sequence[float], y: Sequence[float]) -> None:
    """Make both axes logarithmic, with these ticks alone, written as they are."""
    axes.set(xscale="log", yscale="log")
    axes.set_xticks(x, [f"{tick:g}" for tick in x])
    axes.set_yticks(y, [f"{tick:g}" for tick in y])
    axes.minorticks_off()


@dataclass(frozen=True, eq=False)
class _View:
    """A parallel projection onto the paper.

    Attributes
    ----------
    matrix : ndarray, shape (2, 3)
        To the right and upwards on the paper, as rows, in the frame that is seen.
    centre : tuple of float
        Where the origin of that frame lies on the paper.
    scale : float
        Units of the paper per unit of the frame.
    """

    matrix: FloatArray
    centre: Point = (0.0, 0.0)
    scale: float = 1.0

    def point(self, places: ArrayLike) -> FloatArray:
        """Return where places of shape (..., 3) lie on the paper, shape (..., 2)."""
        flat = np.asarray(places, dtype=np.float64) @ self.matrix.T
        return np.asarray(self.centre + self.scale * flat)


def seen_from(
    azimuth: float, elevation: float, centre: Point = (0.0, 0.0), scale: float = 1.0
) -> _View:
    """Return the view of somebody who stands far out in a direction, Z upwards.

    Examples
    --------
    From negative Y, X points to the right and Z upwards.

    >>> seen_from(-90.0, 0.0).matrix.round(12) + 0.0
    array([[1., 0., 0.],
           [0., 0., 1.]])
    """
    around, above = np.radians([azimuth, elevation])
    viewer = np.array(
        [np.cos(above) * np.cos(around), np.cos(above) * np.sin(around), np.sin(above)]
    )
    right = np.array([-np.sin(around), np.cos(around), 0.0])
    return _View(np.stack([right, np.cross(viewer, right)]), centre, scale)
