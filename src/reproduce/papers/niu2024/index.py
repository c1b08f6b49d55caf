"""Figure 1 of niu2024, the sensor's workflow, and the looks of its channels in every drawing.

Drawn from the caption and the text; the paper's own picture was not at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from reproduce.papers.declare import draws
from reproduce.papers.sketch import INKED, Look, Point, arrow, box, diagram, joined, label, slim

if TYPE_CHECKING:
    from matplotlib.axes import Axes


RED = Look("red", "#D55E00", "--", "s")
GREEN = Look("green", "#009E73", "-.", "o")
BLUE = Look("blue", "#0072B2", ":", "^")
LOOKS = {look.name: look for look in (RED, GREEN, BLUE)}

# Text, then centre and size: on a wide page and on a narrow one.
Place = tuple[Point, Point]
_BOXES: dict[str, tuple[str, Place, Place]] = {
    "light": ("starlight", ((1.3, 6.2), (2.4, 1.2)), ((5.0, 12.4), (3.0, 0.8))),
    "prism": ("lens and\nprism", ((4.2, 6.2), (2.2, 1.6)), ((5.0, 10.8), (3.0, 1.3))),
    "red": ("red detector\nimage and spots", ((8.0, 8.4), (3.6, 1.5)), ((1.7, 8.1), (3.0, 1.6))),
    "green": (
        "green detector\nimage and spots", ((8.0, 6.2), (3.6, 1.5)), ((5.0, 8.1), (3.0, 1.6)),
    ),
    "blue": ("blue detector\nimage and spots", ((8.0, 4.0), (3.6, 1.5)), ((8.3, 8.1), (3.0, 1.6))),
    "registration": (
        "registration\nonto green", ((12.1, 6.2), (3.2, 1.8)), ((7.4, 5.3), (3.2, 1.4)),
    ),
    "fusion": ("fusion", ((15.6, 6.2), (2.2, 1.2)), ((7.4, 3.4), (2.4, 0.9))),
    "centroids": ("centroids", ((15.6, 3.6), (2.6, 1.2)), ((7.4, 1.6), (2.8, 0.9))),
    "colour": (
        "ratio of brightness:\nthe star's colour",
        ((7.6, 1.1), (4.4, 1.5)), ((2.3, 5.3), (4.2, 1.4)),
    ),
    "star": ("star\nidentification", ((12.4, 1.1), (3.2, 1.5)), ((2.3, 2.9), (3.0, 1.4))),
    "attitude": ("attitude", ((15.8, 1.1), (2.2, 1.2)), ((2.3, 0.6), (2.4, 0.9))),
}  # fmt: skip
_STEPS = ("light prism", "registration fusion", "fusion centroids", "centroids star",
         "colour star", "star attitude")  # fmt: skip


@draws("niu2024/fig-1")
@diagram(17.0, 9.6, narrow=(10.0, 13.0))
def _draw_workflow(axes: Axes) -> None:
    """Workflow of a 3CMOS star sensor, from starlight to attitude."""
    places = {name: layouts[slim(axes)] for name, (_, *layouts) in _BOXES.items()}
    for name, (text, *_) in _BOXES.items():
        box(axes, *places[name], text, LOOKS.get(name))
    steps = [(step, INKED) for step in _STEPS]
    for name, look in LOOKS.items():
        steps += [(f"prism {name}", look), (f"{name} registration", look)]
    for step, look in steps:
        start, end = step.split()
        joined(axes, places[start], places[end], look)
    # All three images make the colour.
    group: Place = ((5.0, 8.1), (9.9, 2.2)) if slim(axes) else ((8.0, 6.2), (4.2, 6.3))
    box(axes, *group, style=":", width=0.8)
    (x, y), (_, height) = places["colour"]
    arrow(axes, (x, group[0][1] - group[1][1] / 2), (x, y + height / 2))
    label(axes, (7.6, 4.25) if slim(axes) else (12.1, 7.6), "this paper",
          ha="left" if slim(axes) else "center", style="italic")  # fmt: skip
