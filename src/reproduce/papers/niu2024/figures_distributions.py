"""The distribution of every printed number of the simulation under a choice of readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reproduce.papers.niu2024 import counting, simulation, study
from reproduce.papers.niu2024.sketch import LOOKS
from reproduce.printed.given import given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLES = ("k (1)", "θ (mrad)", "Δx (px)", "Δy (px)", "RMSE before (px)", "RMSE after (px)")
FACTORS = (1.0, 1e3, 1.0, 1.0, 1.0, 1.0)


def chosen() -> dict[str, tuple[int, str]]:
    """Return readings to show: the literal one, and each other choice made in it alone.

    What is other to the place of the reading in `study.readings` and the way of counting axes.
    """
    door = given(study.READS)
    every, literal = study.readings(door), study.literal(door)
    both, *ways = counting.COUNTED
    others = {
        "noise in red and blue": replace(literal, noisy="red and blue"),
        "noise in green": replace(literal, noisy="green"),
        "ten draws": replace(literal, repeats=study.REPEATS[1]),
        "shifts of Table 2": replace(literal, shifts=simulation.SHIFTS[1]),
        "tests among angles": replace(literal, tests=simulation.TESTS[1]),
    }
    readings = {"the literal one": literal} | others
    found = {name: (every.index(reading), both) for name, reading in readings.items()}
    found |= {f"RMSE of {way}": (every.index(literal), way) for way in ways}
    nearest = replace(literal, shifts=simulation.SHIFTS[1], tests=simulation.TESTS[1])
    return found | {"Table 2, angles, y": (every.index(nearest), counting.COUNTED[-1])}


def draw(figure: Figure, arrays: Mapping[str, NDArray[Any]], printed: Sequence[float]) -> None:
    """Median and central 99 % of every printed number, by reading, with the print."""
    rows, factors = chosen(), np.array(FACTORS)
    figure.set_size_inches(6.4, 9.6)
    grid = figure.subplots(len(TITLES), 2, sharey=True)
    for place, channel in enumerate(simulation.REGISTERED):
        for cell, axes in enumerate(grid[:, place]):
            for height, (number, way) in enumerate(rows.values()):
                levels = counting.quantiles_counted(arrays["quantiles"][number], way) * factors
                low, _, middle, _, high = levels[:, place, cell]
                axes.plot([low, high], [height, height], color=LOOKS[channel].colour)
                marker = LOOKS[channel].marker
                axes.plot(middle, height, marker, color="#000000", markersize=3.5)
            value = printed[place * len(TITLES) + cell] * factors[cell]
            axes.axvline(value, color="#000000", linestyle="--", linewidth=1)
            axes.set_xlabel(f"{channel}: {TITLES[cell]}")
            axes.ticklabel_format(axis="x", useOffset=False)
            axes.locator_params(axis="x", nbins=3)
    grid[0, 0].set_yticks(np.arange(len(rows)), list(rows), fontsize=7)
    grid[0, 0].set_ylim(len(rows) - 0.5, -0.5)
    for axes in grid.flat:
        axes.tick_params(axis="y", labelsize=7)
