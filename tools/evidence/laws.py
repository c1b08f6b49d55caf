"""Probabilities that are too small to count: the law that simulated numbers follow.

Estimates from Gaussian noise are Gaussian, as far as the model is linear over the noise. A root
mean square becomes nearly so when it is raised to the power that takes its skewness away; for sums
of Gaussian squares that is 2/3 (Wilson and Hilferty 1931). So draws of a whole table, the root mean
squares among them raised to such powers, follow one Gaussian law in many dimensions. Its moments
are estimated from the draws, and Student's and Hotelling's distributions allow for that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, stdtr

from reproduce.judge.verdicts import farther_out

Array = NDArray[np.float64]
# Logarithms stop here: beyond, the numbers underflow, and mean nothing anyway.
_FLOOR = -300.0


@dataclass(frozen=True, eq=False)
class _Law:
    """A Gaussian law of several numbers after `curved`, estimated from draws."""

    mean: Array
    sd: Array
    draws: int  # how many it was estimated from
    power: Array  # what each number is raised to; one leaves it as it is

    def curved(self, values: Array) -> Array:
        """Return numbers, shape (cells, any), on the scale on which the law is Gaussian."""
        return _raised(values, self.power[:, None])

    def standardised(self, values: Array) -> Array:
        """Return numbers, cells on the first axis, in standard deviations from the mean."""
        return np.asarray((self.curved(values) - self.mean[:, None]) / self.sd[:, None])


def fitted(columns: list[Array], squares: NDArray[np.bool_]) -> _Law:
    """Estimate the law of a table from its draws."""
    values = np.stack(columns)
    # To first order, x^p has the skewness of x and 3 (p - 1) sd / mean besides.
    mean, sd = values.mean(axis=1), values.std(axis=1)
    skewness = ((values - mean[:, None]) ** 3).mean(axis=1) / sd**3
    flat = skewness * mean / (3 * sd)
    power = np.where(squares, 1 - flat, np.ones(len(columns)))
    raised = _raised(values, power[:, None])
    mean, sd = raised.mean(axis=1), raised.std(axis=1, ddof=1)
    return _Law(mean, sd, values.shape[1], power)


def _raised(values: Array, power: Array) -> Array:
    """Return (x^p - 1) / p, which rises with x whatever the power; x - 1 for a power of one."""
    plain = power == 1
    safe = np.where(np.abs(power) < 1e-6, 1e-6, power)
    logarithm = np.log(np.where(plain, 1.0, values))
    return np.asarray(np.where(plain, values - 1, np.expm1(safe * logarithm) / safe))


def log_tails(law: _Law, intervals: Array) -> Array:
    """Return how far out every printed number lies, each by itself.

    Shape (cells,). Decimal logarithm of the two-sided mid-p over the interval, as
    `verdicts.judge_prediction` has it.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> law = fitted([rng.normal(size=20_000), rng.normal(size=20_000)], np.zeros(2, dtype=bool))
    >>> log_tails(law, np.array([[1.96, 1.96], [7.0, 7.0]])).round()
    array([ -1., -12.])
    """
    edges = law.standardised(intervals).T / np.sqrt(1 + 1 / law.draws)
    with np.errstate(divide="ignore"):  # the logarithm of a tail that underflows
        below = np.logaddexp(*np.log(stdtr(law.draws - 1, edges))) - np.log(2)
        above = np.logaddexp(*np.log(stdtr(law.draws - 1, -edges))) - np.log(2)
    smaller = (np.minimum(below, above) + np.log(2)) / np.log(10)
    return np.asarray(np.clip(smaller, _FLOOR, 0.0))


def joint(
    law: _Law, columns: list[Array], intervals: Array, wanted: NDArray[np.bool_]
) -> tuple[float, float, float]:
    """Return how far out several printed numbers lie together.

    The share of draws that `farther_out` counts, its decimal logarithm by Hotelling's law, and the
    Mahalanobis distance of the print.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> draws = [rng.normal(size=20_000), rng.normal(size=20_000)]
    >>> both = np.array([True, True])
    >>> law = fitted(draws, ~both)
    >>> found = joint(law, draws, np.array([[4.0, 4.1], [5.0, 5.1]]), both)
    >>> found[0], round(found[1]), round(found[2], 1)
    (0.0, -9, 6.4)
    """
    drawn, edges = law.standardised(np.stack(columns))[wanted], law.standardised(intervals)[wanted]
    counted, squared = farther_out(drawn, edges)
    n, p = law.draws, len(edges)
    hotelling = squared * (n - p) / (p * (n - 1) * (1 + 1 / n))
    with np.errstate(divide="ignore"):
        log_law = np.log10(fdtrc(p, n - p, hotelling))
    return counted, float(np.clip(log_law, _FLOOR, 0.0)), float(np.sqrt(squared))
