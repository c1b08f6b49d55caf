"""Rounded numbers in a likelihood: the probability of the interval, or the box, that prints so.

A printed number says that a value lies within half its last digit. Where numbers are correlated
their joint probability is that of a box under a multivariate normal distribution: by fixed
quasi-random points, or by a rule made for the box, for few numbers that depend strongly on each
other and whose scatter the data tell well.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpstrf
from scipy.special import log_ndtr, logsumexp, ndtr, ndtri
from scipy.stats import qmc

from reproduce.physics.validate import FloatArray

__all__ = ["AT_ONCE", "BoxRule", "log_box", "log_box_by_rule", "log_interval", "quasi_random"]

# Below this a probability is not told from zero: the walker stands far outside.
SMALLEST = 1e-300
# A difference smaller than this share has lost too many digits.
PRECISE = 1e-5
POINTS = 64
# Widths of a box, over the scatter given the numbers before, beyond which two, three, four and five
# nodes are taken, the last of them by probability.
WIDTHS = (0.02, 0.3, 0.7, 1.2)
# The most nodes of all numbers together; beyond, so many quasi-random points, which cost the same.
MOST, MANY = 2000, 512
# Nodes of all rows that are worked on at once: bounds the memory, and keeps it near.
AT_ONCE = 2**15


def log_interval(low: FloatArray, high: FloatArray) -> FloatArray:
    """Log of Phi(high) - Phi(low), the probability of an interval, safe in both tails.

    Examples
    --------
    >>> float(np.exp(log_interval(np.array(-1.0), np.array(1.0))).round(4))
    0.6827
    """
    low, high, _ = lower_tail(low, high)
    upper, lower = log_ndtr(high), log_ndtr(low)
    return np.asarray(upper + np.log(-np.expm1(np.minimum(lower - upper, -1e-16))))


def quasi_random(dimension: int, points: int = POINTS, seed: int = 1) -> FloatArray:
    """A fixed set of points that fills the unit cube evenly, shape (points, dimension)."""
    return np.asarray(qmc.Sobol(dimension, scramble=True, rng=seed).random(points))


def log_box(
    mean: FloatArray, root: FloatArray, low: FloatArray, high: FloatArray, points: FloatArray
) -> FloatArray:
    """Log probability of a box under multivariate normals, by Genz's sequential conditioning, (n,).

    Of means (n, m), lower triangular roots of covariances (n, m, m), ends (m,) or (n, m), and
    points from `quasi_random`. These are fixed, so the result is a smooth function of its
    arguments: a likelihood that is the same at each call. Few points do where the box, given the
    numbers before, is narrow against the scatter, or where numbers hardly depend on each other:
    only then does the integrand hardly vary. A few strongly correlated numbers are the business of
    `log_box_by_rule`.

    Examples
    --------
    >>> root = np.array([[[1.0, 0.0], [0.6, 0.8]]])
    >>> points = quasi_random(2, 1024)
    >>> quadrant = log_box(np.zeros((1, 2)), root, np.zeros(2), np.full(2, 9.0), points)
    >>> exact = 0.25 + np.arcsin(0.6) / (2 * np.pi)
    >>> bool(abs(np.exp(quadrant[0]) - exact) < 0.003)
    True
    """
    count, size = mean.shape
    normals = np.zeros((count, len(points), size))
    total = np.zeros((count, len(points)))
    low, high = np.broadcast_to(low, mean.shape), np.broadcast_to(high, mean.shape)
    for i in range(size):
        centre = mean[:, i, None] + (normals[..., :i] @ root[:, i, :i, None])[..., 0]
        scale = root[:, i, i, None]
        left, right, mirrored = lower_tail(
            (low[:, i, None] - centre) / scale, (high[:, i, None] - centre) / scale
        )
        start, end = ndtr(left), ndtr(right)
        total += log_difference(start, end, left, right)
        if i + 1 < size:
            # Mirrored with the interval: else the result would jump where intervals change sides.
            share = np.where(mirrored, 1 - points[:, i], points[:, i])
            drawn = ndtri(np.clip(start + share * (end - start), SMALLEST, 1 - 1e-16))
            # Far outside, rounding leaves an empty interval: stay at its nearer end.
            drawn = np.clip(drawn, left, right)
            normals[..., i] = np.where(mirrored, -drawn, drawn)
    largest = total.max(axis=1, keepdims=True)
    safe = np.where(np.isfinite(largest), largest, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(safe[:, 0] + np.log(np.exp(total - safe).mean(axis=1)))


def lower_tail(
    low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Mirror intervals of the upper tail, so that small numbers are subtracted, not those near one.

    Returns the ends, and which intervals were mirrored.
    """
    mirrored = low + high > 0
    return np.where(mirrored, -high, low), np.where(mirrored, -low, high), mirrored


