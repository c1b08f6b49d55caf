"""Corner plots of posteriors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from reproduce.inference import PosteriorSamples
from reproduce.papers.charts import NARROW, is_narrow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# With more parameters the labels could not be read.
MAX_PARAMETERS = 5
# More draws than this do not change the contours.
_MAX_POINTS = 10_000
# Fraction of the draws between the ends of an axis.
_CENTRAL_FRACTION = 0.996
# Room for ticks and labels, and distance of a label from its axis, in inches.
_EDGE_INCHES, _LABEL_INCHES = 1.1, 0.68
_FONT_POINTS = 8.0
_BLUE, _ORANGE = "#0072B2", "#D55E00"


def draw_corner(
    figure: Figure,
    posterior: PosteriorSamples,
    names: Sequence[str],
    marks: Mapping[str, float],
) -> None:
    """Draw the corner plot of some parameters, with marks in the displayed unit."""
    import corner

    columns = [posterior.model.names.index(name) for name in names]
    chosen = [posterior.model.parameters[i] for i in columns]
    draws = posterior.draws[:: -(-len(posterior.draws) // _MAX_POINTS), columns]
    values, count = draws * [parameter.shown for parameter in chosen], len(chosen)
    side = NARROW if is_narrow(figure) else min(6.8, 1.3 * count + 1.2)
    figure.set_layout_engine(None)
    figure.set_size_inches(side, side)
    corner.corner(
        values,
        range=[_CENTRAL_FRACTION] * count,
        fig=figure,
        labels=[
            f"${parameter.label}$\n({parameter.shown_unit.strip()})"
            if parameter.shown_unit
            else f"${parameter.label}$"
            for parameter in chosen
        ],
        label_kwargs={"fontsize": _FONT_POINTS},
        max_n_ticks=3,
        truths=[marks.get(name) for name in names],
        truth_color=_ORANGE,
        quiet=True,
        color=_BLUE,
        bins=20,
        smooth=1.0,
        levels=(0.5, 0.95),
        plot_datapoints=False,
        plot_density=False,
        no_fill_contours=True,
    )
    below = -_LABEL_INCHES * count / (side - _EDGE_INCHES)
    for axes in figure.axes:
        axes.tick_params(labelsize=_FONT_POINTS)
        axes.grid(visible=False)
        for axis, label in ((axes.xaxis, (0.5, below)), (axes.yaxis, (below, 0.5))):
            axis.set_label_coords(*label)
    edge = _EDGE_INCHES / side
    figure.subplots_adjust(left=edge, bottom=edge, right=1 - 0.15 / side, top=0.99)
