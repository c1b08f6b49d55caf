"""Pieces of the graphs of both papers: sizes, panels, legends, bands, logarithmic axes.

Colours are those of the cycle in ``views/figures.mplstyle``, ``C0`` to ``C6``. Black (``k``)
follows the text of the page.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from reproduce.papers.declare import Result
from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure

# Only a computation that draws loads matplotlib.
Axes: TypeAlias = "matplotlib.axes.Axes"
Figure: TypeAlias = "matplotlib.figure.Figure"
# Width in inches that a phone of 390 CSS pixels shows in full.
NARROW = 3.7
# Ends of the central 99 % and of the central 95 %, with the median.
_CENTRAL = (0.005, 0.5, 0.995)
LEVELS = (0.025, 0.5, 0.975)


def _is_narrow(figure: Figure) -> bool:
    """Return whether a figure is drawn for a narrow page."""
    return figure.get_figwidth() <= NARROW


def set_size(
    figure: Figure, height: float, narrow: float | None = None, width: float = 6.4
) -> bool:
    """Set the size in inches, with another height on a narrow page; return whether it is narrow."""
    if narrowed := _is_narrow(figure):
        width, height = NARROW, narrow or height
    figure.set_size_inches(width, height)
    return narrowed


def two_panels(figure: Figure, height: float, narrow: float, label: str) -> list[Axes]:
    """Return two panels with one vertical scale, below each other on a narrow page."""
    shape = (2, 1) if set_size(figure, height, narrow) else (1, 2)
    panels = list(figure.subplots(*shape, sharey=True))
    for axes in panels[: shape[0]]:
        axes.set_ylabel(label)
    return panels


def legend_below(figure: Figure, columns: int) -> None:
    """Put the legend of the first panel below all, in half as many columns on a narrow page."""
    handles = figure.axes[0].get_legend_handles_labels()
    columns = (columns + 1) // 2 if _is_narrow(figure) else columns
    figure.legend(*handles, loc="outside lower center", ncols=columns)


def plot_band(
    axes: Axes, x: ArrayLike, ends: FloatArray, look: str, label: str
) -> None:
    """Draw a median within a band; `ends` are its low end, the median, its high end, (3, n)."""
    [median] = axes.plot(x, ends[1], look, label=label)
    edge = median.get_color()
    axes.fill_between(
        x,
        *ends[::2],
        facecolor=(edge, 0.2),
        edgecolor=edge,
        linewidth=0.6,
        linestyle=median.get_linestyle(),
    )


def central_range(results: Iterable[Result]) -> FloatArray:
    """Return low end, median and high end of the central 99 % of n predictions, (3, n)."""
    return np.quantile([*results], _CENTRAL, axis=-1)


def plot_range(
    axes: Axes,
    y: ArrayLike,
    results: Iterable[Result],
    look: str,
    label: str = "",
    unit: float = 1.0,
) -> FloatArray:
    """Draw medians and central 99 % of n predictions along x; return them, shape (3, n)."""
    ends = central_range(results) / unit
    sides = np.abs(ends[::2] - ends[1])
    axes.errorbar(ends[1], y, xerr=sides, fmt=look, capsize=4, lw=2.5, label=label)
    return ends


def set_log_ticks(axes: Axes, x: Iterable[float], y: Iterable[float]) -> None:
    """Make both axes logarithmic with the given ticks only."""
    axes.set(xscale="log", yscale="log", xticks=[*x], yticks=[*y])
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    axes.minorticks_off()
