"""The comparison of a recomputed number with a printed one, under one reading of the text."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict

from reproduce.physics.validate import FloatArray
from reproduce.printed.number import PrintedNumber

Verdict = Literal["input", "exact", "consistent", "differs", "ambiguous", "unpublished"]
# In the order in which readers see them.
VERDICTS: tuple[Verdict, ...] = (*get_args(Verdict)[1:], "input")
AGREES = ("exact", "consistent")
# Qualifiers with a tolerance beyond rounding.
TOLERANT = ("about", "nominal")
Flag = Literal[
    "rounding", "copy", "difference", "tolerance", "wide", "bound", "stand_in"
]

# The central fraction of the predicted distribution in which a printed value is consistent, and the
# fraction outside: 1 - 0.99 is larger than 0.01 in binary arithmetic.
CENTRAL, OUTSIDE = 0.99, 0.01
# A tolerance above this fraction of the printed value is wide.
_WIDE_TOLERANCE = 0.1
# Smallest eigenvalue of a correlation matrix; smaller ones are raised to it.
_MIN_EIGENVALUE = 1e-9
# Smallest width of a printed interval in a joint test, such as that of a count, in standard
# deviations.
_MIN_WIDTH_SIGMA = 1e-9


class Frozen(BaseModel):
    """Base of the records of the ledger."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, use_attribute_docstrings=True
    )


class Comparison(Frozen):
    """Comparison of a printed number with a result; numbers are in the printed unit."""

    verdict: Verdict
    """verdict; the page on verdicts of the book defines each word"""
    flags: tuple[Flag, ...] = ()
    """qualifications of the verdict"""
    share: float | None = None
    (
        "abs(computed - printed) over half the printed interval (exact), (1 - "
        "probability)/0.99 (consistent)"
    )
    probability: float | None = None
    """two-sided mid-p over the printed interval"""
    mcse: float | None = None
    """Monte Carlo standard error of the probability"""
    error: float | None = None
    """Monte Carlo standard error of a predicted median"""

    @property
    def agrees(self) -> bool:
        """Whether the printed number agrees."""
        return self.verdict in AGREES


class Reading(Comparison):
    """Comparison of a cell under one reading of the text."""

    choices: dict[str, str] = {}
    """alternative of each option that affects the cell"""
    computed: float
    """value, or median of the prediction"""
    interval: tuple[float, float]
    """results that rounded inputs allow, or the central 99 % of the prediction"""
    tolerance: float
    """half the printed interval, or half the predicted one"""


def judge_value(
    printed: PrintedNumber,
    value: float,
    interval: tuple[float, float],
    *,
    wide: bool = False,
) -> Reading:
    """Compare a deterministic result with the printed digits.

    Parameters
    ----------
    printed : PrintedNumber
        Printed number.
    value : float
        Result, in the printed unit.
    interval : tuple of float
        Results that rounded inputs allow, in the printed unit.
    wide : bool
        Whether the result depends on an input that is printed as about or nominal.

    Returns
    -------
    Reading
        Comparison with its verdict.

    Raises
    ------
    ValueError
        If the result is not finite.

    Examples
    --------
    >>> judge_value(PrintedNumber("0.9976"), 0.99760, (0.99759, 0.99761)).verdict
    'exact'
    """
    if not math.isfinite(value):
        raise ValueError(
            f"computed value: expected a finite number, got {value}. Check the computation"
        )
    rounds = printed.overlaps(value, value)
    agrees = rounds or printed.overlaps(*interval)
    flags: list[Flag] = ["bound"] if printed.is_bound else []
    if agrees and (wide or _has_wide_tolerance(printed, value)):
        flags.append("tolerance")
    elif agrees and not rounds:
        flags.append("rounding")
    share = None
    if agrees and not printed.is_bound:
        # A count has no digit to round.
        share = abs(value - printed.value) / (printed.half_width or math.inf)
    return Reading(
        verdict="exact" if agrees else "differs",
        computed=value,
        interval=interval,
        flags=tuple(flags),
        tolerance=printed.half_width,
        share=share,
    )


def _has_wide_tolerance(printed: PrintedNumber, value: float) -> bool:
    """Return whether a value agrees only because of the word *about* or *nominal*.

    The value does not round to the printed digits, or the tolerance of the qualifier is more than
    a tenth of the printed value.

    Examples
    --------
    >>> _has_wide_tolerance(PrintedNumber("44.6", qualifier="about"), 44.69)
    True
    """
    return printed.qualifier in TOLERANT and (
        printed.half_width > _WIDE_TOLERANCE * abs(printed.value)
        or not printed.rounds(value)
    )


