"""A user's printed tables: files of the models that take rounded numbers.

The last digit that a column writes is taken for the digit to which it was rounded: write 0.20, not
0.2, where two decimals are known.

* averages: ``frames`` in an average, ``error_arcsec`` (one standard deviation of the averages), and
  ``series``, the frames of the whole series, the same in every line;
* stage test: positions of the stage (``position_x_um``, ``position_y_um``); angles about Y (which
  motion along X turns) and about X; the first line is the zero state, its angles zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reproduce.inference.model import Model
from reproduce.inference.models.averaging import AveragingLikelihood, averaging_model
from reproduce.inference.models.reference_angles import ReferenceAngles
from reproduce.inference.models.registration import with_priors
from reproduce.inference.models.stage_table import StageTableLikelihood, table_model
from reproduce.inference.priors import HalfNormal, LogUniform, Normal, Prior
from reproduce.papers.declare_posterior import File
from reproduce.physics.validate import FloatArray
from reproduce.store.points import Table, TableFileError
from reproduce.units import ARCSEC_PER_RADIAN

__all__ = ["AVERAGES", "STAGE"]

AVERAGE_COLUMNS = ("frames", "error_arcsec", "series")
STAGE_COLUMNS = (
    "position_x_um", "position_y_um", "reference_y_arcsec", "monitored_y_arcsec",
    "reference_x_arcsec", "monitored_x_arcsec",
)  # fmt: skip
# The moments of running averages need a square matrix of this size, for every line.
LONGEST = 2000
LEAST_STATES = 3
# The noise may be from the last digit to so many times it; the bias up to some hundreds.
NOISE, BIAS = (1.0, 1000.0), 200.0
# How many times what least squares leaves a reference scatter and a bias may be; how many times the
# error of one frame, and its inverse, the white noise.
SCATTER, FARTHER, SINGLE = 100.0, 10.0, 1000.0
# Rounding of angles, in arcsec, for which the prior of the reference scatter is wide enough.
FINEST, COARSEST = 1e-4, 1e-2


def averaging(table: Table, pivot: object) -> Model:
    """White noise and floor of averages."""
    frames, errors, series = table.values.T
    for row in range(len(frames)):
        if not (frames[row] >= 1 and frames[row] % 1 == 0):
            raise table.wrong(row, "frames", "expected a whole number of frames above zero")
        if row and frames[row] <= frames[row - 1]:
            raise table.wrong(row, "frames", "expected more frames than in the line before")
        if not errors[row] > 0:
            raise table.wrong(row, "error_arcsec", "expected a standard deviation above zero")
        if series[row] != series[0] or not frames[-1] < series[row] <= LONGEST:
            raise table.wrong(row, "series", "expected one number of frames in all lines, above "
                              f"that of the longest average and at most {LONGEST}")  # fmt: skip
    if len(frames) < 2 or frames[0] != 1:
        raise table.wrong(0, "frames", "expected two or more lines, the first for one frame")
    half = table.last_digit(["error_arcsec"]) / 2 / ARCSEC_PER_RADIAN
    counts, single = tuple(int(n) for n in frames), float(errors[0]) / ARCSEC_PER_RADIAN
    likelihood = AveragingLikelihood(counts, errors[None] / ARCSEC_PER_RADIAN, half, int(series[0]))
    model = averaging_model(likelihood)
    priors: dict[str, Prior] = {
        "white": LogUniform(single / SINGLE, single * SINGLE, "within a thousand times of the "
                            "error of one frame, no scale preferred"),
        "floor": HalfNormal(single, "a floor that may well be nothing, up to the error of one "
                            "frame or so"),
    }  # fmt: skip
    return replace(model, parameters=with_priors(model.parameters, priors))


def stage_table(table: Table, pivot: object) -> Model:
    """Focal length, bias and noise of a stage test."""
    for column in STAGE_COLUMNS[2:]:
        if table.column(column)[0] != 0:
            raise table.wrong(0, column, "expected zero in the first line: the zero state")
    angles = table.values[1:, 2:] / ARCSEC_PER_RADIAN
    digit = table.last_digit(STAGE_COLUMNS[2:], range(1, len(table.values)))
    _checked_digit(table, digit)
    reference = _reference(table, table.values[:, :2] * 1e-6, angles[:, [0, 2]],
                           table.last_digit(STAGE_COLUMNS[:2]) * 1e-6,
                           digit / ARCSEC_PER_RADIAN)  # fmt: skip
    likelihood = StageTableLikelihood(reference, angles[:, [1, 3]])
    _, noise, *biases, _ = likelihood.start()[0].tolist()
    digit = digit / ARCSEC_PER_RADIAN
    ends = NOISE[0] * digit, NOISE[1] * max(digit, noise)
    likelihood = replace(likelihood, log_noise=(float(np.log(ends[0])), float(np.log(ends[1]))))
    wide = max(BIAS * digit, FARTHER * float(np.abs(biases).max()))
    bias = Normal(0.0, wide, "some hundreds of the last digit, or ten times the mean difference")
    priors: dict[str, Prior] = {
        "noise": LogUniform(*ends, "from the last digit to a thousand times it, or times what "
                            "least squares leaves; no scale preferred"),
        "bias-x": bias, "bias-y": bias,
    }  # fmt: skip
    model = table_model(likelihood, reference.fitted()[1])
    return replace(model, parameters=with_priors(model.parameters, priors), estimate={})


def _reference(
    table: Table,
    positions: FloatArray,
    angles: FloatArray,
    position_digit: float,
    angle_digit: float,
) -> ReferenceAngles:
    if len(positions) < LEAST_STATES or len(positions) != len(angles) + 1:
        raise TableFileError(
            f"{table.path}, {table.named([-1])}: expected the zero state and two or more moved "
            f"ones, each with its angles, got {len(positions)} positions and {len(angles)} lines "
            "of angles"
        )
    found = ReferenceAngles(positions, angles, position_digit / 2, angle_digit / 2)
    widest = float(np.log10(SCATTER * max(found.fitted()[2], angle_digit) * ARCSEC_PER_RADIAN))
    return replace(found, scatter=(found.scatter[0], max(found.scatter[1], widest)))


def _checked_digit(table: Table, digit: float) -> None:
    if not 0.99 * FINEST <= digit <= 1.01 * COARSEST:
        raise TableFileError(
            f"{table.path}: expected angles with two to four decimals of an arc second, got a last "
            f"digit of {digit:g}; write them so"
        )


AVERAGES = File(
    AVERAGE_COLUMNS,
    "one average per line: its frames, the standard deviation of such averages, and the frames of "
    "the whole series, the same in every line; the last digit written is the rounding",
    averaging,
)
STAGE = File(
    STAGE_COLUMNS,
    "one state per line, the zero state first, with angles zero; the last digit written is the "
    "rounding",
    stage_table,
)
