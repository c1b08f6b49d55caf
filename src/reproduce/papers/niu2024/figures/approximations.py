"""What each approximation of niu2024 costs, beside the noise of its simulation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import draws
from reproduce.papers.niu2024 import approximations, simulation
from reproduce.papers.niu2024.figures.looks import LOOKS
from reproduce.papers.sketch import INK, sized
from reproduce.papers.study import Fact
from reproduce.printed.given import given

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_costs"]


def facts() -> Mapping[str, Fact]:
    """Return every size before a fit, ``EFFECT-TABLE-CHANNEL-rms``, and that of the noise."""
    return approximations.facts(given(approximations.READS))


@draws("niu2024-approximations", marks=[approximations.NOISE], named=facts)
def draw_costs(figure: Figure, printed: Mapping[str, float]) -> None:
    """Error of each approximation over the field, before and after a fit, for Tables 1 and 4."""
    sized(figure, 4.9, 5.6, 6.0)
    costs = approximations.costs(given(approximations.READS))
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    for axes, table in zip(panels, approximations.TABLES, strict=True):
        _panel(axes, [cost for cost in costs if cost.labels[1] == table])
        # A length in the plane, as the errors are.
        noise = np.sqrt(2.0) * printed[approximations.NOISE]
        axes.axvline(noise, color=INK, linestyle="--", linewidth=1, label="noise, both axes")
        axes.set_title(f"cameras of {table}", fontsize=10)
    panels[-1].set_xlabel("error over the field, RMS (px)", fontsize=9)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=9)


def _panel(axes: Axes, costs: list[approximations.Cost]) -> None:
    """Draw the costs of one table, a row for each approximation."""
    effects = list(approximations.TITLES.values())
    for place, look in ((channel, LOOKS[channel]) for channel in simulation.REGISTERED):
        own = [cost for cost in costs if cost.labels[2] == place]
        rows = [effects.index(one.labels[0]) + (-0.15 if place == "red" else 0.15) for one in own]
        rms = [one.rms for one in own]
        axes.plot(rms, rows, look.marker, color=look.colour, label=look.name)
        fitted = zip((one.left for one in own), rows, strict=True)
        axes.plot(
            *zip(
                *((left, row) for left, row in fitted if left > approximations.ROUNDING),
                strict=True,
            ),
            look.marker,
            color=look.colour,
            fillstyle="none",
            label=f"{look.name}, after a fit",
        )
    axes.set_yticks(range(len(effects)), effects, fontsize=9)
    axes.set_ylim(len(effects) - 0.5, -0.5)
    axes.set_xscale("log")
    axes.tick_params(axis="x", labelsize=9)
