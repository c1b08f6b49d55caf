"""White noise and a floor from the scatter of running averages: Table IV of chen2023 as data.

The standard deviations of averages over n = 1, 4, ... frames come from the same frames, so they
are strongly correlated. For a series of white noise a and a floor that drifts evenly through the
series with standard deviation b, each squared standard deviation is a quadratic form in Gaussian
numbers. Its mean, variance and covariances with the others are known exactly; its cube root is
very nearly Gaussian (Wilson and Hilferty, 1931). What is printed is rounded: the likelihood is the
probability of the box of all printed digits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Self

import numpy as np
from numpy.random import Generator

from reproduce.inference.model import Derived, Model, Parameter
from reproduce.inference.models.rounded import BoxRule, log_box_by_rule
from reproduce.inference.priors import HalfNormal, LogUniform
from reproduce.physics.attitude.averaging import averaged_error, scatter_of_averages
from reproduce.physics.validate import FloatArray
from reproduce.units import ARCSEC_PER_RADIAN

__all__ = ["AveragingLikelihood", "averaging_model", "moments", "predicted_error"]


@lru_cache(maxsize=8)
def moments(frames: int, counts: tuple[int, ...]) -> tuple[FloatArray, ...]:
    """Moments of the variances of running averages over so many of all frames.

    Means for white noise of unit size and for the floor, (m,); traces of products for the white
    part and for the mixed part of the covariances, (m, m).
    """
    drift = np.linspace(-1, 1, frames)
    drift = drift / drift.std(ddof=1)
    averages, forms = [], []
    for count in counts:
        runs = frames - count + 1
        window = (np.arange(frames) - np.arange(runs)[:, None]) // count == 0
        average = window / count
        centred = (average - average.mean(axis=0)) / np.sqrt(runs - 1)
        forms.append(centred.T @ centred)
        averages.append(centred @ drift)
    stacked = np.stack(forms)
    white = np.einsum("kii->k", stacked)
    floor = np.array([float(a @ a) for a in averages])
    pairs = np.einsum("kij,lij->kl", stacked, stacked, optimize=True)
    bent = stacked @ drift
    return white, floor, pairs, bent @ bent.T


@dataclass(frozen=True, eq=False)
class AveragingLikelihood:
    """Printed scatter of running averages; parameters: white noise of one frame, floor.

    - `counts`: frames in each average.
    - `printed`, (m,): printed standard deviations, one sigma, in radians.
    - `half_unit`: half the last printed digit, in radians.
    - `frames`: length of the series.
    """

    counts: tuple[int, ...]
    printed: FloatArray
    half_unit: float
    frames: int
    floor: bool = True

    @cached_property
    def box(self) -> tuple[FloatArray, FloatArray]:
        """Ends of the printed numbers, as cube roots of squares, shape (m,) each."""
        ends = (np.maximum(self.printed + side * self.half_unit, 0) for side in (-1, 1))
        low, high = (np.cbrt(end**2) for end in ends)
        return low, high

    @cached_property
    def rule(self) -> BoxRule:
        """How their box is integrated, by the scatter at the rough estimates."""
        low, high = self.box
        return BoxRule.of(self._distribution(self.start()[0][None])[1][0], high - low)

    def _floor(self, parameters: FloatArray) -> FloatArray:
        return parameters[:, 1:2] if self.floor else np.zeros((len(parameters), 1))

    def _distribution(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Means and covariances of the cube roots of squares, shapes (n, m) and (n, m, m)."""
        white, floor, pairs, bent = moments(self.frames, self.counts)
        a, b = parameters[:, :1], self._floor(parameters)
        mean = a**2 * white + b**2 * floor
        covariance = 2 * a[..., None] ** 4 * pairs + 4 * (a * b)[..., None] ** 2 * bent
        variance = np.diagonal(covariance, axis1=1, axis2=2)
        # Cube root of a scaled chi square with as many degrees of freedom.
        relative = variance / mean**2
        centre = np.cbrt(mean) * (1 - relative / 18)
        # Standard deviation of the root per standard deviation of the square.
        slope = np.cbrt(mean) / (3 * mean)
        return centre, covariance * slope[:, :, None] * slope[:, None, :]

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        return log_box_by_rule(*self._distribution(parameters), *self.box, self.rule)

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Standard deviations of one series, rounded as in print, shape (m,)."""
        drift = np.linspace(-1, 1, self.frames)
        floor = float(self._floor(parameters[None])[0, 0])
        series = floor * drift / drift.std(ddof=1)
        series = series + parameters[0] * generator.normal(size=self.frames)
        exact = scatter_of_averages(series, self.counts)
        unit = 2 * self.half_unit
        return np.asarray(np.round(exact / unit) * unit)

    def given(self, data: FloatArray) -> Self:
        """The same table with other numbers."""
        return replace(self, printed=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """White noise from the first number; a floor of the size of the last."""
        single, last = float(self.printed[0]), float(self.printed[-1])
        single = max(single, self.half_unit)
        spread = max(single / np.sqrt(2 * self.frames), self.half_unit / 2)
        if not self.floor:
            return np.array([single]), np.array([spread])
        return np.array([single, 0.3 * last]), np.array([spread, 0.15 * max(last, self.half_unit)])

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """Each scatter over what white noise of the first one would leave."""
        data = self.printed if data is None else data
        first = max(float(data[0]), self.half_unit)
        return {
            f"{count} frames, over white noise": float(value * np.sqrt(count) / first)
            for count, value in zip(self.counts[1:], data[1:], strict=True)
        }


def averaging_model(
    likelihood: AveragingLikelihood,
    shown: float = ARCSEC_PER_RADIAN,
    derived: Derived | None = None,
) -> Model:
    """White noise and floor, one sigma in radians, or white noise alone without a floor."""
    least = likelihood.half_unit
    white = LogUniform(10 * least, 10000 * least, "from ten to ten thousand times what the print "
                       "can tell from zero; no scale preferred")  # fmt: skip
    floor = HalfNormal(20 * least, "a floor that may well be nothing; averaging would stop to pay "
                       "at some tens of half the last digit")  # fmt: skip
    parameters: tuple[Parameter, ...] = (
        Parameter("white", "a", "arcsec", white, shown),
        Parameter("floor", "b", "arcsec", floor, shown),
    )
    if likelihood.floor:
        return Model("frame-averaging", parameters, likelihood, {}, derived)
    return Model("frame-averaging, no floor", parameters[:1], likelihood, {}, derived)


def predicted_error(parameters: FloatArray, count: int) -> FloatArray:
    """Error of an average over `count` frames, E^2 = a^2 / n + b^2, shape (n,)."""
    return averaged_error(count, parameters[:, 0], parameters[:, 1])
