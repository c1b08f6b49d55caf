"""What an angle is on the ground: an arc second from the paper's satellite, pixel by pixel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.chen2023 import satellite
from reproduce.papers.declare import draws
from reproduce.papers.sketch import arrow, beside, box, canvas, label, line
from reproduce.papers.study import Fact
from reproduce.printed.given import Given, given
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

FRAMES = "chen2023/table-4#100.frames"
READS = (*satellite.CAMERA, satellite.ACCURACY, FRAMES)
# Of the drawing: units to a metre of the ground.
METRE = 3.4


def _on_the_ground(door: Given) -> tuple[float, float, float]:
    """Return metres on the ground: an arc second, a pixel, the larger printed error (3σ)."""
    height = satellite.altitude(door)
    error = float(door.array(satellite.ACCURACY).max())
    return (
        height * float(np.tan(RADIANS_PER_ARCSEC)),
        door[satellite.CAMERA[2]],
        height * float(np.tan(error)),
    )


def ground_facts() -> Mapping[str, Fact]:
    """Return what the drawing shows, in numbers."""
    door = given(READS)
    second, pixel, error = _on_the_ground(door)
    return {
        "height": Fact(satellite.altitude(door) / 1e3, ".0f", "km"),
        "second": Fact(second, ".1f", "m"),
        "pixel": Fact(pixel, ".2f", "m"),
        "pixels": Fact(second / pixel, ".0f"),
        "error": Fact(error, ".2f", "m"),
        "frames": Fact(door.count(FRAMES), "d"),
    }


@draws("chen2023-arc-second", given=READS, named=ground_facts)
def draw_ground(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """An arc second on the ground, from the height of the paper's satellite, to scale."""
    second, pixel, error = _on_the_ground(door)
    axes = canvas(figure, 10.4, 8.2)
    left, right, ground = 0.9, 0.9 + METRE * second, 3.4
    top = np.array([(left + right) / 2, 7.2])
    box(axes, beside(top, 0.0, 0.45), (2.6, 0.9), "satellite")
    for foot in (left, right):
        line(axes, np.array([top, (foot, ground)]), 1.0)
    label(axes, beside(top, 0.0, -1.6), "1″")
    label(axes, (9.0, 5.6), f"{satellite.altitude(door) / 1e3:.0f} km up,\nnot to scale")
    side = METRE * pixel
    for start in np.arange(left, right, side):
        box(axes, (start + side / 2, ground - 0.5), (side, side), width=0.8)
    for y, length, text in (
        (1.9, second, f"an arc second: {second:.1f} m"),
        (1.2, pixel, f"a pixel of the camera: {pixel:.2f} m"),
        (0.4, error, f"misalignment, mean of {door.count(FRAMES)} frames, 3σ: {error:.2f} m"),
    ):
        arrow(axes, (left, y), (left + METRE * length, y), style="<|-|>")
        if length is second:
            label(axes, ((left + right) / 2, y + 0.28), text)
        else:
            label(axes, (left + METRE * length + 0.3, y), text, ha="left")
