"""The rotation angles of the simulation, and Figure 4 (niu2024, section 4.1).

The text gives a count, a range and a step; no full rectangle has that count, which is a prime.
The count therefore selects among those of `physics.optics.arrangements`, and so it is an input.
The most literal of those that have it takes the step as the distance between neighbours of a
square lattice and holds the zero position, which the starting values of section 3.2 need.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import draws
from reproduce.physics.optics.arrangements import Arrangement, arrangements_with
from reproduce.printed.given import Given

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

# Every arrangement that has the printed count, by the name under which a reader asks for it; the
# first is the literal one.
ARRANGEMENTS = {
    "square": "square, step between neighbours; centred; circle of the smaller half range",
    "square-from-corner": "square, step between neighbours; from the lower left corner; circle of "
    "the smaller half range",
    "quincunx": "quincunx, step between neighbours; centred; circle of the smaller half range",
    "hexagonal-rows-x": "hexagonal, rows along x; from the lower left corner; diamond",
    "hexagonal-half-row": "hexagonal, rows along y; half a row spacing along y; diamond",
    "hexagonal-half-both": "hexagonal, rows along y; half a spacing along both; diamond",
    "hexagonal-from-corner": "hexagonal, rows along y; from the lower left corner; diamond",
    "square-stretched": "square, stretched to the edges; centred; circle of the smaller half range",
    "rectangle": "quincunx, stretched to the edges in 20 by 12 spacings; centred; rectangle",
}
LITERAL = next(iter(ARRANGEMENTS))


def half_ranges(door: Given) -> tuple[float, float]:
    """Return half the printed range about each axis.

    About x and y, in radians.
    """
    x, y = (
        (door[f"{SETTINGS}#range-{axis}-high"] - door[f"{SETTINGS}#range-{axis}-low"]) / 2
        for axis in "xy"
    )
    return x, y


def candidates(door: Given) -> list[Arrangement]:
    """Return every arrangement that has the printed number of angles.

    In the order of the family.
    """
    count = door.count(f"{SETTINGS}#angle-count")
    return arrangements_with(count, *half_ranges(door), door[f"{SETTINGS}#step"])


def arrangement(door: Given, name: str) -> Arrangement:
    """Return one arrangement."""
    found = {one.name: one for one in candidates(door)}
    if ARRANGEMENTS[name] not in found:
        raise ValueError(
            f"angles={name}: this arrangement does not have "
            f"{door.count(f'{SETTINGS}#angle-count')} angles over the range; these do: "
            f"{', '.join(n for n, full in ARRANGEMENTS.items() if full in found) or 'none'}"
        )
    return found[ARRANGEMENTS[name]]


def literal(door: Given) -> Arrangement:
    """Return the arrangement that the ledger uses."""
    return arrangement(door, LITERAL)


def compute(door: Given) -> dict[str, object]:
    """Compute what Figure 4 shows.

    ``angles``, shape (137, 2), in radians, x before y, and ``half_ranges``, in radians.
    """
    return {"angles": literal(door).angles, "half_ranges": half_ranges(door)}


@draws("niu2024/fig-4", given=READS)
def draw(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Rotation angles of the rotary table in the simulation."""
    content = compute(door)
    angles = np.degrees(np.asarray(content["angles"]))
    half_x, half_y = np.degrees(np.asarray(content["half_ranges"]))
    axes = figure.add_subplot()
    axes.plot(*angles.T, "o", markersize=4, label=f"{len(angles)} angles of the simulation")
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * (half_x, half_y)
    axes.plot(*corners.T, linestyle="--", linewidth=1, label="printed range")
    axes.set(aspect="equal", xlabel="middle frame (°)", ylabel="external frame (°)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
