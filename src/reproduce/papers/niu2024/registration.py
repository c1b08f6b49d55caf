"""Registration (niu2024, section 2): what Table 1 implies, and the figures that hold no numbers.

These are drawn from the captions and the text; the paper's own pictures were not at hand. Angle and
shift of Figure 2 are drawn far too large, or nothing would be seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import Results, draws, reproduces
from reproduce.papers.niu2024.simulation import IMAGING, REGISTERED
from reproduce.papers.sketch import Block, Look, Point, Sketch, turned
from reproduce.physics import optics
from reproduce.printed.given import Given

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_RED = Look("red", "#D55E00", "--", "s")
_GREEN = Look("green", "#009E73", "-.", "o")
_BLUE = Look("blue", "#0072B2", ":", "^")
LOOKS = {look.name: look for look in (_RED, _GREEN, _BLUE)}


def scale_factors(given: Given, table: str = IMAGING) -> dict[str, float]:
    """Return the ratio of green's focal length in a table to that of each channel."""
    green = given[f"{table}#focal-length.green"]
    lengths = {
        channel: given[f"{table}#focal-length.{channel}"] for channel in REGISTERED
    }
    return {
        c: float(optics.scale_factor(green, length)) for c, length in lengths.items()
    }


@reproduces(
    "niu2024/table-2",
    cells=["scale.*"],
    given=[f"{IMAGING}#focal-length.*"],
    equations=["6"],
)
def true_scale(given: Given) -> Results:
    """Scale factors as ratios of the focal lengths of Table 1."""
    return {
        f"scale.{channel}": scale for channel, scale in scale_factors(given).items()
    }


@reproduces(
    "niu2024/table-2",
    cells=["translation-*"],
    given=[f"{IMAGING}#principal-point-*"],
    equations=["14"],
)
def true_translation(given: Given) -> Results:
    """Translations as differences of the principal points of Table 1."""
    return {
        f"translation-{axis}.{channel}": given[
            f"{IMAGING}#principal-point-{axis}.{channel}"
        ]
        - given[f"{IMAGING}#principal-point-{axis}.green"]
        for axis in "xy"
        for channel in REGISTERED
    }


_WORKFLOW: dict[str, Block] = {
    "light": ("starlight", ((1.3, 6.2), (2.4, 1.2)), ((5.0, 12.4), (3.0, 0.8))),
    "prism": ("lens and\nprism", ((4.2, 6.2), (2.2, 1.6)), ((5.0, 10.8), (3.0, 1.3))),
    "images": ("", ((8.0, 6.2), (4.2, 6.3)), ((5.0, 8.1), (9.9, 2.2))),
    "red": (
        "red detector\nimage and spots",
        ((8.0, 8.4), (3.6, 1.5)),
        ((1.7, 8.1), (3.0, 1.6)),
    ),
    "green": (
        "green detector\nimage and spots",
        ((8.0, 6.2), (3.6, 1.5)),
        ((5.0, 8.1), (3.0, 1.6)),
    ),
    "blue": (
        "blue detector\nimage and spots",
        ((8.0, 4.0), (3.6, 1.5)),
        ((8.3, 8.1), (3.0, 1.6)),
    ),
    "registration": (
        "registration\nonto green",
        ((12.1, 6.2), (3.2, 1.8)),
        ((7.4, 5.3), (3.2, 1.4)),
    ),
    "fusion": ("fusion", ((15.6, 6.2), (2.2, 1.2)), ((7.4, 3.4), (2.4, 0.9))),
    "centroids": ("centroids", ((15.6, 3.6), (2.6, 1.2)), ((7.4, 1.6), (2.8, 0.9))),
    "colour": (
        "ratio of brightness:\nthe star's colour",
        ((7.6, 1.1), (4.4, 1.5)),
        ((2.3, 5.3), (4.2, 1.4)),
    ),
    "star": (
        "star\nidentification",
        ((12.4, 1.1), (3.2, 1.5)),
        ((2.3, 2.9), (3.0, 1.4)),
    ),
    "attitude": ("attitude", ((15.8, 1.1), (2.2, 1.2)), ((2.3, 0.6), (2.4, 0.9))),
}
_STEPS = (
    *(
        "light prism",
        "registration fusion",
        "fusion centroids",
        "centroids star",
        "colour star",
    ),
    *("star attitude", "prism red", "prism green", "prism blue"),
    *("red registration", "green registration", "blue registration"),
)


@draws("niu2024/fig-1")
def _draw_workflow(figure: Figure) -> None:
    """Workflow of a 3CMOS star sensor, from starlight to attitude."""
    sketch = Sketch.on(figure, 17.0, 9.6, narrow=(10.0, 13.0))
    sketch.blocks(_WORKFLOW, _STEPS, LOOKS)
    # All three images make the colour.
    narrow = sketch.narrow
    sketch.arrow(*(((2.3, 7.0), (2.3, 6.0)) if narrow else ((7.6, 3.05), (7.6, 1.85))))
    sketch.label((9.1, 6.5) if narrow else (12.1, 7.6), "this paper", style="italic")


# Angle in degrees and principal points of Figure 2, in units of the canvas.
_PLANE_ANGLE = 14.0
_PRINCIPAL_POINTS = {"green": (5.4, 5.0), "blue": (7.8, 6.4)}


