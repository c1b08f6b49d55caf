"""Figures 1d and 7 to 10: what the twin of the ground platform sees and measures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import default_rng

from reproduce.papers.chen2023 import accuracy, stage, twin, twin_study
from reproduce.papers.declare import draws, seed_of
from reproduce.papers.sketch import INK
from reproduce.physics.attitude.averaging import moving_average
from reproduce.physics.attitude.misalignment import misalignment, misalignment_angles, stage_angle
from reproduce.physics.attitude.wahba import mean_rotation
from reproduce.physics.images.detector import Detector, expose
from reproduce.physics.images.spots import render_frame
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RATE = ("chen2023/text-accuracy#duration", accuracy.FRAMES)
READS = (*twin.READS, twin_study.SMOOTHED, "chen2023/text-accuracy#duration")
STAGE_READS = (*READS, f"{stage.TABLE}#*.position-?", stage.FRAMES, stage.TELESCOPE)
MARGIN = 12


@cache
def groups(door: Given) -> twin.Series:
    """Return the two groups of frames that Figures 8 and 9 show."""
    return twin.two_groups(
        twin.bench(door), door.count(accuracy.FRAMES), default_rng(seed_of("chen2023/fig-8"))
    )


@dataclass(frozen=True, eq=False)
class Ride:
    """The test with the moving stage, frame by frame.

    Attributes
    ----------
    times : ndarray, shape (frames,)
        In seconds.
    positions : ndarray, shape (frames, 2)
        Of the stage, in metres.
    reference, monitored : ndarray, shape (frames, 2)
        About X and Y, in radians; monitored is the mean of up to 100 frames before.
    """

    times: FloatArray
    positions: FloatArray
    reference: FloatArray
    monitored: FloatArray


@cache
def ride(door: Given) -> Ride:
    """Run the test of Figure 10: the printed positions, one state after the other."""
    platform, frames = twin.bench(door), door.count(stage.FRAMES)
    places = door.array(f"{stage.TABLE}#*.position-?").reshape(-1, 2)
    moved = places - places[0]
    # A motion along one axis turns the camera about the other; the printed signs are kept.
    angles = np.zeros((len(places), 3))
    angles[:, :2] = stage_angle(moved[:, ::-1], door[stage.TELESCOPE])
    spots = platform.turned(angles)
    found = twin.centroids(
        platform, spots, platform.light[1], frames, default_rng(seed_of("chen2023/fig-10b"))
    )
    zero = mean_rotation(platform.transform(found[0]))
    single = misalignment_angles(
        misalignment(platform.camera_directions, platform.directions(found), zero)
    )
    pace = door["chen2023/text-accuracy#duration"] / door.count(accuracy.FRAMES)
    series = single.reshape(-1, 3)[:, :2]
    return Ride(
        times=np.asarray(np.arange(len(series)) * pace, dtype=np.float64),
        positions=np.repeat(places, frames, axis=0),
        reference=np.repeat(angles[:, :2], frames, axis=0),
        monitored=trailing_mean(series, door.count(twin_study.SMOOTHED)),
    )


def trailing_mean(series: FloatArray, count: int) -> FloatArray:
    """Return the mean of the last `count` frames at each frame, of fewer at the beginning.

    Shape (frames, k). In the unit of the series.
    """
    start = np.cumsum(series[: count - 1], axis=0) / np.arange(1, count)[:, np.newaxis]
    return np.concatenate([start, moving_average(series, count, axis=0)])


@draws("chen2023/fig-7", given=READS, marks=["chen2023/text-platform#spot-*"])
def draw_spots(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Image of the four laser spots in the tracker, rendered at the printed places."""
    platform = twin.bench(door)
    corner = np.floor(platform.spots.min(axis=0)).astype(int) - MARGIN
    size = np.ceil(platform.spots.max(axis=0)).astype(int) + MARGIN - corner
    mean = render_frame(
        platform.spots - corner, platform.light[0], platform.radius, (int(size[0]), int(size[1]))
    )
    seen = expose(mean, Detector(), default_rng(seed_of("chen2023/fig-7")))
    left, top = corner - 0.5
    figure.set_size_inches(6.4, 5.2)
    figure.set_layout_engine("compressed")
    axes = figure.add_subplot()
    picture = axes.imshow(
        seen, extent=(left, left + size[0], top + size[1], top), cmap="gray", vmin=0.0
    )
    centres = np.array(list(printed.values())).reshape(-1, 2)
    axes.plot(*centres.T, "o", markersize=16, fillstyle="none", color="#D55E00", label="printed")
    for number, (x, y) in enumerate(centres, start=1):
        axes.annotate(f"{number}", (x + 2.5, y - 1.5), color="#E69F00")
    axes.grid(visible=False)
    axes.set(xlabel="x (px)", ylabel="y (px)")
    axes.legend(loc="upper right", labelcolor="#E69F00")
    figure.colorbar(picture, ax=axes, label="electrons per frame")


