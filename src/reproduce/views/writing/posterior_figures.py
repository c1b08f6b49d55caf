"""Figures of the posteriors: what they say, corner plots, traces, ranks.

Each is light, since a page carries several: few points, and coordinates to a hundredth of a point.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from reproduce.inference.calibration import Ranks, band
from reproduce.inference.model import Parameter
from reproduce.inference.posterior import Sampled
from reproduce.views.writing.figures import inline, styled, vector_of
from reproduce.views.writing.numbers import minus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["MOST", "Bar", "averaged", "bars", "corner", "density", "ranks", "traces"]

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
EDGES = 1.15
SMALL = 8.0  # points
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#777777"
DASHES: tuple[str | tuple[int, tuple[int, ...]], ...] = (
    "-", "--", "-.", ":", (0, (6, 2)), (0, (1, 4)), (0, (4, 1, 1, 1, 1, 1)), (0, (8, 3, 2, 3)),
)  # fmt: skip
_PATH = re.compile(r'\bd="[^"]*"')
_FONTS = re.compile(r"(font-family: 'DejaVu Sans')[^;\"]*")
_LONG = re.compile(r"(\.\d\d)\d+")
# Half-widths of an interval at which a mark beyond it stands, at the edge of its picture.
EDGE = 3.0


def _label(parameter: Parameter) -> str:
    return f"${parameter.label}$" + ("" if parameter.unit == "1" else f" ({parameter.unit})")


def _shown(figure: Figure, name: str, alternative: str, caption: str = "") -> str:
    """Return a drawn figure as HTML, its caption below."""
    drawn = vector_of(figure)
    short = _PATH.sub(lambda path: _LONG.sub(r"\1", path.group()), drawn.svg)
    short = _FONTS.sub(r"\1, sans-serif", short)
    below = Markup("<figcaption>{}</figcaption>").format(caption) if caption else ""
    return inline(drawn._replace(svg=short), f"figure-posterior-{name}", alternative, below)


def traces(posterior: Sampled, alternative: str, caption: str) -> str:
    """Draw the median of the walkers of every ensemble against its steps."""
    model = posterior.model
    stride = max(1, posterior.chain.shape[1] // TRACE_POINTS)
    chain = posterior.chain[:, ::stride]
    height = 1.1 * -(-model.dimension // 2) + 0.6
    with styled((7.0, height)) as figure:
        panels = figure.subplots(-(-model.dimension // 2), 2, sharex=True, squeeze=False).ravel()
        for i, (axes, parameter) in enumerate(zip(panels, model.parameters, strict=False)):
            values = chain[..., i] * parameter.shown
            steps = np.arange(values.shape[1]) * stride
            for ensemble in values:
                axes.plot(steps, np.median(ensemble, axis=1), linewidth=0.7)
            axes.set_ylabel(_label(parameter), fontsize=SMALL)
            axes.tick_params(labelsize=SMALL)
            axes.ticklabel_format(axis="y", useOffset=False)
            axes.locator_params(nbins=2)
            axes.grid(visible=False)
        for axes in panels[model.dimension :]:
            axes.set_axis_off()
        for axes in panels[max(0, model.dimension - 2) : model.dimension]:
            axes.set_xlabel("step", fontsize=SMALL)
    return _shown(figure, f"{model.name}-traces", alternative, caption)


def corner(
    posterior: Sampled,
    names: Sequence[str],
    marks: Mapping[str, float],
    alternative: str,
    caption: str,
    *,
    identifier: str = "corner",
) -> str:
    """Draw the corner plot of some parameters, with marks in SI units or px where there are any."""
    import corner as package

    model = posterior.model
    columns = [model.names.index(name) for name in names]
    chosen = [model.parameters[i] for i in columns]
    rows = posterior.draws[:, columns]
    rows = rows[np.linspace(0, len(rows) - 1, min(POINTS, len(rows))).astype(int)]
    scale = np.array([one.shown for one in chosen])
    marked = [marks[n] * s if n in marks else None for n, s in zip(names, scale, strict=True)]
    side = 1.3 * len(chosen) + 1.2
    alone = len(chosen) == 1
    with styled((4.5, 2.6) if alone else (side, side), alone) as figure:
        if alone:
            _histogram(figure, rows[:, 0] * scale[0], _label(chosen[0]), marked[0])
        else:
            package.corner(
                rows * scale,
                range=[_span(*pair) for pair in zip((rows * scale).T, marked, strict=True)],
                labels=[_label(one) for one in chosen],
                truths=marked, truth_color=ORANGE, color=BLUE, fig=figure, bins=20,
                smooth=1.0, levels=LEVELS, plot_datapoints=False, plot_density=False,
                no_fill_contours=True, max_n_ticks=3, label_kwargs={"fontsize": SMALL}, quiet=True,
            )  # fmt: skip
            for axes in figure.axes:
                _ticked(axes)
            figure.subplots_adjust(left=EDGES / side, bottom=EDGES / side, right=0.99, top=0.99)
    return _shown(figure, f"{model.name}-{identifier}", alternative, caption)


def _span(values: NDArray[np.float64], mark: float | None) -> tuple[float, float]:
    """Return the ends of an axis: nearly all draws, and the mark."""
    low, high = np.quantile(values, TAILS).tolist()
    beside = 0.05 * (high - low)
    return (low, high) if mark is None else (min(low, mark - beside), max(high, mark + beside))


def _ticked(axes: Axes) -> None:
    """Give a panel few ticks, none near its ends, and numbers as they are."""
    from matplotlib.ticker import FixedLocator, MaxNLocator, ScalarFormatter

    axes.tick_params(labelsize=SMALL)
    for axis in (axes.xaxis, axes.yaxis):
        if not isinstance(axis.get_major_locator(), MaxNLocator):
            continue
        low, high = axis.get_view_interval()
        ticks = np.asarray(MaxNLocator(3).tick_values(low, high))
        inside = np.abs(ticks - 0.5 * (low + high)) < 0.4 * (high - low)
        axis.set_major_locator(FixedLocator(ticks[inside].tolist()))
        if isinstance(formatter := axis.get_major_formatter(), ScalarFormatter):
            formatter.set_useOffset(False)
            formatter.set_scientific(False)
    axes.xaxis.set_label_coords(0.5, BELOW)
    axes.yaxis.set_label_coords(BELOW, 0.5)


def _histogram(figure: Figure, values: NDArray[np.float64], label: str, mark: float | None) -> None:
    axes = figure.subplots()
    axes.hist(values, bins=40, density=True, histtype="step", color=BLUE)
    if mark is not None:
        axes.axvline(mark, color=ORANGE, linestyle="--")
    axes.set(xlabel=label, ylabel="posterior density")


def density(posterior: Sampled, name: str, mark: float, alternative: str, caption: str) -> str:
    """Draw the posterior of one parameter beside a mark in SI units or px."""
    column = posterior.model.names.index(name)
    one = posterior.model.parameters[column]
    with styled((5.6, 2.6)) as figure:
        _histogram(figure, posterior.draws[:, column] * one.shown, _label(one), mark * one.shown)
    return _shown(figure, f"{posterior.model.name}-density", alternative, caption)


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


def bars(rows: Sequence[Bar], alternative: str, caption: str) -> str:
    """Draw intervals scaled to one width, with the truth and the print against them."""
    with styled((6.4, 0.3 * len(rows) + 1.2)) as figure:
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
        axes.set_yticks(range(len(rows)), [row.label for row in rows], fontsize=9)
        axes.set(xlim=(-EDGE - 1.2, EDGE + 1.2), ylim=(len(rows) - 0.4, -0.6))
        axes.set_xlabel("distance from the middle of the interval (half-widths)")
        axes.grid(axis="y", visible=False)
        figure.legend(loc="outside lower center", fontsize=9, ncols=3)
    return _shown(figure, "all", alternative, caption)


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


def averaged(
    counts: NDArray[np.float64],
    bands: Mapping[str, NDArray[np.float64]],
    printed: Mapping[str, NDArray[np.float64]],
    alternative: str,
    caption: str,
) -> str:
    """Draw errors against the number of frames averaged, as printed and as the posterior has them.

    `bands` hold rows of low, median and high, (3, n), at the counts; `printed` holds rows of
    numbers of frames, errors and half the last digits; both by column, in arcsec.
    """
    with styled((6.4, 3.6)) as figure:
        panels = figure.subplots(1, len(bands), sharex=True, sharey=True, squeeze=False)[0]
        for axes, (name, (low, median, high)) in zip(panels, bands.items(), strict=True):
            axes.fill_between(counts, low, high, color=BLUE, alpha=0.25, label="95 %")
            axes.plot(counts, median, color=BLUE, label="median")
            axes.plot(counts, median[0] / np.sqrt(counts), "--", color=GREY, label="white noise")
            frames, errors, half = printed[name]
            axes.errorbar(frames, errors, yerr=half, fmt="o", color=ORANGE, markersize=4,
                          label="Table IV")  # fmt: skip
            axes.set(xscale="log", yscale="log", title=name, xlabel="frames averaged (count)")
            axes.set_xticks((1, 10, 100, 1000), ("1", "10", "100", "1000"))
        panels[0].set_ylabel("error, three sigma (arcsec)")
        panels[0].set_yticks((0.05, 0.1, 0.2, 0.5, 1.0), ("0.05", "0.1", "0.2", "0.5", "1"))
        panels[0].minorticks_off()
        panels[-1].legend(fontsize=9)
    return _shown(figure, "averaging", alternative, caption)


def ranks(stored: Ranks, name: str, alternative: str, caption: str) -> str:
    """Draw cumulated ranks, less what even ranks give, against the band of one curve."""
    counts, total = stored.counts(), stored.replicates
    low, high = band(total)
    even = np.arange(1, counts.shape[1] + 1) / counts.shape[1]
    with styled((6.4, 4.4)) as figure:
        axes = figure.subplots()
        ends = low / total - even, high / total - even
        axes.fill_between(even, *ends, facecolor=(GREY, 0.15), edgecolor=GREY,
                          label="95 %: one whole curve", step="mid")  # fmt: skip
        # Colours come round after seven lines, dashes after eight.
        for row, label, dashes in zip(counts, stored.names, cycle(DASHES), strict=False):
            axes.plot(even, row / total - even, linestyle=dashes, linewidth=1.1, label=label)
        axes.set(xlabel="rank / number of draws", ylabel="share of ranks, less even")
        figure.legend(loc="outside lower center", fontsize=SMALL, ncols=3)
    return _shown(figure, f"{name}-ranks", alternative, caption)
