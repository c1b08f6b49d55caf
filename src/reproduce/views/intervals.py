"""Interval plots of posteriors: a strip for each quantity, and a panel for a correlated pair."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reproduce.papers.charts import is_narrow, set_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
# Bounds of the central 95 %, of the central 50 %, and the median.
_QUANTILES = (0.025, 0.25, 0.5, 0.75, 0.975)
# Correlation from which a pair has a panel, and draws that the panel shows at most.
_MIN_CORRELATION, _MAX_POINTS = 0.5, 400
_STRIP_INCHES, _PANEL_INCHES = 0.75, 3.2


def correlated_pair(
    draws: Mapping[str, FloatArray],
) -> tuple[tuple[str, ...], float]:
    """Return the most correlated pair and its correlation; no names if it is not worth a panel."""
    found = {
        pair: float(np.corrcoef(draws[pair[0]], draws[pair[1]])[0, 1])
        for pair in combinations(draws, 2)
    }
    pair = max(found, key=lambda pair: abs(found[pair]), default=None)
    if pair is None or abs(found[pair]) < _MIN_CORRELATION:
        return (), 0.0
    return pair, found[pair]


def draw_intervals(
    figure: Figure,
    draws: Mapping[str, FloatArray],
    labels: Mapping[str, str],
    marks: Mapping[str, float],
    exact: Mapping[str, FloatArray],
) -> None:
    """Draw median, 50 % and 95 % of each quantity, with marks and exact draws by name."""
    (pair, _), height = correlated_pair(draws), _STRIP_INCHES * len(draws)
    width, tall = (6.8, _PANEL_INCHES) if pair else (5.0, 0.0)
    set_size(figure, width, max(height, tall), height + tall)
    narrow = is_narrow(figure)
    parts = figure.subfigures(
        *((1, 1) if not pair else (2, 1) if narrow else (1, 2)),
        squeeze=False,
        height_ratios=[height, _PANEL_INCHES] if pair and narrow else None,
    )
    strips, panel = parts[0, 0], parts[-1, -1]
    rows = strips.subplots(len(draws), 1, squeeze=False)[:, 0]
    for axes, (name, values) in zip(rows, draws.items(), strict=True):
        if name in marks:
            axes.axvline(marks[name], color="C1", linestyle="--")
        _draw_interval(axes, values, 0.0, "C0")
        if name in exact:
            _draw_interval(axes, exact[name], -1.0, "C2")
        axes.set(yticks=[0.0], yticklabels=[labels[name]], ylim=(-1.6, 0.8))
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.locator_params(axis="x", nbins=4)
    if pair:
        axes, every = panel.subplots(), -(-len(draws[pair[0]]) // _MAX_POINTS)
        x, y = (draws[name][::every] for name in pair)
        axes.plot(x, y, "C0.", markersize=3, alpha=0.6)
        if marks.keys() >= {*pair}:
            axes.plot(*(marks[name] for name in pair), "C1D")
        axes.set(xlabel=labels[pair[0]], ylabel=labels[pair[1]])
        axes.locator_params(nbins=4)


def _draw_interval(axes: Axes, values: FloatArray, height: float, colour: str) -> None:
    """Draw the intervals and the median of draws."""
    low, lower, median, upper, high = np.quantile(values, _QUANTILES)
    axes.plot([low, high], [height] * 2, color=colour, linewidth=1.5)
    axes.plot([lower, upper], [height] * 2, color=colour, linewidth=5)
    axes.plot(median, height, "o", color=colour, markeredgecolor="w", markersize=7)