def judge_prediction(printed: PrintedNumber, draws: FloatArray) -> Reading:
    """Compare a predicted distribution with a printed random or measured number.

    The probability is twice the smaller tail beyond the printed interval, with half of the draws
    inside it.

    Parameters
    ----------
    printed : PrintedNumber
        Printed number.
    draws : ndarray, shape (n,)
        Draws of the prediction, in the printed unit.

    Returns
    -------
    Reading
        Comparison with its verdict and probability.

    Raises
    ------
    ValueError
        If there are no draws, or some are not finite.

    Examples
    --------
    >>> draws = np.random.default_rng(1).normal(1.0, 0.1, 4000)
    >>> judge_prediction(PrintedNumber("1.1"), draws).verdict
    'consistent'
    """
    if draws.size == 0 or not np.isfinite(draws).all():
        raise ValueError(
            f"draws: expected finite numbers, got {draws.size} with NaN or infinity. Check the "
            "computation"
        )
    start, end = printed.interval()
    below, above = np.sum(draws < start), np.sum(draws > end)
    tail = min(below, above) + 0.5 * (draws.size - below - above)
    half_step = 0.5 / math.sqrt(draws.size)
    summary = (
        np.median(draws),
        *central_interval(draws),
        min(1.0, 2.0 * tail / draws.size),
        np.ptp(np.quantile(draws, [0.5 - half_step, 0.5 + half_step])) / 2,
    )
    return judge_summary(printed, map(float, summary), draws.size)


def judge_summary(
    printed: PrintedNumber, summary: Iterable[float], replicates: int
) -> Reading:
    """Compare the summary of a predicted distribution with a printed number.

    Parameters
    ----------
    printed : PrintedNumber
        Printed number.
    summary : iterable of float
        Median, bounds of the central interval, probability of the printed number, and Monte Carlo
        error of the median.
    replicates : int
        Number of draws.

    Returns
    -------
    Reading
        Comparison with its verdict and probability.
    """
    computed, low, high, probability, error = summary
    consistent = probability >= OUTSIDE
    # (k + 1/2)/(n + 1) in place of k/n, so that a count of zero does not claim a zero error.
    smoothed = (probability / 2 * replicates + 0.5) / (replicates + 1)
    return Reading(
        verdict="consistent" if consistent else "differs",
        computed=computed,
        interval=(low, high),
        flags=("wide",) if high - low > abs(printed.value) else (),
        tolerance=(high - low) / 2,
        share=(1.0 - probability) / CENTRAL if consistent else None,
        probability=probability,
        mcse=2.0 * math.sqrt(smoothed * (1.0 - smoothed) / replicates),
        error=error,
    )


def central_interval(draws: FloatArray) -> tuple[float, float]:
    """Return the bounds of the central 99 % of draws, in which a printed number is consistent."""
    edge = (1.0 - CENTRAL) / 2
    low, high = np.quantile(draws, [edge, 1.0 - edge])
    return low, high


def joint_probability(draws: FloatArray, intervals: FloatArray) -> tuple[float, float]:
    """Return the probability of cells as far from the prediction as the printed ones.

    The measure is the squared Mahalanobis distance from the mean, which accounts for correlation.
    The distance of the printed cells is the smallest one of all values that round to them, so
    rounding can make the probability too large, but not too small.

    Parameters
    ----------
    draws : ndarray, shape (cells, n)
        Draws of the prediction, in printed units.
    intervals : ndarray, shape (cells, 2)
        Values that round to the printed numbers.

    Returns
    -------
    probability, error : float
        The probability, and its Monte Carlo standard error.

    Examples
    --------
    >>> draws = np.random.default_rng(1).normal(0.0, 1.0, (1, 2000))
    >>> print(joint_probability(draws, np.array([[8.95, 9.05]]))[0] < 0.001)
    True
    """
    from scipy.optimize import lsq_linear  # slow to import

    mean = draws.mean(axis=1, keepdims=True)
    sd = draws.std(axis=1, ddof=1, keepdims=True)
    draws, edges = (draws - mean) / sd, (intervals - mean) / sd
    # Cells that noise moves alike are nearly dependent. Raising the smallest eigenvalues can make
    # a probability too large, but not too small.
    values, vectors = np.linalg.eigh(np.atleast_2d(np.corrcoef(draws)))
    whitening = (vectors / np.sqrt(np.maximum(values, _MIN_EIGENVALUE))).T
    low, high = edges[:, 0], np.maximum(edges[:, 1], edges[:, 0] + _MIN_WIDTH_SIGMA)
    nearest = lsq_linear(whitening, np.zeros(len(edges)), (low, high), method="bvls")
    farther = np.square(whitening @ draws).sum(axis=0) >= 2 * nearest.cost
    size = draws.shape[1]
    probability = (farther.sum() + 1) / (size + 1)
    return probability, math.sqrt(probability * (1 - probability) / size)
