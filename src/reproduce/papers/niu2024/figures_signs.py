"""The signs of niu2024, drawn from what the functions return: registration and rotary table.

Angle, scale, shift and field are drawn far too large, or nothing would be seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.niu2024.sketch import BLUE, GREEN
from reproduce.papers.sketch import arrow, beside, box, canvas, label, line, turning
from reproduce.physics.optics.camera import ideal_positions
from reproduce.physics.optics.rotary import starlight
from reproduce.physics.registration.transforms import Registration
from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SCALE, ANGLE, SHIFT = 1.3, float(np.radians(38.0)), np.array([2.0, 1.0])
PIVOT, SPOT = np.array([3.2, 2.0]), np.array([8.2, 2.6])
TURN, FOCAL = float(np.radians(20.0)), 7.0


def registration_steps() -> FloatArray:
    """Return a blue spot on its way to the green image: as it is, turned, stretched, shifted.

    Shape (4, 2). Pixel coordinates in the units of the drawing; the last row is the registered
    spot.
    """
    steps = Registration.similarity(
        scale=[1.0, 1.0, SCALE, SCALE],
        rotation=[0.0, ANGLE, ANGLE, ANGLE],
        shift=np.outer([0.0, 0.0, 0.0, 1.0], SHIFT),
        pivot=PIVOT,
    )
    return steps.apply([SPOT])[:, 0]


def draw_registration(figure: Figure) -> None:
    """How a blue spot is laid over the green one: turn and stretch about the pivot, then shift."""
    axes = canvas(figure, 13.0, 8.4, 6.0)
    _axes(axes, (0.5, 0.5), 1.8)
    before, turned, stretched, after = registration_steps()
    axes.plot(*PIVOT, "+", color="#000000", markersize=12)
    label(axes, beside(PIVOT, -0.3, -0.7), "pivot: blue principal point")
    for end in (before, stretched):
        line(axes, [PIVOT, end], 0.8, ":")
    axes.plot(*before, BLUE.marker, color=BLUE.colour, markersize=8)
    label(axes, beside(before, 0.4, -0.1), "blue spot", ha="left")
    shares = np.linspace(0.0, 1.0, 60)
    turning(axes, np.stack([_turned(share) for share in shares]))
    label(axes, beside(_turned(0.5), 0.5, 0.1), "turned by θ", ha="left")
    arrow(axes, turned, stretched, width=2.0)
    label(axes, beside(stretched, 0.35, 0.1), "stretched by $k$", ha="left")
    arrow(axes, stretched, after)
    label(axes, beside((stretched + after) / 2, -0.25, 0.35), "less Δ", ha="right")
    axes.plot(*after, GREEN.marker, color=GREEN.colour, markersize=8)
    label(axes, beside(after, -0.35, -0.35), "laid over green", ha="right")


def _turned(share: float) -> FloatArray:
    """Return the spot after a share of its turn about the pivot."""
    about: FloatArray = Registration.similarity(1.0, share * ANGLE, (0.0, 0.0), PIVOT).apply(
        [SPOT]
    )[0]
    return about


def _axes(axes: Axes, corner: tuple[float, float], length: float) -> None:
    start = np.array(corner)
    for way, name in (([length, 0.0], "x"), ([0.0, length], "y")):
        arrow(axes, start, start + way)
        label(axes, start + 1.18 * np.array(way), f"${name}$")


def table_spots() -> dict[str, FloatArray]:
    """Return where the star's spot stands after a positive turn of either frame of the table.

    Name of the angle to the spot, shape (2,), from the principal point.
    """
    turns = {"φ_1": (TURN, 0.0), "φ_2": (0.0, TURN)}
    return {name: ideal_positions([starlight(*turn)], FOCAL)[0] for name, turn in turns.items()}


def draw_table(figure: Figure) -> None:
    """Where the spot of the one star goes when a frame of the rotary table turns."""
    axes = canvas(figure, 12.0, 7.6, 5.6)
    centre = np.array([6.0, 3.0])
    box(axes, centre, (9.6, 5.2))
    label(axes, (10.6, 0.75), "detector", ha="right")
    _axes(axes, (1.7, 0.9), 1.0)
    axes.plot(*centre, "*", color="#000000", markersize=12)
    label(axes, beside(centre, 0.4, -0.35), "both angles zero", ha="left")
    for name, spot in table_spots().items():
        arrow(axes, centre, centre + spot, width=2.0)
        axis = int(np.abs(spot).argmax())
        way = f"{'+' if spot[axis] > 0 else '−'}{'xy'[axis]}"
        text = f"${name} > 0$: towards ${way}$"
        label(axes, centre + spot + ([0.0, 0.4] if axis else [0.6, 0.45]), text)
