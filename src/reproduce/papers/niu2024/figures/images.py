"""Drawings of the simulated images: a star in three channels, errors by star, colours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import draws
from reproduce.papers.niu2024 import experiment, images
from reproduce.papers.niu2024 import images_fusion as fusion
from reproduce.papers.niu2024.figures.looks import LOOKS, RED
from reproduce.papers.sketch import Look, sized
from reproduce.papers.study import Fact
from reproduce.physics.optics.simulate import channel_centroids
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = []

MAGNITUDE, SEED = 3.0, 9
MIDDLE = 4.0  # the magnitude at which kinds of stars are compared
AT = fusion.MAGNITUDES.index(MIDDLE)
KINDS = (
    Look("green", "#777777", ":", "^"),
    Look("raw", "#D55E00", "--", "s"),
    Look("fused", "#0072B2", "-", "o"),
)


def _spots() -> FloatArray:
    """Return where the star stands in green, red and blue, in px, near the corner of the field."""
    door = given(images.READS)
    angles = 0.95 * np.array(experiment.half_field(door))
    return channel_centroids(images.cameras(door), experiment.rotations(door), angles[None])[:, 0]


def star_facts() -> dict[str, Fact]:
    """Return what the drawing of one star shows, in numbers."""
    spots = _spots()
    apart = max(np.hypot(*(one - other)) for one in spots for other in spots)
    return {"apart": Fact(float(apart), ".1f", "px")}


@draws("niu2024-fusion-star", named=star_facts)
def draw_star(figure: Figure) -> None:
    """One star near the corner of the field: three channels, and both ways to add them up."""
    door, spots = given(images.READS), _spots()
    photons = images.star_photons(door, MAGNITUDE, fusion.TEMPERATURE)
    windows, corner = fusion.exposures(spots, photons, 1, np.random.default_rng(SEED))
    green, plain, registered = fusion.combinations(windows, corner, images.similarities(door))
    middle = slice(fusion.MARGIN, -fusion.MARGIN)
    # What is seen, and which spots are marked in it, at which place each.
    at = dict(zip(("green", "red", "blue"), spots - corner - fusion.MARGIN + 0.5, strict=True))
    panels = {
        "red": (windows[1, 0, middle, middle], {"red": at["red"]}),
        "green": (green[0], {"green": at["green"]}),
        "blue": (windows[2, 0, middle, middle], {"blue": at["blue"]}),
        "fused as they are": (plain[0], {name: at[name] for name in LOOKS}),
        "fused after registration": (registered[0], dict.fromkeys(LOOKS, at["green"])),
    }
    shape = (3, 2) if sized(figure, 6.4, 4.6, 5.6) else (2, 3)
    grid = figure.subplots(*shape, sharex=True, sharey=True)
    for axes, (title, (light, marks)) in zip(grid.flat, panels.items(), strict=False):
        root = np.sqrt(np.maximum(light, 0))
        # Never quite black: what is drawn in black follows the page, and is white on a dark one.
        axes.pcolormesh(root, cmap="gray_r", shading="flat", vmin=0, vmax=1.1 * root.max())
        for name, place in marks.items():
            look = LOOKS[name]
            for width, colour in ((3.5, "white"), (1.3, look.colour)):  # a halo, for dark pixels
                mark = axes.plot(*place, look.marker, color=colour, fillstyle="none", markersize=9)
                mark[0].set_markeredgewidth(width)
        axes.set(aspect="equal", title=title, xticks=[0, 3, 6, 9], yticks=[0, 3, 6, 9])
        axes.grid(visible=False)
    for axes in grid[-1]:
        axes.set_xlabel("x (px)")
    for axes in grid[:, 0]:
        axes.set_ylabel("y (px)")
    grid[-1, -1].set_axis_off()


def error_facts() -> dict[str, Fact]:
    """Return what the drawing of the errors shows, in numbers: the middle star, in the corner."""
    row = list(fusion.STARS).index(fusion.BLACKBODIES[len(fusion.BLACKBODIES) // 2])
    green, raw, fused = fusion.stored().arrays["error"][row, -1, :, :, fusion.LIKELY].T
    values = {
        "green-bright": green[0],
        "green-faint": green[-1],
        "fused-bright": fused[0],
        "fused-faint": fused[-1],
        "raw-least": raw.min(),
        "raw-most": raw.max(),
    }
    return {name: Fact(value, ".2g", "px") for name, value in values.items()}


@draws("niu2024-fusion-errors", named=error_facts)
def draw_errors(figure: Figure) -> None:
    """Centroid error and signal-to-noise ratio over magnitude: cool, solar and hot star."""
    arrays, stars = fusion.stored().arrays, len(fusion.BLACKBODIES)
    if narrow := sized(figure, 6.4, 5.6, 7.6):
        grid = figure.subplots(stars, 2, sharex=True, sharey="col")
    else:
        grid = figure.subplots(2, stars, sharex=True, sharey="row").T
    for (above, below), star in zip(grid, fusion.BLACKBODIES, strict=True):
        row = list(fusion.STARS).index(star)
        for kind, (name, look) in enumerate(zip(fusion.MADE, KINDS, strict=True)):
            for place, where, fill in ((0, "centre", "none"), (-1, "corner", look.colour)):
                error = arrays["error"][row, place, :, kind, fusion.LIKELY]
                ratio = arrays["signal_to_noise"][row, place, :, kind]
                for axes, values in ((above, error), (below, ratio)):
                    (line,) = axes.semilogy(fusion.MAGNITUDES, values, look.line, c=look.colour)
                    line.set(marker=look.marker, mfc=fill, label=f"{name}, {where}")
        above.set_title(f"{star}: {fusion.STARS[star]:,.0f} K")
        if not narrow or above is grid[-1, 0]:
            below.set_xlabel("V (mag)")
    grid[-1, 0].set_xlabel("V (mag)" if narrow else "")
    for axes in grid if narrow else grid[:1]:
        axes[0].set_ylabel("centroid error, RMS (px)")
        axes[1].set_ylabel("signal over noise (1)")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    columns = 1 if narrow else 2
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, fontsize=8)


def _in_the_corner() -> tuple[FloatArray, FloatArray]:
    """Return the errors at V = 4 and the gains of signal over noise, by kind of image and star."""
    arrays = fusion.stored().arrays
    signal = arrays["signal_to_noise"][:, -1, AT].T
    return arrays["error"][:, -1, AT, :, fusion.LIKELY].T, signal / signal[0]


def star_kind_facts() -> dict[str, Fact]:
    """Return what the drawing of the kinds of stars shows, in numbers.

    Least and largest centroid errors of each kind of image, least and largest gain.
    """
    errors, gains = _in_the_corner()
    facts = {"gain-least": Fact(gains[2].min(), ".2f"), "gain-most": Fact(gains[2].max(), ".2f")}
    for look, error in zip(KINDS, errors, strict=True):
        facts[f"{look.name}-least"] = Fact(error.min(), ".2g", "px")
        facts[f"{look.name}-most"] = Fact(error.max(), ".2g", "px")
    return facts


@draws("niu2024-fusion-stars", named=star_kind_facts)
def draw_stars(figure: Figure) -> None:
    """Centroid error and gain of signal over noise by kind of star, at V = 4 in the corner."""
    shape = (2, 1) if sized(figure, 6.4, 3.8, 6.4) else (1, 2)
    left, right = figure.subplots(*shape, sharey=True)
    rows, door = np.arange(len(fusion.STARS)), given(images.READS)
    luck = 2 / np.sqrt(2 * fusion.PHASES * fusion.TRIALS)
    for kind, (name, look, error, gain) in enumerate(
        zip(fusion.MADE, KINDS, *_in_the_corner(), strict=True)
    ):
        beside = rows + (kind - 1) * 0.18
        left.errorbar(error, beside, xerr=luck * error, label=name, fmt=look.marker, c=look.colour)
        if kind:
            spread = luck * np.sqrt(2) * gain
            right.errorbar(gain, beside, xerr=spread, fmt=look.marker, c=look.colour)
    lights = [fusion.light_of(door, star, MIDDLE) for star in fusion.STARS]
    expected = [np.sqrt(light.sum() / light[0]) for light in lights]
    right.plot(expected, rows, "|", color="#000000", markersize=14, label="root of the light")
    left.set(xscale="log", xlabel="centroid error, RMS (px)")
    right.set(xlabel="signal over noise, to that of green (1)")
    names = [
        f"{star}, table" if isinstance(kind, str) else f"{star}, {kind:,.0f} K"
        for star, kind in fusion.STARS.items()
    ]
    left.set_yticks(rows, names)
    left.set_ylim(len(rows) - 0.5, -0.5)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8)


def _blackbodies(temperatures: FloatArray) -> FloatArray:
    """Return red over green and blue over green of blackbodies, shape (2, n)."""
    green, *others = images.star_photons(given(images.READS), 0.0, temperatures)
    return np.asarray(np.array(others) / green)


def colour_facts() -> dict[str, Fact]:
    """Return what the drawing of the colours shows, in numbers."""
    (cool_red, hot_red), (cool_blue, hot_blue) = _blackbodies(np.array(images.TEMPERATURES))
    return {
        "stars": Fact(images.colours_of_a_frame().measured.shape[1], "d"),
        "cool-red": Fact(cool_red, ".1f"),
        "cool-blue": Fact(cool_blue, ".1f"),
        "hot-red": Fact(hot_red, ".1f"),
        "hot-blue": Fact(hot_blue, ".1f"),
    }


@draws("niu2024-colours", named=colour_facts)
def draw_colours(figure: Figure) -> None:
    """Colours of the stars of a frame with their errors, and those of known spectra."""
    found = images.colours_of_a_frame()
    narrow = sized(figure, 6.4, 4.6, 4.4)
    axes = figure.add_subplot()
    (red, blue), (red_sigma, blue_sigma) = found.measured, found.sigma
    axes.errorbar(
        red,
        blue,
        blue_sigma,
        red_sigma,
        ".",
        color="#777777",
        elinewidth=0.6,
        markersize=4,
        label="stars of the frame, with predicted errors",
    )
    heat = np.geomspace(*images.TEMPERATURES, 60)
    axes.plot(*_blackbodies(heat), color="#000000", label="blackbodies")
    for star, marker in (("Sun", "*"), ("Vega", "D")):
        green, red, blue = fusion.light_of(given(images.READS), star, MIDDLE)
        axes.plot(
            red / green,
            blue / green,
            marker,
            color=RED.colour,
            markersize=9,
            zorder=5,
            label=f"{star}, table",
        )
    axes.set(xlabel="red over green (1)", ylabel="blue over green (1)")
    if narrow:
        figure.legend(loc="outside lower center", fontsize=8)
    else:
        axes.legend(loc="upper right", fontsize=8)
