"""The frames and signs of equations (1) to (10), drawn from what the functions return.

No direction here is chosen by hand where a function knows it: rays come from (1), (2) and (3),
turned axes from the misalignment of (6) and (7), tilted beams from (10). Angles, fields and lenses
are drawn far too large, or nothing would be seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from reproduce.papers.chen2023.figures.sketch import LASER, SCENE, lens
from reproduce.papers.declare import sketches
from reproduce.papers.sketch import INK, Look, arc, arrow, beside, canvas, key, label, line, path
from reproduce.papers.space import View, seen_from, sense, triad
from reproduce.physics.attitude.lasers import emitted_directions, received_directions
from reproduce.physics.attitude.misalignment import misalignment_angles, stage_angles
from reproduce.physics.attitude.rotations import rotation_from_vector, transpose
from reproduce.physics.ground.imaging import image_vectors
from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "FOCAL",
    "POINT",
    "TURN",
    "draw_instruments",
    "draw_misalignment",
    "draw_stage",
    "turned_camera",
]

NAMES = ("X", "Y", "Z")
BEFORE = Look("zero point", INK, "--")
FOCAL = 2.2
LENS = np.array([0.0, 0.0, FOCAL])
POINT = (0.85, 0.75)
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
    now_from_zero = transpose(rotation_from_vector(np.asarray(angles, dtype=np.float64)))
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


@sketches("chen2023-instruments")
def draw_instruments(figure: Figure) -> None:
    """Frames of camera and tracker, with the vectors of equations (1), (2) and (3)."""
    axes = canvas(figure, 15.6, 8.8, 6.8)
    for x, name, title in zip(
        (2.4, 7.6, 12.8), "ccs", ("camera, (1)", "camera, (2)", "tracker, (3)"), strict=True
    ):
        _instrument(axes, _view(x), name)
        label(axes, (x, 0.4), title, size=10)
    _image_point(axes, _view(2.4))
    _emitted(axes, _view(7.6))
    _received(axes, _view(12.8))
    key(axes, (SCENE, LASER), (0.0, 1.0))


def _view(x: float) -> View:
    return seen_from(-68.0, 24.0, (x, 2.5), 1.15)


def _instrument(axes: Axes, view: View, name: str) -> None:
    """Draw the focal plane, the lens above it and the frame that both instruments use."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]]) * 1.25
    line(axes, view.point(corners))
    around = np.linspace(0, 2 * np.pi, 80)
    rim = np.stack([0.7 * np.cos(around), 0.7 * np.sin(around), 0 * around + FOCAL], axis=-1)
    line(axes, view.point(rim), 1.2)
    lengths = np.array([1.9, 2.0, 1.3])
    triad(axes, view, np.zeros(3), np.diag(lengths), [f"${n}_{name}$" for n in NAMES])


def _image_point(axes: Axes, view: View) -> None:
    """Draw the bracket of (1) from the lens to the image point, against the light's way out."""
    bracket = image_vectors([POINT], FOCAL)[0]
    target = LENS - 0.9 * bracket
    path(axes, [view.point(target), view.point(LENS)], SCENE)
    arrow(axes, view.point(LENS), view.point(LENS + bracket), width=2.4)
    _mark(axes, view, SCENE, "$(X, Y)$")
    label(axes, beside(view.point(target), 0.0, 0.35), "from the target")
    label(axes, beside(view.point(LENS + 0.45 * bracket), 0.95, 0.15), "bracket")


def _emitted(axes: Axes, view: View) -> None:
    """Draw a laser, its light through the lens and the direction (2) in which that leaves."""
    direction = emitted_directions([POINT], FOCAL)[0]
    path(axes, [view.point([*POINT, 0.0]), view.point(LENS)], LASER)
    arrow(axes, view.point(LENS), view.point(LENS + REACH * direction), LASER, width=2.4)
    _mark(axes, view, LASER, "$(X_i, Y_i)$")
    label(axes, beside(view.point(LENS + REACH * direction), 0.0, 0.35), r"$\mathbf{v}_i$: goes")


