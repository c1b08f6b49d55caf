"""The accuracy of the monitoring: Table IV and the numbers around it (chen2023, V-B).

The readings, which stand in the history 14 minutes before the first verdicts: centroid errors are
white noise from frame to frame with the scatter of Table III; the average over n frames runs along
the series; an accuracy is three standard deviations over the whole series, about its own mean. The
zero point of the second group is one constant rotation and does not enter its scatter.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence, default_rng

from reproduce.papers.charts import banded, logarithmic, named_below, pair
from reproduce.papers.chen2023 import platform
from reproduce.papers.declare import Prediction, Results, draws, reproduces
from reproduce.physics.attitude import scatter_of_averages
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

TABLE = "chen2023/table-4"
TEXT = "chen2023/text-accuracy"
FRAMES = f"{TEXT}#frames"
SMOOTHED = f"{TEXT}#smoothing-frames"
DURATION = f"{TEXT}#duration"
RATE = f"{TEXT}#frame-rate"
_MATRICES = {"transform": "laser transform", "misalignment": "misalignment"}
_REPLICATES = 2000
READS = (*platform.INSTRUMENT, platform.SCATTER, FRAMES, f"{TABLE}#*.frames")
# Replicates simulated at once: enough to be fast, few enough to stay small in memory.
_BATCH = 250
_COLUMNS = tuple(product(_MATRICES, "xy"))


@reproduces(
    TABLE,
    cells=["*.transform-?", "*.misalignment-?"],
    given=READS,
    equations=["2", "3", "4", "5", "6", "7"],
    replicates=_REPLICATES,
)
def frame_averaging(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """Accuracy of the two matrices, for averages over more and more frames."""
    counts = _counts(given)
    accuracies = _simulated_accuracies(given, seed, replicates, counts)
    # Group, count and axis come first: each cell is then one series of replicates.
    cells = product(_MATRICES, counts, "xy")
    series = np.moveaxis(accuracies, 0, -1).reshape(-1, replicates)
    return {
        f"{count}.{matrix}-{axis}": Prediction(draws)
        for (matrix, count, axis), draws in zip(cells, series, strict=True)
    }


def _simulated_accuracies(
    given: Given, seed: SeedSequence, replicates: int, counts: list[int]
) -> FloatArray:
    """Simulate both groups of images and return the scatter of their averages.

    Shape (replicates, 2 groups, counts, 2 axes). Three standard deviations, in radians.
    """
    response = platform.angle_response(given)[:2]
    spots = np.stack([platform.scatter(given, group) for group in (1, 2)])
    # What a unit of noise in each coordinate turns: shape (groups, 2 axes, coordinates).
    turns = (spots[:, None] * response).reshape(len(spots), 2, -1)
    frames, generator = given.count(FRAMES), default_rng(seed)
    parts = []
    for first in range(0, replicates, _BATCH):
        batch = min(_BATCH, replicates - first)
        noise = generator.standard_normal((batch, len(spots), frames, turns.shape[-1]))
        # One angle about X and one about Y for each frame, to first order in the noise: exact to
        # a part in a million here, since the noise turns the camera by a few microradians.
        parts.append(scatter_of_averages(turns @ noise.mT, counts))
    return platform.SIGMAS * np.concatenate(parts).swapaxes(-1, -2)


@reproduces(TEXT, cells=["smoothing-time-*"], given=[DURATION, FRAMES, SMOOTHED, RATE])
def times(given: Given) -> Results:
    """Time to take the averaged frames, in flight and on the ground platform."""
    averaged = given.count(SMOOTHED)
    return {
        "smoothing-time-flight": averaged / given[RATE],
        "smoothing-time-ground": averaged * given[DURATION] / given.count(FRAMES),
    }


@reproduces(
    TEXT,
    cells=["*-single-?", "*-smoothed-bound"],
    given=[f"{TABLE}#{row}.{matrix}-?" for row in (1, 100) for matrix in _MATRICES],
)
def quoted_accuracy(given: Given) -> Results:
    """First and last row of Table IV, quoted again in the text."""
    smoothed = {matrix: given.array(f"{TABLE}#100.{matrix}-?") for matrix in _MATRICES}
    return {
        f"{matrix}-single-{axis}": given[f"{TABLE}#1.{matrix}-{axis}"]
        for matrix, axis in _COLUMNS
    } | {
        f"{matrix}-smoothed-bound": float(both.max())
        for matrix, both in smoothed.items()
    }


@reproduces(TEXT, cells=["centroid-accuracy"], given=[f"{platform.SCATTER}#1-*"])
def centroid_accuracy(given: Given) -> Results:
    """Mean scatter of the spots in the group from which the laser transform comes."""
    return {"centroid-accuracy": float(given.array(f"{platform.SCATTER}#1-*").mean())}


@reproduces(TEXT, cells=["angular-resolution"], given=platform.TRACKER)
def pixel_angle(given: Given) -> Results:
    """Angle of one pixel of the tracker, quoted again in the text."""
    return {"angular-resolution": platform.angle_of_one_pixel(given)}


def _counts(given: Given) -> list[int]:
    return [int(n) for n in given.array(f"{TABLE}#*.frames")]


@draws("chen2023/table-4", given=READS, random=True)
def _draw(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Accuracy of the matrices against the number of averaged frames."""
    counts, predicted = _counts(door), frame_averaging(door)
    panels = pair(figure, 4.0, 5.6, "accuracy (3σ, arcsec)")
    looks = {"x": ("#0072B2", "-", "o"), "y": ("#D55E00", "--", "s")}
    for (matrix, axis), axes in zip(
        _COLUMNS, (p for p in panels for _ in "xy"), strict=True
    ):
        names = [f"{count}.{matrix}-{axis}" for count in counts]
        cells = (predicted[name] for name in names)
        tables = [cell.draws for cell in cells if isinstance(cell, Prediction)]
        ends = np.quantile(tables, [0.005, 0.5, 0.995], axis=1) * ARCSEC_PER_RADIAN
        colour, line, marker = looks[axis]
        banded(axes, counts, ends, colour, line, label=f"predicted, {axis.upper()}")
        values = (
            np.array([printed[f"{TABLE}#{name}"] for name in names]) * ARCSEC_PER_RADIAN
        )
        axes.plot(
            counts, values, marker, color=colour, label=f"printed, {axis.upper()}"
        )
    for axes, title in zip(panels, _MATRICES.values(), strict=True):
        axes.set(xlabel="frames averaged", title=title)
        logarithmic(axes, counts, (0.1, 0.2, 0.5, 1.0))
    named_below(figure, 4)
