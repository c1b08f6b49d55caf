"""The accuracy of the monitoring: Table IV and the numbers around it (chen2023, V-B).

The readings, which stand in the history 14 minutes before the first verdicts: centroid errors are
white noise from frame to frame with the scatter of Table III; the average over n frames runs along
the series; an accuracy is three standard deviations over the whole series, about its own mean. The
zero point of the second group is one constant rotation and does not enter its scatter.

Does the table need an error that averaging does not reduce? The accuracies for different n come
from the same frames. They are strongly correlated, and the last of them are uncertain themselves.
So all cells of the table are predicted jointly, from the replicates that the ledger's table draws,
before any axis is asked about a floor b in E^2 = a^2 / n + b^2; and every axis is asked with the
floors of the others left open.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from reproduce.papers.chen2023 import platform
from reproduce.papers.declare import Prediction, Results, draws, reproduces
from reproduce.papers.study import Column, studied
from reproduce.physics.attitude.averaging import averaged_error, scatter_of_averages
from reproduce.physics.optics.simulate import spawned_normals
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN, RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.figure import Figure

__all__ = [
    "DURATION",
    "FRAMES",
    "RATE",
    "READS",
    "SMOOTHED",
    "fit",
    "joint_model",
    "preferences",
    "printed_fit",
    "simulated_accuracies",
]

TABLE = "chen2023/table-4"
TEXT = "chen2023/text-accuracy"
FRAMES = f"{TEXT}#frames"
SMOOTHED = f"{TEXT}#smoothing-frames"
DURATION = f"{TEXT}#duration"
RATE = f"{TEXT}#frame-rate"
MATRICES = ("transform", "misalignment")
TITLES = {"transform": "laser transform", "misalignment": "misalignment"}
REPLICATES = 2000
READS = (*platform.INSTRUMENT, platform.SCATTER, FRAMES, f"{TABLE}#*.frames")
# Replicates simulated at once: enough to be fast, few enough to stay small in memory.
BATCH = 250
COLUMNS = tuple((matrix, axis) for matrix in MATRICES for axis in "xy")
DIGIT = 0.01 * RADIANS_PER_ARCSEC
# Floors that are tried, in units of the column's single-frame accuracy.
TRIED = np.linspace(0.0, 0.4, 81)
# Rounds over the columns; they hardly know of each other, so two already suffice.
ROUNDS = 4
# What twice the log likelihood may fall short of its best at 95 %.
LIMIT = 3.84
# A floor is called needed below this probability, the look at several columns counted.
NEEDED = 0.01


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
    response = platform.angle_response(given)
    spots = np.stack([platform.scatter(given, group) for group in (1, 2)])
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
    return platform.SIGMAS * np.concatenate(parts)


@reproduces(
    TEXT,
    cells=["smoothing-time-*"],
    given=[DURATION, FRAMES, SMOOTHED, RATE],
)
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


@reproduces(TEXT, cells=["centroid-accuracy"], given=[f"{platform.SCATTER}#1-*"])
def centroid_accuracy(given: Given) -> Results:
    """Mean scatter of the spots in the group from which the laser transform comes."""
    return {"centroid-accuracy": float(given.array(f"{platform.SCATTER}#1-*").mean())}


@reproduces(TEXT, cells=["angular-resolution"], given=platform.TRACKER)
def pixel_angle(given: Given) -> Results:
    """Angle of one pixel of the tracker, quoted again in the text."""
    return {"angular-resolution": platform.angle_of_one_pixel(given)}


@cache
def _predicted(door: Given) -> Results:
    return frame_averaging(door)


def replicated_table(door: Given, counts: list[int]) -> FloatArray:
    """Return the replicates of Table IV that its prediction rests on.

    Shape (replicates, columns, counts). Three standard deviations, in radians; X and Y of the laser
    transform, then of the misalignment.
    """
    # The door that the drawing is given, so that both share one simulation.
    predicted = _predicted(door.narrowed(READS))
    columns = [
        np.stack([_draws(predicted[f"{count}.{matrix}-{axis}"]) for count in counts], axis=-1)
        for matrix, axis in COLUMNS
    ]
    return np.stack(columns, axis=1)


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


@dataclass(frozen=True, eq=False)
class Model:
    """The joint law of the logarithms of all cells, for every floor of every column.

    Attributes
    ----------
    means, spreads : ndarray, shape (columns, floors, counts)
        Of the logarithms; the spread counts in that without a floor.
    weight : ndarray, shape (columns, counts, columns, counts)
        Inverse of their covariance without a floor, the rounding of the print included.
    floors : ndarray, shape (columns, floors)
        In radians.
    """

    means: FloatArray
    spreads: FloatArray
    weight: FloatArray
    floors: FloatArray


@dataclass(frozen=True, eq=False)
class JointFit:
    """Floors under all columns of a table, fitted together.

    Attributes
    ----------
    without : float
        How often a table without floors is at least as far from its own mean as the printed one.
    anywhere : float
        How often a table without floors prefers floors at least as strongly as the printed one.
    floors, upper : ndarray, shape (columns,)
        The most likely floors, and the largest that are not refused at 95 %, in radians.
    single, among : ndarray, shape (columns,)
        How often a table without floors prefers one in this column at least as strongly; and how
        often in any of its columns.
    """

    without: float
    anywhere: float
    floors: FloatArray
    upper: FloatArray
    single: FloatArray
    among: FloatArray


def joint_model(noise: FloatArray, digit: float) -> Model:
    """Return the joint law of a table from replicates without floors.

    A floor raises the mean of a logarithm and narrows it; which cells rise and fall together stays.
    """
    columns, counts = noise.shape[1:]
    floors = TRIED * noise[:, :, 0].mean(axis=0)[:, np.newaxis]
    shape = (columns, len(TRIED), counts)
    means, spreads = np.empty(shape), np.empty(shape)
    for column, row in enumerate(floors):
        for place, floor in enumerate(row):
            model = np.log(averaged_error(1.0, noise[:, column], floor))
            means[column, place], spreads[column, place] = model.mean(axis=0), model.std(axis=0)
    spreads /= spreads[:, :1]
    rows = noise.reshape(len(noise), -1)
    # Rounding spreads a number evenly over one digit.
    rounding = np.diag((digit / rows.mean(axis=0)) ** 2 / 12.0)
    weight = np.linalg.inv(np.cov(np.log(rows).T) + rounding)
    return Model(means, spreads, weight.reshape(columns, counts, columns, counts), floors)


def fit(printed: FloatArray, noise: FloatArray, digit: float) -> JointFit:
    """Fit floors under all columns together and compare with tables that have none."""
    model = joint_model(noise, digit)
    tables = np.concatenate([printed[np.newaxis], np.round(noise / digit) * digit])
    none, gains, best = preferences(tables, model)
    away = _away(tables[:1], model)
    least = _descended(model, away)[1]
    upper = [
        max(
            place
            for place in range(len(TRIED))
            if (_descended(model, away, {column: place})[1] - least)[0] <= LIMIT
        )
        for column in range(len(printed))
    ]
    columns = np.arange(len(printed))
    return JointFit(
        without=_share(none),
        anywhere=_share(gains[:, -1]),
        floors=model.floors[columns, best[0]],
        upper=model.floors[columns, upper],
        single=np.array([_share(gains[:, column]) for column in columns]),
        among=(gains[1:, :-1].max(axis=1)[:, np.newaxis] >= gains[0, :-1]).mean(axis=0),
    )


def preferences(
    tables: FloatArray, model: Model
) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    """Return how strongly tables prefer floors, column by column and all together.

    Shape (tables,). Minus twice the log likelihood without floors, up to a constant. Shape (tables,
    columns + 1). What it loses when one column must do without a floor and the others need not;
    last, when all columns must. Shape (tables, columns). Places of the most likely floors.
    """
    away = _away(tables, model)
    none = _surprise(model, away, np.zeros(tables.shape[:2], dtype=np.intp))
    best, least = _descended(model, away)
    alone = [_descended(model, away, {c: 0})[1] for c in range(tables.shape[1])]
    return none, np.stack([*alone, none], axis=-1) - least[:, np.newaxis], best


def _away(tables: FloatArray, model: Model) -> FloatArray:
    """Return tables' logarithms less the mean under every floor, in units of its spread."""
    return np.asarray((np.log(tables)[:, :, np.newaxis] - model.means) / model.spreads)


