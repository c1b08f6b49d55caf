"""Figures of one posterior: its corner plot and its traces; few points each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reproduce.inference import Parameter, Sampled
from reproduce.papers.sketch import sized, thin
from reproduce.views.figure import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Values = NDArray[np.float64]
_Marks = list[float | None]
# More draws than this do not change the contours, nor more points a trace.
_POINTS, _TRACE_POINTS = 10_000, 45
# Parameters of a corner plot: with more its labels could not be read.
MOST = 5
# What of the draws an axis leaves out on either side.
_TAILS = (0.002, 0.998)
# In panels of a corner plot: so far below, a label clears ticks of seven digits, as of a scale.
_BELOW = -0.6
# Room for ticks and labels of a corner plot, in inches.
_EDGES = 1.1
_SMALL = 8.0  # points
_BLUE, _ORANGE = "#0072B2", "#D55E00"


def _label(parameter: Parameter) -> str:
    return f"${parameter.label}$" + ("" if parameter.unit == "1" else f" ({parameter.unit})")


def traces(posterior: Sampled) -> Picture:
    """Draw the median of the walkers of every ensemble against its steps."""
    model = posterior.model
    stride = max(1, posterior.chain.shape[1] // _TRACE_POINTS)
    medians = np.median(posterior.chain[:, ::stride], axis=2)
    steps = np.arange(medians.shape[1]) * stride

    def paint(figure: Figure) -> None:
        columns = 1 if thin(figure) else 2
        rows = -(-model.dimension // columns)
        sized(figure, 6.8, 1.1 * rows + 0.6, 0.9 * rows + 0.6)
        panels = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
        for i, (axes, parameter) in enumerate(zip(panels, model.parameters, strict=False)):
            for ensemble in medians[..., i] * parameter.shown:
                axes.plot(steps, ensemble, linewidth=0.7)
            axes.set_ylabel(_label(parameter), fontsize=_SMALL)
            axes.tick_params(labelsize=_SMALL)
            axes.ticklabel_format(axis="y", useOffset=False)
            axes.locator_params(nbins=2)
            axes.grid(visible=False)
        for axes in panels[model.dimension :]:
            axes.set_axis_off()
        for axes in panels[max(0, model.dimension - columns) : model.dimension]:
            axes.set_xlabel("step", fontsize=_SMALL)

    shown = medians * [one.shown for one in model.parameters]
    numbers = pd.DataFrame(shown.reshape(-1, model.dimension), columns=list(model.names))
    numbers.insert(0, "step", np.tile(steps, len(shown)))
    numbers.insert(0, "ensemble", np.repeat(np.arange(1, len(shown) + 1), len(steps)))
    return Picture(f"posterior-{model.name}-traces", paint, numbers)


def corner(posterior: Sampled, names: Sequence[str], marks: Mapping[str, float]) -> Picture:
    """Draw the corner plot of some parameters, with marks in the unit shown where there are any.

    One parameter, and a narrow page, have histograms alone.
    """
    model = posterior.model
    columns = [model.names.index(name) for name in names]
    chosen = [model.parameters[i] for i in columns]
    rows = posterior.draws[:, columns]
    rows = rows[np.linspace(0, len(rows) - 1, min(_POINTS, len(rows))).astype(int)]
    values = rows * [one.shown for one in chosen]
    marked = [marks.get(name) for name in names]

    def paint(figure: Figure) -> None:
        draw = _histograms if len(chosen) == 1 or thin(figure) else _corner
        draw(figure, values, [_label(one) for one in chosen], marked)

    numbers = pd.DataFrame(values, columns=list(names))
    return Picture(f"posterior-{model.name}-corner", paint, numbers)


def _corner(figure: Figure, values: _Values, labels: list[str], marked: _Marks) -> None:
    import corner as package

    side = min(6.8, 1.3 * len(labels) + 1.2)
    figure.set_layout_engine(None)
    figure.set_size_inches(side, side)
    package.corner(
        values, range=[_span(*pair) for pair in zip(values.T, marked, strict=True)],
        labels=labels, label_kwargs={"fontsize": _SMALL}, max_n_ticks=3, fig=figure,
        truths=marked, truth_color=_ORANGE, quiet=True,
        color=_BLUE, bins=20, smooth=1.0, levels=(0.5, 0.95),
        plot_datapoints=False, plot_density=False, no_fill_contours=True,
    )  # fmt: skip
    for axes in figure.axes:
        _ticked(axes)
        axes.xaxis.set_label_coords(0.5, _BELOW)
        axes.yaxis.set_label_coords(_BELOW, 0.5)
    figure.subplots_adjust(left=_EDGES / side, bottom=_EDGES / side, right=0.99, top=0.99)


def _histograms(figure: Figure, values: _Values, labels: list[str], marked: _Marks) -> None:
    sized(figure, 4.5, 2.6, 1.5 * len(labels))
    panels = figure.subplots(len(labels), squeeze=False).ravel()
    for axes, column, label, mark in zip(panels, values.T, labels, marked, strict=True):
        span = _span(column, mark)
        axes.hist(column, bins=40, range=span, histtype="step", color=_BLUE)
        if mark is not None:
            axes.axvline(mark, color=_ORANGE, linewidth=1)
        axes.set_xlabel(label, fontsize=_SMALL)
        axes.set(yticks=[], xlim=span)
        axes.grid(visible=False)
        _ticked(axes)


def _span(values: _Values, mark: float | None) -> tuple[float, float]:
    """Return the ends of an axis: nearly all draws, and the mark."""
    low, high = np.quantile(values, _TAILS).tolist()
    beside = 0.05 * (high - low)
    return (low, high) if mark is None else (min(low, mark - beside), max(high, mark + beside))


def _ticked(axes: Axes, count: int = 3) -> None:
    """Give a panel few ticks, none near its ends, and numbers as they are."""
    from matplotlib.ticker import FixedLocator, MaxNLocator, ScalarFormatter

    axes.tick_params(labelsize=_SMALL)
    for axis in (axes.xaxis, axes.yaxis):
        if not isinstance(axis.get_major_locator(), MaxNLocator):
            continue
        low, high = axis.get_view_interval()
        ticks = np.asarray(MaxNLocator(count).tick_values(low, high))
        inside = np.abs(ticks - 0.5 * (low + high)) < 0.4 * (high - low)
        axis.set_major_locator(FixedLocator(ticks[inside].tolist()))
        if isinstance(formatter := axis.get_major_formatter(), ScalarFormatter):
            formatter.set_useOffset(False)
            formatter.set_scientific(False)
