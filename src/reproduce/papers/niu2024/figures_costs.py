"""Maps of what the approximations of niu2024 cost over the field."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.niu2024 import costs
from reproduce.physics.approximations import EFFECTS, even_positions
from reproduce.printed.given import given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLES = {
    "coefficients": "unequal coefficients",
    "cube": "k³ for k",
    "pivot": "pivot off by 10 px",
    "tilt": "tilt",
    "second term": "second radial term",
}
ACROSS = 60


def draw_table_1(figure: Figure) -> None:
    """Error of each approximation over the red field, with the parameters of Table 1."""
    _maps(figure, "Table 1")


def draw_table_4(figure: Figure) -> None:
    """Error of each approximation over the red field, with the parameters of Table 4."""
    _maps(figure, "Table 4")


def _maps(figure: Figure, table: str) -> None:
    door = given(costs.READS)
    sides = costs.half_size(door)
    positions = even_positions(sides, ACROSS)
    whole = costs.channels(door, table, "red")
    x, y = (positions * 1e3).reshape(ACROSS, ACROSS, 2).transpose(2, 0, 1)
    figure.set_size_inches(6.4, 5.6)
    grid = figure.subplots(3, 2, sharex=True, sharey=True)
    for axes, effect in zip(grid.flat, EFFECTS, strict=False):
        length = np.hypot(*costs.isolated_error(whole, effect, positions).T)
        axes.set(aspect="equal", title=TITLES[effect])
        if np.ptp(length) < 1e-6 * length.max():  # nothing to draw lines through
            axes.text(0, 0, f"{length[0]:.2g} px everywhere", ha="center", va="center")
        else:
            lines = axes.contour(
                x, y, length.reshape(ACROSS, ACROSS), levels=4, colors="#000000", linewidths=0.9
            )
            axes.clabel(lines, fmt="%.2g", fontsize=7)
    for axes in grid[:, 0]:
        axes.set_ylabel("y (mm)")
    grid[2, 0].set_xlabel("x (mm)")
    grid[1, 1].set_xlabel("x (mm)")
    grid[1, 1].tick_params(labelbottom=True)
    grid[2, 1].set_axis_off()
    grid[2, 1].text(0.05, 0.5, "lines: error (px)", transform=grid[2, 1].transAxes)
