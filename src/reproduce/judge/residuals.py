"""Rounding residuals of the exact cells: where in the last printed digit the computed value lies.

If the computations are right and the papers round to nearest, (computed - printed) over one unit
of the last digit is uniform between minus and plus one half. Only cells that carry information
count: those whose value the rounding of the inputs moves by little. The difference of two numbers
with as many decimals prints exactly, whoever is right; it says nothing here and is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reproduce.judge.ledger import Ledger, Record
from reproduce.printed.cells import library

# Inputs may move the value by a fifth of the last digit at most.
LITTLE = 0.2


@dataclass(frozen=True)
class Residuals:
    """The residuals of one paper.

    Parameters
    ----------
    cells : tuple of str
        Addresses of the cells that carry information.
    values : ndarray, shape (n,)
        (computed - printed) over one unit of the last digit, in the order of the cells.
    exact : int
        All exact cells, those that carry none included.
    probability : float
        Of a sample from the uniform law at least as far from it (Kolmogorov and Smirnov); NaN
        without cells.
    """

    cells: tuple[str, ...]
    values: NDArray[np.float64]
    exact: int
    probability: float


def residuals(ledger: Ledger, paper: str) -> Residuals:
    """Collect the rounding residuals of a paper.

    Parameters
    ----------
    ledger : Ledger
        All records.
    paper : str
        ``niu2024`` or ``chen2023``.

    Returns
    -------
    Residuals
        One value for each exact cell whose inputs' rounding contributes little.
    """
    from scipy import stats

    exact = [r for r in ledger.records if r.key.startswith(f"{paper}/") and r.verdict == "exact"]
    telling = {r.cell: value for r in exact if (value := _residual(r)) is not None}
    values = np.array(list(telling.values()))
    fit = stats.kstest(values, stats.uniform(-0.5, 1.0).cdf).pvalue if values.size else np.nan
    return Residuals(tuple(telling), values, len(exact), float(fit))


def _residual(record: Record) -> float | None:
    number = library()[record.key].by_name[record.cell.partition("#")[2]].number
    step = 2.0 * number.half_unit
    if record.computed is None or not step or number.is_bound or number.qualifier == "about":
        return None
    low, high = record.interval or (record.computed, record.computed)
    if (high - low) / step > LITTLE or (low == high == 0.0):  # zero by definition tells nothing
        return None
    return (record.computed - number.value) / step
