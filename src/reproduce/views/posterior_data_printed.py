"""A user's printed tables: files of the models that take rounded numbers.

The last digit that a column writes is taken for the digit to which it was rounded: write 0.20, not
0.2, where two decimals are known.

* averages: ``frames`` in an average, ``error_arcsec`` (one standard deviation of the averages), and
  ``series``, the frames of the whole series, the same in every line;
* stage test: positions of the stage (``position_x_um``, ``position_y_um``); angles about Y (which
  motion along X turns) and about X; the first line is the zero state, its angles zero;
* geometry: ``block`` 0 holds the spots of lasers 1 to 4 (``first``, ``second``: x and y in px),
  block 1 positions of the stage (X and Y in micrometres, the zero state first), block 2 reference
  angles of the moved states (about Y and about X, in arcsec); ``item`` counts from 1 in each block.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reproduce.inference.averaging import AveragingLikelihood, averaging_model
from reproduce.inference.geometry import GeometryLikelihood, geometry_model
from reproduce.inference.model import Model
from reproduce.inference.priors import HalfNormal, LogUniform, Normal, Prior
from reproduce.inference.reference_angles import ReferenceAngles
from reproduce.inference.registration import with_priors
from reproduce.inference.stage_table import StageTableLikelihood, table_model
from reproduce.papers.chen2023 import lasers
from reproduce.papers.chen2023.posteriors import READS, platform
from reproduce.printed.given import given
from reproduce.store.points import Table, TableFileError
from reproduce.units import ARCSEC_PER_RADIAN

FloatArray = NDArray[np.float64]

AVERAGE_COLUMNS = ("frames", "error_arcsec", "series")
STAGE_COLUMNS = (
    "position_x_um", "position_y_um", "reference_y_arcsec", "monitored_y_arcsec",
    "reference_x_arcsec", "monitored_x_arcsec",
)  # fmt: skip
GEOMETRY_COLUMNS = ("block", "item", "first", "second")
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


def averaging(name: str, table: Table, pivot: object) -> Model:
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
    likelihood = AveragingLikelihood(counts, errors / ARCSEC_PER_RADIAN, half, int(series[0]))
    model = averaging_model(likelihood, name)
    priors: dict[str, Prior] = {
        "white": LogUniform(single / SINGLE, single * SINGLE, "within a thousand times of the "
                            "error of one frame, no scale preferred"),
        "floor": HalfNormal(single, "a floor that may well be nothing, up to the error of one "
                            "frame or so"),
    }  # fmt: skip
    return replace(model, parameters=with_priors(model.parameters, priors))


def stage_table(name: str, table: Table, pivot: object) -> Model:
    """Focal length, bias and noise of a stage test."""
    for column in STAGE_COLUMNS[2:]:
        if table.column(column)[0] != 0:
            raise table.wrong(0, column, "expected zero in the first line: the zero state")
    angles = table.values[1:, 2:] / ARCSEC_PER_RADIAN
    digit = table.last_digit(STAGE_COLUMNS[2:], range(1, len(table.texts)))
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


def geometry(name: str, table: Table, pivot: object) -> Model:
    """Focal lengths and laser spacing."""
    block, item = table.column("block"), table.column("item")
    for row, value in enumerate(block):
        if value not in (0, 1, 2):
            raise table.wrong(row, "block", "expected 0 (spots), 1 (positions) or 2 (angles)")
        if item[row] != (block[:row] == value).sum() + 1:
            raise table.wrong(row, "item", "expected the items of a block to count from 1")
    rows = [np.flatnonzero(block == which).tolist() for which in (0, 1, 2)]
    design = platform(given(READS))
    if len(rows[0]) != len(design.lasers):
        raise TableFileError(
            f"{table.path}, column {table.positions[0]} (block): expected {len(design.lasers)} "
            f"spots in block 0, got {len(rows[0])}"
        )
    spots, positions, angles = (table.values[chosen, 2:] for chosen in rows)
    digits = [table.last_digit(GEOMETRY_COLUMNS[2:], chosen) if chosen else 1.0 for chosen in rows]
    _checked_digit(table, digits[2])
    reference = _reference(
        table,
        positions * 1e-6,
        angles / ARCSEC_PER_RADIAN,
        digits[1] * 1e-6,
        digits[2] / ARCSEC_PER_RADIAN,
    )
    diagonal = given(READS)[lasers.DIAGONAL]
    corners = lasers.designed_positions(spots, diagonal) / (diagonal / 2)
    lengths = (reference.fitted()[1], design.tracker_focal_length, diagonal)
    likelihood = GeometryLikelihood(
        spots, corners, digits[0] / 2, design.pixel_pitch, reference, lengths
    )
    model = geometry_model(likelihood, float(2 * design.principal_point[0] + 1))
    return replace(model, estimate={})


def _reference(
    table: Table,
    positions: FloatArray,
    angles: FloatArray,
    position_digit: float,
    angle_digit: float,
) -> ReferenceAngles:
    if len(positions) < LEAST_STATES or len(positions) != len(angles) + 1:
        raise TableFileError(
            f"{table.path}, line {table.lines[-1]}: expected the zero state and two or more moved "
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