@draws("chen2023/fig-8", given=READS, marks=["chen2023/text-accuracy#transform-single-?"])
def draw_transform(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Error of the laser transform over the first group, single frames and smoothed."""
    _series(figure, door, groups(door).transform, printed, "error (arcsec)")


@draws("chen2023/fig-9", given=READS, marks=["chen2023/text-accuracy#misalignment-single-?"])
def draw_misalignment(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Monitored misalignment over the second group, single frames and smoothed.

    The bench stood differently in the second group, and the paper prints no number for it. A
    constant misalignment moves the whole series and leaves its scatter as it is; the twin has
    none, and the axis says that it counts from there.
    """
    _series(
        figure,
        door,
        groups(door).misalignment,
        printed,
        "angle, less offset (arcsec)",
    )


def _series(
    figure: Figure, door: Given, angles: FloatArray, printed: Mapping[str, float], name: str
) -> None:
    accuracies = list(printed.values())
    count = door.count(twin_study.SMOOTHED)
    frames = np.arange(1, len(angles) + 1)
    figure.set_size_inches(7.2, 3.4)
    panels: list[Axes] = list(figure.subplots(1, 2, sharey=True))
    for panel, axis, index in zip(panels, "XY", range(2), strict=True):
        series = angles[:, index] * ARCSEC_PER_RADIAN
        smoothed = moving_average(series, count)
        panel.plot(frames, series, ".", markersize=2.5, label="single frame")
        panel.plot(
            frames[count - 1 :], smoothed, color=INK, linewidth=2.5, label=f"mean of {count}"
        )
        for side in (-1, 1):
            panel.axhline(
                series.mean() + side * accuracies[index] * ARCSEC_PER_RADIAN,
                color=INK,
                linestyle="--",
                linewidth=1,
                label="printed, 3σ" if side > 0 else None,
            )
        panel.set(xlabel="frame", title=f"about {axis}")
    panels[0].set_ylabel(name)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)


@draws("chen2023/fig-10a", marks=["chen2023/table-5#*.position-?"])
def draw_pattern(figure: Figure, printed: Mapping[str, float]) -> None:
    """Motion pattern of the stage, its five states marked."""
    places = np.array(list(printed.values())).reshape(-1, 2) * 1e6
    axes = figure.add_subplot()
    axes.plot(*places.T, "--", linewidth=1)
    axes.plot(*places.T, "^", markersize=8, color="#D55E00")
    for state, (x, y) in enumerate(places, start=1):
        axes.annotate(f"state {state}", (x + 3.5, y - 4.0), fontsize=9)
    axes.set(xlabel="stage along X (µm)", ylabel="stage along Y (µm)", xlim=(0, 112), ylim=(0, 95))


@draws("chen2023/fig-10b", given=STAGE_READS, marks=["chen2023/table-5#[2-5].monitoring-y"])
def draw_about_y(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Monitored and reference angle about Y while the stage moves along X."""
    _ridden(figure, door, 1, list(printed.values()))


@draws("chen2023/fig-10c", given=STAGE_READS, marks=["chen2023/table-5#[2-5].monitoring-x"])
def draw_about_x(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Monitored and reference angle about X while the stage moves along Y."""
    _ridden(figure, door, 0, list(printed.values()))


def _ridden(figure: Figure, door: Given, index: int, angles: list[float]) -> None:
    content = ride(door)
    axes = figure.add_subplot()
    axes.plot(
        content.times,
        content.monitored[:, index] * ARCSEC_PER_RADIAN,
        label="monitored by the twin",
    )
    axes.plot(
        content.times,
        content.reference[:, index] * ARCSEC_PER_RADIAN,
        "--",
        label="reference, (10)",
    )
    each = len(content.times) // len(stage.STATES)
    middles = content.times[each + each // 2 :: each]
    axes.plot(
        middles, np.array(angles) * ARCSEC_PER_RADIAN, "s", color=INK, label="monitored, printed"
    )
    axes.set(xlabel="time (s)", ylabel=f"angle about {'XY'[index]} (arcsec)")
    axes.legend()


@draws("chen2023/fig-1d", given=STAGE_READS)
def draw_example(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """One move of the stage, close up: the average follows the reference after its own length."""
    content = ride(door)
    each = len(content.times) // len(stage.STATES)
    shown = slice(each // 2, 2 * each)
    figure.set_size_inches(6.4, 3.2)
    axes = figure.add_subplot()
    axes.plot(
        content.times[shown], content.monitored[shown, 1] * ARCSEC_PER_RADIAN, label="monitored"
    )
    axes.plot(
        content.times[shown],
        content.reference[shown, 1] * ARCSEC_PER_RADIAN,
        "--",
        label="reference",
    )
    axes.set(xlabel="time (s)", ylabel="angle about Y (arcsec)")
    axes.legend()
