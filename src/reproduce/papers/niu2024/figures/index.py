"""Figure 1 of niu2024: the sensor's workflow.

Drawn from the caption and the text; the paper's own picture was not at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from reproduce.papers.declare import draws
from reproduce.papers.niu2024.figures.looks import LOOKS
from reproduce.papers.sketch import arrow, box, diagram, label

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@draws("niu2024/fig-1")
@diagram(17.0, 9.6)
def draw_workflow(axes: Axes) -> None:
    """Workflow of a 3CMOS star sensor, from starlight to attitude."""
    box(axes, (1.3, 6.2), (2.4, 1.2), "starlight")
    box(axes, (4.2, 6.2), (2.2, 1.6), "lens and\nprism")
    arrow(axes, (2.5, 6.2), (3.1, 6.2))
    box(axes, (12.1, 6.2), (3.2, 1.8), "registration\nonto green")
    for look, y in zip(LOOKS.values(), (8.4, 6.2, 4.0), strict=True):
        box(axes, (8.0, y), (3.6, 1.5), f"{look.name} detector\nimage and spots", look)
        arrow(axes, (5.3, 6.2 + (y - 6.2) / 8), (6.2, y), look)
        arrow(axes, (9.8, y), (10.5, 6.2 + (y - 6.2) / 4), look)
    box(axes, (15.6, 6.2), (2.2, 1.2), "fusion")
    arrow(axes, (13.7, 6.2), (14.5, 6.2))
    box(axes, (15.5, 3.6), (2.6, 1.2), "centroids")
    arrow(axes, (15.6, 5.6), (15.6, 4.2))
    box(axes, (8.0, 6.2), (4.2, 6.3), style=":", width=0.8)
    box(axes, (7.6, 1.1), (4.2, 1.5), "ratio of brightness:\nthe star's colour")
    arrow(axes, (7.6, 3.05), (7.6, 1.85))
    box(axes, (12.4, 1.1), (3.2, 1.5), "star\nidentification")
    arrow(axes, (9.7, 1.1), (10.8, 1.1))
    arrow(axes, (14.5, 3.0), (13.4, 1.85))
    box(axes, (15.8, 1.1), (2.2, 1.2), "attitude")
    arrow(axes, (14.0, 1.1), (14.7, 1.1))
    label(axes, (12.1, 7.6), "this paper", style="italic")
