"""Frames and signs of equations (1) to (10), drawn, and the axes that an error is decomposed in.

The drawings are made from what the functions return (chen2023, II and III): no direction is chosen
by hand where a function knows it. Rays come from (1), (2) and (3), turned axes from the
misalignment of (6) and (7), tilted beams from (10). Angles, fields and lenses are drawn far too
large, or nothing would be seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from reproduce.papers.chen2023 import platform
from reproduce.papers.chen2023.looks import LASER, SCENE, lens
from reproduce.papers.declare import draws
from reproduce.papers.sketch import (
    INK,
    Look,
    arc,
    arrow,
    beside,
    canvas,
    key,
    label,
    line,
    path,
    slim,
)
from reproduce.papers.space import View, seen_from, sense, triad
from reproduce.papers.study import studied
from reproduce.physics.attitude import (
    emitted_directions,
    misalignment_angles,
    received_directions,
    rotation_from_vector,
    stage_angles,
)
from reproduce.physics.ground import image_vectors
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PRINTED = "chen2023/table-4#1.transform-?"
NAMES = ("X", "Y", "Z")
# Where the three instruments stand beside each other on the paper.
WIDE = (2.4, 7.6, 12.8)
BEFORE = Look("zero point", INK, "--")
FOCAL = 2.2
LENS = np.array([0.0, 0.0, FOCAL])
POINT = (0.85, 0.75)
SPOT = (*POINT, 0.0)
REACH = 2.6
TURN = float(np.radians(28.0))
SHIFT = 0.8


def turned_camera(angles: ArrayLike) -> FloatArray:
    """Return the axes of a camera that has turned, in the camera frame of the zero point.

    Shape (3, 3). X, Y and Z of the turned camera, one per row.

    Examples
    --------
    A quarter turn about Y brings the boresight to where X was.

    >>> turned_camera([0, np.pi / 2, 0])[2].round(12) + 0.0
    array([1., 0., 0.])
    """
    now_from_zero = rotation_from_vector(np.asarray(angles, dtype=np.float64)).T
    if not np.allclose(misalignment_angles(now_from_zero), angles):
        raise ValueError("angles: expected less than half a turn")
    # A row of the matrix is an axis of its target frame, said in its source frame.
    return now_from_zero


def towards(before: ArrayLike, after: ArrayLike) -> str:
    """Say along which axis a vector has moved most, with its sign.

    Examples
    --------
    >>> towards([0, 0, 1], [0.3, 0, 0.9])
    '+X'
    """
    across = np.asarray(after, dtype=np.float64) - np.asarray(before, dtype=np.float64)
    axis = int(np.abs(across).argmax())
    return f"{'+' if across[axis] > 0 else '−'}{NAMES[axis]}"


@draws("chen2023/drawing-instruments")
def draw_instruments(figure: Figure) -> None:
    """Frames of camera and tracker, with the vectors of equations (1), (2) and (3)."""
    axes = canvas(figure, 15.6, 8.8, 6.8, (10.4, 17.6))
    feet = [(2.4, 11.3), (7.6, 11.3), (2.4, 2.5)] if slim(axes) else [(x, 2.5) for x in WIDE]
    views = [seen_from(-68.0, 24.0, foot, 1.15) for foot in feet]
    for view, (name, title, look, what) in zip(
        views,
        (
            ("c", "camera, (1)", SCENE, "$(X, Y)$"),
            ("c", "camera, (2)", LASER, "$(X_i, Y_i)$"),
            ("s", "tracker, (3)", LASER, "$(x_i, y_i)$"),
        ),
        strict=True,
    ):
        _instrument(axes, view, name)
        label(axes, beside(view.centre, 0.0, -2.1), title, size=10)
        place = view.point(SPOT)
        axes.plot(*place, look.marker, color=look.colour, markersize=6)
        label(axes, beside(place, -0.1, -1.1), what)
    # The bracket of (1), from the lens to the image point, against the light's way out.
    bracket, point = image_vectors([POINT], FOCAL)[0], views[0].point
    target, middle = point(LENS - 0.9 * bracket), point(LENS)
    path(axes, [target, middle], SCENE)
    arrow(axes, middle, point(LENS + bracket), width=2.4)
    label(axes, beside(target, 0.0, 0.35), "from the target")
    label(axes, beside(point(LENS + 0.45 * bracket), 0.95, 0.15), "bracket")
    # A laser, its light through the lens and the direction (2) in which that leaves.
    direction, point = emitted_directions([POINT], FOCAL)[0], views[1].point
    middle, end = point(LENS), point(LENS + REACH * direction)
    path(axes, [point(SPOT), middle], LASER)
    arrow(axes, middle, end, LASER, width=2.4)
    label(axes, beside(end, 0.0, 0.35), r"$\mathbf{v}_i$: goes")
    # A spot, the light that made it and the direction (3) from which that came.
    direction = received_directions([POINT], (0.0, 0.0), 1.0, FOCAL)[0]
    point, aside = views[2].point, np.array([0.35, 0.12])
    start, middle = point(LENS + REACH * direction), point(LENS)
    path(axes, [start, middle, point(SPOT)], LASER)
    arrow(axes, middle + aside, start + aside, width=2.4)
    label(axes, beside(start, 0.2, 0.45), r"$\mathbf{w}_i$: where from")
    key(axes, (SCENE, LASER), (0.6, 0.3) if slim(axes) else (0.0, 1.0))


def _instrument(axes: Axes, view: View, name: str) -> None:
    """Draw the focal plane, the lens above it and the frame that both instruments use."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]]) * 1.25
    line(axes, view.point(corners))
    around = np.linspace(0, 2 * np.pi, 80)
    rim = np.stack([0.7 * np.cos(around), 0.7 * np.sin(around), 0 * around + FOCAL], axis=-1)
    line(axes, view.point(rim), 1.2)
    triad(axes, view, np.zeros(3), np.diag([1.9, 2.0, 1.3]), [f"${n}_{name}$" for n in NAMES])


