"""The accuracy of the monitoring: Table IV and the numbers around it (chen2023, V-B).

The assumptions, which were recorded before the first verdicts: centroid errors are white noise from
frame to frame with the scatter of Table III. The average over n frames runs along the series. An
accuracy is three standard deviations over the whole series, about its own mean. The zero point of
the second group is one constant rotation and does not enter its scatter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence, default_rng

from reproduce.papers.charts import banded, logarithmic, named_below, pair
from reproduce.papers.chen2023 import platform
from reproduce.papers.declare import Prediction, Results, draws, reproduces
from reproduce.physics.attitude import scatter_of_averages
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
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
_BATCH_REPLICATES = 250


@reproduces(
    TABLE,
    cells=["*.transform-?", "*.misalignment-?"],
    inputs=READS,
    equations=["2", "3", "4", "5", "6", "7"],
    replicates=_REPLICATES,
)
def frame_averaging(inputs: Inputs, seed: SeedSequence, replicates: int) -> Results:
    """Accuracy of the two matrices, for averages over more and more frames."""
    counts = _counts(inputs)
    found = _simulated_accuracies(inputs, seed, replicates, counts)
    return {
        f"{count}.{matrix}-{axis}": Prediction(found[:, group, place, column])
        for group, matrix in enumerate(_MATRICES)
        for column, count in enumerate(counts)
        for place, axis in enumerate("xy")
    }


def _simulated_accuracies(
    inputs: Inputs, seed: SeedSequence, replicates: int, counts: list[int]
) -> FloatArray:
    """Return the simulated scatter of averages, (replicates, 2 groups, 2 axes, counts).

    It is three standard deviations, in radians.
    """
    response = platform.angle_response(inputs)[:2]
    spots = np.stack([platform.scatter(inputs, group) for group in (1, 2)])
    # Turns by unit noise in each coordinate: shape (groups, 2 axes, coordinates).
    turns = (spots[:, None] * response).reshape(len(spots), 2, -1)
    frames, generator = inputs.count(FRAMES), default_rng(seed)
    parts = []
    for first in range(0, replicates, _BATCH_REPLICATES):
        batch = min(_BATCH_REPLICATES, replicates - first)
        noise = generator.standard_normal((batch, len(spots), frames, turns.shape[-1]))
        # One angle about X and one about Y for each frame, to first order in the noise: exact to
        # a part in a million here, since the noise turns the camera by a few microradians.
        parts.append(scatter_of_averages(turns @ noise.mT, counts))
    return platform.SIGMAS * np.concatenate(parts)


def time_per_frame(inputs: Inputs) -> float:
    """Return the time between two frames on the ground platform, in seconds."""
    return inputs[DURATION] / inputs[FRAMES]


@reproduces(TEXT, cells=["smoothing-time-*"], inputs=[DURATION, FRAMES, SMOOTHED, RATE])
def times(inputs: Inputs) -> Results:
    """Time to take the averaged frames, in flight and on the ground platform."""
    return {
        "smoothing-time-flight": inputs[SMOOTHED] / inputs[RATE],
        "smoothing-time-ground": inputs[SMOOTHED] * time_per_frame(inputs),
    }


@reproduces(
    TEXT,
    cells=["*-single-?", "*-smoothed-bound"],
    inputs=[f"{TABLE}#{row}.{matrix}-?" for row in (1, 100) for matrix in _MATRICES],
)
def quoted_accuracy(inputs: Inputs) -> Results:
    """First and last row of Table IV, quoted again in the text."""
    results = {}
    for matrix in _MATRICES:
        smoothed = inputs.array(f"{TABLE}#100.{matrix}-?")
        results[f"{matrix}-smoothed-bound"] = float(smoothed.max())
        for axis in "xy":
            results[f"{matrix}-single-{axis}"] = inputs[f"{TABLE}#1.{matrix}-{axis}"]
    return results


@reproduces(TEXT, cells=["centroid-accuracy"], inputs=[f"{platform.SCATTER}#1-*"])
def centroid_accuracy(inputs: Inputs) -> Results:
    """Mean scatter of the spots in the group from which the laser transform comes."""
    return {"centroid-accuracy": float(inputs.array(f"{platform.SCATTER}#1-*").mean())}


@reproduces(TEXT, cells=["angular-resolution"], inputs=platform.TRACKER)
def pixel_angle(inputs: Inputs) -> Results:
    """Angle of one pixel of the tracker, quoted again in the text."""
    return {"angular-resolution": platform.angle_of_one_pixel(inputs)}


def _counts(inputs: Inputs) -> list[int]:
    return [int(n) for n in inputs.array(f"{TABLE}#*.frames")]


@draws("chen2023/table-4", inputs=READS, random=True)
def _draw(figure: Figure, printed: Mapping[str, float], inputs: Inputs) -> None:
    """Accuracy of the matrices against the number of averaged frames."""
    counts, predicted = _counts(inputs), frame_averaging(inputs)
    panels = pair(figure, 4.0, 5.6, "accuracy (3σ, arcsec)")
    looks = {"x": ("#0072B2", "-", "o"), "y": ("#D55E00", "--", "s")}
    for axes, (matrix, title) in zip(panels, _MATRICES.items(), strict=True):
        for axis, (colour, line, marker) in looks.items():
            names = [f"{count}.{matrix}-{axis}" for count in counts]
            cells = (predicted[name] for name in names)
            tables = [cell.draws for cell in cells if isinstance(cell, Prediction)]
            ends = np.quantile(tables, [0.005, 0.5, 0.995], axis=1) * ARCSEC_PER_RADIAN
            label = axis.upper()
            banded(axes, counts, ends, colour, line, label=f"predicted, {label}")
            values = np.array([printed[f"{TABLE}#{name}"] for name in names])
            axes.plot(
                counts,
                values * ARCSEC_PER_RADIAN,
                marker,
                color=colour,
                label=f"printed, {label}",
            )
        axes.set(xlabel="frames averaged", title=title)
        logarithmic(axes, counts, (0.1, 0.2, 0.5, 1.0))
    named_below(figure, 4)