def _share(values: FloatArray) -> float:
    """Return how many of the others are at least as large as the first."""
    return float((values[1:] >= values[0]).mean())


def _descended(
    model: Model, away: FloatArray, held: dict[int, int] | None = None
) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the best floor of every column of every table, and its surprise; some may be held."""
    held = held or {}
    places = np.zeros(away.shape[:2], dtype=np.intp)
    for column, place in held.items():
        places[:, column] = place
    for _ in range(ROUNDS):
        for column in set(range(away.shape[1])) - set(held):
            others = _at(away, places)
            others[:, column] = 0.0
            pull = np.einsum("kdl,tdl->tk", model.weight[column], others)
            mine = away[:, column]
            cost = np.einsum("tgk,kl,tgl->tg", mine, model.weight[column, :, column], mine)
            cost += 2.0 * np.einsum("tgk,tk->tg", mine, pull)
            cost += 2.0 * np.log(model.spreads[column]).sum(axis=-1)
            places[:, column] = cost.argmin(axis=1)
    return places, _surprise(model, away, places)


def _surprise(model: Model, away: FloatArray, places: NDArray[np.intp]) -> FloatArray:
    """Return minus twice the log likelihood of tables under chosen floors, up to a constant."""
    chosen = _at(away, places)
    square = np.einsum("tck,ckdl,tdl->t", chosen, model.weight, chosen, optimize=True)
    spreads = np.log(model.spreads).sum(axis=-1)
    widths = np.take_along_axis(spreads, places.T, axis=1).sum(axis=0)
    return np.asarray(square + 2.0 * widths)


def _at(away: FloatArray, places: NDArray[np.intp]) -> FloatArray:
    index = places[:, :, np.newaxis, np.newaxis]
    return np.take_along_axis(away, index, axis=2)[:, :, 0]


def printed_fit(given: Given) -> JointFit:
    """Return the joint fit of Table IV as printed."""
    counts = [int(n) for n in given.array(f"{TABLE}#*.frames")]
    printed = np.stack([given.array(f"{TABLE}#*.{matrix}-{axis}") for matrix, axis in COLUMNS])
    return fit(printed, replicated_table(given, counts), DIGIT)


@studied(
    "chen2023/floors",
    given=(*READS, *(f"{TABLE}#*.{matrix}-?" for matrix in MATRICES)),
    columns=(
        Column("Column"),
        Column("best floor (arcsec, 3σ)", ".3f"),
        Column("at most (95 %)", ".3f"),
        Column("probability", ".3f"),
        Column("in any of four columns", ".3f"),
        Column("a floor is"),
    ),
    caption="Floors under the averages of Table IV, all its cells fitted jointly. A probability is "
    "that of so strong a preference for a floor in a table that has none. A table without floors "
    "is as far from its mean as the printed one with probability {without:.2f}.",
)
def floors(given: Given) -> pd.DataFrame:
    """Whether Table IV needs floors that averaging does not reduce, all cells together."""
    found = printed_fit(given)
    best, most = found.floors * ARCSEC_PER_RADIAN, found.upper * ARCSEC_PER_RADIAN
    rows = [
        (f"{matrix}, {axis.upper()}", *numbers, _needed(numbers[-1]))
        for (matrix, axis), *numbers in zip(
            COLUMNS, best, most, found.single, found.among, strict=True
        )
    ]
    open_ended = (np.nan, np.nan, found.anywhere, np.nan)
    rows.append(("all four together", *open_ended, _needed(found.anywhere)))
    return floors.frame(rows, without=found.without)


def _needed(probability: float) -> str:
    return "needed" if probability < NEEDED else "not needed"
