"""White noise and floors from the scatter of running averages: Table IV of chen2023 as data.

The standard deviations of averages over n = 1, 4, ... frames come from the same frames, so they
are strongly correlated. For a series of white noise a and a floor that drifts evenly through the
series with standard deviation b, each squared standard deviation is a quadratic form in Gaussian
numbers. Its mean, variance and covariances with the others are known exactly; its root is nearly
Gaussian. What is printed is rounded, which adds the variance of an even distribution over the last
digit; the likelihood is the density times the widths of all digits. For Table IV, with digits twice
as coarse, mean and upper end of a floor agree with the exact law of simulated series within a
twentieth; with the digits as printed the upper end may be a tenth too low.

Every column has its own white noise and floor. How the columns depend on each other is not printed:
given their parameters they are taken as independent, and the likelihood is the product over them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.random import Generator

from reproduce.inference import Derived, HalfNormal, LogUniform, Model, Parameter
from reproduce.physics.attitude import scatter_of_averages
from reproduce.physics.validate import FloatArray
from reproduce.units import ARCSEC_PER_RADIAN


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
    """Printed scatter of running averages; parameters: white noise and floor of each column.

    - `counts`: frames in each average.
    - `printed`, (columns, m): printed standard deviations, one sigma, in radians.
    - `half_unit`: half the last printed digit, in radians.
    - `frames`: length of the series.
    - `names`: of the columns; one column needs none.
    """

    counts: tuple[int, ...]
    printed: FloatArray
    half_unit: float
    frames: int
    names: tuple[str, ...] = ("",)

    def distribution(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Means and covariances of the standard deviations before they are rounded.

        Shapes (n, columns, m) and (n, columns, m, m).
        """
        white, floor, pairs, bent = moments(self.frames, self.counts)
        a, b = self._amplitudes(parameters)
        mean = a**2 * white + b**2 * floor
        covariance = 2 * a[..., None] ** 4 * pairs + 4 * (a * b)[..., None] ** 2 * bent
        variance = np.diagonal(covariance, axis1=-2, axis2=-1)
        root = np.sqrt(mean)
        slopes = 4 * root[..., :, None] * root[..., None, :]
        return root * (1 - variance / mean**2 / 8), covariance / slopes

    def _amplitudes(self, parameters: FloatArray) -> FloatArray:
        """White noises and floors, shape (2, n, columns, 1)."""
        both = parameters.reshape(len(parameters), -1, 2).transpose(2, 0, 1)
        return np.asarray(both[..., None])

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        mean, covariance = self.distribution(parameters)
        rounded = covariance + self.half_unit**2 / 3 * np.eye(len(self.counts))
        factor = np.linalg.cholesky(rounded)
        off = np.linalg.solve(factor, (self.printed - mean)[..., None])[..., 0]
        widths = 2 * self.half_unit / np.diagonal(factor, axis1=-2, axis2=-1)
        logs = np.log(widths / np.sqrt(2 * np.pi)) - 0.5 * off**2
        return np.asarray(logs.sum(axis=(1, 2)))

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Standard deviations of one series per column, rounded as in print, (columns, m)."""
        drift = np.linspace(-1, 1, self.frames)
        white, floor = self._amplitudes(parameters[None])[:, 0]
        series = floor * (drift / drift.std(ddof=1))
        series = series + white * generator.normal(size=(len(self.names), self.frames))
        unit = 2 * self.half_unit
        exact = scatter_of_averages(series, self.counts, axis=1)
        return np.asarray(np.round(exact / unit) * unit)

    def given(self, data: FloatArray) -> Self:
        """The same table with other numbers."""
        return replace(self, printed=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """White noises from the first numbers; floors of the size of the last."""
        last = self.printed[:, -1]
        single = np.maximum(self.printed[:, 0], self.half_unit)
        spread = np.maximum(single / np.sqrt(2 * self.frames), self.half_unit / 2)
        rough = np.stack([[single, 0.3 * last], [spread, 0.15 * np.maximum(last, self.half_unit)]])
        centre, errors = rough.transpose(0, 2, 1).reshape(2, -1)
        return centre, errors

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """Each scatter over what white noise of the first one of its column would leave."""
        data = self.printed if data is None else data
        first = np.maximum(data[:, :1], self.half_unit)
        over = data * np.sqrt(self.counts) / first
        return {
            f"{name}: {count} frames, over white noise".removeprefix(": "): float(over[i, j])
            for i, name in enumerate(self.names)
            for j, count in enumerate(self.counts) if j
        }  # fmt: skip


def averaging_model(
    likelihood: AveragingLikelihood,
    shown: float = ARCSEC_PER_RADIAN,
    derived: Derived | None = None,
) -> Model:
    """White noise and floor of every column, one sigma in radians."""
    least = likelihood.half_unit
    white = LogUniform(10 * least, 10000 * least, "from ten to ten thousand times what the print "
                       "can tell from zero; no scale preferred")  # fmt: skip
    floor = HalfNormal(20 * least, "a floor that may well be nothing; averaging would stop to pay "
                       "at some tens of half the last digit")  # fmt: skip
    kinds = (("white", "a", white), ("floor", "b", floor))
    parameters = tuple(
        Parameter(f"{column}-{name}".removeprefix("-"), symbol + _index(column), "arcsec", prior,
                  shown)
        for column in likelihood.names for name, symbol, prior in kinds
    )  # fmt: skip
    return Model("frame-averaging", parameters, likelihood, {}, derived)


def _index(column: str) -> str:
    initials = "".join(word[0] for word in column.split("-") if word)
    return f"_\\mathrm{{{initials}}}" if initials else ""


def by_column(model: Model) -> list[Model]:
    """Return the model of every column by itself: the joint model is their product."""
    likelihood = model.likelihood_of(AveragingLikelihood)
    each = model.dimension // len(likelihood.names)
    return [
        replace(
            model,
            parameters=model.parameters[each * i : each * (i + 1)],
            likelihood=replace(likelihood, printed=likelihood.printed[i : i + 1], names=(name,)),
            derived=None,
        )
        for i, name in enumerate(likelihood.names)
    ]
