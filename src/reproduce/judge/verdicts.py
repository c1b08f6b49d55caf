"""The comparison of a recomputed number with a printed one, under one reading of the text."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from decimal import Decimal
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from reproduce.papers.declare import Computation, Prediction, Result
from reproduce.printed.cells import Cell
from reproduce.printed.corners import corner_intervals
from reproduce.printed.given import Given
from reproduce.printed.number import PrintedNumber, si_factor

Verdict = Literal["input", "exact", "consistent", "differs", "ambiguous", "unpublished"]
VERDICTS: tuple[Verdict, ...] = (
    "exact",
    "consistent",
    "differs",
    "ambiguous",
    "unpublished",
    "input",
)
AGREES = ("exact", "consistent")
Flag = Literal[
    "rounding", "copy", "difference", "tolerance", "wide", "bound", "stand_in"
]

# The central fraction of the predicted distribution in which a printed value is consistent.
CENTRAL = 0.99
# A tolerance above this fraction of the printed value is wide.
_WIDE_TOLERANCE = 0.1
_WIDE = ("about", "nominal")
_DEPENDENT = 1e-9
_POINT = 1e-9  # standard deviations: the width of an interval that has none, such as a count's


class Frozen(BaseModel):
    """Base of the records of the ledger."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Reading(Frozen):
    """Comparison of a cell under one reading of the text; numbers are in the printed unit."""

    choices: dict[str, str] = Field(
        description="alternative of each option that affects the cell"
    )
    verdict: Verdict = Field(description="exact, consistent or differs")
    computed: float = Field(description="value, or median of the prediction")
    interval: tuple[float, float] = Field(
        description="results that rounded inputs allow, or the central 99 % of the prediction"
    )
    flags: tuple[Flag, ...] = Field(description="qualifications of the verdict")
    tolerance: float = Field(
        description="half the printed interval, or half the predicted one"
    )
    share: float | None = Field(
        description="|computed - printed| over half the printed interval (exact), "
        "(1 - probability)/0.99 (consistent)"
    )
    probability: float | None = Field(
        description="two-sided mid-p over the printed interval"
    )
    mcse: float | None = Field(
        description="Monte Carlo standard error of the probability"
    )
    error: float | None = Field(
        description="Monte Carlo standard error of a predicted median"
    )

    @property
    def agrees(self) -> bool:
        """Whether the printed number agrees with this reading."""
        return self.verdict in AGREES


class Propagated(NamedTuple):
    """Results that rounded inputs allow, in SI; whether one of the inputs has a wide tolerance."""

    low: float
    high: float
    wide: bool


def judge(
    cell: Cell,
    result: Result,
    choices: Mapping[str, str],
    allowed: Propagated | None = None,
) -> Reading:
    """Compare the result of one reading with the printed number of a cell."""
    unit = si_factor(cell.unit)
    if isinstance(result, Prediction):
        return judge_prediction(cell.number, result.draws / unit, choices)
    low, high, wide = allowed or (result, result, False)
    return judge_value(
        cell.number, result / unit, (low / unit, high / unit), choices, wide=wide
    )


def judge_value(
    printed: PrintedNumber,
    value: float,
    interval: tuple[float, float],
    choices: Mapping[str, str] | None = None,
    *,
    wide: bool = False,
) -> Reading:
    """Compare a deterministic result with the printed digits.

    `wide` states that the result depends on an input printed as about or nominal.

    Examples
    --------
    >>> judge_value(PrintedNumber("0.9976"), 0.99760, (0.99759, 0.99761)).verdict
    'exact'
    """
    if not math.isfinite(value):
        raise ValueError(f"computed value: expected a finite number, got {value}")
    rounds = printed.meets(value, value)
    agrees = rounds or printed.meets(*interval)
    flags: tuple[Flag, ...] = ("bound",) if printed.is_bound else ()
    if agrees and (wide or _has_wide_tolerance(printed, value)):
        flags += ("tolerance",)
    elif agrees and not rounds:
        flags += ("rounding",)
    half = printed.reach
    share = None
    if agrees and not printed.is_bound:  # a count has no digit to round
        share = abs(value - printed.value) / half if half else 0.0
    return Reading(
        choices=dict(choices or {}),
        verdict="exact" if agrees else "differs",
        computed=value,
        interval=interval,
        flags=flags,
        tolerance=half,
        share=share,
        probability=None,
        mcse=None,
        error=None,
    )


