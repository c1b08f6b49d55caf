"""Rounding residuals of the exact cells: where in the last printed digit the computed value lies.

If the computations are right and the papers round to nearest, (computed - printed) over one unit
of the last digit is uniform between minus and plus one half. Only cells that carry information
count: those whose value the rounding of the inputs moves by little. The difference of two numbers
with as many decimals prints exactly, whoever is right; it says nothing here and is left out.
``python tools/evidence/residuals.py`` stores the residuals of both papers.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import reproduce
from keep import write_table
from reproduce.judge.ledger import Ledger, Record, build, frozen
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Computation, Results
from reproduce.printed.cells import PAPERS, Cell, library
from reproduce.printed.given import given
from reproduce.printed.number import si_factor

NAME = "rounding-residuals"
COMMAND = "python tools/evidence/residuals.py"

# Inputs may move the value by a fifth of the last digit at most.
LITTLE = 0.2
DRAWS = 1_000
_NOISE = 1e-6


@dataclass(frozen=True)
class Residuals:
    """The residuals of one paper.

    `values` belong to `cells`, those that carry information, of the `exact` cells of the paper:
    (computed - printed) over one unit of the last digit, or its probability integral transform.
    `probability` is that of a sample from the uniform law at least as far from it (Kolmogorov and
    Smirnov); NaN without cells.
    """

    cells: tuple[str, ...]
    values: NDArray[np.float64]
    exact: int
    probability: float


def residuals(ledger: Ledger, paper: str) -> Residuals:
    """Collect the residuals of the exact cells whose inputs' rounding contributes little."""
    from scipy import stats

    exact = [
        r
        for r in ledger.records
        if r.key.startswith(f"{paper}/") and r.verdict == "exact"
    ]
    telling = {r.cell: value for r in exact if (value := _residual(r)) is not None}
    values = np.array(list(telling.values()))
    fit = (
        stats.kstest(values, stats.uniform(-0.5, 1.0).cdf).pvalue
        if values.size
        else np.nan
    )
    return Residuals(tuple(telling), values, len(exact), float(fit))


def _residual(record: Record) -> float | None:
    number = library()[record.key].by_name[record.cell.partition("#")[2]].number
    step = 2.0 * number.half_unit
    if (
        record.computed is None
        or not step
        or number.is_bound
        or number.qualifier == "about"
    ):
        return None
    low, high = record.interval or (record.computed, record.computed)
    if (high - low) / step > LITTLE or (
        low == high == 0.0
    ):  # zero by definition tells nothing
        return None
    return (record.computed - number.value) / step


def unrounded(ledger: Ledger, paper: str, draws: int = DRAWS) -> Residuals:
    """Place the residuals of all exact cells in the law that rounded inputs give them.

    Suppose that the authors computed with numbers of which the paper prints roundings. Then
    (computed - printed) is spread by the rounding of the inputs and of the result. That law is
    drawn here cell by cell: inputs anywhere about the printed ones, the result rounded from them,
    and the recomputation from their roundings. A residual is placed in it by its probability
    integral transform, which is even between zero and one whatever the formula. Where the law has
    steps, as for a difference of equal decimals, the place within a step is drawn at random. A
    cell whose law is one single value (a number printed twice) says nothing and is left out. The
    probability is that of a sample at least as far from the uniform law, drawn with the same
    shared inputs.
    """
    ours = [r for r in ledger.records if r.key.startswith(f"{paper}/")]
    exact = {r.cell for r in ours if r.verdict == "exact"}
    laws: dict[str, tuple[NDArray[np.float64], float]] = {}
    for item in catalogue().values():
        for computation in item.computations:
            if not computation.replicates and computation.key.startswith(f"{paper}/"):
                laws |= _laws(computation, exact, draws)
    telling = {cell: law for cell, law in laws.items() if np.ptp(law[0]) > _NOISE}
    ties = np.random.default_rng([draws, len(telling)]).random(
        (len(telling), draws + 1)
    )
    placed = np.array(
        [
            _place(np.append(law, seen), tie)
            for (law, seen), tie in zip(telling.values(), ties, strict=True)
        ]
    )
    if not telling:
        return Residuals((), np.array([]), len(exact), float("nan"))
    apart = np.array([_distance(column) for column in placed.T])
    probability = float(np.mean(apart >= apart[-1]))
    return Residuals(tuple(telling), placed[:, -1], len(exact), probability)


