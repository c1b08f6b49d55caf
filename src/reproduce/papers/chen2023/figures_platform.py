"""Figures 1c and 6: a frame of stars and lasers, and the ground platform.

Drawn from the captions and the text; the paper's own pictures were not at hand, and nothing here
claims their likeness.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.chen2023 import lasers
from reproduce.papers.chen2023.sketch import (
    INK,
    LASER,
    STAR,
    arc,
    arrow,
    box,
    canvas,
    label,
    lens,
    mirror,
    ray,
    turned,
)
from reproduce.physics.lasers import received_spots
from reproduce.physics.rotations import rotation_from_vector, transpose
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given
from reproduce.store.stars import bright_stars

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

DESIGN = "chen2023/text-design"
ANGLES = tuple(f"{DESIGN}#{name}-angle" for name in ("boresight", "table", "dihedral"))
# Towards Orion, for no better reason than that everybody knows it; turned about the boresight.
POINTING = np.radians([83.8, -1.0, 20.0])
FAINTEST = 6.0
NAMED = {1852: "Mintaka", 1903: "Alnilam", 1948: "Alnitak", 1899: "Hatysa"}


def starfield() -> tuple[FloatArray, FloatArray, list[int]]:
    """Return the stars that the tracker sees in the example: spots, magnitudes, numbers.

    Returns
    -------
    spots : ndarray, shape (n, 2)
        In px.
    magnitude : ndarray, shape (n,)
        Visual.
    numbers : list of int
        In the Bright Star Catalogue.
    """
    door = given(lasers.READS)
    pixels = door.array(f"{lasers.PLATFORM}#tracker-pixels-*.value")
    tracker = (
        (pixels - 1) / 2,
        door[f"{lasers.PLATFORM}#tracker-pixel-size.value"],
        door[f"{lasers.PLATFORM}#tracker-focal-length.value"],
    )
    stars = bright_stars()
    rays = stars.directions @ transpose(_tracker_from_inertial())
    ahead = (rays[:, 2] > 0.9) & (stars.magnitude <= FAINTEST)
    spots = received_spots(rays[ahead], *tracker)
    inside = ((spots > 0) & (spots < pixels - 1)).all(axis=1)
    numbers = [int(n) for n in stars.number[ahead][inside]]
    return spots[inside], stars.magnitude[ahead][inside], numbers


def _tracker_from_inertial() -> FloatArray:
    alpha, delta, turn = POINTING
    boresight = np.array(
        [np.cos(delta) * np.cos(alpha), np.cos(delta) * np.sin(alpha), np.sin(delta)]
    )
    east = np.array([-np.sin(alpha), np.cos(alpha), 0.0])
    north = np.cross(boresight, east)
    axes = np.stack([east, north, boresight])
    result: FloatArray = rotation_from_vector([0.0, 0.0, -turn]) @ axes
    return result


def draw_frame(figure: Figure, printed: Mapping[str, float]) -> None:
    """A frame of the star and laser tracker: stars of the catalogue and the four laser spots.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Addresses of the printed centroids to values, in px.
    """
    spots, magnitude, numbers = starfield()
    centres = np.array(list(printed.values())).reshape(-1, 2)
    figure.set_size_inches(6.0, 6.0)
    axes = figure.add_subplot()
    axes.scatter(
        spots[:, 0],
        spots[:, 1],
        s=4 * 1.7 ** (FAINTEST - magnitude),
        color=STAR.colour,
        label="stars",
    )
    for number, (x, y) in zip(numbers, spots, strict=True):
        if number in NAMED:
            axes.annotate(NAMED[number], (x + 14, y), va="center", fontsize=8)
    axes.plot(*centres.T, "s", markersize=4, color=LASER.colour, label="laser spots, printed")
    axes.set(xlim=(-0.5, 1023.5), ylim=(1023.5, -0.5), aspect="equal")
    axes.set(xlabel="x (px)", ylabel="y (px)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.09), ncols=2)


def draw_stage(figure: Figure, printed: Mapping[str, float]) -> None:
    """The stage that moves the lasers, and how the four lasers sit on it.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Addresses of the printed diagonal to its value, in metres.
    """
    diagonal = next(iter(printed.values())) * 1e3
    axes = canvas(figure, 12.0, 8.0)
    centre = np.array([5.5, 4.0])
    box(axes, (5.5, 4.0), (7.0, 7.0))
    label(axes, (2.3, 0.85), "stage", side="left")
    corners = np.array([[0, 1], [1, 0], [0, -1], [-1, 0]]) * 2.4 + centre
    outline = np.vstack([corners, corners[:1]])
    axes.plot(*outline.T, color=INK, linewidth=0.7, linestyle=":")
    axes.plot(*corners.T, "o", markersize=13, color=LASER.colour)
    arrow(axes, (3.35, 4.0), (7.65, 4.0), style="<|-|>")
    label(axes, (6.4, 4.35), f"{diagonal:g} mm")
    arrow(axes, (9.8, 1.6), (11.6, 1.6))
    arrow(axes, (9.8, 1.6), (9.8, 3.4))
    label(axes, (9.6, 0.9), "X, turns the\ncamera about Y", side="left", size=8)
    label(axes, (9.6, 4.0), "Y, turns it\nabout X", side="left", size=8)


def draw_bench(figure: Figure, printed: Mapping[str, float]) -> None:
    """The ground platform: lasers, telescope, two mirrors at a right angle, tracker.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Addresses of the printed angles to values, in radians.
    """
    between, table, tilt = (float(np.degrees(printed[address])) for address in ANGLES)
    axes = canvas(figure, 16.0, 8.6, 7.2)
    box(axes, (1.0, 5.2), (0.7, 2.2), "")
    label(axes, (1.0, 6.7), "stage and lasers", size=8)
    lens(axes, (4.6, 5.2), 2.6)
    label(axes, (4.6, 6.9), "telescope", size=8)
    ray(axes, [(1.4, 5.6), (4.6, 5.6), (14.0, 5.6), (14.0, 3.4), (9.0, 3.4)], LASER)
    mirror(axes, (14.0, 5.6), 1.6, -45)
    mirror(axes, (14.0, 3.4), 1.6, 45)
    label(axes, (14.9, 4.5), "two mirrors\nat a right\nangle", side="left", size=8)
    # The tracker looks backwards and up; its mirror folds the laser into it.
    out = turned([1.0, 0.0], between)
    hit = np.array([9.0, 3.4])
    lens_at, detector_at = hit - 1.6 * out, hit - 3.0 * out
    ray(axes, [(9.0, 3.4), (float(detector_at[0]), float(detector_at[1]))], LASER)
    mirror(axes, (9.0, 3.4), 1.7, between - 90 + (tilt if between < 180 else -tilt))
    lens(axes, (float(lens_at[0]), float(lens_at[1])), 1.5, between)
    box(axes, (float(detector_at[0]), float(detector_at[1])), (0.3, 1.3), turn=between)
    label(axes, (10.6, 1.6), "tracker", size=9)
    far = hit + 3.2 * out
    ray(axes, [(float(far[0]), float(far[1])), (9.0, 3.4)], STAR)
    label(axes, (8.0, 7.3), "boresight of tracker", size=8)
    arc(axes, (9.0, 3.4), 1.2, (0, between), f"{between:g}°")
    label(axes, (0.4, 0.7), f"tracker against the table: {table:g}°;", side="left", size=8)
    label(axes, (0.4, 0.2), f"mirror against the plane across it: {tilt:g}°", side="left", size=8)
    label(axes, (6.0, 6.0), "camera's boresight", size=8)
