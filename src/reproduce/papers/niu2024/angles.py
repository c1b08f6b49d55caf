"""The rotation angles of the simulation, and Figure 4 (niu2024, section 4.1).

The text gives a count, a range and a step; no full rectangle has that count, which is a prime.
The count therefore selects among those of `physics.optics.arrangements`, and so it is an input.
The most literal of those that have it takes the step as the distance between neighbours of a
square lattice and holds the zero position, which the starting values of section 3.2 need.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.physics.optics.arrangements import Arrangement, arrangements_with
from reproduce.printed.given import Given, given

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

SETTINGS = "niu2024/text-simulation"
READS = (
    f"{SETTINGS}#angle-count",
    f"{SETTINGS}#range-x-*",
    f"{SETTINGS}#range-y-*",
    f"{SETTINGS}#step",
)


def half_ranges(door: Given) -> tuple[float, float]:
    """Return half the printed range about each axis.

    Parameters
    ----------
    door : Given
        Holds the cells of `READS`.

    Returns
    -------
    tuple of float
        About x and y, in radians.
    """
    x, y = (
        (door[f"{SETTINGS}#range-{axis}-high"] - door[f"{SETTINGS}#range-{axis}-low"]) / 2
        for axis in "xy"
    )
    return x, y


def candidates(door: Given) -> list[Arrangement]:
    """Return every arrangement that has the printed number of angles.

    Parameters
    ----------
    door : Given
        Holds the cells of `READS`.

    Returns
    -------
    list of Arrangement
        In the order of the family.
    """
    count = door.count(f"{SETTINGS}#angle-count")
    return arrangements_with(count, *half_ranges(door), door[f"{SETTINGS}#step"])


def literal(door: Given) -> Arrangement:
    """Return the arrangement that the ledger uses.

    Parameters
    ----------
    door : Given
        Holds the cells of `READS`.

    Returns
    -------
    Arrangement
        The square lattice with the printed step, centred on the zero position.
    """
    lattice = "square, step between neighbours"
    return next(c for c in candidates(door) if c.lattice == lattice and c.offset == "centred")


def compute() -> dict[str, object]:
    """Compute what Figure 4 shows.

    Returns
    -------
    dict
        ``angles``, shape (137, 2), in radians, x before y, and ``half_ranges``, in radians.
    """
    door = given(READS)
    return {"angles": literal(door).angles, "half_ranges": half_ranges(door)}


def draw(figure: Figure, printed: Mapping[str, float]) -> None:
    """Rotation angles of the rotary table in the simulation.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure.
    """
    content = compute()
    angles = np.degrees(np.asarray(content["angles"]))
    half_x, half_y = np.degrees(np.asarray(content["half_ranges"]))
    axes = figure.add_subplot()
    axes.plot(*angles.T, "o", markersize=4, label=f"{len(angles)} angles of the simulation")
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * (half_x, half_y)
    axes.plot(*corners.T, linestyle="--", linewidth=1, label="printed range")
    axes.set(aspect="equal", xlabel="middle frame (°)", ylabel="external frame (°)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
