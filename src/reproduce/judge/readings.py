"""The printed simulation of niu2024 held against every reading of its text.

Rows are the readings of `reproduce.papers.niu2024.study`, each with every way of counting the axes
of (26), the ledger's first; columns are the printed cells of `ADDRESSES`.

Draws can tell a probability down to about one over their number. Below that, the law that they
follow is used, see `reproduce.judge.laws`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reproduce.judge import laws
from reproduce.judge.verdicts import judge_prediction
from reproduce.papers.niu2024 import counting, simulation
from reproduce.printed.cells import Cell, find
from reproduce.printed.units import si_factor

Array = NDArray[np.float64]
ADDRESSES = tuple(
    f"niu2024/text-simulation#{cell}-{channel}"
    if cell.startswith("rmse")
    else f"niu2024/table-3#{cell}.{channel}"
    for channel in simulation.REGISTERED
    for cell in counting.CELLS
)
RESIDUAL = np.array(["rmse" in address for address in ADDRESSES])
SCALE = np.array(["#scale" in address for address in ADDRESSES])
# Groups of cells that get a joint probability, and which cells are in each.
GROUPS = {
    "Table 3": ~RESIDUAL,
    "residuals": RESIDUAL,
    "all but the scales": ~SCALE,
    "all": np.ones(len(ADDRESSES), dtype=bool),
}
# Draws that must lie beyond the print before their count says how likely it is.
LEAST = 20


@dataclass(frozen=True)
class Comparison:
    """How the print fares under every reading.

    Attributes
    ----------
    tails : ndarray, shape (readings, 4, 12)
        Two-sided mid-p of each cell by counting draws; the second axis is how (26) counts the axes.
    law_tails : ndarray, shape (readings, 4, 12)
        Decimal logarithm of the same by the law of the draws.
    joint : ndarray, shape (readings, 4, 4)
        Joint probability of each group, by counting draws.
    law_joint : ndarray, shape (readings, 4, 4)
        Decimal logarithm of the same by the law of the draws.
    distance : ndarray, shape (readings, 4, 4)
        Mahalanobis distance of each group of printed numbers, in standard deviations.
    """

    tails: Array
    law_tails: Array
    joint: Array
    law_joint: Array
    distance: Array


def compare(draws: Array) -> Comparison:
    """Compare the print with the predictions of every reading."""
    found = [compare_one(one) for one in draws]
    return Comparison(*(np.stack(part) for part in zip(*found, strict=True)))


def compare_one(one: Array) -> tuple[Array, ...]:
    """Compare the print with the prediction of one reading, for every way of counting the axes.

    A row of each array of `Comparison`, in order.
    """
    cells = [find(address)[0] for address in ADDRESSES]
    intervals = np.array([cell.number.interval() for cell in cells])
    rows: list[tuple[Array, ...]] = []
    for way in counting.COUNTED:
        columns = columns_in_print(one, cells, way)
        law = laws.fitted(columns, RESIDUAL)
        judged = [judge_prediction(c.number, d) for c, d in zip(cells, columns, strict=True)]
        joint = [laws.joint(law, columns, intervals, wanted) for wanted in GROUPS.values()]
        tails = np.array([judgement.probability for judgement in judged])
        rows.append((tails, laws.log_tails(law, intervals), *np.array(joint).T))
    return tuple(np.stack(part) for part in zip(*rows, strict=True))


def columns_in_print(one: Array, cells: list[Cell], way: str) -> list[Array]:
    """Return the draws of one reading cell by cell, in the unit of print.

    Shape (replicates,). In the order of `cells`.
    """
    flat = counting.counted(one, way).reshape(len(one), -1)
    return [flat[:, i] / si_factor(cell.unit) for i, cell in enumerate(cells)]


def corrected(joint: Array, readings: int) -> Array:
    """Return joint probabilities corrected for having tried so many readings.

    Examples
    --------
    >>> corrected(np.array([0.001, 0.5]), 20)
    array([0.02, 1.  ])
    """
    return np.minimum(1.0, joint * readings)


def resolved(counted: Array, law: Array, replicates: int) -> Array:
    """Return probabilities by count where the draws can tell, else by their law.

    Examples
    --------
    >>> resolved(np.array([0.3, 0.0]), np.array([-0.5, -9.0]), 10_000)
    array([3.e-01, 1.e-09])
    """
    return np.asarray(np.where(counted * replicates >= LEAST, counted, 10.0**law))
