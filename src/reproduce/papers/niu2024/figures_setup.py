"""Figures 3 and 5 of niu2024: the calibration set-up and the data acquisition.

Drawn from the captions and the text; the papers' own pictures were not at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from reproduce.papers.declare import draws
from reproduce.papers.niu2024.sketch import LOOKS
from reproduce.papers.sketch import INK, arc, arrow, box, diagram, label, line

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@draws("niu2024/fig-3")
@diagram(17.0, 9.6)
def draw_calibration(axes: Axes) -> None:
    """Calibration set-up: a single-star simulator, a rotary table, the sensor on its frame."""
    _simulator(axes)
    _table(axes)
    box(axes, (4.0, 1.3), (2.8, 1.2), "computer")
    line(axes, [(12.2, 2.6), (12.2, 1.3), (5.8, 1.3)])
    label(axes, (8.9, 0.7), "frame angles and spots")
    arrow(axes, (6.0, 1.3), (5.4, 1.3))


def _simulator(axes: Axes) -> None:
    """Draw the lamp, the collimator and the parallel light that leaves it."""
    from matplotlib.patches import Ellipse

    axes.plot([0.9], [5.6], marker="*", markersize=11, color=INK)
    label(axes, (0.9, 4.4), "point\nsource")
    lens = Ellipse((4.6, 5.6), 0.55, 3.0, facecolor="none", edgecolor=INK, linewidth=1.3)
    axes.add_patch(lens)
    label(axes, (3.0, 7.9), "single-star simulator")
    for height in (-1.1, 0.0, 1.1):
        line(axes, [(0.9, 5.6), (4.6, 5.6 + height)], 0.8)
        arrow(axes, (4.6, 5.6 + height), (9.2, 5.6 + height))
    label(axes, (7.2, 7.2), "parallel light")


def _table(axes: Axes) -> None:
    """Draw the two frames of the table, and the sensor on the middle one."""
    box(axes, (12.8, 5.6), (6.2, 6.0), width=1.6)
    box(axes, (12.8, 5.6), (4.6, 4.4), style="--")
    label(axes, (12.8, 9.0), "external frame, $φ_1$")
    label(axes, (12.8, 3.75), "middle frame, $φ_2$")
    box(axes, (12.9, 5.6), (2.8, 2.2), "3CMOS\nstar sensor")
    line(axes, [(11.0, 6.2), (11.5, 6.0)], 1.3)
    line(axes, [(11.0, 5.0), (11.5, 5.2)], 1.3)
    line(axes, [(16.6, 5.6), (15.9, 5.6)], 0.8, "-.")
    line(axes, [(12.8, 7.0), (12.8, 8.3)], 0.8, "-.")
    arc(axes, (12.8, 7.6), 0.45, (-150.0, 130.0), head=True)
    arc(axes, (16.4, 5.6), 0.4, (-140.0, 140.0), head=True)


@draws("niu2024/fig-5")
@diagram(17.2, 10.0)
def draw_acquisition(axes: Axes) -> None:
    """Data acquisition: simulated starlight of a chosen band and magnitude, three images."""
    box(axes, (8.6, 6.45), (16.8, 6.5), width=0.8)
    label(axes, (0.6, 9.2), "dark room", ha="left", style="italic")
    box(axes, (2.9, 6.3), (4.9, 2.2), "single-star simulator:\nband and magnitude\ncan be chosen")
    arrow(axes, (5.35, 6.3), (7.4, 6.3))
    label(axes, (6.4, 6.75), "starlight")
    box(axes, (10.0, 6.3), (5.0, 4.4), width=1.5)
    label(axes, (10.0, 8.95), "two-axis rotary table")
    box(axes, (10.0, 6.3), (4.4, 2.0), "3CMOS camera on\nthe middle frame")
    box(axes, (14.9, 6.3), (3.6, 4.8), style=":", width=0.8)
    for look, y in zip(LOOKS.values(), (7.9, 6.3, 4.7), strict=True):
        box(axes, (14.9, y), (3.0, 1.0), f"{look.name} image", look)
        axes.plot([16.2], [y], look.marker, color=look.colour, markersize=4)
        arrow(axes, (12.5, 6.3), (13.4, y), look)
    box(axes, (10.0, 1.5), (3.6, 1.5), "trajectory\nof the table")
    arrow(axes, (10.0, 2.25), (10.0, 4.1))
    box(axes, (14.8, 1.5), (4.0, 1.5), "spots and angles\nare recorded")
    arrow(axes, (11.8, 1.5), (12.8, 1.5))
    arrow(axes, (14.8, 3.9), (14.8, 2.25))
