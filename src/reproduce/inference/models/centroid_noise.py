"""Effective centroid noise of a simulation from the errors of its printed results.

The calibrated parameters of both channels respond to centroid noise linearly, so they are Gaussian
about what noise-free centroids give, with a covariance proportional to the squared noise. The
printed digits are a box under that distribution.

Rounded numbers in a likelihood: the probability of the interval, or the box, that prints so.

A printed number says that a value lies within half its last digit. Where numbers are correlated
their joint probability is that of a box under a multivariate normal distribution, by fixed
quasi-random points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.special import log_ndtr, ndtr, ndtri
from scipy.stats import qmc

from reproduce.inference import LogUniform, Model, Parameter
from reproduce.physics.validate import FloatArray

# Below this a probability is not told from zero: the walker stands far outside.
SMALLEST = 1e-300
# A difference smaller than this share has lost too many digits.
PRECISE = 1e-5
POINTS = 64


def log_interval(low: FloatArray, high: FloatArray) -> FloatArray:
    """Log of Phi(high) - Phi(low), the probability of an interval, safe in both tails.

    Examples
    --------
    >>> float(np.exp(log_interval(np.array(-1.0), np.array(1.0))).round(4))
    0.6827
    """
    low, high, _ = _lower_tail(low, high)
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
    only then does the integrand hardly vary.

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
        left, right, mirrored = _lower_tail(
            (low[:, i, None] - centre) / scale, (high[:, i, None] - centre) / scale
        )
        start, end = ndtr(left), ndtr(right)
        total += _log_difference(start, end, left, right)
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


def _lower_tail(
    low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Mirror intervals of the upper tail, so that small numbers are subtracted, not those near one.

    Returns the ends, and which intervals were mirrored.
    """
    mirrored = low + high > 0
    return np.where(mirrored, -high, low), np.where(mirrored, -low, high), mirrored


def _log_difference(
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
class CentroidNoiseLikelihood:
    """One parameter: standard deviation of a centroid coordinate, in px.

    - `expected`, (m,): what noise-free centroids give.
    - `cofactor`, (m, m): covariance of the results per squared noise.
    - `printed`, `half_units`, (m,): the printed results and half their last digits, in the units of
      `expected`.
    """

    expected: FloatArray
    cofactor: FloatArray
    printed: FloatArray
    half_units: FloatArray

    @cached_property
    def _scaled(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        scale = np.sqrt(np.diagonal(self.cofactor))
        root = np.linalg.cholesky(self.cofactor / np.outer(scale, scale))
        return scale, root, quasi_random(len(scale))

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        scale, root, points = self._scaled
        low, high = (
            (self.printed - self.expected + side * self.half_units) / scale for side in (-1, 1)
        )
        mean = np.zeros((len(parameters), len(scale)))
        return log_box(mean, parameters[:, :, None] * root, low, high, points)

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Results as they would be printed, shape (m,)."""
        scale, root, _ = self._scaled
        exact = self.expected + parameters[0] * scale * (root @ generator.normal(size=len(scale)))
        unit = 2 * self.half_units
        return np.asarray(np.round(exact / unit) * unit)

    def given(self, data: FloatArray) -> Self:
        """The same simulation with other results."""
        return replace(self, printed=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Root mean square of the scaled errors."""
        scale = self._scaled[0]
        noise = np.sqrt(np.square((self.printed - self.expected) / scale).mean())
        noise = max(float(noise), float((self.half_units / scale).min()))
        return np.array([noise]), np.array([noise / 4])

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """Errors against what one px of noise makes: their size, and how unequal they are."""
        data = self.printed if data is None else data
        scaled = (data - self.expected) / self._scaled[0]
        return {
            "errors, rms (px)": float(np.sqrt(np.square(scaled).mean())),
            "errors, largest (px)": float(np.abs(scaled).max()),
            # Free of the noise, which fits the size of the errors and not how unequal they are.
            "errors, median over largest": float(np.median(np.abs(scaled)) / np.abs(scaled).max()),
        }


def centroid_noise_model(likelihood: CentroidNoiseLikelihood, stated: float) -> Model:
    """Effective centroid noise of a simulation whose text states a noise, in px."""
    prior = LogUniform(1e-4, 10.0, "from a ten-thousandth of a pixel to the size of a spot; no "
                       "scale preferred")  # fmt: skip
    parameter = Parameter("noise", r"\sigma", "px", prior)
    return Model("centroid-noise", (parameter,), likelihood, {"noise": stated})
