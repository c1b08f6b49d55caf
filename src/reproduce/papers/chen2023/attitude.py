"""Directions and signs of equations (2) to (9), drawn, and the axes that an error is decomposed in.

Turned axes and rays are drawn from what the functions return, angles, fields and lenses far too
large, or nothing would be seen (chen2023, II and III).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from reproduce.papers.chen2023 import platform
from reproduce.papers.chen2023.satellite import LASER
from reproduce.papers.declare import draws, studied
from reproduce.papers.sketch import INK, Look, Sketch, beside, seen_from
from reproduce.physics.attitude import emitted_directions, rotation_from_vector
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PRINTED = "chen2023/table-4#1.transform-?"
_NAMES = ("X", "Y", "Z")
_BEFORE = Look("zero point", INK, "--")
_TURN = float(np.radians(28.0))
_ROUTE = {
    "calibration": (
        "installation,\nby the stars",
        "spots at the\nzero point",
        "laser\ntransform",
    ),
    "monitoring": (
        "spots in\nevery frame",
        "mean over\nmany frames",
        "misalignment,\nby QUEST",
    ),
    "correction": (
        "corrected\ninstallation",
        "attitude of\ntracker",
        "attitude of\ncamera",
    ),
}


@draws("chen2023/fig-4")
def _draw_route(figure: Figure) -> None:
    """Technical route: calibration, monitoring, correction."""
    sketch = Sketch.on(figure, 15.0, 12.4)
    heights = (9.6, 5.6, 1.6)
    for x, (name, texts) in zip((2.5, 7.5, 12.5), _ROUTE.items(), strict=True):
        sketch.label((x, 11.8), name, size=11)
        for y, text in zip(heights, texts, strict=True):
            sketch.box((x, y), (4.2, 2.4), text)
        for y in heights[:2]:
            sketch.arrow((x, y - 1.2), (x, y - 2.8))
    sketch.arrow((4.6, 1.6), (5.4, 1.6))
    sketch.path([(9.6, 1.6), (10.0, 1.6), (10.0, 9.6), (10.4, 9.6)])


@draws("chen2023/fig-5")
def _draw_transform(figure: Figure) -> None:
    """Laser directions in the camera and in the tracker, joined by the laser transform."""
    sketch = Sketch.on(figure, 14.0, 8.4)
    for x, vector, name, what in ((3.0, "v", "c", "lasers"), (11.0, "w", "s", "spots")):
        sketch.line([(x - 2.2, 1.2), (x + 2.2, 1.2)], 2.5)
        sketch.lens((x, 4.4), 3.0, 90)
        for tip, text in (((x, 2.8), f"$Z_{name}$"), ((x + 2.7, 1.2), f"$X_{name}$")):
            sketch.arrow((x, 1.2), tip)
            sketch.label(beside(tip, 0.1, 0.35), text)
        for number, offset in ((1, -1.2), (2, 1.2)):
            # The light of one laser through the lens, its direction as equation (2) gives it.
            direction = emitted_directions([(offset, 0.0)], 3.2)[0][[0, 2]]
            places = [(x + offset, 1.2), (x, 4.4), (x, 4.4) + 2.9 * direction]
            sketch.path(places if vector == "v" else places[::-1], LASER)
            sketch.label(
                beside(places[2], 0.0, 0.4), rf"$\mathbf{{{vector}}}_{number}$"
            )
        sketch.label((x, 0.5), what)
    sketch.arrow((5.6, 5.9), (8.4, 5.9))
    sketch.label((7.0, 6.4), r"$\mathbf{w} = T\,\mathbf{v}$", size=11)
    sketch.label((7.0, 5.2), "retro-reflector,\ndichroic mirror")


def _turned_camera(angles: ArrayLike) -> FloatArray:
    """Return X, Y and Z of a turned camera as rows, in the camera frame of the zero point.

    Examples
    --------
    A quarter turn about Y brings the boresight to where X was.

    >>> _turned_camera([0, np.pi / 2, 0])[2].round(12) + 0.0
    array([1., 0., 0.])
    """
    # A row of the matrix is an axis of its target frame, said in its source frame.
    return np.asarray(rotation_from_vector(angles).mT)


def towards(before: ArrayLike, after: ArrayLike) -> str:
    """Say along which axis a vector has moved most, with its sign.

    Examples
    --------
    >>> towards([0, 0, 1], [0.3, 0, 0.9])
    '+X'
    """
    across = np.subtract(after, before)
    axis = int(np.abs(across).argmax())
    return f"{'+' if across[axis] > 0 else '−'}{_NAMES[axis]}"


@draws("chen2023/drawing-misalignment")
def _draw_misalignment(figure: Figure) -> None:
    """Positive misalignment angles: the camera's axes before and after a turn about each."""
    sketch = Sketch.on(figure, 13.6, 6.2, 6.8, (13.6, 7.4))
    below, gap = (1.2, "\n") if sketch.narrow else (0.0, " ")
    sketch.axes.set_ylim(-below, 6.2)
    for index, x in enumerate((2.0, 6.6, 11.2)):
        view, centre = seen_from(-62.0, 26.0, (x, 2.7), 2.2), np.zeros(3)
        angles = _TURN * np.eye(3)[index]
        after = _turned_camera(angles)
        sketch.triad(view, centre, 1.15 * np.eye(3), _NAMES, look=_BEFORE)
        sketch.triad(view, centre, np.delete(after, index, axis=0), ["", ""], width=2.4)
        watched, what = (0, "X") if index == 2 else (2, "boresight")
        before = np.eye(3)[watched]
        sketch.sense(view, centre, angles, 0.75 * before, _TURN)
        axis = towards(before, after[watched])
        text = rf"$\theta_{_NAMES[index]} > 0$: {what}{gap}towards {axis}"
        sketch.label((x + 0.2, 0.95 - below / 4), text)
    sketch.label((6.8, 0.2 - below), "dashed: zero point; thick: now")


@studied(
    "chen2023/orders",
    given=(*platform.INSTRUMENT, f"{platform.SCATTER}#1-*", _PRINTED),
)
def _orders(given: Given) -> list[tuple[str | float, ...]]:
    """Accuracy of a single frame in the axes of either instrument, for two principal points."""
    designed = platform.as_designed(given)
    points = {
        "centre of the detector": designed.principal_point,
        "middle of the spots": designed.spots.mean(axis=0),
    }
    rows: list[tuple[str | float, ...]] = []
    for name, point in points.items():
        design = replace(designed, principal_point=point)
        response = design.response(design.spots)
        # One small rotation, seen in the other frame: its vector turns with the laser transform.
        responses = (
            response,
            np.tensordot(design.transform(design.spots), response, axes=1),
        )
        for frame, response in zip(("camera", "tracker"), responses, strict=True):
            variance = (response**2 * platform.scatter(given, 1) ** 2).sum(
                axis=(-2, -1)
            )
            angles = platform.SIGMAS * np.sqrt(variance[:2])
            rows.append((name, frame, *map(float, angles * ARCSEC_PER_RADIAN)))
    return [
        *rows,
        ("printed", "", *map(float, given.array(_PRINTED) * ARCSEC_PER_RADIAN)),
    ]
