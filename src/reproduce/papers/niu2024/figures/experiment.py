"""Figure 5 of niu2024: the data acquisition.

Drawn from the caption and the text; the paper's own picture was not at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from reproduce.papers.declare import draws
from reproduce.papers.niu2024.figures.looks import LOOKS
from reproduce.papers.sketch import Point, arrow, box, diagram, joined, label, slim

if TYPE_CHECKING:
    from matplotlib.axes import Axes


Place = tuple[Point, Point]


@draws("niu2024/fig-5")
@diagram(17.2, 10.0, narrow=(10.0, 12.4))
def draw_acquisition(axes: Axes) -> None:
    """Data acquisition: simulated starlight of a chosen band and magnitude, three images."""
    narrow = slim(axes)

    def placed(
        wide: Place, slender: Place, text: str = "", width: float = 1.3, style: str = "-"
    ) -> Place:
        """Draw a box where it stands on this page, and return its place."""
        place = slender if narrow else wide
        box(axes, *place, text, width=width, style=style)
        return place

    placed(((8.6, 6.45), (16.8, 6.5)), ((5.0, 7.6), (9.8, 9.4)), width=0.8)
    label(axes, (0.4, 11.9) if narrow else (0.6, 9.2), "dark room", ha="left", style="italic")
    star = placed(
        ((2.9, 6.3), (4.9, 2.2)),
        ((5.0, 10.5), (5.2, 1.8)),
        "single-star simulator:\nband and magnitude\ncan be chosen",
    )
    table = placed(((10.0, 6.3), (5.0, 4.4)), ((2.8, 6.3), (4.8, 3.6)), width=1.5)
    joined(axes, star, table)
    label(axes, (5.0, 8.8) if narrow else (6.4, 6.75), "starlight")
    label(axes, (2.8, 5.1) if narrow else (10.0, 8.95), "two-axis rotary table")
    camera = "3CMOS camera on\nthe middle frame"
    placed(((10.0, 6.3), (4.4, 2.0)), ((2.8, 6.6), (4.2, 1.6)), camera)
    images = placed(((14.9, 6.3), (3.6, 4.8)), ((8.0, 6.3), (3.2, 4.6)), style=":", width=0.8)
    (x, _), start = images[0], (5.2 if narrow else 12.5, 6.3)
    for look, y in zip(LOOKS.values(), (7.9, 6.3, 4.7), strict=True):
        box(axes, (x, y), (2.8, 1.0), f"{look.name} image", look)
        axes.plot([x + 1.25], [y], look.marker, color=look.colour, markersize=4)
        arrow(axes, start, (x - 1.4, y), look)
    course = placed(((10.0, 1.5), (3.6, 1.5)), ((2.8, 1.3), (3.4, 1.3)), "trajectory\nof the table")
    kept = placed(
        ((14.9, 1.5), (4.0, 1.5)), ((8.0, 1.3), (3.4, 1.3)), "spots and angles\nare recorded"
    )
    for one, other in ((course, table), (course, kept), (images, kept)):
        joined(axes, one, other)
