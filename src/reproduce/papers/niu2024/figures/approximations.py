"""Maps of what the approximations of niu2024 cost over the field."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import sketches
from reproduce.papers.niu2024 import approximations
from reproduce.papers.niu2024.simulation import REGISTERED
from reproduce.papers.study import Fact
from reproduce.physics.registration.approximations import EFFECTS, even_positions
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_table_1", "draw_table_4"]

ACROSS = 60


def facts(table: str) -> dict[str, Fact]:
    """Return the largest error of every map of a table, ``EFFECT-CHANNEL``."""
    return {
        f"{effect}-{channel}".replace(" ", "-"): Fact(
            _length(table, channel, effect).max(), ".1g", "px"
        )
        for effect in EFFECTS
        for channel in REGISTERED
    }


@sketches("niu2024-approximations-table-1", named=partial(facts, "Table 1"))
def draw_table_1(figure: Figure) -> None:
    """Error of each approximation over the red and the blue field, for Table 1."""
    _maps(figure, "Table 1")


@sketches("niu2024-approximations-table-4", named=partial(facts, "Table 4"))
def draw_table_4(figure: Figure) -> None:
    """Error of each approximation over the red and the blue field, for Table 4."""
    _maps(figure, "Table 4")


def _length(table: str, channel: str, effect: str) -> FloatArray:
    """Return the length of an error over the field, shape (ACROSS, ACROSS), in px."""
    door = given(approximations.READS)
    positions = even_positions(approximations.half_size(door), ACROSS)
    error = approximations.isolated_error(
        approximations.channels(door, table, channel), effect, positions
    )
    return np.asarray(np.hypot(error[:, 0], error[:, 1]).reshape(ACROSS, ACROSS))


def _maps(figure: Figure, table: str) -> None:
    figure.set_size_inches(6.4, 9.8)
    grid = figure.subplots(len(EFFECTS), len(REGISTERED), sharex=True, sharey=True)
    for column, channel in zip(grid.T, REGISTERED, strict=True):
        for axes, effect in zip(column, EFFECTS, strict=True):
            _map(axes, table, channel, effect)
        column[-1].set_xlabel("x (mm)")
    for axes in grid[:, 0]:
        axes.set_ylabel("y (mm)")
    figure.supxlabel("lines: error (px)", fontsize="medium")


def _map(axes: Axes, table: str, channel: str, effect: str) -> None:
    positions = even_positions(approximations.half_size(given(approximations.READS)), ACROSS) * 1e3
    x, y = positions.reshape(ACROSS, ACROSS, 2).transpose(2, 0, 1)
    length = _length(table, channel, effect)
    axes.set(aspect="equal")
    axes.set_title(
        f"{approximations.TITLES[effect]}, {channel}: up to {length.max():.1g} px", fontsize=8.5
    )
    if np.ptp(length) < 1e-6 * length.max():  # nothing to draw lines through
        axes.text(0, 0, "the same everywhere", ha="center", va="center")
        return
    lines = axes.contour(x, y, length, levels=3, colors="#000000", linewidths=0.9)
    axes.clabel(lines, fmt="%.2g", fontsize=7)
