"""Figure 4 of niu2024: the rotation angles of the simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import draws
from reproduce.papers.niu2024 import simulation_angles
from reproduce.printed.given import Given

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

__all__ = ["draw"]


@draws("niu2024/fig-4", given=simulation_angles.READS)
def draw(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Rotation angles of the rotary table in the simulation."""
    angles = np.degrees(simulation_angles.literal(door).angles)
    half_x, half_y = np.degrees(simulation_angles.half_ranges(door))
    axes = figure.add_subplot()
    axes.plot(*angles.T, "o", markersize=4, label=f"{len(angles)} angles of the simulation")
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * (half_x, half_y)
    axes.plot(*corners.T, linestyle="--", linewidth=1, label="printed range")
    axes.set(aspect="equal", xlabel="middle frame (°)", ylabel="external frame (°)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
