"""Figures 3 and 5 of niu2024: the calibration set-up and the data acquisition.

Drawn from the captions and the text; the papers' own pictures were not at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from reproduce.papers.niu2024.sketch import LOOKS, arrow, box, canvas, group, turning

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_calibration(figure: Figure, printed: Mapping[str, float]) -> None:
    """Calibration set-up: a single-star simulator, a rotary table, the sensor on its frame.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure.
    """
    figure.set_size_inches(6.4, 3.6)
    axes = canvas(figure, 17.0, 9.4)
    _simulator(axes)
    _table(axes)
    box(axes, (4.2, 1.3), "computer", (2.6, 1.2))
    axes.plot([12.2, 12.2, 5.5], [1.9, 1.3, 1.3], color="#000000", linewidth=0.9)
    axes.text(8.9, 0.75, "frame angles and spots", ha="center", va="center", fontsize=8.5)
    arrow(axes, (6.0, 1.3), (5.5, 1.3))


def _simulator(axes: Axes) -> None:
    """Draw the lamp, the collimator and the parallel light that leaves it."""
    axes.plot([0.9], [5.6], marker="*", markersize=11, color="#000000")
    axes.text(0.9, 4.9, "point\nsource", ha="center", va="top", fontsize=8.5)
    from matplotlib.patches import Ellipse

    lens = Ellipse((4.6, 5.6), 0.55, 3.0, facecolor="none", edgecolor="#000000", linewidth=1.3)
    axes.add_patch(lens)
    axes.text(2.9, 7.7, "single-star simulator", ha="center", va="center", fontsize=8.5)
    for height in (-1.1, 0.0, 1.1):
        axes.plot([0.9, 4.6], [5.6, 5.6 + height], color="#000000", linewidth=0.8)
        arrow(axes, (4.6, 5.6 + height), (9.2, 5.6 + height))
    axes.text(7.0, 7.2, "parallel light", ha="center", va="center", fontsize=8.5)


def _table(axes: Axes) -> None:
    """Draw the two frames of the table from above, and the sensor on the middle one."""
    from matplotlib.patches import Rectangle

    outer = Rectangle((9.7, 2.6), 6.2, 6.0, facecolor="none", edgecolor="#000000", linewidth=1.6)
    inner = Rectangle((10.5, 3.4), 4.6, 4.4, facecolor="none", edgecolor="#000000")
    inner.set(linestyle="--", linewidth=1.3)
    axes.add_patch(outer)
    axes.add_patch(inner)
    axes.text(15.7, 8.85, "external frame, φ₁", ha="right", va="center", fontsize=8.5)
    axes.text(12.8, 3.75, "middle frame, φ₂", ha="center", va="center", fontsize=8.5)
    box(axes, (12.9, 5.6), "3CMOS\nstar sensor", (2.8, 2.2))
    axes.plot([11.0, 11.5, 11.5, 11.0], [6.2, 6.0, 5.2, 5.0], color="#000000", linewidth=1.3)
    axes.plot([12.2, 12.2], [1.9, 2.6], color="#000000", linewidth=0.9)
    axes.plot([16.5, 15.9], [5.6, 5.6], color="#000000", linewidth=0.8, linestyle="-.")
    axes.plot([12.8, 12.8], [7.0, 8.3], color="#000000", linewidth=0.8, linestyle="-.")
    turning(axes, (12.8, 7.6), 0.45, (-150.0, 130.0))
    turning(axes, (16.35, 5.6), 0.4, (-140.0, 140.0))


def draw_acquisition(figure: Figure, printed: Mapping[str, float]) -> None:
    """Data acquisition: simulated starlight of a chosen band and magnitude, three images.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: the settings stand in the table of the experiment.
    """
    figure.set_size_inches(6.4, 3.8)
    axes = canvas(figure, 17.0, 10.0)
    from matplotlib.patches import Rectangle

    room = Rectangle((0.2, 3.2), 16.6, 6.5, facecolor="none", edgecolor="#000000", linewidth=1.0)
    room.set(linestyle="--")
    axes.add_patch(room)
    axes.text(0.5, 9.3, "dark room", ha="left", va="center", fontsize=8.5, style="italic")
    box(axes, (2.8, 6.3), "single-star simulator:\nband and magnitude\ncan be chosen", (4.6, 2.2))
    arrow(axes, (5.1, 6.3), (7.4, 6.3))
    axes.text(6.25, 6.75, "starlight", ha="center", va="center", fontsize=8.5)
    table = Rectangle((7.5, 4.1), 4.9, 4.4, facecolor="none", edgecolor="#000000", linewidth=1.5)
    axes.add_patch(table)
    axes.text(9.95, 8.9, "two-axis rotary table", ha="center", va="center", fontsize=8.5)
    box(axes, (9.95, 6.3), "3CMOS camera on\nthe middle frame", (4.2, 2.0))
    _images(axes)
    box(axes, (9.95, 1.5), "trajectory\nof the table", (3.6, 1.5))
    arrow(axes, (9.95, 2.25), (9.95, 4.1))
    box(axes, (14.7, 1.5), "spots and angles\nare recorded", (3.8, 1.5))
    arrow(axes, (11.75, 1.5), (12.8, 1.5))
    arrow(axes, (14.7, 3.9), (14.7, 2.25))


def _images(axes: Axes) -> None:
    """Draw the three images that each exposure gives, one above the other."""
    group(axes, (13.0, 3.9), (3.4, 4.8))
    for look, y in zip(LOOKS.values(), (7.9, 6.3, 4.7), strict=True):
        box(axes, (14.7, y), f"{look.name} image", (3.0, 1.0), look)
        axes.plot([15.95], [y], look.marker, color=look.colour, markersize=4)
        arrow(axes, (12.4, 6.3), (13.2, y), look)
