"""The verdict on one printed number, and how far rounded inputs let a result go."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reproduce.papers.declare import Blocked, Computation
from reproduce.printed.given import Given
from reproduce.printed.number import Interval, PrintedNumber

Verdict = Literal["input", "exact", "consistent", "differs", "blocked"]
VERDICTS: tuple[Verdict, ...] = ("exact", "consistent", "differs", "blocked", "input")

# The central share of the predicted distribution in which a printed value counts as consistent.
CENTRAL = 0.99
_DEPENDENT = 1e-9
_POINT = 1e-9  # standard deviations: the width of an interval that has none, such as a count's


@dataclass(frozen=True)
class Judgement:
    """What a comparison found, in the unit of print.

    Parameters
    ----------
    verdict : str
        exact, consistent or differs.
    computed : float
        The value, or the median of the prediction.
    interval : tuple of float
        The results that rounded inputs allow, or the central 99 % of the prediction.
    flags : tuple of str
        ``through_rounding``, ``uninformative``, ``bound``.
    tolerance : float
        Half the printed interval, or half the width of the predicted one.
    share : float, optional
        The part of the tolerance that is used up; none for differs and for bounds.
    probability, mcse : float, optional
        Two-sided mid-p of the printed value under the prediction, and its Monte Carlo error.
    error : float, optional
        Monte Carlo standard error of the median: half of what lies between the quantiles that are
        one standard error of a share of one half apart from it.
    """

    verdict: Verdict
    computed: float
    interval: tuple[float, float]
    flags: tuple[str, ...]
    tolerance: float
    share: float | None = None
    probability: float | None = None
    mcse: float | None = None
    error: float | None = None


def judge_value(printed: PrintedNumber, value: float, interval: tuple[float, float]) -> Judgement:
    """Judge a deterministic recomputation against the printed digits.

    Examples
    --------
    >>> judge_value(PrintedNumber("0.9976"), 0.99760, (0.99759, 0.99761)).verdict
    'exact'
    """
    if not math.isfinite(value):
        raise ValueError(f"expected a finite recomputed value, got {value}; mend the computation")
    rounds = printed.meets(value, value)
    agrees = rounds or printed.meets(*interval)
    flags: tuple[str, ...] = ("bound",) if printed.is_bound else ()
    if agrees and not rounds:
        flags += ("through_rounding",)
    half = printed.reach
    share = None
    if agrees and not printed.is_bound:  # a count is met or missed: there is no digit to round
        share = abs(value - printed.value) / half if half else 0.0
    return Judgement("exact" if agrees else "differs", value, interval, flags, half, share)


def judge_prediction(printed: PrintedNumber, draws: NDArray[np.float64]) -> Judgement:
    """Judge a printed random or measured number against what the reproduction predicts.

    Examples
    --------
    >>> draws = np.random.default_rng(1).normal(1.0, 0.1, 4000)
    >>> judge_prediction(PrintedNumber("1.1"), draws).verdict
    'consistent'
    """
    if draws.size == 0 or not np.isfinite(draws).all():
        raise ValueError(f"expected finite draws, got {draws.size} with NaN or infinity among them")
    tail = tail_mid_p(np.sort(draws), *printed.interval())
    probability = min(1.0, 2.0 * float(tail))
    low, high = central(draws)
    consistent = probability >= 1.0 - CENTRAL
    flags = ("uninformative",) if high - low > abs(printed.value) else ()
    # (k + 1/2)/(n + 1) in place of k/n, so that a count of zero does not claim a zero error.
    smoothed = (float(tail) * draws.size + 0.5) / (draws.size + 1)
    near = np.quantile(draws, np.array([0.5, 0.5]) + np.array([-0.5, 0.5]) / math.sqrt(draws.size))
    return Judgement(
        verdict="consistent" if consistent else "differs",
        computed=float(np.median(draws)),
        interval=(low, high),
        flags=flags,
        tolerance=(high - low) / 2,
        share=(1.0 - probability) / CENTRAL if consistent else None,
        probability=probability,
        mcse=2.0 * math.sqrt(smoothed * (1.0 - smoothed) / draws.size),
        error=float(np.ptp(near)) / 2,
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
    return np.asarray((smaller + 0.5 * inside) / ordered.size, dtype=np.float64).clip(max=0.5)


def central(draws: NDArray[np.float64]) -> tuple[float, float]:
    """Return the ends of the central share of some draws in which a print counts as consistent."""
    edge = (1.0 - CENTRAL) / 2
    low, high = np.quantile(draws, [edge, 1.0 - edge])
    return float(low), float(high)


def joint_probability(
    draws: NDArray[np.float64], intervals: NDArray[np.float64]
) -> tuple[float, float]:
    """Return how often cells that are drawn together lie as far out as the print, and its error.

    Cells on the first axis: draws of shape (cells, n), printed intervals of shape (cells, 2).

    Examples
    --------
    >>> draws = np.random.default_rng(1).normal(0.0, 1.0, (1, 2000))
    >>> joint_probability(draws, np.array([[8.95, 9.05]]))[0] < 0.001
    True
    """
    mean, sd = draws.mean(axis=1, keepdims=True), draws.std(axis=1, ddof=1, keepdims=True)
    share, _ = farther_out((draws - mean) / sd, (intervals - mean) / sd)
    size = draws.shape[1]
    probability = (share * size + 1) / (size + 1)
    return probability, math.sqrt(probability * (1 - probability) / size)


def farther_out(draws: NDArray[np.float64], edges: NDArray[np.float64]) -> tuple[float, float]:
    """Return which share of the draws lies as far out as the print, and how far that is, squared.

    Both in standard deviations from the mean. The measure is the squared Mahalanobis distance,
    which knows that cells move together. That of the print is the least one of all tables that
    round to it, so rounding can make the share too large and never too small.
    """
    from scipy.optimize import lsq_linear  # only now: SciPy's optimisers take long

    # Cells that noise moves alike are nearly dependent; lifting the smallest eigenvalues, again,
    # can make a probability too large only.
    values, vectors = np.linalg.eigh(np.atleast_2d(np.corrcoef(draws)))
    whitening = (vectors / np.sqrt(np.maximum(values, _DEPENDENT))).T
    low, high = edges[:, 0], np.maximum(edges[:, 1], edges[:, 0] + _POINT)
    nearest = lsq_linear(whitening, np.zeros(len(edges)), (low, high), method="bvls")
    squared = 2 * float(nearest.cost)
    return float((np.square(whitening @ draws).sum(axis=0) >= squared).mean()), squared


def result_intervals(computation: Computation, given: Given) -> dict[str, Interval]:
    """Propagate the rounding of the printed inputs through a deterministic computation.

    Each input is moved to both ends of its rounding interval on its own to see which way every
    result goes (both, because a smallest or largest value may answer to one side alone); then all
    inputs are moved together to the corner that makes the result smallest and to the one that
    makes it largest. These corners are the exact ends of a result that is monotone in each input.
    That every one here is, is proven: an enclosure of its formula (`reproduce.audit`) gives the
    same interval.

    Cell name to the smallest and largest result, in SI; for a reading of a blocked cell, the name
    that `reading_name` gives.
    """
    centre = numbers(computation, given)
    slopes: dict[str, dict[str, float]] = {name: {} for name in centre}
    for cell in given.numbers():
        for side in (1.0, -1.0):
            moved = numbers(computation, given.shifted({cell.address: side}))
            for name, value in moved.items():
                if value != centre[name]:
                    slopes[name][cell.address] = side if value > centre[name] else -side
    found = {name: (value, value) for name, value in centre.items()}
    for name, signs in slopes.items():
        if signs:
            moves = ({a: side * sign for a, sign in signs.items()} for side in (-1.0, 1.0))
            ends = [numbers(computation, given.shifted(one))[name] for one in moves]
            found[name] = min(ends), max(ends)
    return found


def plain_results(computation: Computation, given: Given) -> dict[str, str]:
    """Find the results that hardly compute anything: copies and differences of two cells.

    Every input is moved by one unit of its last digit, up and down, to see which results follow
    it and by how much.

    Cell name to ``repeated`` (the result is one input, moves one to one with it and with no other)
    or ``difference`` (one input less another, or less itself); no other names.
    """
    centre = numbers(computation, given)
    follows: dict[str, dict[str, set[float]]] = {name: {} for name in centre}
    for cell in (cell for cell in given.cells.values() if cell.is_number):
        for steps in (1, -1):
            number, last = cell.number, Decimal(1).scaleb(cell.number.exponent)
            text = str(Decimal(number.text) + steps * last)
            other = replace(cell, content=replace(number, text=text))
            moved = Given({**given.cells, cell.address: other})
            step = moved[cell.address] - given[cell.address]
            for name, value in numbers(computation, moved).items():
                follows[name].setdefault(cell.address, set()).add(
                    round((value - centre[name]) / step, 9)
                )
    found = {}
    for name, value in centre.items():
        slopes = {address: seen for address, seen in follows[name].items() if seen != {0.0}}
        rising, falling = ([a for a, s in slopes.items() if s == {side}] for side in (1.0, -1.0))
        if len(slopes) == len(rising) == 1 and given[rising[0]] == value:
            found[name] = "repeated"
        elif (len(slopes), len(rising), len(falling)) == (2, 1, 1):
            if math.isclose(value, given[rising[0]] - given[falling[0]], rel_tol=1e-9):
                found[name] = "difference"
        elif given.cells and not slopes and value == 0:
            found[name] = "difference"
    return found


def reading_name(cell: str, reading: str) -> str:
    """Return the name of one reading of a blocked cell among the results of its computation."""
    return f"{cell} ({reading})"


def numbers(computation: Computation, given: Given) -> dict[str, float]:
    """Return the numbers that a computation makes, those of every reading under their own name."""
    found: dict[str, float] = {}
    for name, result in computation(given).items():
        if isinstance(result, int | float):
            found[name] = float(result)
        elif isinstance(result, Blocked):
            found |= {
                reading_name(name, reading.name): float(reading.result)
                for reading in result.readings
                if isinstance(reading.result, int | float)
            }
    return found
