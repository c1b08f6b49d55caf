"""A model is one frozen object: parameters with priors, likelihood, simulation, start.

Adding a model is one small file: a likelihood class with the five methods of `Likelihood`, and a
function that gives it parameters. Everything else (sampling, diagnostics, calibration, checks,
pages) works on any `Model`. Parameter vectors have shape (n, d), in SI units and px, in the order
of `Model.parameters`; n counts vectors that are evaluated together.

Every prior is proper, and carries the reason for its choice: only then can parameters be drawn
from it, which simulation-based calibration needs. Its numbers are in the parameter's own unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, Self, TypeVar

import numpy as np
from numpy.random import Generator

from reproduce.physics.validate import FloatArray, finite_array, positive

Kind = TypeVar("Kind")
# Called with the parts of long work that are done, and all.
Progress = Callable[[int, int], None]

# Ratio of the spread of a start to the expected spread of the posterior.
_OVERDISPERSION = 3.0
_MAX_ATTEMPTS = 1000
# A prior and the data disagree beyond this number of standard deviations.
_MAX_DISTANCE = 3.0
# A start inside such a prior: points of a population, points that make the next one, populations,
# and the decades by which the first one is wider than the rough errors.
_POPULATION, _PARENTS, _GENERATIONS, _DECADES = 2000, 200, 200, 6.0


@dataclass(frozen=True)
class Uniform:
    """Flat between two bounds.

    Examples
    --------
    >>> float(np.exp(Uniform(0.0, 2.0, "both bounds are impossible").log_density(np.array(1.0))))
    0.5
    >>> str(Uniform(0.5, 2.0, "a doctest").in_unit(10.0))
    'uniform from 5 to 20'
    """

    low: float
    high: float
    reason: str

    def __post_init__(self) -> None:
        finite_array("bounds", (self.low, self.high))
        if not self.low < self.high:
            raise ValueError(
                f"bounds: expected low below high, got {self.low:g} and {self.high:g}. Swap them"
            )

    def log_density(self, values: FloatArray) -> FloatArray:
        """Return the log density, of the shape of the values; minus infinity outside."""
        inside = (values >= self.low) & (values <= self.high)
        return np.where(inside, -np.log(self.high - self.low), -np.inf)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Return independent draws, shape (count,)."""
        return generator.uniform(self.low, self.high, count)

    def in_unit(self, scale: float) -> Self:
        """Return the prior in another unit, with `scale` new units per old unit."""
        return type(self)(self.low * scale, self.high * scale, self.reason)

    def distance(self, value: float, error: float) -> float:
        """Return how far an estimate lies outside of the prior, in standard deviations."""
        return max(self.low - value, value - self.high, 0.0) / error

    def __str__(self) -> str:
        return f"uniform from {self.low:.6g} to {self.high:.6g}"


