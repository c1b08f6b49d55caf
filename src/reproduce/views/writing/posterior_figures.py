"""Figures of the posteriors: traces, corner plots, ranks."""

from __future__ import annotations

from itertools import cycle

import numpy as np

from reproduce.inference.calibration import Ranks, band
from reproduce.inference.model import Parameter
from reproduce.inference.posterior import Sampled
from reproduce.views.writing.figures import inline, styled

__all__ = ["corner", "ranks", "traces"]

# More draws than this do not change the contours.
POINTS = 10_000
TRACE_POINTS = 150
# In panels of a corner plot: so far below, a label clears ticks of five digits, as of a scale.
BELOW = -0.42
DASHES: tuple[str | tuple[int, tuple[int, ...]], ...] = (
    "-", "--", "-.", ":", (0, (6, 2)), (0, (1, 4)), (0, (4, 1, 1, 1, 1, 1)), (0, (8, 3, 2, 3)),
)  # fmt: skip


def _label(parameter: Parameter) -> str:
    return f"${parameter.label}$" + ("" if parameter.unit == "1" else f" ({parameter.unit})")


def traces(posterior: Sampled, alternative: str) -> str:
    """Draw the median and the central half of every ensemble against its steps."""
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
            axes.set_ylabel(_label(parameter), fontsize=8)
            axes.ticklabel_format(axis="y", useOffset=False)
        for axes in panels[model.dimension :]:
            axes.set_axis_off()
        for axes in panels[max(0, model.dimension - 2) : model.dimension]:
            axes.set_xlabel("step (median of the walkers)")
    return inline(figure, f"figure-posterior-{model.name}-traces", alternative)


def corner(posterior: Sampled, alternative: str) -> str:
    """Draw the corner plot, with the point estimate where there is one."""
    import corner as package

    model = posterior.model
    rows = posterior.draws
    rows = rows[np.linspace(0, len(rows) - 1, min(POINTS, len(rows))).astype(int)]
    scale = np.array([p.shown for p in model.parameters])
    truths = [model.estimate.get(name, np.nan) for name in model.names]
    marked = [None if np.isnan(t) else t * s for t, s in zip(truths, scale, strict=True)]
    side = 1.25 * model.dimension + 1.2
    alone = model.dimension == 1
    with styled((4.0, 2.6) if alone else (side, side), alone) as figure:
        if alone:
            axes = figure.subplots()
            axes.hist(rows[:, 0] * scale[0], bins=40, density=True, histtype="step")
            if marked[0] is not None:
                axes.axvline(marked[0], color="#D55E00", linestyle="--")
            axes.set(xlabel=_label(model.parameters[0]), ylabel="posterior density")
        else:
            package.corner(
                rows * scale,
                labels=[_label(p) for p in model.parameters],
                truths=marked, truth_color="#D55E00", color="#0072B2", fig=figure, bins=24,
                plot_datapoints=False, plot_density=False, no_fill_contours=True, max_n_ticks=3,
                label_kwargs={"fontsize": 8}, quiet=True,
            )  # fmt: skip
            for axes in figure.axes:
                axes.tick_params(labelsize=7)
                axes.xaxis.set_label_coords(0.5, BELOW)
    return inline(figure, f"figure-posterior-{model.name}-corner", alternative)


def ranks(stored: Ranks, name: str, alternative: str) -> str:
    """Draw cumulated ranks, less what even ranks give, against the band of one curve."""
    counts, total = stored.counts(), stored.replicates
    low, high = band(total)
    even = np.arange(1, counts.shape[1] + 1) / counts.shape[1]
    with styled((6.4, 4.4)) as figure:
        axes = figure.subplots()
        ends = low / total - even, high / total - even
        axes.fill_between(even, *ends, facecolor=("#777777", 0.15), edgecolor="#777777",
                          label="95 %: one whole curve", step="mid")  # fmt: skip
        # Colours come round after seven lines, dashes after eight.
        for row, label, dashes in zip(counts, stored.names, cycle(DASHES), strict=False):
            axes.plot(even, row / total - even, linestyle=dashes, linewidth=1.1, label=label)
        axes.set(xlabel="rank / number of draws", ylabel="share of ranks, less even")
        figure.legend(loc="outside lower center", fontsize=8, ncols=3)
    return inline(figure, f"figure-posterior-{name}-ranks", alternative)
