"""Figures 1c and 6: a frame of stars and lasers, and the ground platform.

Drawn from the captions and the text; the paper's own pictures were not at hand, and nothing here
claims their likeness.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.chen2023 import lasers
from reproduce.papers.chen2023.sketch import LASER, STAR, lens, mirror, reflected
from reproduce.papers.declare import draws
from reproduce.papers.sketch import arc, arrow, beside, box, canvas, key, label, line, path, turned
from reproduce.physics.attitude.lasers import received_spots
from reproduce.physics.attitude.misalignment import stage_angles
from reproduce.physics.attitude.rotations import rotation_from_vector, transpose
from reproduce.physics.optics.camera import detector_centre
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.store.stars import bright_stars

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

DESIGN = "chen2023/text-satellite"
ANGLES = tuple(f"{DESIGN}#{name}-angle" for name in ("boresight", "table", "dihedral"))
# Towards Orion, for no better reason than that everybody knows it; turned about the boresight.
POINTING = np.radians([84.6, -0.4, 20.0])
FAINTEST = 6.0
# With the side on which there is room for the name.
NAMED = {1852: ("Mintaka", 1), 1903: ("Alnilam", -1), 1948: ("Alnitak", -1), 1899: ("Hatysa", -1)}


def starfield(door: Given) -> tuple[FloatArray, FloatArray, list[int]]:
    """Return the stars that the tracker sees in the example: spots, magnitudes, numbers.

    Shape (n, 2). In px. Shape (n,). Visual.
    """
    pixels = door.array(f"{lasers.PLATFORM}#tracker-pixels-*.value")
    tracker = (
        detector_centre(pixels),
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


@draws("chen2023/fig-1c", given=lasers.READS, marks=[lasers.SPOTS])
def draw_frame(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """A frame of the star and laser tracker: stars of the catalogue and the four laser spots."""
    spots, magnitude, numbers = starfield(door)
    centres = np.array(list(printed.values())).reshape(-1, 2)
    figure.set_size_inches(6.0, 6.0)
    axes = figure.add_subplot()
    axes.scatter(
        spots[:, 0],
        spots[:, 1],
        s=5 * 1.7 ** (FAINTEST - magnitude),
        color=STAR.colour,
        marker=STAR.marker,
        label="stars",
    )
    for number, (x, y) in zip(numbers, spots, strict=True):
        if number in NAMED:
            name, side = NAMED[number]
            ends = "left" if side > 0 else "right"
            axes.annotate(name, (x + 16 * side, y), ha=ends, va="center", fontsize=9)
    axes.plot(
        *centres.T, LASER.marker, markersize=5, color=LASER.colour, label="laser spots, printed"
    )
    axes.set(xlim=(-0.5, 1023.5), ylim=(1023.5, -0.5), aspect="equal")
    axes.set(xlabel="x (px)", ylabel="y (px)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.09), ncols=2)


def stage_sense(index: int) -> str:
    """Say about which axis a camera seems to turn when the stage moves along positive X or Y.

    Examples
    --------
    >>> stage_sense(1)
    '+X'
    """
    angles = stage_angles(np.eye(2)[index], 1.0)
    axis = int(np.abs(angles).argmax())
    return f"{'+' if angles[axis] > 0 else '−'}{'XYZ'[axis]}"


@draws("chen2023/fig-6a", marks=[lasers.DIAGONAL])
def draw_stage(figure: Figure, printed: Mapping[str, float]) -> None:
    """The stage that moves the lasers, and how the four lasers sit on it."""
    diagonal = next(iter(printed.values())) * 1e3
    axes = canvas(figure, 12.6, 7.6)
    centre = np.array([3.8, 3.8])
    box(axes, centre, (7.0, 7.0))
    label(axes, (0.7, 0.7), "stage", ha="left")
    corners = np.array([[0, 1], [1, 0], [0, -1], [-1, 0]]) * 2.4 + centre
    line(axes, np.vstack([corners, corners[:1]]), 0.7, ":")
    axes.plot(*corners.T, LASER.marker, markersize=11, color=LASER.colour)
    arrow(axes, beside(corners[3], 0.3, 0), corners[1] - [0.3, 0], style="<|-|>")
    label(axes, beside(centre, 0.0, 0.35), f"{diagonal:g} mm")
    label(axes, beside(corners[0], 0.0, 0.55), "laser")
    corner = np.array([8.3, 2.6])
    arrow(axes, corner, beside(corner, 2.0, 0.0))
    arrow(axes, corner, beside(corner, 0.0, 2.0))
    label(axes, beside(corner, 2.3, 0.0), "X")
    label(axes, beside(corner, 0.0, 2.35), "Y")
    for index, y in enumerate((1.5, 0.9)):
        text = f"towards {'XY'[index]}: as if the camera turned about {stage_sense(index)}"
        label(axes, (7.5, y), text, ha="left", size=8)


@draws("chen2023/fig-6b", marks=ANGLES)
def draw_bench(figure: Figure, printed: Mapping[str, float]) -> None:
    """The ground platform: lasers, telescope, two mirrors at a right angle, tracker."""
    between, table, tilt = (float(np.degrees(printed[address])) for address in ANGLES)
    axes = canvas(figure, 16.0, 9.0, 6.8)
    box(axes, (0.8, 5.4), (0.7, 2.2))
    label(axes, (0.2, 7.0), "stage and lasers", ha="left")
    lens(axes, (4.6, 5.4), 2.6)
    label(axes, (4.6, 7.2), "telescope")
    label(axes, (10.6, 5.75), "camera's boresight")
    out, hit, back = turned([1.0, 0.0], between), np.array([8.6, 3.4]), np.array([-1.0, 0.0])
    path(axes, [(1.2, 5.4), (4.6, 5.4), (13.4, 5.4), (13.4, 3.4), hit], LASER)
    mirror(axes, (13.4, 5.4), 1.6, -45)
    mirror(axes, (13.4, 3.4), 1.6, 45)
    label(axes, (14.1, 4.4), "two mirrors\nat a right\nangle", ha="left")
    # The mirror stands at its tilt to the plane across the tracker's boresight.
    stands = between - 90 + tilt
    detector = hit + 3.0 * reflected(back, stands)
    mirror(axes, hit, 1.9, stands)
    path(axes, [hit, detector], LASER)
    lens(axes, hit - 1.6 * out, 1.6, between)
    box(axes, detector, (0.3, 1.4), turn=between)
    label(axes, beside(detector, 0.9, 0.9), "tracker", ha="left")
    path(axes, [hit + 4.4 * out, hit], STAR)
    label(axes, beside(hit + 4.4 * out, 0.2, 0.5), "tracker's boresight")
    arc(axes, hit, 1.2, (0, between), head=False)
    label(axes, beside(hit, 0.9, 1.35), f"{between:g}°")
    label(axes, (0.2, 1.0), f"tracker against the table: {table:g}°", ha="left")
    label(axes, (0.2, 0.4), f"mirror against the plane across it: {tilt:g}°", ha="left")
    key(axes, (LASER, STAR), (0.8, 1.0))
