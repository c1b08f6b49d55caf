"""The three channels of niu2024, told apart wherever they are drawn, and the axes of an image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.sketch import Look, Point, arrow, label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["BLUE", "GREEN", "LOOKS", "RED", "image_axes"]

RED = Look("red", "#D55E00", "--", "s")
GREEN = Look("green", "#009E73", "-.", "o")
BLUE = Look("blue", "#0072B2", ":", "^")
LOOKS = {look.name: look for look in (RED, GREEN, BLUE)}


def image_axes(axes: Axes, corner: Point, length: float) -> None:
    """Draw the x and y axes of an image from its corner."""
    start = np.array(corner)
    for tip, name in (([length, 0.0], "x"), ([0.0, length], "y")):
        arrow(axes, start, start + tip)
        label(axes, start + 1.18 * np.array(tip), f"${name}$")
