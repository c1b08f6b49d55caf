"""Pieces of the drawings of chen2023: light, mirrors and lenses.

Laser light is drawn dashed and vermilion, starlight dash-dotted and green, light of the landscape
dotted and blue, so that they stay apart without colour. All else takes the page's own colour.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from reproduce.papers.sketch import INK, Look, line, turned
from reproduce.physics.light import reflection
from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LASER = Look("laser", "#D55E00", "--", "s")
STAR = Look("starlight", "#009E73", "-.", "o")
SCENE = Look("landscape", "#0072B2", ":", "^")


def mirror(axes: Axes, centre: ArrayLike, length: float, degrees: float, style: str = "-") -> None:
    """Draw a mirror as a thick line."""
    ends = turned([[-length / 2, 0], [length / 2, 0]], degrees) + np.asarray(centre)
    axes.plot(*ends.T, color=INK, linewidth=3, linestyle=style, solid_capstyle="butt")


def reflected(direction: ArrayLike, degrees: float) -> FloatArray:
    """Return where light in the plane of the paper goes after a mirror drawn at some degrees."""
    normal = turned([0.0, 1.0], degrees)
    return np.asarray(reflection([*normal, 0.0])[:2, :2] @ np.asarray(direction, dtype=np.float64))


def lens(axes: Axes, centre: ArrayLike, height: float, degrees: float = 0.0) -> None:
    """Draw a lens, its axis turned from the horizontal by some degrees."""
    t = np.linspace(-1, 1, 30)
    bulge = 0.12 * height * (1 - t**2)
    for side in (-1, 1):
        outline = np.stack([side * bulge, t * height / 2], axis=-1)
        line(axes, turned(outline, degrees) + np.asarray(centre), 1.2)