@draws("niu2024/fig-2")
def _draw_planes(figure: Figure) -> None:
    """Rotation and translation of the blue image plane against the green one."""
    sketch = Sketch.on(figure, 14.0, 11.6, 5.6)
    green, blue = _PRINCIPAL_POINTS["green"], _PRINCIPAL_POINTS["blue"]
    (left, low), (right, high) = green, blue
    _plane(sketch, green, 0.0, _GREEN)
    _plane(sketch, blue, _PLANE_ANGLE, _BLUE)
    sketch.arc(blue, 4.8, (0.0, _PLANE_ANGLE), "θ")
    # The step from one principal point to the other, along each axis.
    sketch.line([green, (left, low - 1.6)], 0.6)
    sketch.line([(right, low - 1.6), blue, (right + 5.4, high)], 0.6)
    sketch.line([(left + 3.8, low), (right + 2.3, low)], 0.6)
    sketch.arrow((left, low - 1.4), (right, low - 1.4), style="<|-|>")
    sketch.label(((left + right) / 2, low - 1.0), "Δx")
    sketch.arrow((right + 2.1, low), (right + 2.1, high), style="<|-|>")
    sketch.label((right + 2.6, (low + high) / 2), "Δy")


def _plane(sketch: Sketch, origin: Point, turn: float, look: Look) -> None:
    """Draw a detector about its principal point, with its axes."""
    corners = turned([[-4, -3], [4, -3], [4, 3], [-4, 3], [-4, -3]], turn) + origin
    sketch.axes.plot(
        *corners.T, color=look.colour, linestyle=look.line, label=look.name
    )
    sketch.mark(origin, look, 7)
    letter = look.name[0]
    for tip, name in zip(turned([[3.0, 0.0], [0.0, 2.2]], turn), "XY", strict=True):
        sketch.arrow(origin, origin + tip, look)
        sketch.label(origin + tip + 0.38 * tip / np.hypot(*tip), f"${name}_{letter}$")
    below, corner = turned([[-0.55, -0.5], [2.1, -2.35]], turn) + origin
    sketch.label(below, f"$O_{letter}$")
    sketch.label(corner, look.name, ha="left", rotation=turn)


_SETUP: dict[str, Block] = {
    "simulator": (
        "single-star simulator:\npoint source in\nthe focus of a lens",
        ((3.2, 5.0), (5.4, 2.4)),
        ((5.0, 10.6), (5.8, 1.9)),
    ),
    "external": ("", ((13.0, 5.6), (7.2, 6.6)), ((5.0, 5.4), (9.0, 6.6))),
    "middle": ("", ((13.0, 5.2), (5.8, 4.6)), ((5.0, 5.2), (7.0, 4.2))),
    "sensor": (
        "3CMOS\nstar sensor",
        ((13.0, 5.0), (3.8, 2.0)),
        ((5.0, 4.8), (4.0, 1.6)),
    ),
    "computer": (
        "frame angles\nand spots",
        ((3.2, 1.2), (3.6, 1.6)),
        ((5.0, 0.8), (4.0, 1.4)),
    ),
}


@draws("niu2024/fig-3")
def _draw_calibration(figure: Figure) -> None:
    """Calibration set-up: a single-star simulator, a rotary table, the sensor on its frame."""
    sketch = Sketch.on(figure, 17.4, 9.6, narrow=(10.0, 11.8))
    sketch.blocks(_SETUP, ["simulator sensor", "external computer"], LOOKS)
    narrow = sketch.narrow
    sketch.label((7.2, 9.1) if narrow else (7.6, 5.4), "parallel light")
    sketch.label(
        (5.0, 2.6) if narrow else (13.0, 8.2), "external frame, turns by $φ_1$"
    )
    sketch.label((5.0, 3.6) if narrow else (13.0, 6.8), "middle frame, turns by $φ_2$")


_ACQUISITION: dict[str, Block] = {
    "room": ("", ((8.6, 6.45), (16.8, 6.5)), ((5.0, 7.6), (9.8, 9.4))),
    "simulator": (
        "single-star simulator:\nband and magnitude\ncan be chosen",
        ((2.9, 6.3), (4.9, 2.2)),
        ((5.0, 10.5), (5.2, 1.8)),
    ),
    "table": (
        "two-axis rotary table,\n3CMOS camera on\nits middle frame",
        ((10.0, 6.3), (4.8, 3.4)),
        ((2.8, 6.3), (4.6, 3.0)),
    ),
    "images": ("", ((14.9, 6.3), (3.6, 4.8)), ((8.0, 6.3), (3.2, 4.6))),
    "red": ("red image", ((14.9, 7.9), (2.8, 1.0)), ((8.0, 7.9), (2.8, 1.0))),
    "green": ("green image", ((14.9, 6.3), (2.8, 1.0)), ((8.0, 6.3), (2.8, 1.0))),
    "blue": ("blue image", ((14.9, 4.7), (2.8, 1.0)), ((8.0, 4.7), (2.8, 1.0))),
    "course": (
        "trajectory\nof the table",
        ((10.0, 1.5), (3.6, 1.5)),
        ((2.8, 1.3), (3.4, 1.3)),
    ),
    "kept": (
        "spots and angles\nare recorded",
        ((14.9, 1.5), (4.0, 1.5)),
        ((8.0, 1.3), (3.4, 1.3)),
    ),
}
_FLOWS = (
    "simulator table",
    "table red",
    "table green",
    "table blue",
    "course table",
    "course kept",
    "images kept",
)


@draws("niu2024/fig-5")
def _draw_acquisition(figure: Figure) -> None:
    """Data acquisition: simulated starlight of a chosen band and magnitude, three images."""
    sketch = Sketch.on(figure, 17.2, 10.0, narrow=(10.0, 12.4))
    sketch.blocks(_ACQUISITION, _FLOWS, LOOKS)
    narrow = sketch.narrow
    sketch.label(
        (0.4, 11.9) if narrow else (0.6, 9.2), "dark room", ha="left", style="italic"
    )
    sketch.label((5.0, 8.8) if narrow else (6.4, 6.75), "starlight")
