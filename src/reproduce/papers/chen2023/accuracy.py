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
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from reproduce.papers.chen2023 import platform
from reproduce.papers.declare import Prediction, Results, draws, reproduces, studied
from reproduce.papers.sketch import sized
from reproduce.physics.attitude import averaged_error, scatter_of_averages
from reproduce.physics.optics import spawned_normals
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN, RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.figure import Figure

TABLE = "chen2023/table-4"
TEXT = "chen2023/text-accuracy"
FRAMES = f"{TEXT}#frames"
SMOOTHED = f"{TEXT}#smoothing-frames"
DURATION = f"{TEXT}#duration"
RATE = f"{TEXT}#frame-rate"
MATRICES = {"transform": "laser transform", "misalignment": "misalignment"}
REPLICATES = 2000
READS = (*platform.INSTRUMENT, platform.SCATTER, FRAMES, f"{TABLE}#*.frames")
# Replicates simulated at once: enough to be fast, few enough to stay small in memory.
BATCH = 250
COLUMNS = tuple(product(MATRICES, "xy"))
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
    counts = _counts(given)
    accuracies = simulated_accuracies(given, seed, replicates, counts)
    # Group, count and axis come first: each cell is then one series of replicates.
    cells = product(MATRICES, counts, "xy")
    series = np.moveaxis(accuracies, 0, -1).reshape(-1, replicates)
    return {
        f"{count}.{matrix}-{axis}": Prediction(draws)
        for (matrix, count, axis), draws in zip(cells, series, strict=True)
    }


def simulated_accuracies(
    given: Given, seed: SeedSequence, replicates: int, counts: list[int]
) -> FloatArray:
    """Simulate both groups of images and return the scatter of their averages.

    Shape (replicates, 2 groups, counts, 2 axes). Three standard deviations, in radians.
    """
    response = platform.angle_response(given)[:2]
    spots = np.stack([platform.scatter(given, group) for group in (1, 2)])
    # What a unit of noise in each coordinate turns: shape (groups, 2 axes, coordinates).
    turns = (spots[:, None] * response).reshape(len(spots), 2, -1)
    frames = given.count(FRAMES)
    parts = []
    for first in range(0, replicates, BATCH):
        batch = min(BATCH, replicates - first)
        noise = spawned_normals(seed, batch, (len(spots), frames, turns.shape[-1]), first=first)
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
    given=[f"{TABLE}#{row}.{matrix}-?" for row in (1, 100) for matrix in MATRICES],
)
def quoted_accuracy(given: Given) -> Results:
    """First and last row of Table IV, quoted again in the text."""
    smoothed = {matrix: given.array(f"{TABLE}#100.{matrix}-?") for matrix in MATRICES}
    return {
        f"{matrix}-single-{axis}": given[f"{TABLE}#1.{matrix}-{axis}"] for matrix, axis in COLUMNS
    } | {f"{matrix}-smoothed-bound": float(both.max()) for matrix, both in smoothed.items()}


@reproduces(TEXT, cells=["centroid-accuracy"], given=[f"{platform.SCATTER}#1-*"])
def centroid_accuracy(given: Given) -> Results:
    """Mean scatter of the spots in the group from which the laser transform comes."""
    return {"centroid-accuracy": float(given.array(f"{platform.SCATTER}#1-*").mean())}


@reproduces(TEXT, cells=["angular-resolution"], given=platform.TRACKER)
def pixel_angle(given: Given) -> Results:
    """Angle of one pixel of the tracker, quoted again in the text."""
    return {"angular-resolution": platform.angle_of_one_pixel(given)}


@cache
def _replicated_table(door: Given) -> FloatArray:
    """Return the replicates of Table IV that its prediction rests on.

    Shape (replicates, columns, counts). Three standard deviations, in radians; X and Y of the laser
    transform, then of the misalignment.
    """
    predicted = frame_averaging(door)
    cells = product(MATRICES, _counts(door), "xy")
    found = [predicted[f"{count}.{matrix}-{axis}"] for matrix, count, axis in cells]
    draws = np.stack([cell.draws for cell in found if isinstance(cell, Prediction)], axis=-1)
    tables = draws.reshape(len(draws), len(MATRICES), -1, 2)
    return tables.swapaxes(2, 3).reshape(len(draws), len(COLUMNS), -1)


def _counts(given: Given) -> list[int]:
    return [int(n) for n in given.array(f"{TABLE}#*.frames")]