def log_difference(
    start: FloatArray, end: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Log of end less start, distribution functions at the ends of intervals in the lower tail.

    Where they are too small, or too near each other, the ends themselves tell the difference.
    """
    difference = end - start
    lost = difference < PRECISE * end
    lost |= end < SMALLEST
    if not lost.any():
        return np.asarray(np.log(difference))
    found = np.log(np.where(lost, 1.0, difference))
    found[lost] = log_interval(low[lost], high[lost])
    return found


@dataclass(frozen=True, eq=False)
class BoxRule:
    """How a box is integrated: the order of its numbers, and nodes along each but the last.

    A rule belongs to data, not to parameters, so that a likelihood is smooth in its parameters.

    - `order`, (m,): each number is conditioned on those before it.
    - `nodes`, length m - 1: Gauss-Legendre nodes in this order; the last number is integrated
      exactly.
    - `wide`, length m - 1: where nodes share the probability between the ends evenly rather than
      the interval.
    - `points`, (count, m), optional: quasi-random points to use instead, where the nodes would be
      too many.
    """

    order: NDArray[np.intp]
    nodes: tuple[int, ...]
    wide: tuple[bool, ...]
    points: FloatArray | None = None

    @property
    def size(self) -> int:
        """Nodes or points of one box."""
        return int(np.prod(self.nodes)) if self.points is None else len(self.points)

    @classmethod
    def of(cls, covariance: FloatArray, width: FloatArray) -> Self:
        """Make the rule for a box: narrow numbers first, few nodes where it is narrow.

        The next number is the one whose box is narrowest against its scatter given those chosen
        already: the pivots of a Cholesky decomposition of the covariance at parameters typical of
        the data. The density bends little along a narrow box, and the widest is left to the exact
        integral. At most `MOST` nodes altogether, or else points.
        """
        root, pivots, _, _ = dpstrf(covariance / np.outer(width, width), lower=1)
        # Width of the box over the scatter given the numbers before.
        widths = 1 / np.diagonal(root)[:-1]
        nodes = 1 + np.searchsorted(WIDTHS, widths)
        wide = widths > WIDTHS[-1]
        points = quasi_random(len(width), MANY) if np.prod(1.0 * nodes) > MOST else None
        return cls(pivots - 1, tuple(map(int, nodes)), tuple(map(bool, wide)), points)


def log_box_by_rule(
    mean: FloatArray, covariance: FloatArray, low: FloatArray, high: FloatArray, rule: BoxRule
) -> FloatArray:
    """Log probability of a box under multivariate normals, by sequential conditioning, (n,).

    Of means (n, m) and covariances (n, m, m). The density is summed over a product of
    Gauss-Legendre rules in all numbers but the last, each standardised given those before it; the
    last is integrated exactly. Where the box is wide the nodes follow the probability instead
    (Genz, 1992), and where they would be too many, points do as in `log_box`. The rule is fixed, so
    the result is a smooth function of parameters. How good it is depends on the widths of the box
    over the scatter given the numbers before: thousandths of the logarithm or far less while few
    are above one, hundredths where most are.

    Examples
    --------
    >>> covariance = np.array([[1.0, 0.6], [0.6, 1.0]])
    >>> low, high = np.zeros(2), np.full(2, 9.0)
    >>> rule = BoxRule.of(covariance, high - low)
    >>> quadrant = log_box_by_rule(np.zeros((1, 2)), covariance[None], low, high, rule)
    >>> exact = 0.25 + np.arcsin(0.6) / (2 * np.pi)
    >>> bool(abs(np.exp(quadrant[0]) - exact) < 0.003)
    True
    """
    order = rule.order
    root = np.asarray(np.linalg.cholesky(covariance[:, order[:, None], order]), dtype=float)
    mean, low, high = mean[:, order], low[order], high[order]
    rows = max(1, AT_ONCE // rule.size)
    parts = [
        _log_boxes(mean[i : i + rows], root[i : i + rows], low, high, rule)
        for i in range(0, len(mean), rows)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def _log_boxes(
    mean: FloatArray, root: FloatArray, low: FloatArray, high: FloatArray, rule: BoxRule
) -> FloatArray:
    """Log probabilities; every number adds an axis of nodes to the arrays, shape (n, k, ...)."""
    if rule.points is not None:
        return log_box(mean, root, low, high, rule.points)
    normals: list[FloatArray] = []
    total = np.zeros(len(mean))
    for i, (count, wide) in enumerate(zip(rule.nodes, rule.wide, strict=True)):
        left, right = _standardised(i, normals, mean, root, low, high)
        normal, logs = (_wide_nodes if wide else _narrow_nodes)(left, right, count)
        normals.append(normal)
        total = total[..., None] + logs
    left, right, _ = lower_tail(*_standardised(len(low) - 1, normals, mean, root, low, high))
    total = total + log_difference(ndtr(left), ndtr(right), left, right)
    return np.asarray(logsumexp(total.reshape(len(mean), -1), axis=1))


def _standardised(
    i: int,
    normals: list[FloatArray],
    mean: FloatArray,
    root: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Ends of one number given those before, over its scatter given those before."""
    centre = mean[:, i]
    for j, normal in enumerate(normals):
        centre = centre[..., None] + _aligned(root[:, i, j], normal) * normal
    scale = _aligned(root[:, i, i], centre)
    return (low[i] - centre) / scale, (high[i] - centre) / scale


def _aligned(column: FloatArray, array: FloatArray) -> FloatArray:
    """One value per row, in the shape that multiplies an array whose first axis is the rows."""
    return column.reshape(-1, *[1] * (array.ndim - 1))


def _narrow_nodes(left: FloatArray, right: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Standard normal numbers spread over intervals, and log weights, on one more axis."""
    places, weights = _unit_rule(count)
    width = (right - left)[..., None]
    normal = left[..., None] + places * width
    return normal, np.log(weights / np.sqrt(2 * np.pi)) + np.log(width) - 0.5 * normal**2


def _wide_nodes(left: FloatArray, right: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Standard normal numbers spread by their probability, and log weights, on one more axis."""
    places, weights = _unit_rule(count)
    left, right, mirrored = lower_tail(left, right)
    start, end = ndtr(left), ndtr(right)
    share = start[..., None] + places * (end - start)[..., None]
    # Far outside, rounding leaves an empty interval: stay at its nearer end.
    normal = np.clip(ndtri(np.maximum(share, SMALLEST)), left[..., None], right[..., None])
    logs = log_difference(start, end, left, right)[..., None] + np.log(weights)
    return np.where(mirrored[..., None], -normal, normal), logs


@lru_cache(maxsize=16)
def _unit_rule(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre places and weights between zero and one."""
    places, weights = np.polynomial.legendre.leggauss(count)
    return (places + 1) / 2, weights / 2
