"""Figures of the posteriors: what they say, corner plots, traces, ranks; few points each."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reproduce.inference import Parameter, Sampled
from reproduce.papers.sketch import again, sized, thin
from reproduce.views.objects.figure import Picture
from reproduce.views.writing.numbers import minus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# More draws than this do not change the contours, nor more points a trace.
POINTS, TRACE_POINTS = 10_000, 45
# Parameters of a corner plot: with more its labels could not be read.
MOST = 5
# Probability inside the contours.
LEVELS = (0.5, 0.95)
# What of the draws an axis leaves out on either side.
TAILS = (0.002, 0.998)
# In panels of a corner plot: so far below, a label clears ticks of seven digits, as of a scale.
BELOW = -0.6
# Room for ticks and labels of a corner plot, in inches.
EDGES = 1.1
SMALL = 8.0  # points
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#777777"
# How both kinds of corner plot draw contours.
CONTOURS: dict[str, Any] = {
    "bins": 20, "smooth": 1.0, "levels": LEVELS, "color": BLUE, "plot_datapoints": False,
    "plot_density": False, "no_fill_contours": True,
}  # fmt: skip
DASHES: tuple[str | tuple[int, tuple[int, ...]], ...] = (
    "-", "--", "-.", ":", (0, (6, 2)), (0, (1, 4)), (0, (4, 1, 1, 1, 1, 1)), (0, (8, 3, 2, 3)),
)  # fmt: skip
# Half-widths of an interval at which a mark beyond it stands, at the edge of its picture.
EDGE = 3.0


def _label(parameter: Parameter) -> str:
    return f"${parameter.label}$" + ("" if parameter.unit == "1" else f" ({parameter.unit})")


def traces(posterior: Sampled) -> Picture:
    """Draw the median of the walkers of every ensemble against its steps."""
    model = posterior.model
    stride = max(1, posterior.chain.shape[1] // TRACE_POINTS)
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
            axes.set_ylabel(_label(parameter), fontsize=SMALL)
            axes.tick_params(labelsize=SMALL)
            axes.ticklabel_format(axis="y", useOffset=False)
            axes.locator_params(nbins=2)
            axes.grid(visible=False)
        for axes in panels[model.dimension :]:
            axes.set_axis_off()
        for axes in panels[max(0, model.dimension - columns) : model.dimension]:
            axes.set_xlabel("step", fontsize=SMALL)

    shown = medians * [one.shown for one in model.parameters]
    numbers = pd.DataFrame(shown.reshape(-1, model.dimension), columns=list(model.names))
    numbers.insert(0, "step", np.tile(steps, len(shown)))
    numbers.insert(0, "ensemble", np.repeat(np.arange(1, len(shown) + 1), len(steps)))
    return Picture(f"posterior-{model.name}-traces", paint, numbers)


def corner(posterior: Sampled, names: Sequence[str], marks: Mapping[str, float]) -> Picture:
    """Draw the corner plot of some parameters, with marks in SI units or px where there are any.

    A narrow page has the histograms one below the other, and beside each the parameter that it is
    correlated with most.
    """
    model = posterior.model
    columns = [model.names.index(name) for name in names]
    chosen = [model.parameters[i] for i in columns]
    rows = posterior.draws[:, columns]
    rows = rows[np.linspace(0, len(rows) - 1, min(POINTS, len(rows))).astype(int)]
    values = rows * [one.shown for one in chosen]
    marked = [marks[n] * one.shown if n in marks else None
              for n, one in zip(names, chosen, strict=True)]  # fmt: skip

    def paint(figure: Figure) -> None:
        if len(chosen) == 1:
            sized(figure, 4.5, 2.6)
            _histogram(figure, values[:, 0], _label(chosen[0]), marked[0])
        elif thin(figure):
            _pairs(figure, values, [_label(one) for one in chosen], marked)
        else:
            _corner(figure, values, [_label(one) for one in chosen], marked)

    return Picture(
        f"posterior-{model.name}-corner", paint, pd.DataFrame(values, columns=list(names))
    )


def _corner(
    figure: Figure,
    values: NDArray[np.float64],
    labels: Sequence[str],
    marked: Sequence[float | None],
) -> None:
    import corner as package

    side = min(6.8, 1.3 * len(labels) + 1.2)
    figure.set_layout_engine(None)
    figure.set_size_inches(side, side)
    package.corner(
        values,
        range=[_span(*pair) for pair in zip(values.T, marked, strict=True)],
        labels=list(labels),
        truths=list(marked),
        truth_color=ORANGE,
        fig=figure,
        max_n_ticks=3,
        label_kwargs={"fontsize": SMALL},
        quiet=True,
        **CONTOURS,
    )
    for axes in figure.axes:
        _ticked(axes)
    figure.subplots_adjust(left=EDGES / side, bottom=EDGES / side, right=0.99, top=0.99)


def _pairs(
    figure: Figure,
    values: NDArray[np.float64],
    labels: Sequence[str],
    marked: Sequence[float | None],
) -> None:
    """Draw a row for each parameter: its histogram, and contours with its closest partner."""
    import corner as package

    related = np.abs(np.corrcoef(values.T)) - 2 * np.eye(len(labels))
    spans = [_span(*pair) for pair in zip(values.T, marked, strict=True)]
    sized(figure, 6.8, 1.6 * len(labels))
    for row, panels in enumerate(figure.subplots(len(labels), 2)):
        other = int(related[row].argmax())
        left, right = panels
        left.hist(values[:, row], bins=20, range=spans[row], histtype="step", color=BLUE)
        package.hist2d(
            values[:, row],
            values[:, other],
            ax=right,
            range=[spans[row], spans[other]],
            **CONTOURS,
        )
        for axes in panels:
            axes.set_xlabel(labels[row], fontsize=SMALL)
            axes.grid(visible=False)
            if marked[row] is not None:
                axes.axvline(marked[row], color=ORANGE, linewidth=1)
        if marked[other] is not None:
            right.axhline(marked[other], color=ORANGE, linewidth=1)
        left.set(yticks=[], xlim=spans[row])
        right.set_ylabel(labels[other], fontsize=SMALL)
        for axes in panels:
            _ticked(axes, 2, placed=False)


def _span(values: NDArray[np.float64], mark: float | None) -> tuple[float, float]:
    """Return the ends of an axis: nearly all draws, and the mark."""
    low, high = np.quantile(values, TAILS).tolist()
    beside = 0.05 * (high - low)
    return (low, high) if mark is None else (min(low, mark - beside), max(high, mark + beside))


def _ticked(axes: Axes, count: int = 3, *, placed: bool = True) -> None:
    """Give a panel few ticks, none near its ends, and numbers as they are."""
    from matplotlib.ticker import FixedLocator, MaxNLocator, ScalarFormatter

    axes.tick_params(labelsize=SMALL)
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
    if placed:
        axes.xaxis.set_label_coords(0.5, BELOW)
        axes.yaxis.set_label_coords(BELOW, 0.5)


def _histogram(figure: Figure, values: NDArray[np.float64], label: str, mark: float | None) -> None:
    axes = figure.subplots()
    axes.hist(values, bins=40, density=True, histtype="step", color=BLUE)
    if mark is not None:
        axes.axvline(mark, color=ORANGE, linestyle="--")
    axes.set(xlabel=label, ylabel="posterior density")


@dataclass(frozen=True)
class Bar:
    """One bar of `bars`.

    - `label`: what it is.
    - `low`, `mean`, `high`: mean and ends of the central 95 %.
    - `truth`, `printed`: marks beside it, in the same unit; None where there is none.
    - `half`: half the last printed digit.
    """

    label: str
    low: float
    mean: float
    high: float
    truth: float | None
    printed: float | None
    half: float


def bars(rows: Sequence[Bar]) -> Picture:
    """Draw intervals scaled to one width, with the truth and the print against them."""

    def paint(figure: Figure) -> None:
        narrow = sized(figure, 6.4, 0.3 * len(rows) + 1.2, 0.42 * len(rows) + 1.6)
        axes = figure.subplots()
        axes.axvspan(-1, 1, color=BLUE, alpha=0.12)
        for place, row in enumerate(rows):
            middle, width = 0.5 * (row.low + row.high), 0.5 * (row.high - row.low)
            axes.plot((-1, 1), (place, place), color=BLUE, linewidth=3)
            axes.plot((row.mean - middle) / width, place, "|", color=BLUE, markersize=11)
            if row.truth is not None:
                axes.plot((row.truth - middle) / width, place, "D", color=ORANGE, markersize=6)
            if row.printed is not None:
                _against(axes, (row.printed - middle) / width, row.half / width, place)
        for style, colour, label in (
            ("-", BLUE, "95 % of the posterior"),
            ("D", ORANGE, "truth of our simulation"),
            ("o", "#000000", "print, with its rounding"),
        ):
            axes.plot([], [], style, color=colour, label=label)
        # What a quantity is, in lines that leave room for its bar.
        labels = [textwrap.fill(row.label, 20) if narrow else row.label for row in rows]
        axes.set_yticks(range(len(rows)), labels, fontsize=8 if narrow else 9)
        beside = 2.2 if narrow else 1.2  # room for the distances
        axes.set(xlim=(-EDGE - beside, EDGE + beside), ylim=(len(rows) - 0.4, -0.6))
        axes.set_xlabel("from the middle of the interval" + "\n" * narrow + " (half-widths)")
        axes.grid(axis="y", visible=False)
        columns = 1 if narrow else 3
        figure.legend(loc="outside lower center", fontsize=9, ncols=columns)

    return Picture("posterior-all", paint, pd.DataFrame(list(map(vars, rows))))


def _against(axes: Axes, place: float, half: float, row: int) -> None:
    """Mark a print with its rounding, or an arrow at the edge with its distance."""
    if abs(place) <= EDGE:
        reach = np.clip((place - half, place + half), -EDGE, EDGE)
        axes.plot(reach, (row, row), color="#000000", linewidth=1)
        axes.plot(place, row, "o", color="#000000")
        return
    side = np.sign(place)
    axes.plot(side * EDGE, row, ">" if side > 0 else "<", color="#000000", markersize=6)
    text = minus(f"{place:.0f}")
    axes.text(side * (EDGE + 0.15), row, text, fontsize=8.5, va="center",
              ha="left" if side > 0 else "right")  # fmt: skip


def edge_errors(
    counts: NDArray[np.float64],
    curves: Mapping[str, NDArray[np.float64]],
    count: float,
    marks: Mapping[str, NDArray[np.float64]],
    arcsec_per_px: float,
) -> Picture:
    """Draw errors at the edge of the field against stars, and those that were sampled, in px.

    `curves` hold rows of low, median and high, (3, n), at the counts; `marks` the same at `count`.
    """
    looks = dict(zip(curves, ((BLUE, "-", "o", 0.97), (ORANGE, "--", "s", 1.03)), strict=True))

    def paint(figure: Figure) -> None:
        narrow = sized(figure, 6.0, 3.6, 4.2)
        axes = figure.subplots()
        for name, (colour, line, marker, aside) in looks.items():
            low, median, high = curves[name]
            axes.fill_between(counts, low, high, facecolor=(colour, 0.12), edgecolor=colour,
                              linestyle=line, linewidth=0.7)  # fmt: skip
            axes.plot(counts, median, line, color=colour, label=f"{name}, with 95 %")
            start, middle, end = marks[name]
            axes.errorbar(count * aside, middle, [[middle - start], [end - middle]], fmt=marker,
                          color=colour, capsize=3, label=f"{name}, emcee")  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel="stars of the calibration (count)",
                 ylabel="error at the edge (px)")  # fmt: skip
        axes.set_xticks((10, 30, 100, 300, 1000), ("10", "30", "100", "300", "1000"))
        axes.set_yticks((0.001, 0.01, 0.1), ("0.001", "0.01", "0.1"))
        axes.minorticks_off()
        again(axes, "y", "as an angle (arcsec)", arcsec_per_px)
        figure.legend(loc="outside lower center", ncols=1 if narrow else 2)

    rows = [
        pd.DataFrame({"model": name, "stars": counts, "low": low, "median": middle, "high": high})
        for name, (low, middle, high) in curves.items()
    ]
    return Picture("posterior-stars", paint, pd.concat(rows))