@draws("chen2023/table-4", given=READS, random=True)
def _draw(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Accuracy of the matrices against the number of averaged frames."""
    counts = _counts(door)
    narrow = sized(figure, 6.4, 4.0, 5.6)
    panels = figure.subplots(*((2, 1) if narrow else (1, 2)), sharey=True)
    looks = (("o", "-"), ("s", "--")) * 2
    columns = zip(COLUMNS, looks, _replicated_table(door).transpose(1, 2, 0), strict=True)
    for (matrix, axis), (marker, line), tables in columns:
        axes = panels[list(MATRICES).index(matrix)]
        low, middle, high = np.quantile(tables, [0.005, 0.5, 0.995], axis=1) * ARCSEC_PER_RADIAN
        (drawn,) = axes.loglog(counts, middle, line, label=f"predicted, {axis.upper()}")
        colour = drawn.get_color()
        face = (colour, 0.15)
        axes.fill_between(counts, low, high, facecolor=face, edgecolor=colour, linestyle=line)
        values = np.array([printed[f"{TABLE}#{count}.{matrix}-{axis}"] for count in counts])
        label = f"printed, {axis.upper()}"
        axes.plot(counts, values * ARCSEC_PER_RADIAN, marker, color=colour, label=label)
    for axes, title in zip(panels, MATRICES.values(), strict=True):
        axes.set(xlabel="frames averaged", title=title)
        axes.set_xticks(counts, [str(count) for count in counts], minor=False)
        axes.set_yticks([0.1, 0.2, 0.5, 1.0], ["0.1", "0.2", "0.5", "1"], minor=False)
        axes.minorticks_off()
    for axes in panels if narrow else panels[:1]:
        axes.set_ylabel("accuracy (3σ, arcsec)")
    handles, across = panels[0].get_legend_handles_labels(), 2 if narrow else 4
    figure.legend(*handles, loc="outside lower center", ncols=across)


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


def joint_model(noise: FloatArray, digit: float) -> Model:
    """Return the joint law of a table from replicates without floors.

    A floor raises the mean of a logarithm and narrows it; which cells rise and fall together stays.
    """
    floors = TRIED * noise[:, :, 0].mean(axis=0)[:, np.newaxis]
    logarithms = np.log(averaged_error(1.0, noise[:, :, np.newaxis], floors[..., np.newaxis]))
    means, spreads = logarithms.mean(axis=0), logarithms.std(axis=0)
    rows = noise.reshape(len(noise), -1)
    # Rounding spreads a number evenly over one digit.
    rounding = np.diag((digit / rows.mean(axis=0)) ** 2 / 12.0)
    weight = np.linalg.inv(np.cov(np.log(rows).T) + rounding)
    return Model(means, spreads / spreads[:, :1], weight.reshape(noise.shape[1:] * 2), floors)


def fit(printed: FloatArray, noise: FloatArray, digit: float) -> dict[str, FloatArray]:
    """Fit floors under all columns together and compare with tables that have none.

    ``without``: how often a table without floors is at least as far from its own mean as the
    printed one. ``floors`` and ``upper``: the most likely floors of the columns, and the largest
    that are not refused at 95 %, in radians. ``single``: how often a table without floors prefers
    one in this column at least as strongly; last, floors anywhere. ``among``: how often in any of
    its columns.
    """
    model = joint_model(noise, digit)
    tables = np.concatenate([printed[np.newaxis], np.round(noise / digit) * digit])
    none, gains, best = preferences(tables, model)
    away = _away(tables[:1], model)
    least = _descended(model, away)[1]
    columns = range(len(printed))
    lost = [
        [(_descended(model, away, {column: place})[1] - least)[0] for place in range(len(TRIED))]
        for column in columns
    ]
    upper = [np.flatnonzero(np.array(row) <= LIMIT).max() for row in lost]
    return {
        "without": (none[1:] >= none[0]).mean(),
        "floors": model.floors[columns, best[0]],
        "upper": model.floors[columns, upper],
        "single": (gains[1:] >= gains[0]).mean(axis=0),
        "among": (gains[1:, :-1].max(axis=1)[:, np.newaxis] >= gains[0, :-1]).mean(axis=0),
    }


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


@studied(
    "chen2023/floors",
    random=True,
    given=(*READS, *(f"{TABLE}#*.{matrix}-?" for matrix in MATRICES)),
)
def floors(given: Given) -> pd.DataFrame:
    """Whether Table IV needs floors that averaging does not reduce, all cells together."""
    printed = np.stack([given.array(f"{TABLE}#*.{matrix}-{axis}") for matrix, axis in COLUMNS])
    # The door that the drawing is given, so that both share one simulation.
    found = fit(printed, _replicated_table(given.narrowed(READS)), DIGIT)
    *single, anywhere = found["single"]
    best, most = found["floors"] * ARCSEC_PER_RADIAN, found["upper"] * ARCSEC_PER_RADIAN
    columns = zip(best, most, single, found["among"], found["among"], strict=True)
    lines = {
        f"{matrix}, {axis.upper()}": numbers
        for (matrix, axis), numbers in zip(COLUMNS, columns, strict=True)
    }
    lines["all four together"] = (np.nan, np.nan, anywhere, np.nan, anywhere)
    rows = [
        (name, *numbers, "needed" if decides < NEEDED else "not needed")
        for name, (*numbers, decides) in lines.items()
    ]
    return floors.frame(rows, without=found["without"])
