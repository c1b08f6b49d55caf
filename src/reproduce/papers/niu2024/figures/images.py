"""Drawings of the simulated images: a star in three channels, errors by star, colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reproduce.papers.declare import draws
from reproduce.papers.niu2024 import experiment, images, images_fusion
from reproduce.papers.niu2024.figures.looks import LOOKS, RED
from reproduce.papers.study import Fact
from reproduce.physics.optics.simulate import channel_centroids
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = []

MAGNITUDE, SEED = 3.0, 9
MIDDLE = 4.0  # the magnitude at which kinds of stars are compared
KINDS = (("#777777", ":", "^"), ("#D55E00", "--", "s"), ("#0072B2", "-", "o"))


def _spots() -> FloatArray:
    """Return where the star stands in green, red and blue, in px, near the corner of the field."""
    door = given(images.READS)
    used, turns = images.cameras(door), experiment.rotations(door)
    angles = 0.95 * np.array(experiment.half_field(door))
    return channel_centroids(used, turns, angles[None])[:, 0]


def star_facts() -> dict[str, Fact]:
    """Return what the drawing of one star shows, in numbers."""
    spots = _spots()
    apart = max(np.hypot(*(one - other)) for one in spots for other in spots)
    return {"apart": Fact(float(apart), ".1f", "px")}


@draws("niu2024-fusion-star", named=star_facts)
def draw_star(figure: Figure) -> None:
    """One star near the corner of the field: three channels, and both ways to add them up."""
    door, spots = given(images.READS), _spots()
    photons = images.star_photons(door, MAGNITUDE, images_fusion.TEMPERATURE)
    generator = np.random.default_rng(SEED)
    windows, corner = images_fusion.exposures(spots, photons, 1, generator)
    made = images_fusion.combinations(windows, corner, images.similarities(door))
    first = corner + images_fusion.MARGIN
    middle = slice(images_fusion.MARGIN, -images_fusion.MARGIN)
    panels = {
        "red": windows[1, 0, middle, middle],
        "green": made[0][0],
        "blue": windows[2, 0, middle, middle],
        "fused as they are": made[1][0],
        "fused after registration": made[2][0],
    }
    figure.set_size_inches(6.4, 4.6)
    grid = figure.subplots(2, 3, sharex=True, sharey=True)
    for axes, (name, light) in zip(grid.flat, panels.items(), strict=False):
        root = np.sqrt(np.maximum(light, 0))
        # Never quite black: what is drawn in black follows the page, and is white on a dark one.
        axes.pcolormesh(root, cmap="gray_r", shading="flat", vmin=0, vmax=1.1 * root.max())
        marked = {name: spots[list(LOOKS).index(name)]} if name in LOOKS else {}
        order = ("green", "red", "blue")
        for look in LOOKS.values():
            if marked and look.name != name:
                continue
            x, y = spots[order.index(look.name)] - first + 0.5
            if name == "fused after registration":
                x, y = spots[0] - first + 0.5
            for width, colour in ((3.5, "white"), (1.3, look.colour)):  # a halo, for dark pixels
                axes.plot(
                    x,
                    y,
                    look.marker,
                    color=colour,
                    fillstyle="none",
                    markersize=9,
                    markeredgewidth=width,
                )
        axes.set(aspect="equal", title=name, xticks=[0, 3, 6, 9], yticks=[0, 3, 6, 9])
        axes.grid(visible=False)
    for axes in grid[1]:
        axes.set_xlabel("x (px)")
    for axes in grid[:, 0]:
        axes.set_ylabel("y (px)")
    grid[1, 2].set_axis_off()


def error_facts() -> dict[str, Fact]:
    """Return what the drawing of the errors shows, in numbers: the middle star, in the corner."""
    row = list(images_fusion.STARS).index(
        images_fusion.BLACKBODIES[len(images_fusion.BLACKBODIES) // 2]
    )
    error = images_fusion.stored().arrays["error"][row, -1, :, :, images_fusion.LIKELY]
    green, raw, fused = (error[:, images_fusion.MADE.index(name)] for name in images_fusion.MADE)
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
    figure.set_size_inches(6.4, 5.6)
    arrays = images_fusion.stored().arrays
    grid = figure.subplots(2, len(images_fusion.BLACKBODIES), sharex=True, sharey="row")
    for column, star in zip(grid.T, images_fusion.BLACKBODIES, strict=True):
        _over_magnitude(column, star, arrays)
        column[0].set_title(f"{star}: {images_fusion.STARS[star]:,.0f} K")
        column[1].set_xlabel("V (mag)")
    grid[0, 0].set_ylabel("centroid error, RMS (px)")
    grid[1, 0].set_ylabel("signal over noise (1)")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=8)


def _over_magnitude(column: Any, star: str, arrays: dict[str, NDArray[Any]]) -> None:
    row = list(images_fusion.STARS).index(star)
    for kind, (name, (colour, line, marker)) in enumerate(
        zip(images_fusion.MADE, KINDS, strict=True)
    ):
        look: dict[str, Any] = {"color": colour, "linestyle": line, "marker": marker}
        for place, where, fill in ((0, "centre", "none"), (-1, "corner", colour)):
            look["markerfacecolor"] = fill
            error = arrays["error"][row, place, :, kind, images_fusion.LIKELY]
            column[0].plot(images_fusion.MAGNITUDES, error, label=f"{name}, {where}", **look)
            ratio = arrays["signal_to_noise"][row, place, :, kind]
            column[1].plot(images_fusion.MAGNITUDES, ratio, **look)
    for axes in column:
        axes.set_yscale("log")


def star_kind_facts() -> dict[str, Fact]:
    """Return what the drawing of the kinds of stars shows, in numbers.

    Least and largest centroid errors of each kind of image, least and largest gain.
    """
    at = images_fusion.MAGNITUDES.index(MIDDLE)
    arrays, facts = images_fusion.stored().arrays, {}
    error, signal = (
        arrays["error"][:, -1, at, :, images_fusion.LIKELY],
        arrays["signal_to_noise"][:, -1, at],
    )
    for kind, name in enumerate(("green", "raw", "fused")):
        facts[f"{name}-least"] = Fact(error[:, kind].min(), ".2g", "px")
        facts[f"{name}-most"] = Fact(error[:, kind].max(), ".2g", "px")
    gain = signal[:, 2] / signal[:, 0]
    return facts | {"gain-least": Fact(gain.min(), ".2f"), "gain-most": Fact(gain.max(), ".2f")}


@draws("niu2024-fusion-stars", named=star_kind_facts)
def draw_stars(figure: Figure) -> None:
    """Centroid error and gain of signal over noise by kind of star, at V = 4 in the corner."""
    figure.set_size_inches(6.4, 3.8)
    left, right = figure.subplots(1, 2, sharey=True)
    at = images_fusion.MAGNITUDES.index(MIDDLE)
    rows = np.arange(len(images_fusion.STARS))
    arrays = images_fusion.stored().arrays
    signal = arrays["signal_to_noise"][:, -1, at]
    luck = 1 / np.sqrt(2 * images_fusion.PHASES * images_fusion.TRIALS)
    for kind, (name, (colour, _, marker)) in enumerate(zip(images_fusion.MADE, KINDS, strict=True)):
        look: dict[str, Any] = {"color": colour, "marker": marker, "linestyle": "none"}
        beside = rows + (kind - 1) * 0.18
        error = arrays["error"][:, -1, at, kind, images_fusion.LIKELY]
        left.errorbar(error, beside, xerr=2 * luck * error, label=name, **look)
        if kind:
            gain = signal[:, kind] / signal[:, 0]
            right.errorbar(gain, beside, xerr=2 * luck * np.sqrt(2) * gain, **look)
    expected = [np.sqrt(light.sum() / light[0]) for light in _lights()]
    right.plot(expected, rows, "|", color="#000000", markersize=14, label="root of the light")
    left.set(xscale="log", xlabel="centroid error, RMS (px)")
    right.set(xlabel="signal over noise, to that of green (1)")
    left.set_yticks(rows, [_named(star) for star in images_fusion.STARS])
    left.set_ylim(len(rows) - 0.5, -0.5)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8)


def _lights() -> list[NDArray[np.float64]]:
    door = given(images.READS)
    return [images_fusion.light_of(door, star, MIDDLE) for star in images_fusion.STARS]


def _named(star: str) -> str:
    spectrum = images_fusion.STARS[star]
    return f"{star}, table" if isinstance(spectrum, str) else f"{star}, {spectrum:,.0f} K"


def colour_facts() -> dict[str, Fact]:
    """Return what the drawing of the colours shows, in numbers."""
    door = given(images.READS)
    light = images.star_photons(door, np.zeros(2), np.array(images.TEMPERATURES))
    cool, hot = (light[1:] / light[0]).T
    return {
        "stars": Fact(images_fusion.frame_colours().measured.shape[1], "d"),
        "cool-red": Fact(cool[0], ".1f"),
        "cool-blue": Fact(cool[1], ".1f"),
        "hot-red": Fact(hot[0], ".1f"),
        "hot-blue": Fact(hot[1], ".1f"),
    }


@draws("niu2024-colours", named=colour_facts)
def draw_colours(figure: Figure) -> None:
    """Colours of the stars of a frame with their errors, and those of known spectra."""
    door = given(images.READS)
    found = images_fusion.frame_colours()
    heat = np.geomspace(*images.TEMPERATURES, 60)
    light = images.star_photons(door, np.zeros(60), heat)
    figure.set_size_inches(6.4, 4.6)
    axes = figure.add_subplot()
    axes.errorbar(
        found.measured[0],
        found.measured[1],
        xerr=found.sigma[0],
        yerr=found.sigma[1],
        fmt=".",
        color="#777777",
        elinewidth=0.6,
        markersize=4,
        label="stars of the frame, with predicted errors",
    )
    curve = light[1:] / light[0]
    axes.plot(curve[0], curve[1], color="#000000", label="blackbodies")
    for star, marker in (("Sun", "*"), ("Vega", "D")):
        own = images_fusion.light_of(door, star, MIDDLE)
        look: dict[str, Any] = {
            "marker": marker,
            "color": RED.colour,
            "markersize": 9,
            "linestyle": "none",
            "zorder": 5,
        }
        axes.plot(own[1] / own[0], own[2] / own[0], label=f"{star}, table", **look)
    axes.set(xlabel="red over green (1)", ylabel="blue over green (1)")
    axes.legend(loc="upper right", fontsize=8)
