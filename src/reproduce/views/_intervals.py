"""Interval plots of posteriors: a strip for each quantity, and a panel for a correlated pair."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np

from reproduce.inference import Quantity
from reproduce.papers.charts import Axes, Figure, set_size
from reproduce.physics.validate import FloatArray

# Draws of quantities by their names.
_Draws = Mapping[str, Quantity]
# Correlation from which a pair has a panel, and draws that the panel shows at most.
_MIN_CORRELATION, _MAX_POINTS = 0.5, 400
# Largest number of draws that a density uses.
_MAX_DENSITY_DRAWS = 5000
_WIDTH_INCHES, _STRIP_INCHES, _PANEL_INCHES = 5.0, 0.75, 3.2


def correlated_pair(draws: _Draws) -> tuple[tuple[str, ...], float]:
    """Return the most correlated pair and its correlation; no names if it is not worth a panel."""
    found = (
        (np.corrcoef(draws[pair[0]].values, draws[pair[1]].values)[0, 1], pair)
        for pair in combinations(draws, 2)
    )
    value, pair = max(found, key=lambda one: abs(one[0]), default=(0.0, ()))
    return (pair, value) if abs(value) >= _MIN_CORRELATION else ((), 0.0)


def draw_intervals(
    figure: Figure,
    draws: _Draws,
    labels: Mapping[str, str],
    marks: Mapping[str, float],
    exact: _Draws,
    pair: tuple[str, ...],
) -> None:
    """Draw density, median, 50 % and 95 % of each quantity, and below them the panel of a pair.

    Marks and exact draws are given by the name of the quantity.
    """
    heights = [_STRIP_INCHES] * len(draws) + [_PANEL_INCHES] * bool(pair)
    set_size(figure, sum(heights), width=_WIDTH_INCHES)
    panels = figure.subplots(len(heights), squeeze=False, height_ratios=heights).flat
    for axes, (name, one) in zip(panels, draws.items(), strict=False):
        if name in marks:
            axes.axvline(marks[name], color="C1", linestyle="--")
        _draw_interval(axes, one.values, 0.0, "C0")
        if name in exact:
            _draw_interval(axes, exact[name].values, -1.0, "C2")
        axes.set(yticks=[0.0], yticklabels=[labels[name]], ylim=(-1.6, 0.8))
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.locator_params(axis="x", nbins=4)
    if pair:
        axes = panels[-1]
        values = np.stack([draws[name].values for name in pair])
        every = -(-values.shape[1] // _MAX_POINTS)
        axes.plot(*values[:, ::every], "C0.", markersize=3, alpha=0.6)
        if marks.keys() >= {*pair}:
            axes.plot(*(marks[name] for name in pair), "C1D")
        axes.set(xlabel=labels[pair[0]], ylabel=labels[pair[1]])
        axes.locator_params(nbins=4)


def _draw_interval(axes: Axes, values: FloatArray, height: float, colour: str) -> None:
    """Draw the density, the intervals and the median of draws."""
    bodies: Any = axes.violinplot(
        values[:: -(-len(values) // _MAX_DENSITY_DRAWS)],
        [height],
        orientation="horizontal",
        widths=1.2,
        showextrema=False,
        side="high",
    )["bodies"]
    bodies[0].set(facecolor=colour, edgecolor="none", alpha=0.2)
    axes.boxplot(
        values,
        positions=[height],
        orientation="horizontal",
        whis=(2.5, 97.5),
        widths=0.3,
        showcaps=False,
        showfliers=False,
        manage_ticks=False,
        patch_artist=True,
        boxprops={"facecolor": colour, "edgecolor": colour},
        whiskerprops={"color": colour},
        medianprops={"color": "w"},
    )