class LogUniform(Uniform):
    """Flat in the logarithm between two bounds above zero: no scale is preferred.

    Examples
    --------
    >>> float(LogUniform(1.0, np.e, "a doctest").log_density(np.array(0.5)))
    -inf
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

    def __str__(self) -> str:
        return f"log-{super().__str__()}"


@dataclass(frozen=True)
class Normal:
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
        return np.asarray(
            -0.5 * scaled**2 - np.log(self.sigma) - 0.5 * np.log(2 * np.pi)
        )

    def draw(self, generator: Generator, count: int) -> FloatArray:
        return generator.normal(self.mean, self.sigma, count)

    def in_unit(self, scale: float) -> Normal:
        return Normal(self.mean * scale, self.sigma * scale, self.reason)

    def distance(self, value: float, error: float) -> float:
        return float(abs(value - self.mean) / np.hypot(self.sigma, error))

    def __str__(self) -> str:
        return f"normal, mean {self.mean:.6g}, standard deviation {self.sigma:.6g}"


# As text, a prior is its distribution in words and numbers.
Prior = Uniform | Normal


class Coordinates:
    """Coordinates in which the moves of an ensemble work: here the parameters themselves.

    Parameters stay as they are declared, in chains, files and summaries. For one that ranges over
    decades, a subclass makes proposals in a smooth one-to-one map of it, in which the posterior is
    nearly Gaussian; the ratio of volumes in the acceptance keeps the posterior unchanged.
    """

    def straight(self, parameters: FloatArray) -> FloatArray:
        """Return coordinates of parameter vectors, shape (..., d)."""
        return parameters

    def parameters(self, straight: FloatArray) -> FloatArray:
        """Return parameter vectors at coordinates, shape (..., d)."""
        return straight

    def log_volume(self, parameters: FloatArray) -> FloatArray:
        """Return the log determinant of the derivatives by the coordinates, shape (...)."""
        return np.zeros(parameters.shape[:-1])


class Likelihood(Protocol):
    """What a model needs of a likelihood: a picklable object that holds the data.

    The draws of the posterior are repeated with `simulate`, or with the method `repeat` of the
    same arguments, if the likelihood has one.
    """

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood, shape (n,), of parameter vectors, shape (n, d)."""

    def simulate(self, parameters: FloatArray, generator: Generator) -> Any:
        """Return data drawn for one parameter vector, shape (d,)."""

    def with_data(self, data: Any) -> Self:
        """Return the same likelihood with other data, which `simulate` returns."""

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Return a rough estimate and its rough standard error, both of shape (d,)."""

    def checks(self, data: Any | None = None) -> dict[str, float]:
        """Return numbers of other data, or of the present data, that predictive checks compare."""

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return that of each observation, shape (n, observations) or (n, groups, lights)."""

    @property
    def observed(self) -> dict[str, FloatArray]:
        """The data by name, one row per observation."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model.

    - `name`: its name in tables and files, such as ``shift-x``.
    - `label`: its symbol for axes, in TeX without dollar signs.
    - `unit`: the unit in which it is shown.
    - `prior`: its prior, in SI units or px.
    - `shown`: displayed units per SI unit, such as ARCSEC_PER_RADIAN.
    - `natural`: bounds of the prior that are bounds of the quantity: draws may pile up there.
    """

    name: str
    label: str
    unit: str
    prior: Prior
    shown: float = 1.0
    natural: tuple[float, ...] = ()

    @property
    def shown_unit(self) -> str:
        """The displayed unit as it follows a number; empty if there is none."""
        return "" if self.unit == "1" else f" {self.unit}"


@dataclass(frozen=True, eq=False)
class Consequence:
    """Draws of a consequence of the parameters, (n,), in the unit shown, and that unit."""

    values: FloatArray
    unit: str


# Named consequences of parameter vectors of shape (n, d).
Derived = Callable[[FloatArray], dict[str, Consequence]]


