"""Figures 1 and 2: the satellite, its monitoring system and the focal plane, as diagrams.

Drawn from the captions and the text; the paper's own pictures were not at hand, and nothing here
claims their likeness or a scale.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.chen2023.sketch import (
    INK,
    LASER,
    SCENE,
    STAR,
    arrow,
    box,
    canvas,
    frame,
    label,
    legend,
    mirror,
    ray,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DETECTORS = "chen2023/text-hardware#detectors"


def draw_geometry(figure: Figure, printed: Mapping[str, float]) -> None:
    """Frames of the imaging model, from a point of the image to a place on the Earth.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure.
    """
    axes = canvas(figure, 12.0, 8.6)
    centre, radius = np.array([3.4, 2.9]), 2.3
    sweep = np.linspace(0, 2 * np.pi, 200)
    for flat in (1.0, 0.28):
        axes.plot(
            centre[0] + radius * np.cos(sweep),
            centre[1] + flat * radius * np.sin(sweep),
            color=INK,
            linewidth=1.3 if flat == 1.0 else 0.7,
        )
    origin = (float(centre[0]), float(centre[1]))
    frame(axes, origin, "WGS84", 1.5, 12)
    frame(axes, origin, "J2000", 1.5, -20)
    satellite, target = (8.4, 6.3), (5.05, 4.47)
    box(axes, satellite, (1.5, 0.8), "satellite", turn=30)
    frame(axes, (9.6, 7.0), "s", 0.9, 60)
    frame(axes, (8.0, 5.3), "c", 0.8, 210)
    ray(axes, [target, (8.0, 6.05)], SCENE)
    axes.plot(*target, "o", color=SCENE.colour)
    label(axes, (5.0, 3.95), "target")
    axes.plot([origin[0], satellite[0]], [origin[1], satellite[1]], color=INK, linewidth=0.7)
    label(axes, (6.6, 3.3), "position of the satellite: thin line", side="left")
    label(axes, (9.0, 5.0), "line of sight:\nfrom image point\nand focal length", side="left")
    label(axes, (1.0, 7.9), "camera → tracker → J2000 → WGS84", side="left", size=10)
    ray(axes, [(10.8, 8.4), (9.9, 7.6)], STAR)
    legend(axes, (SCENE, STAR), (0.72, 0.02))


def draw_system(figure: Figure, printed: Mapping[str, float]) -> None:
    """The monitoring system: what the laser light couples, and what the stars add.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure.
    """
    axes = canvas(figure, 12.0, 6.4)
    box(axes, (2.4, 3.4), (3.2, 1.6), "camera with lasers\nin its focal plane")
    box(axes, (6.1, 1.0), (2.6, 1.0), "retro-reflector")
    box(axes, (9.4, 3.4), (2.8, 1.6), "star and laser\ntracker")
    ray(axes, [(2.0, 2.6), (2.0, 1.15), (4.8, 1.15)], LASER)
    ray(axes, [(7.4, 1.0), (9.4, 1.0), (9.4, 2.6)], LASER)
    ray(axes, [(10.0, 6.3), (10.0, 4.2)], STAR)
    ray(axes, [(2.8, 0.2), (2.8, 2.6)], SCENE)
    arrow(axes, (4.0, 3.4), (8.0, 3.4), style="<|-|>")
    label(axes, (6.0, 3.7), "installation and misalignment")
    label(axes, (6.0, 3.1), "what heat bends", size=8)
    label(axes, (6.0, 4.9), "camera's attitude = misalignment × installation × attitude of tracker")
    legend(axes, (LASER, STAR, SCENE), (0.0, 0.78))


def draw_structure(figure: Figure, printed: Mapping[str, float]) -> None:
    """Structure of the system in the satellite: camera down, tracker up, retro-reflector between.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure.
    """
    axes = canvas(figure, 12.0, 8.8)
    box(axes, (3.6, 5.0), (3.6, 5.0))
    label(axes, (0.2, 5.0), "camera", side="left")
    mirror(axes, (3.6, 5.9), 3.0, 0)
    label(axes, (2.35, 6.15), "primary", size=8)
    mirror(axes, (3.6, 3.0), 0.9, 0)
    label(axes, (4.15, 2.7), "secondary", size=8)
    box(axes, (3.6, 6.95), (2.4, 0.5), "focal plane, lasers")
    ray(axes, [(4.0, 6.7), (3.8, 3.1), (5.0, 5.8), (5.0, 1.4)], LASER)
    _retro_reflector(axes)
    ray(axes, [(5.0, 1.4), (5.7, 0.7), (8.3, 0.7), (9.0, 1.4), (9.0, 4.3)], LASER)
    _tracker(axes)
    ray(axes, [(9.5, 8.7), (9.5, 6.0)], STAR)
    ray(axes, [(2.4, 0.3), (2.4, 5.8)], SCENE)
    label(axes, (2.4, 0.1), "to the Earth", size=8)
    legend(axes, (LASER, STAR, SCENE), (0.0, 0.8))


def _retro_reflector(axes: Axes) -> None:
    mirror(axes, (5.35, 1.05), 1.3, -45)
    mirror(axes, (8.65, 1.05), 1.3, 45)
    axes.plot([5.6, 8.4], [0.35, 0.35], color=INK, linewidth=1)
    label(axes, (7.0, 1.15), "retro-reflector")


def _tracker(axes: Axes) -> None:
    box(axes, (9.4, 5.3), (2.4, 2.0), "star and laser\ntracker")
    axes.plot([8.4, 7.9], [6.3, 7.8], color=INK)
    axes.plot([10.4, 10.9], [6.3, 7.8], color=INK)
    label(axes, (11.3, 7.2), "baffle", size=8)
    box(axes, (7.0, 5.3), (1.6, 0.6), "platform")


def draw_focal_plane(figure: Figure, printed: Mapping[str, float]) -> None:
    """Focal plane of the camera: detectors in two planes, joined by reflectors, and the lasers.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure.
    """
    count = given([DETECTORS]).count(DETECTORS)
    axes = canvas(figure, 14.0, 8.2)
    _planes(axes)
    for index in range(count):
        x = 1.6 + 0.72 * index
        if index % 2 == 0:
            _detector(axes, np.array([x, 3.9]), np.array([0.0, 0.9]), "#0072B2")
            box(axes, (x + 0.3, 3.0), (0.45, 0.45), line=":")
        else:
            _detector(axes, np.array([x - 0.75, 1.4]), np.array([0.3, 0.7]), "#E69F00")
    for x, y in ((0.95, 1.5), (11.0, 1.3)):
        axes.plot(x, y, "o", color=LASER.colour, markersize=9)
    names = ((5.0, "upright plane"), (3.0, "reflector"), (2.2, "flat plane"), (1.5, "lasers"))
    for y, name in names:
        label(axes, (12.1, y), name, side="left", size=8)
    for x in (3.0, 6.0, 9.0):
        arrow(axes, (x, 7.6), (x, 6.0), SCENE.colour, SCENE.line)
    label(axes, (6.0, 7.9), "light from the telescope")
    label(axes, (0.2, 6.6), f"{count} detectors", side="left")


def _planes(axes: Axes) -> None:
    """Draw the outlines of the two planes, which share an edge."""
    for corners in (
        [(1.2, 3.0), (11.9, 3.0), (11.9, 5.4), (1.2, 5.4)],
        [(1.2, 3.0), (11.9, 3.0), (10.9, 0.9), (0.2, 0.9)],
    ):
        axes.plot(*np.array([*corners, corners[0]]).T, color=INK, linewidth=0.8)


def _detector(axes: Axes, foot: FloatArray, rise: FloatArray, colour: str) -> None:
    from matplotlib.patches import Polygon

    side = np.array([0.6, 0.0])
    corners = np.array([foot, foot + side, foot + side + rise, foot + rise])
    patch = Polygon(corners, closed=True)
    patch.set(facecolor=colour, alpha=0.6, edgecolor=INK)
    patch.set(hatch="//" if rise[0] == 0 else None)
    axes.add_patch(patch)
