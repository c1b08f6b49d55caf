"""Pieces of the graphs of both papers: looks without colour, panels, legends, bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colour that follows the text of the page.
INK = "#000000"
# Inches that a phone of 390 CSS pixels shows in full.
NARROW = 3.7


@dataclass(frozen=True)
class Look:
    """Appearance of one kind of thing: colour, line and marker all differ."""

    name: str
    colour: str
    line: str
    marker: str = "o"


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