def _received(axes: Axes, view: View) -> None:
    """Draw a spot, the light that made it and the direction (3) from which that came."""
    direction = received_directions([POINT], (0.0, 0.0), 1.0, FOCAL)[0]
    start = view.point(LENS + REACH * direction)
    path(axes, [start, view.point(LENS), view.point([*POINT, 0.0])], LASER)
    aside = np.array([0.35, 0.12])
    arrow(axes, view.point(LENS) + aside, start + aside, width=2.4)
    _mark(axes, view, LASER, "$(x_i, y_i)$")
    label(axes, beside(start, 0.2, 0.45), r"$\mathbf{w}_i$: where from")


def _mark(axes: Axes, view: View, look: Look, text: str) -> None:
    at = view.point([*POINT, 0.0])
    axes.plot(*at, look.marker, color=look.colour, markersize=6)
    label(axes, beside(at, -0.1, -1.1), text)


@sketches("chen2023-misalignment")
def draw_misalignment(figure: Figure) -> None:
    """Positive misalignment angles: the camera's axes before and after a turn about each."""
    axes = canvas(figure, 13.6, 6.2, 6.8)
    for index, x in enumerate((2.0, 6.6, 11.2)):
        view = seen_from(-62.0, 26.0, (x, 2.7), 2.2)
        angles = TURN * np.eye(3)[index]
        after = turned_camera(angles)
        triad(axes, view, np.zeros(3), 1.15 * np.eye(3), NAMES, look=BEFORE)
        moving = [row for row in range(3) if row != index]
        triad(axes, view, np.zeros(3), after[moving], ["", ""], width=2.4)
        watched = 2 if index != 2 else 0
        start = 0.75 * np.eye(3)[watched]
        sense(axes, view, np.zeros(3), angles, start, TURN)
        what = "boresight" if watched == 2 else "X"
        axis = towards(np.eye(3)[watched], after[watched])
        label(axes, (x + 0.2, 0.95), rf"$\theta_{NAMES[index]} > 0$: {what} towards {axis}")
    label(axes, (6.8, 0.2), "dashed: zero point; thick: now")


@sketches("chen2023-stage")
def draw_stage(figure: Figure) -> None:
    """Lasers that move, and the camera whose turn they stand for, by (10) with signs."""
    axes = canvas(figure, 14.0, 8.2)
    _moved(axes, 3.4, 0)
    _moved(axes, 10.4, 1)
    key(axes, (LASER,), (0.42, 1.0))


def _moved(axes: Axes, x: float, index: int) -> None:
    """Draw the plane of one axis and Z: a laser moved along the axis, and the turned camera."""
    shift = np.zeros(2)
    shift[index] = SHIFT
    beam = emitted_directions([shift], FOCAL)[0]
    angles = stage_angles(shift, FOCAL)
    boresight = turned_camera(angles)[2]
    plane = [index, 2]
    origin, centre = np.array([x, 1.6]), np.array([x, 1.6 + 1.4 * FOCAL])
    line(axes, [origin - [2.2, 0], beside(origin, 2.2, 0)], 2.5)
    lens(axes, centre, 2.6, 90)
    source = origin + 1.4 * np.array([SHIFT, 0.0])
    path(axes, [source, centre, centre + 2.6 * beam[plane]], LASER)
    axes.plot(*source, LASER.marker, color=LASER.colour, markersize=7)
    arrow(axes, origin, source, width=2.2)
    line(axes, [origin, beside(centre, 0, 2.4)], 0.8, ":")
    up, turned = np.array([0.0, 1.0]), boresight[plane]
    ends = np.degrees([np.pi / 2, np.arctan2(turned[1], turned[0])])
    arc(axes, centre, 1.9, (float(ends[0]), float(ends[1])), head=True)
    turn = int(np.abs(angles).argmax())
    sign = ">" if angles[turn] > 0 else "<"
    label(axes, centre + 2.95 * turned, rf"$\theta_{NAMES[turn]} {sign} 0$")
    label(axes, centre + 2.75 * up, "$Z$")
    label(axes, beside(origin, 2.6, 0.0), f"${NAMES[index]}$")
    label(axes, beside(source, 0.0, -0.5), f"laser moves towards +{NAMES[index]}")
    label(axes, beside(origin, 0.0, -1.1), f"its beam goes towards {towards([0, 0, 1], beam)}")
