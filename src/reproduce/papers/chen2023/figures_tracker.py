"""Figures 3 to 5: the star and laser tracker, its filters, the method and the laser transform.

Drawn from the captions and the text; the paper's own pictures were not at hand, and nothing here
claims their likeness or a scale.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.chen2023.sketch import (
    INK,
    LASER,
    STAR,
    arc,
    arrow,
    box,
    canvas,
    frame,
    label,
    legend,
    lens,
    mirror,
    ray,
    turned,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DESIGN = "chen2023/text-design"
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


def draw_structure(figure: Figure, printed: Mapping[str, float]) -> None:
    """Structure of the star and laser tracker.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure.
    """
    axes = canvas(figure, 12.0, 8.4)
    box(axes, (5.0, 1.0), (3.4, 1.2), "processor")
    box(axes, (5.0, 2.0), (1.6, 0.3), "")
    label(axes, (6.3, 2.0), "detector", side="left", size=8)
    lens(axes, (5.0, 3.4), 2.2, 90)
    label(axes, (6.6, 3.4), "lens", side="left", size=8)
    mirror(axes, (5.0, 5.0), 2.4, 30, line="-")
    label(axes, (4.2, 5.6), "dichroic mirror", size=8)
    mirror(axes, (7.3, 3.7), 1.3, 60, line=":")
    label(axes, (8.2, 3.1), "narrow band-pass\nfilter", side="left", size=8)
    box(axes, (3.6, 4.4), (0.5, 1.9), line="--")
    label(axes, (2.1, 4.4), "invar support", size=8)
    for side in (-1, 1):
        axes.plot([5 + side * 1.6, 5 + side * 2.6], [6.3, 8.2], color=INK, linewidth=1.3)
    label(axes, (7.8, 7.5), "baffle, held by the\nsatellite alone", side="left", size=8)
    box(axes, (5.0, 3.9), (5.6, 4.4), line=":")
    label(axes, (8.2, 5.2), "thermal control\n(dotted)", side="left", size=8)


def draw_paths(figure: Figure, printed: Mapping[str, float]) -> None:
    """Paths of starlight and laser light into the tracker.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Addresses of the printed tilt of the mirror to its value, in radians.
    """
    tilt = float(np.degrees(next(iter(printed.values()))))
    axes = canvas(figure, 10.0, 8.0)
    meeting = np.array([5.0, 4.6])
    mirror(axes, (5.0, 4.6), 3.2, tilt)
    lens(axes, (5.0, 2.0), 2.4, 90)
    box(axes, (5.0, 0.5), (1.8, 0.3), "")
    label(axes, (6.2, 0.5), "detector", side="left")
    label(axes, (6.5, 2.0), "lens", side="left")
    for shift in (-0.5, 0.0, 0.5):
        ray(axes, [(5 + shift, 7.8), (5 + shift, 2.1), (4.8, 0.7)], STAR)
    # The laser comes in so that the mirror sends it straight down.
    normal = turned([0.0, -1.0], tilt)
    down = np.array([0.0, -1.0])
    coming = down - 2 * (down @ normal) * normal
    for shift in (-0.35, 0.35):
        hit = meeting + shift * turned([1.0, 0.0], tilt)
        start = hit - 3.6 * coming
        bend = (float(hit[0]), float(hit[1]))
        ray(axes, [(float(start[0]), float(start[1])), bend, (bend[0], 2.1), (5.2, 0.7)], LASER)
    filtered = meeting - 2.3 * coming
    across = float(np.degrees(np.arctan2(coming[1], coming[0]))) + 90
    mirror(axes, (float(filtered[0]), float(filtered[1])), 1.6, across, line=":")
    label(axes, (float(filtered[0]) - 0.9, float(filtered[1]) - 0.8), "band-pass filter", size=8)
    axes.plot([5.0, 7.2], [4.6, 4.6], color=INK, linewidth=0.7)
    arc(axes, (5.0, 4.6), 1.9, (0, tilt), f"{tilt:g}°")
    label(axes, (7.2, 6.4), "dichroic mirror", side="left")
    legend(axes, (STAR, LASER), (0.0, 0.85))


def draw_filters(figure: Figure, printed: Mapping[str, float]) -> None:
    """Transmission and reflection of the dichroic mirror and of the band-pass filter, idealised.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Addresses of the ends of the bands and of the filter's wavelength, in metres.
    """
    low, high, turn, end = (printed[address] * NANO for address in BANDS)
    passed = printed[FILTER] * NANO
    panels = figure.subplots(2, 1, sharex=True)
    mirror_axes, filter_axes = panels
    mirror_axes.plot(
        [350, low, low, high, high, 1100], [0, 0, 100, 100, 0, 0], "-", label="transmission"
    )
    mirror_axes.plot(
        [350, turn, turn, end, end, 1100],
        [0, 0, 100, 100, 0, 0],
        "--",
        label="reflection",
    )
    mirror_axes.set(ylabel="dichroic mirror (%)")
    # The width of the filter is not printed: a line stands for its band.
    filter_axes.plot([350, passed, passed, passed, 1100], [0, 0, 100, 0, 0], "-.", color="#009E73")
    filter_axes.set(ylabel="band-pass filter (%)", xlabel="wavelength (nm)", xlim=(350, 1100))
    for axes in panels:
        axes.axvspan(low, high, color=STAR.colour, alpha=0.15)
        axes.axvline(passed, color=LASER.colour, linestyle=":", linewidth=2)
    mirror_axes.text((low + high) / 2, 45, "stars", ha="center")
    mirror_axes.text(passed + 8, 45, "laser")
    mirror_axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


def draw_route(figure: Figure, printed: Mapping[str, float]) -> None:
    """Technical route: calibration, monitoring, correction.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure.
    """
    axes = canvas(figure, 15.0, 9.0, 7.2)
    for x, name in ((2.5, "calibration"), (7.5, "monitoring"), (12.5, "correction")):
        label(axes, (x, 8.5), name, size=11)
        box(axes, (x, 4.2), (4.6, 7.6), line=":")
    steps = {
        2.5: (
            "control points and\nstars: installation",
            "laser spots at\nthe zero point",
            "laser transform\nat the zero point",
        ),
        7.5: ("laser spots in\nevery frame", "mean over\nmany frames", "misalignment, by\nQUEST"),
        12.5: (
            "corrected\ninstallation",
            "attitude of tracker\nfrom the stars",
            "attitude of camera\namong the stars",
        ),
    }
    for x, texts in steps.items():
        for y, text in zip((6.8, 4.2, 1.6), texts, strict=True):
            box(axes, (x, y), (3.9, 1.4), text)
        for y in (6.1, 3.5):
            arrow(axes, (x, y), (x, y - 1.2))
    arrow(axes, (4.45, 1.6), (5.55, 1.6))
    _bend(axes, [(9.45, 1.6), (10.0, 1.6), (10.0, 6.8), (10.55, 6.8)])


def _bend(axes: Axes, points: list[tuple[float, float]]) -> None:
    axes.plot(*np.array(points[:-1]).T, color=INK, linewidth=1.3)
    arrow(axes, points[-2], points[-1])


def draw_transform(figure: Figure, printed: Mapping[str, float]) -> None:
    """Laser directions in the camera and in the tracker, joined by the laser transform.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Not used: no value is printed on this figure.
    """
    axes = canvas(figure, 14.0, 8.0)
    for x, name, way in ((2.8, "c", "out"), (11.2, "s", "in")):
        axes.plot([x - 2.2, x + 2.2], [1.2, 1.2], color=INK, linewidth=2.5)
        lens(axes, (x, 4.4), 3.0, 90)
        frame(axes, (x, 1.2), name, 1.95)
        for shift, number in ((-1.3, "1"), (1.3, "2")):
            end = (x - shift * 0.9, 7.0)
            path = [(x + shift, 1.2), (x, 4.4), end]
            ray(axes, path if way == "out" else path[::-1], LASER)
            axes.plot(x + shift, 1.2, "o" if way == "out" else "s", color=LASER.colour)
            vector = "v" if way == "out" else "w"
            label(axes, (end[0], 7.4), rf"$\mathbf{{{vector}}}_{number}$")
    label(axes, (2.8, 0.4), "lasers in the focal plane of the camera")
    label(axes, (11.2, 0.4), "spots on the detector of the tracker")
    arrow(axes, (5.4, 5.6), (8.6, 5.6))
    label(axes, (7.0, 6.1), r"$\mathbf{w} = T\,\mathbf{v}$", size=11)
    label(axes, (7.0, 5.1), "retro-reflector,\ndichroic mirror", size=8)
    label(axes, (1.2, 2.9), "$f_{cam}$", size=9)
    label(axes, (9.6, 2.9), "$f_s$", size=9)
