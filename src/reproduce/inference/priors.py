"""Priors of one parameter, each with the reason for its choice.

Every prior is proper: only then can parameters be drawn from it, which simulation-based
calibration and prior predictive checks need. Its numbers are in the parameter's own unit.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.random import Generator

from reproduce.physics.validate import FloatArray, finite_array, positive


class Prior(ABC):
    """What a model needs of a prior; as text it is the distribution in words and numbers."""

    reason: str

    @abstractmethod
    def log_density(self, values: FloatArray) -> FloatArray:
        """Log density at values of any shape, minus infinity outside the support."""

    @abstractmethod
    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws, shape (count,)."""

    @abstractmethod
    def in_unit(self, scale: float) -> Prior:
        """The prior in another unit, of which one old unit has so many, to be read, not sampled."""

    def place(self, values: FloatArray) -> FloatArray | None:
        """Where values lie between the ends of a flat prior, zero to one; None if it is not flat.

        In the scale in which the prior is flat.
        """
        return None


@dataclass(frozen=True)
class _Flat(Prior):
    low: float
    high: float
    reason: str

    def __post_init__(self) -> None:
        finite_array("ends", (self.low, self.high))
        if not self.low < self.high:
            raise ValueError(
                f"ends: expected low below high, got {self.low:g} and {self.high:g}; swap them"
            )

    def in_unit(self, scale: float) -> Self:
        return type(self)(self.low * scale, self.high * scale, self.reason)


class Uniform(_Flat):
    """Flat between two ends.

    Examples
    --------
    >>> float(np.exp(Uniform(0.0, 2.0, "both ends are impossible").log_density(np.array(1.0))))
    0.5
    >>> str(Uniform(0.5, 2.0, "a doctest").in_unit(10.0))
    'uniform from 5 to 20'
    """

    def log_density(self, values: FloatArray) -> FloatArray:
        inside = (values >= self.low) & (values <= self.high)
        return np.where(inside, -np.log(self.high - self.low), -np.inf)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        return generator.uniform(self.low, self.high, count)

    def place(self, values: FloatArray) -> FloatArray:
        return np.asarray((values - self.low) / (self.high - self.low))

    def __str__(self) -> str:
        return f"uniform from {self.low:.6g} to {self.high:.6g}"


class LogUniform(_Flat):
    """Flat in the logarithm between two ends above zero: no scale is preferred.

    Examples
    --------
    >>> float(LogUniform(1.0, np.e, "a doctest").log_density(np.array(0.5)))
    -inf
    >>> float(LogUniform(1.0, 100.0, "a doctest").place(np.array(10.0)).round(12))
    0.5
    """

    def __post_init__(self) -> None:
        positive("low", self.low)
        super().__post_init__()

    def log_density(self, values: FloatArray) -> FloatArray:
        inside = (values >= self.low) & (values <= self.high)
        safe = np.where(inside, values, 1.0)
        return np.where(inside, -np.log(safe * np.log(self.high / self.low)), -np.inf)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        return np.exp(generator.uniform(np.log(self.low), np.log(self.high), count))

    def place(self, values: FloatArray) -> FloatArray:
        return np.asarray(np.log(values / self.low) / np.log(self.high / self.low))

    def __str__(self) -> str:
        return f"log-uniform from {self.low:.6g} to {self.high:.6g}"


@dataclass(frozen=True)
class Normal(Prior):
    """A Gaussian.

    Examples
    --------
    >>> prior = Normal(0.0, 1.0, "a doctest")
    >>> round(float(prior.log_density(np.array(0.0))), 4)
    -0.9189
    """

    mean: float
    sigma: float
    reason: str

    def __post_init__(self) -> None:
        finite_array("mean", self.mean)
        positive("sigma", self.sigma)

    def log_density(self, values: FloatArray) -> FloatArray:
        scaled = (values - self.mean) / self.sigma
        return np.asarray(-0.5 * scaled**2 - np.log(self.sigma) - 0.5 * np.log(2 * np.pi))

    def draw(self, generator: Generator, count: int) -> FloatArray:
        return generator.normal(self.mean, self.sigma, count)

    def in_unit(self, scale: float) -> Normal:
        return Normal(self.mean * scale, self.sigma * scale, self.reason)

    def __str__(self) -> str:
        return f"normal, mean {self.mean:.6g}, standard deviation {self.sigma:.6g}"


@dataclass(frozen=True)
class LogNormal(Prior):
    """A Gaussian in the logarithm, for a length known to a few per cent.

    For small values `sigma`, the standard deviation of the logarithm, is the relative one.

    Examples
    --------
    >>> float(LogNormal(1.0, 0.1, "a doctest").log_density(np.array(-1.0)))
    -inf
    """

    median: float
    sigma: float
    reason: str

    def __post_init__(self) -> None:
        positive("median", self.median)
        positive("sigma", self.sigma)

    def log_density(self, values: FloatArray) -> FloatArray:
        inside = values > 0
        safe = np.where(inside, values, 1.0)
        scaled = np.log(safe / self.median) / self.sigma
        density = -0.5 * scaled**2 - np.log(safe * self.sigma) - 0.5 * np.log(2 * np.pi)
        return np.where(inside, density, -np.inf)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        return self.median * np.exp(generator.normal(0.0, self.sigma, count))

    def in_unit(self, scale: float) -> LogNormal:
        return LogNormal(self.median * scale, self.sigma, self.reason)

    def __str__(self) -> str:
        return f"log-normal, median {self.median:.6g}, relative width {self.sigma:.6g}"


@dataclass(frozen=True)
class HalfNormal(Prior):
    """The upper half of a Gaussian about zero, for a size that may well be nothing.

    `sigma` is the standard deviation of the whole Gaussian.

    Examples
    --------
    >>> float(HalfNormal(1.0, "a doctest").log_density(np.array(-1.0)))
    -inf
    """

    sigma: float
    reason: str

    def __post_init__(self) -> None:
        positive("sigma", self.sigma)

    def log_density(self, values: FloatArray) -> FloatArray:
        scaled = values / self.sigma
        inside = -0.5 * scaled**2 - np.log(self.sigma) + 0.5 * np.log(2 / np.pi)
        return np.where(values >= 0, inside, -np.inf)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        return np.abs(generator.normal(0.0, self.sigma, count))

    def in_unit(self, scale: float) -> HalfNormal:
        return HalfNormal(self.sigma * scale, self.reason)

    def __str__(self) -> str:
        return f"half-normal of scale {self.sigma:.6g}"