@draws("chen2023/drawing-misalignment")
def draw_misalignment(figure: Figure) -> None:
    """Positive misalignment angles: the camera's axes before and after a turn about each."""
    axes = canvas(figure, 13.6, 6.2, 6.8, (13.6, 7.4))
    below, gap = (1.2, "\n") if slim(axes) else (0.0, " ")
    axes.set_ylim(-below, 6.2)
    for index, x in enumerate((2.0, 6.6, 11.2)):
        view, centre = seen_from(-62.0, 26.0, (x, 2.7), 2.2), np.zeros(3)
        angles = TURN * np.eye(3)[index]
        after = turned_camera(angles)
        triad(axes, view, centre, 1.15 * np.eye(3), NAMES, look=BEFORE)
        triad(axes, view, centre, np.delete(after, index, axis=0), ["", ""], width=2.4)
        watched, what = (0, "X") if index == 2 else (2, "boresight")
        before = np.eye(3)[watched]
        sense(axes, view, centre, angles, 0.75 * before, TURN)
        axis = towards(before, after[watched])
        text = rf"$\theta_{NAMES[index]} > 0$: {what}{gap}towards {axis}"
        label(axes, (x + 0.2, 0.95 - below / 4), text)
    label(axes, (6.8, 0.2 - below), "dashed: zero point; thick: now")


@draws("chen2023/drawing-stage")
def draw_stage(figure: Figure) -> None:
    """Lasers that move, and the camera whose turn they stand for, by (10) with signs."""
    axes = canvas(figure, 14.0, 8.2)
    # The plane of one axis and Z: a laser moved along the axis, and the turned camera.
    for index, x in enumerate((3.4, 10.4)):
        shift, name = SHIFT * np.eye(2)[index], NAMES[index]
        beam, angles = emitted_directions([shift], FOCAL)[0], stage_angles(shift, FOCAL)
        boresight = turned_camera(angles)[2, [index, 2]]
        origin, centre = np.array([x, 1.6]), np.array([x, 1.6 + 1.4 * FOCAL])
        line(axes, [origin - [2.2, 0], beside(origin, 2.2, 0)], 2.5)
        lens(axes, centre, 2.6, 90)
        source = beside(origin, 1.4 * SHIFT, 0.0)
        path(axes, [source, centre, centre + 2.6 * beam[[index, 2]]], LASER)
        axes.plot(*source, LASER.marker, color=LASER.colour, markersize=7)
        arrow(axes, origin, source, width=2.2)
        line(axes, [origin, beside(centre, 0, 2.4)], 0.8, ":")
        end = float(np.degrees(np.arctan2(boresight[1], boresight[0])))
        arc(axes, centre, 1.9, (90.0, end), head=True)
        turn = int(np.abs(angles).argmax())
        sign = ">" if angles[turn] > 0 else "<"
        label(axes, centre + 2.95 * boresight, rf"$\theta_{NAMES[turn]} {sign} 0$")
        label(axes, beside(centre, 0.35, 2.2), "$Z$")
        label(axes, beside(origin, 2.6, 0.0), f"${name}$")
        label(axes, beside(origin, 0.0, -0.6), f"laser moves towards +{name}")
        label(axes, beside(origin, 0.0, -1.3), f"its beam goes towards {towards([0, 0, 1], beam)}")
    key(axes, (LASER,), (0.38, 1.0))


@studied(
    "chen2023/orders",
    given=(*platform.INSTRUMENT, f"{platform.SCATTER}#1-*", PRINTED),
)
def orders(given: Given) -> list[tuple[str | float, ...]]:
    """Accuracy of a single frame in the axes of either instrument, for two principal points."""
    points = {
        "centre of the detector": platform.tracker(given)[0],
        "middle of the spots": platform.printed_spots(given).mean(axis=0),
    }
    rows: list[tuple[str | float, ...]] = []
    for name, point in points.items():
        responses = platform.responses(given, point)
        for frame, response in zip(("camera", "tracker"), responses, strict=True):
            variance = (response**2 * platform.scatter(given, 1) ** 2).sum(axis=(-2, -1))
            angles = platform.SIGMAS * np.sqrt(variance[:2])
            rows.append((name, frame, *map(float, angles * ARCSEC_PER_RADIAN)))
    return [*rows, ("printed", "", *map(float, given.array(PRINTED) * ARCSEC_PER_RADIAN))]