def _has_wide_tolerance(printed: PrintedNumber, value: float) -> bool:
    """Return whether agreement with a value rests on the word *about* or *nominal*.

    The value does not round to the printed digits, or the tolerance of the qualifier is more than
    a tenth of the printed value.

    Examples
    --------
    >>> _has_wide_tolerance(PrintedNumber("44.6", qualifier="about"), 44.69)
    True
    """
    if printed.qualifier not in _WIDE:
        return False
    wide = printed.reach > _WIDE_TOLERANCE * abs(printed.value)
    return wide or not dataclasses.replace(printed, qualifier=None).meets(value, value)


def judge_prediction(
    printed: PrintedNumber,
    draws: NDArray[np.float64],
    choices: Mapping[str, str] | None = None,
) -> Reading:
    """Compare a predicted distribution with a printed random or measured number.

    Examples
    --------
    >>> draws = np.random.default_rng(1).normal(1.0, 0.1, 4000)
    >>> judge_prediction(PrintedNumber("1.1"), draws).verdict
    'consistent'
    """
    if draws.size == 0 or not np.isfinite(draws).all():
        raise ValueError(
            f"draws: expected finite numbers, got {draws.size} with NaN or infinity"
        )
    probability = min(1.0, 2.0 * float(tail_mid_p(np.sort(draws), *printed.interval())))
    near = np.quantile(
        draws, np.array([0.5, 0.5]) + np.array([-0.5, 0.5]) / math.sqrt(draws.size)
    )
    return predicted(
        printed,
        dict(choices or {}),
        computed=float(np.median(draws)),
        interval=central(draws),
        probability=probability,
        error=float(np.ptp(near)) / 2,
        replicates=draws.size,
    )


def predicted(
    printed: PrintedNumber,
    choices: dict[str, str],
    *,
    computed: float,
    interval: tuple[float, float],
    probability: float,
    error: float,
    replicates: int,
) -> Reading:
    """Return the comparison that follows from the summary of a predicted distribution."""
    low, high = interval
    consistent = probability >= 1.0 - CENTRAL
    # (k + 1/2)/(n + 1) in place of k/n, so that a count of zero does not claim a zero error.
    smoothed = (probability / 2 * replicates + 0.5) / (replicates + 1)
    return Reading(
        choices=choices,
        verdict="consistent" if consistent else "differs",
        computed=computed,
        interval=interval,
        flags=("wide",) if high - low > abs(printed.value) else (),
        tolerance=(high - low) / 2,
        share=(1.0 - probability) / CENTRAL if consistent else None,
        probability=probability,
        mcse=2.0 * math.sqrt(smoothed * (1.0 - smoothed) / replicates),
        error=error,
    )


