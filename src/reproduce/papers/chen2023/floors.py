"""Does Table IV need an error that averaging does not reduce? All cells at once (chen2023, V-B).

The accuracies for different n come from the same frames. They are strongly correlated, and the
last of them are uncertain themselves. So all cells of the table are predicted jointly, from the
replicates that the ledger's table draws, before any axis is asked about a floor b in
E^2 = a^2 / n + b^2; and every axis is asked with the floors of the others left open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reproduce.papers.chen2023 import accuracy
from reproduce.papers.study import Study
from reproduce.physics.attitude.averaging import averaged_error
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given
from reproduce.units import ARCSEC_PER_RADIAN, RADIANS_PER_ARCSEC

TABLE = accuracy.TABLE
COLUMNS = tuple((matrix, axis) for matrix in accuracy.MATRICES for axis in "xy")
# Floors that are tried, in units of the column's single-frame accuracy.
TRIED = np.linspace(0.0, 0.4, 81)
# Rounds over the columns; they hardly know of each other, so two already suffice.
ROUNDS = 4
# What twice the log likelihood may fall short of its best at 95 %.
LIMIT = 3.84
# A floor is called needed below this probability, the look at several columns counted.
NEEDED = 0.01


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


def printed_fit() -> JointFit:
    """Return the joint fit of Table IV as printed."""
    door = given((*accuracy.READS, f"{TABLE}#*"))
    counts = [int(n) for n in door.array(f"{TABLE}#*.frames")]
    printed = np.stack([door.array(f"{TABLE}#*.{m}-{axis}") for m, axis in COLUMNS])
    return fit(printed, accuracy.replicated_table(counts), 0.01 * RADIANS_PER_ARCSEC)


def floors() -> Study:
    """Whether Table IV needs floors that averaging does not reduce, all cells together."""
    found = printed_fit()
    rows = []
    for column, (matrix, axis) in enumerate(COLUMNS):
        said = "needed" if found.among[column] < NEEDED else "not needed"
        values = np.array([found.floors[column], found.upper[column]]) * ARCSEC_PER_RADIAN
        rows.append(
            (
                f"{matrix}, {axis.upper()}",
                *(f"{value:.3f}" for value in values),
                f"{found.single[column]:.3f}",
                f"{found.among[column]:.3f}",
                said,
            )
        )
    said = "needed" if found.anywhere < NEEDED else "not needed"
    rows.append(("all four together", "", "", f"{found.anywhere:.3f}", "", said))
    head = (
        "Column",
        "best floor (arcsec, 3σ)",
        "at most (95 %)",
        "probability",
        "in any of four columns",
        "a floor is",
    )
    caption = (
        "Floors under the averages of Table IV, all its cells fitted jointly. A probability is "
        "that of so strong a preference for a floor in a table that has none. A table without "
        f"floors is as far from its mean as the printed one with probability {found.without:.2f}."
    )
    return Study(caption, head, tuple(rows))
