"""The accuracy of the monitoring: Table IV and the numbers around it (chen2023, V-B).

The readings, which stand in the history 14 minutes before the first verdicts: centroid errors are
white noise from frame to frame with the scatter of Table III; the average over n frames runs along
the series; an accuracy is three standard deviations over the whole series, about its own mean. The
zero point of the second group is one constant rotation and does not enter its scatter.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.chen2023 import lasers
from reproduce.papers.chen2023.platform import TRACKER, angle_of_one_pixel
from reproduce.papers.declare import Prediction, Results, draws, reproduces
from reproduce.papers.study import Study
from reproduce.physics.attitude.averaging import scatter_of_averages
from reproduce.physics.optics.simulate import spawned_normals
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

TABLE = "chen2023/table-4"
TEXT = "chen2023/text-accuracy"
FRAMES = f"{TEXT}#frames"
MATRICES = ("transform", "misalignment")
TITLES = {"transform": "laser transform", "misalignment": "misalignment"}
REPLICATES = 2000
READS = (*lasers.READS, lasers.SCATTER, FRAMES, f"{TABLE}#*.frames")
# Replicates simulated at once: enough to be fast, few enough to stay small in memory.
BATCH = 250


@reproduces(
    TABLE,
    cells=["*.transform-?", "*.misalignment-?"],
    given=READS,
    equations=["2", "3", "4", "5", "6", "7"],
    replicates=REPLICATES,
)
def frame_averaging(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """Accuracy of the two matrices, for averages over more and more frames."""
    counts = [int(n) for n in given.array(f"{TABLE}#*.frames")]
    accuracies = simulated_accuracies(given, seed, replicates, counts)
    return {
        f"{count}.{matrix}-{axis}": Prediction(accuracies[:, m, c, a])
        for m, matrix in enumerate(MATRICES)
        for c, count in enumerate(counts)
        for a, axis in enumerate("xy")
    }


def simulated_accuracies(
    given: Given, seed: SeedSequence, replicates: int, counts: list[int]
) -> FloatArray:
    """Simulate both groups of images and return the scatter of their averages.

    Shape (replicates, 2 groups, counts, 2 axes). Three standard deviations, in radians.
    """
    response = lasers.angle_response(given)
    spots = np.stack([lasers.scatter(given, group) for group in (1, 2)])
    frames = given.count(FRAMES)
    parts = []
    for first in range(0, replicates, BATCH):
        batch = min(BATCH, replicates - first)
        shape = (len(MATRICES), frames, *spots.shape[1:])
        noise = spawned_normals(seed, batch, shape, first=first) * spots[:, None]
        # One angle about X and one about Y for each frame, to first order in the noise: exact to
        # a part in a million here, since the noise turns the camera by a few microradians.
        angles = np.tensordot(noise, response, axes=([-2, -1], [-2, -1]))
        parts.append(scatter_of_averages(angles, counts, axis=-2))
    return lasers.SIGMAS * np.concatenate(parts)


@reproduces(
    TEXT,
    cells=["smoothing-time-*"],
    given=[
        f"{TEXT}#duration",
        FRAMES,
        f"{TEXT}#smoothing-frames",
        f"{TEXT}#frame-rate",
    ],
)
def times(given: Given) -> Results:
    """Time to take the averaged frames, in flight and on the ground platform."""
    averaged = given.count(f"{TEXT}#smoothing-frames")
    return {
        "smoothing-time-flight": averaged / given[f"{TEXT}#frame-rate"],
        "smoothing-time-ground": averaged * given[f"{TEXT}#duration"] / given.count(FRAMES),
    }


@reproduces(
    TEXT,
    cells=["*-single-?", "*-smoothed-bound"],
    given=[f"{TABLE}#{row}.{matrix}-?" for row in (1, 100) for matrix in MATRICES],
)
def quoted_accuracy(given: Given) -> Results:
    """First and last row of Table IV, quoted again in the text."""
    results = {}
    for matrix in MATRICES:
        for axis in "xy":
            results[f"{matrix}-single-{axis}"] = given[f"{TABLE}#1.{matrix}-{axis}"]
        smoothed = given.array(f"{TABLE}#100.{matrix}-?")
        results[f"{matrix}-smoothed-bound"] = float(smoothed.max())
    return results


@reproduces(TEXT, cells=["centroid-accuracy"], given=[f"{lasers.SCATTER}#1-*"])
def centroid_accuracy(given: Given) -> Results:
    """Mean scatter of the spots in the group from which the laser transform comes."""
    return {"centroid-accuracy": float(given.array(f"{lasers.SCATTER}#1-*").mean())}


@reproduces(TEXT, cells=["angular-resolution"], given=TRACKER)
def pixel_angle(given: Given) -> Results:
    """Angle of one pixel of the tracker, quoted again in the text."""
    return {"angular-resolution": angle_of_one_pixel(given)}


def orders() -> Study:
    """Accuracy of a single frame in the axes of either instrument, for two principal points."""
    door = given((*READS, *quoted_accuracy.given))
    points = {
        "centre of the detector": lasers.tracker_centre(door),
        "middle of the spots": door.array(lasers.SPOTS).reshape(-1, 2).mean(axis=0),
    }
    rows = []
    for name, point in points.items():
        for frame, response in zip(FRAMES_OF_ERROR, lasers.responses(door, point), strict=True):
            variance = (response**2 * lasers.scatter(door, 1) ** 2).sum(axis=(-2, -1))
            angles = lasers.SIGMAS * np.sqrt(variance[:2]) * ARCSEC_PER_RADIAN
            rows.append((f"{name}; {frame}", *(f"{angle:.2f}" for angle in angles)))
    printed = [door[f"{TABLE}#1.transform-{axis}"] * ARCSEC_PER_RADIAN for axis in "xy"]
    rows.append(("printed", *(f"{angle:.2f}" for angle in printed)))
    caption = (
        "Accuracy of the laser transform from one frame (3σ), by the scatter of Table III, for two "
        "principal points of the tracker and both orders of the product."
    )
    head = ("Principal point; axes of the error", "about X (arcsec)", "about Y (arcsec)")
    return Study(caption, head, tuple(rows))


FRAMES_OF_ERROR = ("axes of the camera", "axes of the tracker")


@functools.cache
def _predicted(door: Given) -> Results:
    return frame_averaging(door)


def replicated_table(counts: list[int]) -> FloatArray:
    """Return the replicates of Table IV that its prediction rests on.

    Shape (replicates, columns, counts). Three standard deviations, in radians; X and Y of the laser
    transform, then of the misalignment.
    """
    predicted = _predicted(given(READS))
    return np.stack(
        [
            np.stack(
                [_draws(predicted[f"{count}.{m}-{axis}"]) for count in counts],
                axis=-1,
            )
            for m in MATRICES
            for axis in "xy"
        ],
        axis=1,
    )


@draws("chen2023/table-4", given=READS)
def draw(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Accuracy of the matrices against the number of averaged frames."""
    predicted = _predicted(door)
    counts = [int(n) for n in door.array(f"{TABLE}#*.frames")]
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, matrix in zip(panels, MATRICES, strict=True):
        for axis, marker, line in (("x", "o", "-"), ("y", "s", "--")):
            names = [f"{count}.{matrix}-{axis}" for count in counts]
            draws = np.stack([_draws(predicted[name]) for name in names])
            ends = np.quantile(draws, [0.005, 0.5, 0.995], axis=1)
            low, middle, high = ends * ARCSEC_PER_RADIAN
            (drawn,) = axes.loglog(counts, middle, line, label=f"predicted, {axis.upper()}")
            colour = drawn.get_color()
            axes.fill_between(
                counts, low, high, facecolor=(colour, 0.15), edgecolor=colour, linestyle=line
            )
            values = [printed[f"{TABLE}#{name}"] * ARCSEC_PER_RADIAN for name in names]
            axes.plot(counts, values, marker, color=colour, label=f"printed, {axis.upper()}")
        axes.set(xlabel="frames averaged", title=TITLES[matrix])
        axes.set_xticks(counts, [str(count) for count in counts], minor=False)
        axes.set_yticks([0.1, 0.2, 0.5, 1.0], ["0.1", "0.2", "0.5", "1"], minor=False)
        axes.minorticks_off()
    panels[0].set_ylabel("accuracy (3σ, arcsec)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def _draws(result: object) -> FloatArray:
    if not isinstance(result, Prediction):
        raise TypeError(f"expected a Prediction, got {type(result).__name__}")
    return result.draws