def tail_mid_p(
    ordered: NDArray[np.float64],
    low: float | NDArray[np.float64],
    high: float | NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the smaller tail beyond an interval, with half of the draws inside it.

    Examples
    --------
    >>> float(tail_mid_p(np.array([1.0, 2.0, 3.0, 4.0]), 2.5, 2.5))
    0.5
    """
    below = np.searchsorted(ordered, low, side="left")
    up_to = np.searchsorted(ordered, high, side="right")
    inside = up_to - below
    smaller = np.minimum(below, ordered.size - up_to)
    return np.asarray((smaller + 0.5 * inside) / ordered.size, dtype=np.float64).clip(
        max=0.5
    )


def central(draws: NDArray[np.float64]) -> tuple[float, float]:
    """Return the ends of the central fraction of draws in which a printed number is consistent."""
    edge = (1.0 - CENTRAL) / 2
    low, high = np.quantile(draws, [edge, 1.0 - edge])
    return float(low), float(high)


def joint_probability(
    draws: NDArray[np.float64], intervals: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the probability of cells as far out as the printed ones, and its error.

    Cells on the first axis: draws of shape (cells, n), printed intervals of shape (cells, 2). The
    measure is the squared Mahalanobis distance from the mean, which accounts for correlation. The
    distance of the printed cells is the smallest one of all values that round to them, so rounding
    can make the probability too large and never too small.

    Examples
    --------
    >>> draws = np.random.default_rng(1).normal(0.0, 1.0, (1, 2000))
    >>> joint_probability(draws, np.array([[8.95, 9.05]]))[0] < 0.001
    True
    """
    from scipy.optimize import lsq_linear  # only now: SciPy's optimisers take long

    mean, sd = (
        draws.mean(axis=1, keepdims=True),
        draws.std(axis=1, ddof=1, keepdims=True),
    )
    draws, edges = (draws - mean) / sd, (intervals - mean) / sd
    # Cells that noise moves alike are nearly dependent; lifting the smallest eigenvalues, again,
    # can make a probability too large only.
    values, vectors = np.linalg.eigh(np.atleast_2d(np.corrcoef(draws)))
    whitening = (vectors / np.sqrt(np.maximum(values, _DEPENDENT))).T
    low, high = edges[:, 0], np.maximum(edges[:, 1], edges[:, 0] + _POINT)
    nearest = lsq_linear(whitening, np.zeros(len(edges)), (low, high), method="bvls")
    farther = np.square(whitening @ draws).sum(axis=0) >= 2 * float(nearest.cost)
    size = draws.shape[1]
    probability = (float(farther.mean()) * size + 1) / (size + 1)
    return probability, math.sqrt(probability * (1 - probability) / size)


def result_intervals(computation: Computation, given: Given) -> dict[str, Propagated]:
    """Propagate the rounding of the printed inputs through a deterministic computation.

    The result maps each cell name to its interval, by `corner_intervals`. Tests compare every
    interval with results at random points inside the rounding intervals.
    """
    addresses = [cell.address for cell in given.numbers()]
    corners = corner_intervals(
        lambda sides: _values(computation, given.shifted(sides)), addresses
    )
    return {
        name: Propagated(
            one.low,
            one.high,
            any(given.cells[a].number.qualifier in _WIDE for a in one.sides),
        )
        for name, one in corners.items()
    }


def _values(computation: Computation, given: Given) -> dict[str, float]:
    """Return the results of a computation without random numbers."""
    results = computation(given).items()
    return {
        name: float(value)
        for name, value in results
        if not isinstance(value, Prediction)
    }


def plain_results(computation: Computation, given: Given) -> dict[str, Flag]:
    """Find the results that hardly compute anything.

    Every input is moved by one unit of its last digit, up and down, to see which results follow
    it and by how much.

    The result maps a cell name to ``copy`` (one input, also through a sign, an absolute value, a
    minimum or a maximum, ties included) or ``difference`` (one input minus another, or minus
    itself). Other cells are not in it.
    """
    centre = _values(computation, given)
    follows: dict[str, dict[str, set[float]]] = {name: {} for name in centre}
    for cell in (cell for cell in given.cells.values() if cell.is_number):
        for steps in (1, -1):
            number, last = cell.number, Decimal(1).scaleb(cell.number.exponent)
            text = str(Decimal(number.text) + steps * last)
            other = cell_with(cell, text)
            moved = Given({**given.cells, cell.address: other})
            step = moved[cell.address] - given[cell.address]
            for name, value in _values(computation, moved).items():
                follows[name].setdefault(cell.address, set()).add(
                    round((value - centre[name]) / step, 9)
                )
    found: dict[str, Flag] = {}
    for name, value in centre.items():
        slopes = {address: seen - {0.0} for address, seen in follows[name].items()}
        slopes = {address: seen for address, seen in slopes.items() if seen}
        kind = _plain(value, slopes, given)
        if kind:
            found[name] = kind
    return found


def cell_with(cell: Cell, text: str) -> Cell:
    """Return a cell with other printed digits."""
    return dataclasses.replace(
        cell, content=dataclasses.replace(cell.number, text=text)
    )


def _plain(value: float, slopes: Mapping[str, set[float]], given: Given) -> Flag | None:
    """Return the kind of a result from its slopes by the inputs that it responds to."""
    steep = [address for address, seen in slopes.items() if seen <= {1.0, -1.0}]
    if len(steep) == len(slopes) and slopes:
        if all(math.isclose(abs(given[a]), abs(value), rel_tol=1e-9) for a in steep):
            return "copy"
        if len(slopes) == 2:
            one, other = (given[a] for a in steep)
            ends = (one - other, other - one)
            if any(math.isclose(value, end, rel_tol=1e-9) for end in ends):
                return "difference"
    if given.cells and not slopes and value == 0:
        return "difference"
    return None