def _laws(
    computation: Computation, judged: set[str], draws: int
) -> dict[str, tuple[NDArray[np.float64], float]]:
    """Draw (computed - printed) over the last digit for the exact cells of a computation."""
    table = library()[computation.key]
    door = given(computation.given)
    centre = computation(door)
    # What has several readings has several laws.
    single = [name for name, value in centre.items() if isinstance(value, int | float)]
    cells = [table[name] for name in single if table[name].address in judged]
    cells = [
        c for c in cells if not (c.number.is_bound or c.number.qualifier == "about")
    ]
    cells = [c for c in cells if c.number.half_unit]
    if not cells:
        return {}
    true = {
        c.address: _true(c, draws)
        for c in door.numbers()
        if c.number.qualifier != "nominal"
    }
    printed = {address: 2.0 * np.rint(shift / 2.0) for address, shift in true.items()}
    exact, again = (
        [
            computation(door.shifted({a: float(s[k]) for a, s in x.items()}))
            for k in range(draws)
        ]
        for x in (true, printed)
    )
    found = {}
    for cell in cells:
        step, unit = 2.0 * cell.number.half_unit, si_factor(cell.unit)
        wanted, got = (
            np.array([_number(results, cell, unit) for results in runs]) / step
            for runs in (exact, again)
        )
        seen = (_number(centre, cell, unit) - cell.number.value) / step
        found[cell.address] = (got - np.rint(wanted), seen)
    return found


def _number(results: Results, cell: Cell, unit: float) -> float:
    value = results[cell.address.partition("#")[2]]
    if not isinstance(value, int | float):
        raise TypeError(f"{cell.address}: expected a number from its computation")
    return float(value) / unit


def _true(cell: Cell, draws: int) -> NDArray[np.float64]:
    """Draw true values about a printed input, in half units of its last digit from the print.

    Over a few units of its last digit, or a twentieth of itself if that is more: enough for the
    results to fall anywhere between two prints. The same for all computations that read the cell.
    """
    number = cell.number
    width = max(6.0, abs(number.value) / number.half_unit / 20)
    rng = np.random.default_rng([zlib.crc32(cell.address.encode()), draws])
    return rng.uniform(-width, width, draws)


def _place(law: NDArray[np.float64], tie: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the transform of every draw of a law, and of the last entry, among all of them."""
    rounded = np.round(law, 6)
    order = np.sort(rounded)
    below = np.searchsorted(order, rounded, side="left")
    upto = np.searchsorted(order, rounded, side="right")
    return np.asarray((below + tie * (upto - below)) / law.size)


def _distance(values: NDArray[np.float64]) -> float:
    """Return the largest distance of an empirical distribution from the uniform law."""
    ordered = np.sort(values)
    steps = np.arange(ordered.size + 1) / ordered.size
    return float(max((steps[1:] - ordered).max(), (ordered - steps[:-1]).max()))


def study() -> pd.DataFrame:
    """Return for each paper how many exact cells speak, and how probable their scatter is."""
    exact = [address for address, found in frozen().items() if found.verdict == "exact"]
    ledger = build(sorted({address.partition("#")[0] for address in exact}))
    rows = []
    for paper in PAPERS:
        for rule, found in (
            ("print", residuals(ledger, paper)),
            ("law", unrounded(ledger, paper)),
        ):
            rows.append((paper, rule, found.exact, len(found.cells), found.probability))
    return pd.DataFrame(
        rows, columns=["paper", "against", "exact", "telling", "probability"]
    )


if __name__ == "__main__":
    write_table(NAME, study(), {"command": COMMAND, "version": reproduce.__version__})
