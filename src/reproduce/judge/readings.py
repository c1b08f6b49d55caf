"""The printed simulation of niu2024 held against every reading of its text.

Rows are the readings of `reproduce.papers.niu2024.study`, each with both ways of counting the
axes of (26), the ledger's first; columns are the printed cells of `ADDRESSES`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reproduce.judge.verdicts import joint_probability, judge_prediction
from reproduce.papers.niu2024 import simulation, study
from reproduce.printed.cells import Cell, find
from reproduce.printed.units import si_factor

Array = NDArray[np.float64]
ADDRESSES = tuple(
    f"niu2024/text-simulation#{cell}-{channel}"
    if cell.startswith("rmse")
    else f"niu2024/table-3#{cell}.{channel}"
    for channel in simulation.REGISTERED
    for cell in study.CELLS
)
# Groups of cells that get a joint probability.
GROUPS = ("table 3", "residuals", "all")


@dataclass(frozen=True)
class Comparison:
    """How the print fares under every reading.

    Attributes
    ----------
    tails : ndarray, shape (readings, 2, 12)
        Two-sided mid-p of each cell; the second axis is how (26) counts the axes.
    joint : ndarray, shape (readings, 2, 3)
        Joint probability of each group, as `verdicts.joint_probability` has it.
    """

    tails: Array
    joint: Array


def compare(draws: Array) -> Comparison:
    """Compare the print with the predictions of every reading.

    Parameters
    ----------
    draws : ndarray, shape (readings, replicates, 2, 6)
        From `study.simulate`, in SI.

    Returns
    -------
    Comparison
        Probabilities by reading.
    """
    cells = [find(address)[0] for address in ADDRESSES]
    tails = np.empty((len(draws), len(study.COUNTED), len(cells)))
    joint = np.empty((len(draws), len(study.COUNTED), len(GROUPS)))
    for row, one in enumerate(draws):
        for way in range(len(study.COUNTED)):
            columns = columns_in_print(one, cells, one_axis=bool(way))
            judged = [judge_prediction(c.number, d) for c, d in zip(cells, columns, strict=True)]
            tails[row, way] = [judgement.probability for judgement in judged]
            joint[row, way] = _joint(cells, columns)
    return Comparison(tails, joint)


def columns_in_print(one: Array, cells: list[Cell], *, one_axis: bool) -> list[Array]:
    """Return the draws of one reading cell by cell, in the unit of print.

    Parameters
    ----------
    one : ndarray, shape (replicates, 2, 6)
        In SI.
    cells : list of Cell
        Those of `ADDRESSES`.
    one_axis : bool
        Whether the RMSE is that of one axis on average.

    Returns
    -------
    list of ndarray, each of shape (replicates,)
        In the order of `cells`.
    """
    counted = np.ones(len(study.CELLS))
    if one_axis:
        counted[[cell.startswith("rmse") for cell in study.CELLS]] = np.sqrt(0.5)
    flat = (one * counted).reshape(len(one), -1)
    return [flat[:, i] / si_factor(cell.unit) for i, cell in enumerate(cells)]


def corrected(joint: Array, readings: int) -> Array:
    """Return joint probabilities corrected for having tried so many readings.

    Parameters
    ----------
    joint : ndarray
        Of one or many readings.
    readings : int
        How many were tried.

    Returns
    -------
    ndarray
        Bonferroni's bound: that many times larger, at most one.

    Examples
    --------
    >>> corrected(np.array([0.001, 0.5]), 20)
    array([0.02, 1.  ])
    """
    return np.minimum(1.0, joint * readings)


def _joint(cells: list[Cell], columns: list[Array]) -> list[float]:
    residual = ["rmse" in cell.name for cell in cells]
    groups = ([not r for r in residual], residual, [True] * len(cells))
    return [
        joint_probability(
            [c.number for c, take in zip(cells, wanted, strict=True) if take],
            [d for d, take in zip(columns, wanted, strict=True) if take],
        )[0]
        for wanted in groups
    ]
