"""Figures 3 to 5: the star and laser tracker, its filters, the method and the laser transform.

Drawn from the captions and the text; the paper's own pictures were not at hand, and nothing here
claims their likeness or a scale.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.chen2023.sketch import LASER, SCENE, STAR, lens, mirror, reflected
from reproduce.papers.declare import draws
from reproduce.papers.sketch import (
    INK,
    arc,
    arrow,
    beside,
    box,
    canvas,
    diagram,
    key,
    label,
    line,
    path,
    turned,
)
from reproduce.physics.attitude.lasers import emitted_directions
from reproduce.physics.validate import FloatArray

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DESIGN = "chen2023/text-satellite"
HARDWARE = "chen2023/text-hardware"
BANDS = (
    f"{DESIGN}#transmission-low",
    f"{DESIGN}#transmission-high",
    f"{DESIGN}#reflection-low",
    f"{DESIGN}#reflection-high",
)
FILTER = f"{HARDWARE}#filter-wavelength"
TILT = f"{DESIGN}#dihedral-angle"
NANO = 1e9
# Of the drawing of the light paths: how far the two lights come in beside the boresight.
ASIDE = 9.0
LENS, FOCUS = np.array([5.0, 2.2]), 1.5


@draws("chen2023/fig-3a")
@diagram(12.6, 9.2)
def draw_structure(axes: Axes) -> None:
    """Structure of the star and laser tracker."""
    box(axes, (5.0, 1.0), (3.6, 1.2), "processor")
    box(axes, (5.0, 2.2), (1.6, 0.3))
    label(axes, (6.0, 2.25), "detector", ha="left")
    lens(axes, (5.0, 3.4), 2.2, 90)
    label(axes, (5.0, 3.4), "lens")
    mirror(axes, (5.0, 5.3), 2.6, 30)
    label(axes, (3.9, 6.15), "dichroic mirror")
    mirror(axes, (7.2, 4.0), 1.4, 60, ":")
    label(axes, (8.4, 3.5), "narrow band-pass\nfilter (dots)", ha="left")
    box(axes, (3.35, 4.7), (0.5, 2.2), style="--")
    label(axes, (0.1, 4.7), "invar support\n(dashed)", ha="left")
    box(axes, (5.2, 4.25), (5.8, 4.6), style=":")
    label(axes, (8.4, 5.6), "thermal control\n(dotted)", ha="left")
    for side in (-1, 1):
        line(axes, [(5 + side * 1.6, 6.8), (5 + side * 2.6, 8.9)], 1.3)
    label(axes, (7.8, 7.9), "baffle, held by the\nsatellite alone", ha="left")


@draws("chen2023/fig-3b", marks=[TILT])
def draw_paths(figure: Figure, printed: Mapping[str, float]) -> None:
    """Paths of starlight and laser light into the tracker."""
    tilt = float(np.degrees(next(iter(printed.values()))))
    axes = canvas(figure, 11.0, 8.2)
    middle = np.array([5.0, 4.8])
    mirror(axes, middle, 3.4, tilt)
    label(axes, (2.0, 4.3), "dichroic\nmirror")
    lens(axes, LENS, 2.6, 90)
    label(axes, LENS - [1.5, 0.0], "lens", ha="right")
    box(axes, LENS - [0, FOCUS + 0.15], (1.8, 0.3))
    label(axes, (6.2, 0.55), "detector", ha="left")
    star, laser = turned([0.0, -1.0], -ASIDE), turned([0.0, -1.0], ASIDE)
    for shift in (-0.5, 0.0, 0.5):
        _into_lens(axes, star, shift, [beside(LENS, shift, 0.0) - 5.4 * star])
    came = reflected(laser, tilt)
    for shift in (-0.35, 0.35):
        hit = _on_mirror(beside(LENS, shift, 0.0), laser, middle, tilt)
        _into_lens(axes, laser, shift, [hit - 4.0 * came, hit])
    across = float(np.degrees(np.arctan2(came[1], came[0]))) + 90
    filtered = middle - 2.5 * came
    mirror(axes, filtered, 1.6, across, ":")
    label(axes, beside(filtered, 0.85, 0.55), "band-pass\nfilter (dots)", ha="left")
    line(axes, [middle, beside(middle, 2.9, 0.0)], 0.7)
    arc(axes, middle, 2.5, (0, tilt), f"{tilt:g}°")
    key(axes, (STAR, LASER), (0.0, 1.0))


def _into_lens(axes: Axes, way: FloatArray, shift: float, before: list[FloatArray]) -> None:
    """Draw a ray to its place on the lens and on to the focus of its direction."""
    look = STAR if len(before) == 1 else LASER
    focus = LENS + FOCUS * way / -way[1]
    path(axes, [*before, beside(LENS, shift, 0.0), focus], look)


def _on_mirror(place: FloatArray, way: FloatArray, middle: FloatArray, tilt: float) -> FloatArray:
    """Return where light that reaches a place along a way has met the mirror."""
    normal = turned([0.0, 1.0], tilt)
    result: FloatArray = place - way * ((place - middle) @ normal) / (way @ normal)
    return result


@draws("chen2023/fig-3c", marks=[*BANDS, FILTER])
def draw_filters(figure: Figure, printed: Mapping[str, float]) -> None:
    """Transmission and reflection of the dichroic mirror and of the band-pass filter, idealised."""
    low, high, turn, end = (printed[address] * NANO for address in BANDS)
    passed = printed[FILTER] * NANO
    upper, lower = figure.subplots(2, 1, sharex=True)
    for start, stop, look, name in (
        (low, high, SCENE, "transmission"),
        (turn, end, LASER, "reflection"),
    ):
        upper.plot(
            [350, start, start, stop, stop, 1100],
            [0, 0, 100, 100, 0, 0],
            look.line if look is LASER else "-",
            color=look.colour,
            label=name,
        )
    upper.set(ylabel="dichroic mirror (%)")
    # The width of the filter is not printed: a line stands for its band.
    lower.plot([350, passed, passed, passed, 1100], [0, 0, 100, 0, 0], color=INK)
    lower.set(ylabel="band-pass filter (%)", xlabel="wavelength (nm)", xlim=(350, 1100))
    for axes in (upper, lower):
        axes.axvspan(low, high, facecolor=(STAR.colour, 0.15), edgecolor=STAR.colour, linestyle=":")
        axes.text((low + high) / 2, 45, "light of the stars", ha="center")
        axes.text(passed + 8, 45, "laser")
    upper.axvline(passed, color=INK, linestyle=":", linewidth=2)
    upper.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


@draws("chen2023/fig-4")
@diagram(15.0, 9.0, 6.8)
def draw_route(axes: Axes) -> None:
    """Technical route: calibration, monitoring, correction."""
    steps = {
        "calibration": (
            "control points and\nstars: installation",
            "laser spots at\nthe zero point",
            "laser transform\nat the zero point",
        ),
        "monitoring": (
            "laser spots in\nevery frame",
            "mean over\nmany frames",
            "misalignment, by\nQUEST",
        ),
        "correction": (
            "corrected\ninstallation",
            "attitude of tracker\nfrom the stars",
            "attitude of camera\namong the stars",
        ),
    }
    for x, (name, texts) in zip((2.5, 7.5, 12.5), steps.items(), strict=True):
        label(axes, (x, 8.5), name, size=11)
        box(axes, (x, 4.2), (4.6, 7.6), style=":")
        for y, text in zip((6.8, 4.2, 1.6), texts, strict=True):
            box(axes, (x, y), (4.0, 1.4), text)
        for y in (6.1, 3.5):
            arrow(axes, (x, y), (x, y - 1.2))
    arrow(axes, (4.5, 1.6), (5.5, 1.6))
    line(axes, [(9.5, 1.6), (10.0, 1.6), (10.0, 6.8)], 1.3)
    arrow(axes, (10.0, 6.8), (10.5, 6.8))


@draws("chen2023/fig-5")
@diagram(14.0, 8.4)
def draw_transform(axes: Axes) -> None:
    """Laser directions in the camera and in the tracker, joined by the laser transform."""
    for x, name, focal in ((3.0, "c", r"f_\mathrm{cam}"), (11.0, "s", r"f_\mathrm{s}")):
        line(axes, [(x - 2.2, 1.2), (x + 2.2, 1.2)], 2.5)
        lens(axes, (x, 4.4), 3.0, 90)
        arrow(axes, (x, 1.2), (x, 2.8))
        label(axes, (x + 0.45, 2.7), f"$Z_{name}$")
        arrow(axes, (x + 2.2, 1.2), (x + 2.7, 1.2))
        label(axes, (x + 2.45, 1.6), f"$X_{name}$")
        arrow(axes, (x - 2.0, 1.2), (x - 2.0, 4.4), style="<|-|>", width=0.8)
        label(axes, (x - 2.55, 2.8), f"${focal}$")
        for offset, number in ((-1.2, 1), (1.2, 2)):
            _beam(axes, np.array([x, 4.4]), offset, number, leaves=name == "c")
    label(axes, (3.0, 0.4), "lasers in the focal plane\nof the camera")
    label(axes, (11.0, 0.4), "spots on the detector\nof the tracker")
    arrow(axes, (5.6, 5.9), (8.4, 5.9))
    label(axes, (7.0, 6.4), r"$\mathbf{w} = T\,\mathbf{v}$", size=11)
    label(axes, (7.0, 5.2), "retro-reflector,\ndichroic mirror")


def _beam(axes: Axes, centre: FloatArray, offset: float, number: int, *, leaves: bool) -> None:
    """Draw the light of one laser through a lens, its direction as equation (2) gives it."""
    depth = 3.2
    direction = emitted_directions([(offset, 0.0)], depth)[0][[0, 2]]
    source, end = beside(centre, offset, -depth), centre + 2.9 * direction
    way = [source, centre, end]
    path(axes, way if leaves else way[::-1], LASER)
    axes.plot(*source, LASER.marker if leaves else "o", color=LASER.colour, markersize=6)
    vector = "v" if leaves else "w"
    label(axes, beside(end, 0.0, 0.4), rf"$\mathbf{{{vector}}}_{number}$")
