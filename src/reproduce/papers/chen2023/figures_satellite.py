"""Figures 1b and 2: the monitoring system, its place in the satellite, and the focal plane.

Drawn from the captions and the text; the paper's own pictures were not at hand, and nothing here
claims their likeness or a scale.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.chen2023.sketch import LASER, SCENE, STAR, mirror
from reproduce.papers.declare import draws
from reproduce.papers.sketch import INK, arrow, box, diagram, key, label, line, path
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DETECTORS = "chen2023/text-hardware#detectors"


@draws("chen2023/fig-1b")
@diagram(12.0, 7.2)
def draw_system(axes: Axes) -> None:
    """The monitoring system: what the laser light couples, and what the stars add."""
    box(axes, (2.5, 3.4), (3.4, 1.7), "camera with lasers\nin its focal plane")
    box(axes, (6.2, 0.8), (2.8, 1.1), "retro-reflector")
    box(axes, (9.8, 3.4), (2.8, 1.7), "star and laser\ntracker")
    path(axes, [(3.5, 2.55), (3.5, 0.8), (4.8, 0.8)], LASER)
    path(axes, [(7.6, 0.8), (9.8, 0.8), (9.8, 2.55)], LASER)
    path(axes, [(10.5, 6.9), (10.5, 4.25)], STAR)
    path(axes, [(1.6, 0.1), (1.6, 2.55)], SCENE)
    arrow(axes, (4.2, 3.4), (8.4, 3.4), style="<|-|>")
    label(axes, (6.3, 3.75), "installation, misalignment")
    label(axes, (6.3, 3.05), "what heat bends")
    label(
        axes, (5.4, 4.95), "camera's attitude =\nmisalignment × installation × tracker's attitude"
    )
    key(axes, (LASER, STAR, SCENE), (0.0, 1.0))


@draws("chen2023/fig-2a")
@diagram(12.6, 10.8)
def draw_structure(axes: Axes) -> None:
    """The system in the satellite: camera down, tracker up, retro-reflector between."""
    box(axes, (3.4, 5.4), (3.8, 5.2))
    label(axes, (3.4, 8.35), "camera")
    for x in (2.35, 4.45):
        mirror(axes, (x, 6.2), 1.3, 0)
    label(axes, (2.45, 6.55), "primary")
    mirror(axes, (3.4, 3.6), 1.0, 0)
    label(axes, (3.2, 3.2), "secondary")
    box(axes, (3.4, 7.3), (2.9, 0.6), "focal plane, lasers")
    path(axes, [(3.4, 7.0), (3.65, 3.65), (4.5, 6.1), (4.5, 1.2)], LASER)
    mirror(axes, (4.5, 1.2), 1.4, -45)
    mirror(axes, (9.4, 1.2), 1.4, 45)
    path(axes, [(4.5, 1.2), (9.4, 1.2), (9.4, 4.6)], LASER)
    label(axes, (6.95, 1.6), "retro-reflector, in section")
    path(axes, [(2.2, 0.6), (2.2, 6.1)], SCENE)
    label(axes, (2.2, 0.25), "from the Earth")
    box(axes, (9.4, 5.6), (2.8, 2.0), "star and laser\ntracker")
    for side in (-1, 1):
        line(axes, [(9.4 + side * 1.0, 6.6), (9.4 + side * 1.7, 8.2)], 1.3)
    label(axes, (11.2, 7.4), "baffle", ha="left")
    path(axes, [(9.9, 10.4), (9.9, 6.7)], STAR)
    box(axes, (6.65, 5.4), (2.7, 0.8), "platform")
    key(axes, (LASER, STAR, SCENE), (0.0, 1.0))


@draws("chen2023/fig-2b", given=[DETECTORS])
@diagram(14.8, 8.2)
def draw_focal_plane(axes: Axes, door: Given) -> None:
    """Focal plane of the camera: detectors in two planes, joined by reflectors, and the lasers."""
    count = door.count(DETECTORS)
    _planes(axes)
    for index in range(count):
        x = 1.5 + 0.7 * index
        if index % 2 == 0:
            _detector(axes, np.array([x, 3.9]), np.array([0.0, 0.9]), SCENE.colour, "//")
            box(axes, (x + 0.3, 3.0), (0.45, 0.45), style=":")
        else:
            _detector(axes, np.array([x - 0.75, 1.4]), np.array([0.3, 0.7]), "#AA7700", "")
    for place in ((0.9, 1.6), (10.8, 1.25)):
        axes.plot(*place, LASER.marker, color=LASER.colour, markersize=8)
    names = ((12.1, 4.4, "upright plane"), (12.1, 3.0, "reflectors"), (11.9, 2.1, "flat plane"))
    for x, y, name in (*names, (11.4, 1.25, "lasers: squares")):
        label(axes, (x, y), name, ha="left")
    for x in (3.0, 6.0, 9.0):
        arrow(axes, (x, 7.4), (x, 6.0), SCENE)
    label(axes, (6.0, 7.8), "light from the telescope")
    label(axes, (0.2, 6.3), f"{count} detectors", ha="left")


def _planes(axes: Axes) -> None:
    """Draw the outlines of the two planes, which share an edge."""
    for corners in (
        [(1.2, 3.0), (11.9, 3.0), (11.9, 5.4), (1.2, 5.4)],
        [(1.2, 3.0), (11.9, 3.0), (10.9, 0.9), (0.2, 0.9)],
    ):
        line(axes, [*corners, corners[0]], 0.8)


def _detector(axes: Axes, foot: FloatArray, rise: FloatArray, colour: str, hatch: str) -> None:
    from matplotlib.patches import Polygon

    side = np.array([0.6, 0.0])
    corners = np.array([foot, foot + side, foot + side + rise, foot + rise])
    patch = Polygon(corners, closed=True, facecolor=colour, edgecolor=INK, hatch=hatch)
    axes.add_patch(patch)