@dataclass(frozen=True, eq=False)
class Model:
    """A model with its data.

    - `name`: its name in tables, messages and stored runs.
    - `parameters`: in the order of the columns of every parameter array.
    - `likelihood`: the log likelihood with its data.
    - `estimate`: the published or least-squares point estimate, by parameter, where there is one;
      SI.
    - `derived`: functions that return consequences of the parameters.
    - `coordinates`: in which ensembles move; they never show in the draws.

    Examples
    --------
    See `reproduce.inference.models.registration.registration_model`.
    """

    name: str
    parameters: tuple[Parameter, ...]
    likelihood: Likelihood
    estimate: Mapping[str, float] = field(default_factory=dict)
    derived: tuple[Derived, ...] = ()
    coordinates: Coordinates = field(default_factory=Coordinates)

    def likelihood_of(self, kind: type[Kind]) -> Kind:
        """Return the likelihood, or raise `TypeError` if it is of another kind."""
        if not isinstance(self.likelihood, kind):
            got = type(self.likelihood).__name__
            raise TypeError(f"{self.name}: expected a {kind.__name__}, got {got}")
        return self.likelihood

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def dimension(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    def log_prior(self, parameters: FloatArray) -> FloatArray:
        """Return the log prior density, shape (n,), of vectors of shape (n, d)."""
        total = np.zeros(len(parameters))
        for column, parameter in zip(parameters.T, self.parameters, strict=True):
            total += parameter.prior.log_density(column)
        return total

    def log_posterior(self, parameters: FloatArray) -> FloatArray:
        """Return log prior plus log likelihood, shape (n,); minus infinity outside the prior."""
        total = self.log_prior(parameters)
        inside = np.isfinite(total)
        if inside.any():
            total[inside] += self.likelihood(parameters[inside])
        return np.where(np.isnan(total), -np.inf, total)

    def log_density(self, straight: FloatArray) -> FloatArray:
        """Return the log posterior density of the coordinates, shape (n,)."""
        with np.errstate(over="ignore"):  # far outside: infinite, and rejected
            parameters = self.coordinates.parameters(straight)
        total = self.log_posterior(parameters)
        inside = np.isfinite(total)
        total[inside] += self.coordinates.log_volume(parameters[inside])
        return total

    def consequences(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Return all consequences of parameter vectors, by name."""
        found: dict[str, Consequence] = {}
        for derived in self.derived:
            found |= derived(parameters)
        return found

    def repeat(self, parameters: FloatArray, generator: Generator) -> Any:
        """Return data of a repeat of this experiment, for one parameter vector."""
        repeat = getattr(self.likelihood, "repeat", self.likelihood.simulate)
        return repeat(parameters, generator)

    def with_data(self, data: Any) -> Model:
        """Return the same model with other data; point estimates do not carry over."""
        return replace(self, likelihood=self.likelihood.with_data(data), estimate={})

    def with_priors(self, priors: Mapping[str, Prior]) -> Model:
        """Return the same model with other priors, by name; an unknown name is a ValueError."""
        if unknown := priors.keys() - set(self.names):
            raise ValueError(
                f"priors: expected names among {', '.join(self.names)}, got "
                f"{', '.join(sorted(unknown))}. Check the spelling"
            )
        parameters = (
            replace(p, prior=priors.get(p.name, p.prior)) for p in self.parameters
        )
        return replace(self, parameters=tuple(parameters))

    def disagreements(self) -> dict[str, tuple[float, float, float]]:
        """Return the parameters whose prior and data disagree.

        With the rough estimate from the data, its standard error, and the distance from the prior
        in standard deviations.
        """
        rough, spread = (column.tolist() for column in self.likelihood.start())
        found = {}
        for one, value, error in zip(self.parameters, rough, spread, strict=True):
            distance = one.prior.distance(value, error) if error > 0 else 0.0
            if distance > _MAX_DISTANCE:
                found[one.name] = (value, error, distance)
        return found

    def _supported(self, generator: Generator) -> tuple[FloatArray, FloatArray]:
        """Return centre and spread of the posterior if priors and data disagree.

        A population of points moves to where the posterior is high.
        """
        rough, spread = self.likelihood.start()
        wide = 10 ** generator.uniform(0, _DECADES, (_POPULATION, 1))
        steps = generator.normal(size=(_POPULATION, self.dimension))
        points, apart = rough + spread * wide * steps, self.disagreements()
        for i, one in enumerate(self.parameters):
            if one.name in apart or isinstance(one.prior, LogUniform):
                points[:, i] = one.prior.draw(generator, _POPULATION)
        for _ in range(_GENERATIONS):
            log = self.log_posterior(points)
            order = np.argsort(-log)[:_PARENTS]
            best = points[order]
            if log[order[0]] - log[order[-1]] < self.dimension:
                break
            a, b, c = best[generator.integers(0, _PARENTS, (3, _POPULATION))]
            points = a + (b - c) * generator.normal(size=(_POPULATION, 1))
        return best.mean(axis=0), best.std(axis=0)

    def start(self, generator: Generator, walkers: int) -> FloatArray:
        """Return over-dispersed starting points about a displaced centre, shape (walkers, d).

        The displacement belongs to the ensemble, so that ensembles start apart from each other.
        If hardly any point has a finite posterior, a ValueError is raised.
        """
        rough, spread = self.likelihood.start()
        if self.disagreements():
            rough, spread = self._supported(generator)
        reach = _OVERDISPERSION * spread
        centre = rough + reach * generator.normal(size=self.dimension)
        points = np.empty((0, self.dimension))
        for attempt in range(_MAX_ATTEMPTS):
            # A displaced centre may lie outside the support: let the scatter grow back to it.
            steps = generator.normal(size=(walkers, self.dimension))
            tried = centre + (1 + attempt / 20) * reach * steps
            inside = np.isfinite(self.log_posterior(tried))
            points = np.concatenate([points, tried[inside]])
            if len(points) >= walkers:
                return points[:walkers]
        raise ValueError(
            f"{self.name}: expected a finite posterior near the rough estimate, got none. Check "
            "the data for values that are alike, far off or without noise, or widen the priors"
        )
