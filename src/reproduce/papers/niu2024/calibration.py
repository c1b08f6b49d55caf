"""Figure 3 of niu2024: the calibration set-up.

Drawn from the caption and the text; the paper's own picture was not at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from reproduce.papers.declare import draws
from reproduce.papers.sketch import INK, arc, arrow, box, diagram, label, line

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@draws("niu2024/fig-3")
@diagram(17.4, 9.6)
def _draw_calibration(axes: Axes) -> None:
    """Calibration set-up: a single-star simulator, a rotary table, the sensor on its frame."""
    from matplotlib.patches import Ellipse

    # The lamp, the collimator and the parallel light that leaves it.
    axes.plot([0.9], [5.6], marker="*", markersize=11, color=INK)
    label(axes, (0.9, 4.4), "point\nsource")
    lens = Ellipse((4.6, 5.6), 0.55, 3.0, facecolor="none", edgecolor=INK, linewidth=1.3)
    axes.add_patch(lens)
    label(axes, (3.0, 7.9), "single-star simulator")
    for height in (-1.1, 0.0, 1.1):
        line(axes, [(0.9, 5.6), (4.6, 5.6 + height)], 0.8)
        arrow(axes, (4.6, 5.6 + height), (9.2, 5.6 + height))
    label(axes, (7.2, 7.2), "parallel light")
    # The two frames of the table, and the sensor on the middle one.
    box(axes, (12.8, 5.6), (6.6, 6.0), width=1.6)
    box(axes, (12.8, 5.6), (5.6, 4.6), style="--")
    label(axes, (12.8, 9.0), "external frame, $φ_1$")
    label(axes, (12.8, 3.8), "middle frame, $φ_2$")
    box(axes, (12.9, 5.5), (3.8, 2.0), "3CMOS\nstar sensor")
    line(axes, [(10.5, 6.1), (11.0, 5.9)], 1.3)
    line(axes, [(10.5, 4.9), (11.0, 5.1)], 1.3)
    line(axes, [(16.9, 5.6), (16.1, 5.6)], 0.8, "-.")
    line(axes, [(12.8, 7.0), (12.8, 8.3)], 0.8, "-.")
    arc(axes, (12.8, 7.6), 0.45, (-150.0, 130.0), head=True)
    arc(axes, (16.7, 5.6), 0.4, (-140.0, 140.0), head=True)
    box(axes, (4.0, 1.3), (3.2, 1.2), "computer")
    line(axes, [(12.2, 2.6), (12.2, 1.3), (6.2, 1.3)])
    label(axes, (9.4, 0.6), "frame angles and spots")
    arrow(axes, (6.3, 1.3), (5.6, 1.3))
