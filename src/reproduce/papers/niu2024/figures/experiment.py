"""Figure 5 of niu2024: the data acquisition.

Drawn from the caption and the text; the paper's own picture was not at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from reproduce.papers.declare import draws
from reproduce.papers.niu2024.figures.looks import LOOKS
from reproduce.papers.sketch import arrow, box, diagram, label

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
