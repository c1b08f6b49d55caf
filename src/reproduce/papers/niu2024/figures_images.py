"""Drawings of the simulated images: one star in three channels, and errors over magnitude."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reproduce.papers.niu2024 import fusion, images, laboratory
from reproduce.papers.niu2024.sketch import LOOKS
from reproduce.physics.simulate import channel_centroids
from reproduce.printed.given import given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAGNITUDE, SEED = 3.0, 9
KINDS = (("#555555", ":", "^"), ("#D55E00", "--", "s"), ("#0072B2", "-", "o"))


def draw_star(figure: Figure) -> None:
    """One star near the corner of the field: three channels, and both ways to add them up."""
    door = given(images.READS)
    used, turns = images.cameras(door), laboratory.rotations(door)
    angles = 0.95 * np.array(laboratory.half_field(door))
    spots = channel_centroids(used, turns, angles[None])[:, 0]
    photons = images.star_photons(door, [MAGNITUDE], [fusion.TEMPERATURE])[:, 0]
    generator = np.random.default_rng(SEED)
    windows, corner = fusion.exposures(spots, photons, 1, generator)
    made = fusion.combinations(windows, corner, images.similarities(door))
    first = corner + fusion.MARGIN
    middle = slice(fusion.MARGIN, -fusion.MARGIN)
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
            axes.plot(x, y, look.marker, color=look.colour, markerfacecolor="none", markersize=9)
        axes.set(aspect="equal", title=name, xticks=[0, 3, 6, 9], yticks=[0, 3, 6, 9])
        axes.grid(visible=False)
    for axes in grid[1]:
        axes.set_xlabel("x (px)")
    for axes in grid[:, 0]:
        axes.set_ylabel("y (px)")
    grid[1, 2].set_axis_off()


def draw_errors(figure: Figure, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Centroid error and signal-to-noise ratio over magnitude, with and without registration.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    arrays : mapping
        Those of the stored study, as `fusion.Outcome` names them.
    """
    figure.set_size_inches(6.4, 3.6)
    left, right = figure.subplots(1, 2)
    corner, likely = len(fusion.PLACES) - 1, fusion.METHODS.index("maximum likelihood")
    for kind, (name, (colour, line, marker)) in enumerate(zip(fusion.MADE, KINDS, strict=True)):
        look: dict[str, Any] = {"color": colour, "linestyle": line, "marker": marker}
        for place, alpha in ((0, 0.45), (corner, 1.0)):
            where = "centre" if place == 0 else "corner"
            error = arrays["error"][place, :, kind, likely]
            left.plot(fusion.MAGNITUDES, error, alpha=alpha, label=f"{name}, {where}", **look)
            ratio = arrays["signal_to_noise"][place, :, kind]
            right.plot(fusion.MAGNITUDES, ratio, alpha=alpha, **look)
    left.set(yscale="log", xlabel="V (mag)", ylabel="centroid error, RMS (px)")
    right.set(yscale="log", xlabel="V (mag)", ylabel="signal over noise (1)")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=8)
