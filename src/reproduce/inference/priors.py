"""Priors of one parameter, each with the reason for its choice.

Every prior is proper: only then can parameters be drawn from it, which simulation-based
calibration and prior predictive checks need.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.random import Generator

from reproduce.physics.validate import FloatArray, finite_array, positive


class Prior(Protocol):
    """What a model needs of a prior."""

    @property
    def reason(self) -> str:
        """Why this prior and not another."""

    def log_density(self, values: FloatArray) -> FloatArray:
        """Log density at values of any shape, minus infinity outside the support."""

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws, shape (count,)."""

    def __str__(self) -> str:
        """The distribution in words and numbers, in the parameter's own unit."""


@dataclass(frozen=True)
class Uniform:
    """Flat between two ends.

    Parameters
    ----------
    low, high : float
        The ends, in the parameter's unit.
    reason : str
        Why these ends.

    Examples
    --------
    >>> float(np.exp(Uniform(0.0, 2.0, "both ends are impossible").log_density(np.array(1.0))))
    0.5
    """

    low: float
    high: float
    reason: str

    def __post_init__(self) -> None:
        _ordered(self.low, self.high)

    def log_density(self, values: FloatArray) -> FloatArray:
        """Log density, shape of `values`."""
        inside = (values >= self.low) & (values <= self.high)
        return np.where(inside, -np.log(self.high - self.low), -np.inf)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws, shape (count,)."""
        return generator.uniform(self.low, self.high, count)

    def __str__(self) -> str:
        """The distribution in words and numbers."""
        return f"uniform from {self.low:.6g} to {self.high:.6g}"


@dataclass(frozen=True)
class LogUniform:
    """Flat in the logarithm between two ends: no scale is preferred.

    Parameters
    ----------
    low, high : float
        The ends, above zero, in the parameter's unit.
    reason : str
        Why these ends.

    Examples
    --------
    >>> float(LogUniform(1.0, np.e, "a doctest").log_density(np.array(0.5)))
    -inf
    """

    low: float
    high: float
    reason: str

    def __post_init__(self) -> None:
        positive("low", self.low)
        _ordered(self.low, self.high)

    def log_density(self, values: FloatArray) -> FloatArray:
        """Log density, shape of `values`."""
        inside = (values >= self.low) & (values <= self.high)
        safe = np.where(inside, values, 1.0)
        return np.where(inside, -np.log(safe * np.log(self.high / self.low)), -np.inf)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws, shape (count,)."""
        return np.exp(generator.uniform(np.log(self.low), np.log(self.high), count))

    def __str__(self) -> str:
        """The distribution in words and numbers."""
        return f"log-uniform from {self.low:.6g} to {self.high:.6g}"


@dataclass(frozen=True)
class Normal:
    """A Gaussian.

    Parameters
    ----------
    mean, sigma : float
        Its mean and standard deviation, in the parameter's unit.
    reason : str
        Why these.

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
        """Log density, shape of `values`."""
        scaled = (values - self.mean) / self.sigma
        return np.asarray(-0.5 * scaled**2 - np.log(self.sigma) - 0.5 * np.log(2 * np.pi))

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws, shape (count,)."""
        return generator.normal(self.mean, self.sigma, count)

    def __str__(self) -> str:
        """The distribution in words and numbers."""
        return f"normal, mean {self.mean:.6g}, standard deviation {self.sigma:.6g}"


@dataclass(frozen=True)
class LogNormal:
    """A Gaussian in the logarithm: for a length known to a few per cent.

    Parameters
    ----------
    median : float
        Above zero, in the parameter's unit.
    sigma : float
        Standard deviation of the logarithm: for small values, the relative one.
    reason : str
        Why these.

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
        """Log density, shape of `values`."""
        inside = values > 0
        safe = np.where(inside, values, 1.0)
        scaled = np.log(safe / self.median) / self.sigma
        density = -0.5 * scaled**2 - np.log(safe * self.sigma) - 0.5 * np.log(2 * np.pi)
        return np.where(inside, density, -np.inf)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws, shape (count,)."""
        return self.median * np.exp(generator.normal(0.0, self.sigma, count))

    def __str__(self) -> str:
        """The distribution in words and numbers."""
        return f"log-normal, median {self.median:.6g}, relative width {self.sigma:.6g}"


@dataclass(frozen=True)
class HalfNormal:
    """The upper half of a Gaussian about zero: for a size that may well be nothing.

    Parameters
    ----------
    sigma : float
        The standard deviation of the whole Gaussian, in the parameter's unit.
    reason : str
        Why this size.

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
        """Log density, shape of `values`."""
        scaled = values / self.sigma
        inside = -0.5 * scaled**2 - np.log(self.sigma) + 0.5 * np.log(2 / np.pi)
        return np.where(values >= 0, inside, -np.inf)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws, shape (count,)."""
        return np.abs(generator.normal(0.0, self.sigma, count))

    def __str__(self) -> str:
        """The distribution in words and numbers."""
        return f"half-normal of scale {self.sigma:.6g}"


def in_unit(prior: Prior, scale: float) -> Prior:
    """Return a prior in another unit, of which one SI unit has so many, to be read, not sampled.

    Examples
    --------
    >>> str(in_unit(Uniform(0.5, 2.0, "a doctest"), 10.0))
    'uniform from 5 to 20'
    """
    if isinstance(prior, Uniform):
        return Uniform(prior.low * scale, prior.high * scale, prior.reason)
    if isinstance(prior, Normal):
        return Normal(prior.mean * scale, prior.sigma * scale, prior.reason)
    if isinstance(prior, LogUniform):
        return LogUniform(prior.low * scale, prior.high * scale, prior.reason)
    if isinstance(prior, LogNormal):
        return LogNormal(prior.median * scale, prior.sigma, prior.reason)
    if isinstance(prior, HalfNormal):
        return HalfNormal(prior.sigma * scale, prior.reason)
    return prior


def flat_place(prior: Prior, values: FloatArray) -> FloatArray | None:
    """Return where values lie between the ends of a flat prior, zero to one.

    In the scale in which the prior is flat; None if it is not flat.

    Examples
    --------
    >>> float(flat_place(LogUniform(1.0, 100.0, "a doctest"), np.array(10.0)).round(12))
    0.5
    """
    if isinstance(prior, Uniform):
        return np.asarray((values - prior.low) / (prior.high - prior.low))
    if isinstance(prior, LogUniform):
        return np.asarray(np.log(values / prior.low) / np.log(prior.high / prior.low))
    return None


def _ordered(low: float, high: float) -> None:
    finite_array("ends", (low, high))
    if not low < high:
        raise ValueError(f"ends: expected low below high, got {low:g} and {high:g}; swap them")
