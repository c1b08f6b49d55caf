"""The rotation angles of the simulation, with Figure 4, which shows them (niu2024, section 4.1).

The text gives a count, a range and a step; no full rectangle has that count, which is a prime.
The count therefore selects among those of `physics.optics.arrangements`, and so it is an input.
The most literal of those that have it takes the step as the distance between neighbours of a
square lattice and holds the zero position, which the starting values of section 3.2 need.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import draws
from reproduce.papers.sketch import sized, thin
from reproduce.papers.study import Fact
from reproduce.physics.optics.arrangements import Arrangement, arrangements_with
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "ARRANGEMENTS", "READS", "SETTINGS", "arrangement", "candidates", "draw", "half_ranges",
    "literal",
]  # fmt: skip

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


def half_ranges(door: Given) -> tuple[float, float]:
    """Return half the printed range about x and about y, in radians."""
    low, high = (door.array(f"{SETTINGS}#range-?-{end}") for end in ("low", "high"))
    x, y = ((high - low) / 2).tolist()
    return x, y


@cache
def candidates(door: Given) -> tuple[Arrangement, ...]:
    """Return every arrangement that has the printed number of angles, in the family's order."""
    count = door.count(f"{SETTINGS}#angle-count")
    return tuple(arrangements_with(count, *half_ranges(door), door[f"{SETTINGS}#step"]))


def arrangement(door: Given, name: str) -> Arrangement:
    """Return one arrangement."""
    found = {candidate.name: candidate for candidate in candidates(door)}
    if ARRANGEMENTS[name] not in found:
        raise ValueError(
            f"angles={name}: this arrangement does not have "
            f"{door.count(f'{SETTINGS}#angle-count')} angles over the range; these do: "
            f"{', '.join(n for n, full in ARRANGEMENTS.items() if full in found) or 'none'}"
        )
    return found[ARRANGEMENTS[name]]


def literal(door: Given) -> Arrangement:
    """Return the arrangement that the ledger uses."""
    return arrangement(door, next(iter(ARRANGEMENTS)))


@draws("niu2024/fig-4", given=READS)
def draw(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Rotation angles of the rotary table in the simulation."""
    angles = np.degrees(literal(door).angles)
    axes = figure.add_subplot()
    axes.plot(*angles.T, "o", markersize=4, label=f"{len(angles)} angles of the simulation")
    axes.plot(*_range(door), linestyle="--", linewidth=1, label="printed range")
    axes.set(aspect="equal", xlabel="middle frame (°)", ylabel="external frame (°)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)


def _range(door: Given) -> FloatArray:
    """Return the outline of the printed range, in degrees, shape (2, 5)."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
    return np.degrees(corners * half_ranges(door)).T


def facts() -> dict[str, Fact]:
    """Return how many arrangements have the printed count, and how many of them hold zero."""
    found = candidates(given(READS))
    return {
        "arrangements": Fact(len(found), "d"),
        "angles": Fact(len(found[0].angles), "d"),
        "with-zero": Fact(sum(map(_holds_zero, found)), "d"),
    }


def _holds_zero(one: Arrangement) -> bool:
    return bool(np.isclose(one.angles, 0).all(axis=-1).any())


@draws("niu2024-arrangements", given=READS, named=facts)
def draw_arrangements(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Every arrangement of rotation angles that has the printed count."""
    found, used = candidates(door), literal(door).name
    columns = 2 if thin(figure) else 3
    rows = -(-len(found) // columns)
    sized(figure, 6.4, 1.85 * rows, narrow=1.7 * rows)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True).ravel()
    for axes, one in zip(grid, found, strict=False):
        axes.plot(*np.degrees(one.angles).T, "o", markersize=1.5)
        axes.plot(*_range(door), color="#000000", linewidth=0.6)
        if _holds_zero(one):
            axes.plot(0, 0, "o", markersize=6, fillstyle="none", color="#000000")
        name = one.name + (" (in use)" if one.name == used else "")
        axes.set_title("\n".join(textwrap.wrap(name, 26)), fontsize=8)
        axes.set(aspect="equal")
    for axes in grid[len(found) :]:
        axes.set_axis_off()
    figure.supxlabel("middle frame (°)", fontsize=9)
    figure.supylabel("external frame (°)", fontsize=9)
