"""Maps of what the approximations of niu2024 cost over the field."""

from __future__ import annotations

from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import draws
from reproduce.papers.niu2024 import approximations
from reproduce.papers.niu2024.simulation import REGISTERED
from reproduce.papers.study import Fact
from reproduce.physics.registration.approximations import EFFECTS, error_field, even_positions
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_table_1", "draw_table_4"]

ACROSS = 60


def facts(table: str) -> dict[str, Fact]:
    """Return the largest error of every map of a table, ``EFFECT-CHANNEL``."""
    return {
        f"{effect}-{channel}".replace(" ", "-"): Fact(
            _map(table, channel, effect)[-1].max(), ".1g", "px"
        )
        for effect, channel in product(EFFECTS, REGISTERED)
    }


@draws("niu2024-approximations-table-1", named=partial(facts, "Table 1"))
def draw_table_1(figure: Figure) -> None:
    """Error of each approximation over the red and the blue field, for Table 1."""
    _maps(figure, "Table 1")


@draws("niu2024-approximations-table-4", named=partial(facts, "Table 4"))
def draw_table_4(figure: Figure) -> None:
    """Error of each approximation over the red and the blue field, for Table 4."""
    _maps(figure, "Table 4")


def _map(table: str, channel: str, effect: str) -> FloatArray:
    """Return x and y in mm and the length of an error in px, shape (3, ACROSS, ACROSS)."""
    door = given(approximations.READS)
    positions = even_positions(approximations.half_size(door), ACROSS)
    whole = approximations.channels(door, table, channel)
    error = approximations.isolated(error_field, whole, effect, positions)
    return np.stack([*positions.T * 1e3, np.hypot(*error.T)]).reshape(3, ACROSS, ACROSS)


def _maps(figure: Figure, table: str) -> None:
    figure.set_size_inches(6.4, 9.8)
    grid = figure.subplots(len(EFFECTS), len(REGISTERED), sharex=True, sharey=True)
    for axes, (effect, channel) in zip(grid.flat, product(EFFECTS, REGISTERED), strict=True):
        x, y, length = _map(table, channel, effect)
        title = f"{approximations.TITLES[effect]}, {channel}: up to {length.max():.1g} px"
        axes.set(aspect="equal")
        axes.set_title(title, fontsize=8.5)
        if np.ptp(length) < 1e-6 * length.max():  # nothing to draw lines through
            axes.text(0, 0, "the same everywhere", ha="center", va="center")
            continue
        lines = axes.contour(x, y, length, levels=3, colors="#000000", linewidths=0.9)
        axes.clabel(lines, fmt="%.2g", fontsize=7)
    for axes in grid[-1]:
        axes.set_xlabel("x (mm)")
    for axes in grid[:, 0]:
        axes.set_ylabel("y (mm)")
    figure.supxlabel("lines: error (px)", fontsize="medium")
