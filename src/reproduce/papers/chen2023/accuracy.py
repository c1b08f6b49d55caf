"""The accuracy of the monitoring: Table IV and the numbers around it (chen2023, V-B).

The assumptions, which were recorded before the first verdicts, are: Centroid errors are white noise
from frame to frame with the scatter of Table III. The average over n frames moves along the series.
An accuracy is three standard deviations over the whole series, about its mean. The zero point of
the second group is one constant rotation and is not part of its scatter.
"""

from __future__ import annotations

import numpy as np
from numpy.random import SeedSequence, default_rng

from reproduce.papers.charts import (
    Figure,
    central_range,
    legend_below,
    set_log_ticks,
    two_panels,
)
from reproduce.papers.chen2023.platform import (
    INSTRUMENT,
    PIXEL,
    SIGMAS,
    TRACKER,
    TRACKER_FOCAL_LENGTH,
    unit_rotations,
)
from reproduce.papers.declare import (
    Results,
    by_cell,
    draws,
    reproduces,
)
from reproduce.physics.attitude import averaged_error, scatter_of_averages
from reproduce.physics.optics import angle_from_pixels
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN, RADIANS_PER_ARCSEC

FRAMES = "chen2023/text-accuracy#frames"
SMOOTHED = "chen2023/text-accuracy#smoothing-frames"
DURATION = "chen2023/text-accuracy#duration"
_RATE = "chen2023/text-accuracy#frame-rate"
COUNTS = "chen2023/table-4#*.frames"
# Rows of Table IV, by their printed numbers of frames.
_ROWS = ("1", "4", "16", "25", "49", "100")
_MATRICES = {"transform": "laser transform", "misalignment": "misalignment"}
INPUTS = (*INSTRUMENT, "chen2023/table-3", FRAMES, COUNTS)
# Floor of the dotted line in the figure, three sigma: the bound of the paper on its differences.
_EXAMPLE_FLOOR = 0.1 * RADIANS_PER_ARCSEC


@reproduces(
    "chen2023/table-4",
    cells=["*.transform-?", "*.misalignment-?"],
    inputs=INPUTS,
    replicates=2000,
)
def frame_averaging(inputs: Inputs, seed: SeedSequence, replicates: int) -> Results:
    """Compute the accuracy of the two matrices for averages over several numbers of frames.

    Implements: chen2023 (2), (3), (4), (5), (6), (7).
    """
    # By unit noise in each coordinate: shape (groups, 2 axes, coordinates).
    rotations = np.stack([unit_rotations(inputs, g)[:2] for g in (1, 2)])
    generator = default_rng(seed)
    shape = (len(rotations), inputs.count(FRAMES), rotations.shape[-1])
    # One angle about X and one about Y for each frame, to first order in the noise. The relative
    # error is one millionth, because the rotations are a few microradians.
    angles = (
        rotations @ generator.standard_normal(shape).mT for _ in range(replicates)
    )
    counts = inputs.array(COUNTS).astype(int).tolist()
    scatter = np.stack([scatter_of_averages(one, counts) for one in angles])
    return by_cell("{2}.{0}-{1}", SIGMAS * scatter, _MATRICES, "xy", _ROWS)


def time_per_frame(inputs: Inputs) -> float:
    """Return the time between two frames on the ground platform, in seconds."""
    return inputs[DURATION] / inputs[FRAMES]


@reproduces(
    "chen2023/text-accuracy",
    cells=["smoothing-time-*"],
    inputs=[DURATION, FRAMES, SMOOTHED, _RATE],
)
def times(inputs: Inputs) -> Results:
    """Compute the time of the averaged frames, in flight and on the ground platform."""
    return {
        "smoothing-time-flight": inputs[SMOOTHED] / inputs[_RATE],
        "smoothing-time-ground": inputs[SMOOTHED] * time_per_frame(inputs),
    }


@reproduces(
    "chen2023/text-accuracy",
    cells=["*-single-?", "*-smoothed-bound"],
    inputs=[
        f"chen2023/table-4#{row}.{matrix}-?" for row in (1, 100) for matrix in _MATRICES
    ],
)
def quoted_accuracy(inputs: Inputs) -> Results:
    """Return the first and last row of Table IV, which the text quotes."""
    single, smoothed = (
        inputs.pairs(f"chen2023/table-4#{count}.*-?") for count in (1, 100)
    )
    return {
        **by_cell("{}-single-{}", single, _MATRICES, "xy"),
        **by_cell("{}-smoothed-bound", smoothed.max(axis=1), _MATRICES),
    }


@reproduces(
    "chen2023/text-accuracy",
    cells=["centroid-accuracy"],
    inputs=["chen2023/table-3#1-*"],
)
def centroid_accuracy(inputs: Inputs) -> Results:
    """Compute the mean scatter of the spots in the group of the laser transform."""
    return {"centroid-accuracy": inputs.array("chen2023/table-3#1-*").mean()}


@reproduces("chen2023/text-accuracy", cells=["angular-resolution"], inputs=TRACKER)
def pixel_angle(inputs: Inputs) -> Results:
    """Return the angle of one pixel of the tracker, which the text quotes."""
    angle = angle_from_pixels(1, inputs[PIXEL], inputs[TRACKER_FOCAL_LENGTH])
    return {"angular-resolution": angle}


@draws("chen2023/table-4", inputs=INPUTS, random=True)
def _draw(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the printed accuracies over the predicted medians, against the averaged frames."""
    counts, predicted = inputs.array(COUNTS), frame_averaging(inputs)
    panels = two_panels(figure, 3.8, 5.8, "printed over predicted (ratio)")
    for axes, (matrix, title) in zip(panels, _MATRICES.items(), strict=True):
        for axis, look, shift in (("x", "C0o", 0.92), ("y", "C1s", 1.08)):
            cells = (predicted[f"{row}.{matrix}-{axis}"] for row in _ROWS)
            low, median, high = central_range(cells)
            values = printed.array(f"chen2023/table-4#*.{matrix}-{axis}")
            label, x = axis.upper(), counts * shift
            ends = 1 - low / median, high / median - 1
            axes.errorbar(
                x,
                1 + 0 * x,
                ends,
                fmt="none",
                ecolor=look[:2],
                capsize=4,
                label=f"predicted, {label}",
            )
            axes.plot(x, values / median, look, label=f"printed, {label}")
        axes.axhline(1.0, color="k", lw=1)
        # Without the floor the median of single frames is the accuracy of one frame.
        single = printed[f"chen2023/table-4#1.{matrix}-x"]
        floor = averaged_error(counts, single, _EXAMPLE_FLOOR)
        floor /= averaged_error(counts, single)
        label = f"with a floor of {_EXAMPLE_FLOOR * ARCSEC_PER_RADIAN:g} arcsec"
        axes.plot(counts, floor, "k:", label=label)
        axes.set(xlabel="frames averaged (count)", title=title)
        set_log_ticks(axes, counts, (0.5, 0.7, 1.0, 1.5, 2.0))
    legend_below(figure, 3)
