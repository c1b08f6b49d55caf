"""Frames in space, seen from a side: parallel projection, three axes, the sense of a turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from reproduce.papers.sketch import INKED, SIZE, Look, Point, arrow, label, slim, turning
from reproduce.physics.attitude import rotation_from_vector, unit
from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class View:
    """A parallel projection onto the paper.

    Attributes
    ----------
    matrix : ndarray, shape (2, 3)
        To the right and upwards on the paper, as rows, in the frame that is seen.
    centre : tuple of float
        Where the origin of that frame lies on the paper.
    scale : float
        Units of the paper per unit of the frame.
    """

    matrix: FloatArray
    centre: Point = (0.0, 0.0)
    scale: float = 1.0

    def point(self, places: ArrayLike) -> FloatArray:
        """Return where places of shape (..., 3) lie on the paper, shape (..., 2)."""
        flat = np.asarray(places, dtype=np.float64) @ self.matrix.T
        return np.asarray(self.centre + self.scale * flat)


def seen_from(
    azimuth: float, elevation: float, centre: Point = (0.0, 0.0), scale: float = 1.0
) -> View:
    """Return the view of somebody who stands far out in a direction, Z upwards.

    Examples
    --------
    From negative Y, X points to the right and Z upwards.

    >>> seen_from(-90.0, 0.0).matrix.round(12) + 0.0
    array([[1., 0., 0.],
           [0., 0., 1.]])
    """
    around, above = np.radians([azimuth, elevation])
    viewer = np.array(
        [np.cos(above) * np.cos(around), np.cos(above) * np.sin(around), np.sin(above)]
    )
    right = np.array([-np.sin(around), np.cos(around), 0.0])
    return View(np.stack([right, np.cross(viewer, right)]), centre, scale)


def triad(
    axes: Axes,
    view: View,
    origin: ArrayLike,
    directions: FloatArray,
    names: Sequence[str],
    *,
    look: Look = INKED,
    width: float = 1.3,
) -> None:
    """Draw axes of a frame with their names."""
    start = view.point(origin)
    for direction, name in zip(directions, names, strict=True):
        end = view.point(np.asarray(origin) + direction)
        arrow(axes, start, end, look, width=width)
        if name:
            away = (end - start) / np.hypot(*(end - start))
            # Beside an arrow that runs sideways, above or below one that runs up or down.
            side = "center" if abs(away[0]) < 0.6 else "left" if away[0] > 0 else "right"
            gap = (0.36 if side == "center" else 0.16) * (1.2 if slim(axes) else 1.0)
            label(axes, end + gap * away, name, size=SIZE, ha=side)


def sense(
    axes: Axes, view: View, origin: ArrayLike, axis: ArrayLike, start: ArrayLike, angle: float
) -> None:
    """Draw the sense of a right-handed turn: the way of a vector while it turns about an axis."""
    steps = np.linspace(0.0, angle, 60)[:, np.newaxis] * unit("axis", axis)
    turning(axes, view.point(np.asarray(origin) + rotation_from_vector(steps) @ np.asarray(start)))
