"""Models of posteriors: parameters with priors, a likelihood with its data, and a start.

Parameter vectors have shape (n, d), in SI units and px, in the order of `Model.parameters`. Each
prior is proper, because simulation-based calibration draws from it, and contains the reason for its
choice. A new model is a subclass of `Likelihood` and a function that gives it parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.random import Generator
from scipy.optimize import Bounds, differential_evolution
from scipy.stats import norm, truncnorm

from reproduce.physics.validate import (
    FloatArray,
    finite_array,
    non_negative,
    positive,
    whole_number,
)

# An estimate of the parameters and its standard error, both of shape (d,).
Estimate = tuple[FloatArray, FloatArray]
# Callback with the number of finished parts of the work, and the number of all parts.
Progress = Callable[[int, int], None]

# Ratio of the spread of a start to the expected spread of the posterior.
_START_SPREAD_RATIO = 3.0
_MAX_START_ATTEMPTS = 1000
# Draws in closed form per requested draw, since the bounds of priors reject some.
_DRAWS_PER_EXACT = 10
# Standard deviations between a prior and an estimate, beyond which they disagree.
_MAX_PRIOR_DISTANCE_SIGMA = 3.0
# Half width of the search for a start in that case, in standard deviations.
_SEARCH_SIGMA = 10.0
# Scales in which an ensemble moves: coordinate of a parameter, parameter at a coordinate, and
# logarithm of the derivative of the parameter at the coordinate.
_SCALES: dict[str, tuple[Callable[[FloatArray], FloatArray], ...]] = {
    "": (np.copy, np.copy, np.zeros_like),
    "log": (np.log, np.exp, np.copy),
    "normal score": (norm.ppf, norm.cdf, norm.logpdf),
}


@dataclass(frozen=True)
class Uniform:
    """Uniform prior between two bounds.

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
        """Return the log density, with the shape of `values`; minus infinity outside."""
        inside = (values >= self.low) & (values <= self.high)
        return np.where(inside, -np.log(self._width(values)), -np.inf)

    def _width(self, values: FloatArray) -> FloatArray:
        """Return the inverse of the density inside the bounds."""
        return np.asarray(self.high - self.low)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Return independent draws, shape (count,)."""
        return generator.uniform(self.low, self.high, count)

    def in_unit(self, scale: float) -> Self:
        """Return the prior in another unit, with `scale` new units per old unit."""
        return replace(self, low=self.low * scale, high=self.high * scale)

    def above_zero(self) -> Self:
        """Return the prior of a positive number; raise ValueError for a bound below zero."""
        non_negative("low", self.low)
        return self

    def distance(self, value: float, error: float) -> float:
        """Return the distance of an estimate from the prior, in standard deviations."""
        return max(self.low - value, value - self.high, 0.0) / error

    def __str__(self) -> str:
        return f"uniform from {self.low:.6g} to {self.high:.6g}"


class LogUniform(Uniform):
    """Prior that is uniform in the logarithm, between two bounds above zero.

    Examples
    --------
    >>> float(LogUniform(1.0, np.e, "a doctest").log_density(np.array(0.5)))
    -inf
    """

    def __post_init__(self) -> None:
        positive("low", self.low)
        super().__post_init__()

    def _width(self, values: FloatArray) -> FloatArray:
        return np.maximum(values, self.low) * np.log(self.high / self.low)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        return np.exp(generator.uniform(np.log(self.low), np.log(self.high), count))

    def __str__(self) -> str:
        return f"log-{super().__str__()}"


@dataclass(frozen=True)
class Normal:
    """Gaussian prior.

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
        return -0.5 * scaled**2 - np.log(self.sigma * np.sqrt(2 * np.pi))

    def draw(self, generator: Generator, count: int) -> FloatArray:
        return generator.normal(self.mean, self.sigma, count)

    def in_unit(self, scale: float) -> Self:
        return replace(self, mean=self.mean * scale, sigma=self.sigma * scale)

    def above_zero(self) -> Normal:
        return _PositiveNormal(self.mean, self.sigma, self.reason)

    def distance(self, value: float, error: float) -> float:
        return abs(value - self.mean) / np.hypot(self.sigma, error)

    def __str__(self) -> str:
        return f"normal, mean {self.mean:.6g}, standard deviation {self.sigma:.6g}"


class _PositiveNormal(Normal):
    """Gaussian prior of a number above zero; its density is not normalised."""

    def __post_init__(self) -> None:
        non_negative("mean", self.mean)
        super().__post_init__()

    def log_density(self, values: FloatArray) -> FloatArray:
        return np.where(values > 0, super().log_density(values), -np.inf)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        positive = truncnorm(-self.mean / self.sigma, np.inf, self.mean, self.sigma)
        return positive.rvs(count, random_state=generator)

    def __str__(self) -> str:
        return f"{super().__str__()}, above zero"


# The text of a prior describes its distribution in words and numbers.
Prior = Uniform | Normal


class Likelihood(Protocol):
    """Base of likelihoods: a picklable object with its data.

    `observables` are the names of the attributes that contain the data.
    """

    observables: ClassVar[tuple[str, ...]]

    @property
    def observed(self) -> dict[str, FloatArray]:
        """The data by name, one row per observation."""
        return {name: getattr(self, name) for name in self.observables}

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood, shape (n,), of parameter vectors, shape (n, d)."""

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of each observation, shape (n, ...); by default of all data."""
        return self(parameters)[:, None]

    @staticmethod
    def white_noise(squares: FloatArray, count: float, noise: FloatArray) -> FloatArray:
        """Return the log density of numbers with white noise, from the sum of their squares."""
        constant = -count * np.log(np.sqrt(2 * np.pi) * noise)
        return constant - squares / (2 * noise**2)

    def simulate(self, parameters: FloatArray, generator: Generator) -> Self:
        """Return the likelihood of data drawn for one parameter vector, shape (d,)."""

    def repeat(self, parameters: FloatArray, generator: Generator) -> Self:
        """Return the likelihood of a repeat of the experiment, for one parameter vector, (d,)."""
        return self.simulate(parameters, generator)

    def exact(self, count: int, generator: Generator) -> FloatArray:
        """Return independent draws for uniform priors without bounds, shape (n, d)."""
        raise ValueError(
            "exact: expected printed estimates, or a similarity without errors of the source. Use "
            "the draws of emcee"
        )

    def start(self) -> Estimate:
        """Return a rough estimate and its rough standard error, both of shape (d,)."""

    def checks(self, other: Self) -> dict[str, float]:
        """Return numbers of the data of `other` for predictive checks; by default all data."""
        return {
            f"{name} {i}": value
            for name, values in other.observed.items()
            for i, value in enumerate(values.ravel(), 1)
        }


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model.

    - `name`: name in tables, figures and files, such as ``shift-x``.
    - `unit`: displayed unit.
    - `prior`: prior, in SI units or px.
    - `shown`: displayed units per SI unit, such as ARCSEC_PER_RADIAN.
    - `natural`: bound of the prior that is a bound of the quantity: draws may pile up there.
    - `scale`: scale in which ensembles move: empty for a linear scale, ``log`` for a parameter
      that ranges over decades, ``normal score`` for a fraction that may be close to zero. The
      posterior is nearly Gaussian in this scale. Draws and priors are not affected.
    """

    name: str
    unit: str
    prior: Prior
    shown: float = 1.0
    natural: float | None = None
    scale: str = ""

    @property
    def text(self) -> str:
        """Its prior in the displayed unit."""
        return str(self.prior.in_unit(self.shown))

    def with_prior(self, prior: Prior | tuple[float, float] | str) -> Self:
        """Return the parameter with a prior, or two bounds of one, in the displayed unit."""
        try:
            if not isinstance(prior, Prior):
                ends = prior.split(",") if isinstance(prior, str) else prior
                bounds = [*map(float, ends)]
                if len(bounds) != 2:
                    raise ValueError(f"expected low and high, got {bounds}")
                low, high = bounds
                prior = Uniform(low, high, "bounds given by the user")
            if isinstance(self.prior, LogUniform) or self.natural == 0:
                prior = prior.above_zero()
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"prior of {self.name}: {error}. Give two bounds"
            ) from error
        return replace(self, prior=prior.in_unit(1 / self.shown))


@dataclass(frozen=True, eq=False)
class Quantity:
    """Draws of a parameter or of a consequence of parameters, in the displayed unit, its unit."""

    values: FloatArray
    unit: str


# Function of parameter vectors of shape (n, d) that returns their consequences by name.
Derived = Callable[[FloatArray], dict[str, Quantity]]


def _no_consequences(parameters: FloatArray) -> dict[str, Quantity]:
    return {}


@dataclass(frozen=True, eq=False)
class Model:
    """A model with its data.

    - `name`: name in tables, messages and stored runs.
    - `parameters`: in the order of the columns of every parameter array.
    - `likelihood`: log likelihood with its data.
    - `consequences`: function that returns consequences of the parameters.
    - `truth`: parameters with which the data were simulated, by name; empty for other data.

    Examples
    --------
    See `reproduce.inference.models.registration.registration_model`.
    """

    name: str
    parameters: tuple[Parameter, ...]
    likelihood: Likelihood
    consequences: Derived = _no_consequences
    truth: Mapping[str, float] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def dimension(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    def displayed(self, parameters: FloatArray) -> dict[str, Quantity]:
        """Return the parameters of vectors, (..., d), by name, in the displayed unit."""
        columns = zip(self.parameters, np.moveaxis(parameters, -1, 0), strict=True)
        return {p.name: Quantity(p.shown * column, p.unit) for p, column in columns}

    def drawn_prior(self, generator: Generator, count: int) -> FloatArray:
        """Return independent draws from the prior, shape (count, d)."""
        columns = [one.prior.draw(generator, count) for one in self.parameters]
        return np.stack(columns, axis=-1)

    def log_prior(self, parameters: FloatArray) -> FloatArray:
        """Return the log prior density, shape (n,), of vectors of shape (n, d)."""
        columns = zip(self.parameters, parameters.T, strict=True)
        return np.asarray(sum(one.prior.log_density(column) for one, column in columns))

    def log_posterior(self, parameters: FloatArray) -> FloatArray:
        """Return log prior plus log likelihood, shape (n,); minus infinity outside the prior."""
        total = self.log_prior(parameters)
        inside = np.isfinite(total)
        if inside.any():
            # A Normal prior of a noise or a fraction also has impossible values.
            with np.errstate(invalid="ignore"):
                total[inside] += self.likelihood(parameters[inside])
        return np.where(np.isnan(total), -np.inf, total)

    def coordinates(self, parameters: FloatArray) -> FloatArray:
        """Return the coordinates in which ensembles move, shape (..., d)."""
        return self._mapped(parameters, 0)

    def parameters_at(self, coordinates: FloatArray) -> FloatArray:
        """Return the parameter vectors at coordinates, shape (..., d)."""
        return self._mapped(coordinates, 1)

    def _mapped(self, values: FloatArray, function: int) -> FloatArray:
        columns = np.moveaxis(values, -1, 0)
        with np.errstate(over="ignore"):  # far outside: infinite, and rejected
            mapped = [
                _SCALES[one.scale][function](column)
                for one, column in zip(self.parameters, columns, strict=True)
            ]
        return np.stack(mapped, axis=-1)

    def log_density(self, coordinates: FloatArray) -> FloatArray:
        """Return the log posterior density of the coordinates, shape (n,)."""
        # The log determinant of the derivatives of the parameters by the coordinates.
        volume = self._mapped(coordinates, 2).sum(axis=-1)
        return self.log_posterior(self.parameters_at(coordinates)) + volume

    def with_priors(self, priors: Mapping[str, Prior | tuple[float, float]]) -> Model:
        """Return the model with priors in displayed units, by name, as in `Parameter.with_prior`.

        An unknown name is a ValueError.
        """
        if unknown := priors.keys() - set(self.names):
            raise ValueError(
                f"priors: expected names among {', '.join(self.names)}, got "
                f"{', '.join(sorted(map(str, unknown)))}. Check the spelling"
            )
        parameters = (
            p.with_prior(priors[p.name]) if p.name in priors else p
            for p in self.parameters
        )
        return replace(self, parameters=tuple(parameters))

    def exact(self, count: int, generator: Generator) -> FloatArray:
        """Return independent draws in closed form, without a sampler, shape (count, d).

        The priors must be uniform, and that of the noise log-uniform. A `ValueError` is raised for
        others, if the model has no closed form, or if the priors exclude most of the posterior.
        """
        drawn = _DRAWS_PER_EXACT * whole_number("draws", count)
        rows = self.likelihood.exact(drawn, generator)[:, : self.dimension]
        # The priors are those of the closed form within their bounds.
        rows = rows[np.isfinite(self.log_prior(rows))]
        others = any(
            type(one.prior) is not (LogUniform if one.name == "noise" else Uniform)
            for one in self.parameters
        )
        if others or len(rows) < count:
            raise ValueError(
                "exact: expected priors that contain most of the posterior, uniform or, of the "
                "noise, log-uniform, got other priors. Use the draws of emcee"
            )
        return rows[:count]

    def disagreements(self) -> dict[str, tuple[float, float, float]]:
        """Return the parameters whose prior and data disagree.

        Each with the rough estimate from the data, its standard error, and the distance from the
        prior in standard deviations.
        """
        found = {}
        for one, value, error in zip(
            self.parameters, *self.likelihood.start(), strict=True
        ):
            distance = one.prior.distance(value, error) if error > 0 else 0.0
            if distance > _MAX_PRIOR_DISTANCE_SIGMA:
                found[one.name] = (value, error, distance)
        return found

    def _compatible_start(self, generator: Generator) -> Estimate:
        """Return centre and spread of the posterior if priors and data disagree."""
        bounds = []
        for one, value, error in zip(
            self.parameters, *self.likelihood.start(), strict=True
        ):
            prior = one.prior
            if isinstance(prior, Normal):
                centres = np.array([value, prior.mean])
                reach = _SEARCH_SIGMA * np.array([error, prior.sigma])
                bounds.append(((centres - reach).min(), (centres + reach).max()))
            else:
                bounds.append((prior.low, prior.high))

        def cost(points: Any) -> Any:
            return -self.log_posterior(points.T)

        found = differential_evolution(
            cost,
            Bounds(*np.transpose(bounds)),
            rng=generator,
            polish=False,
            vectorized=True,
            updating="deferred",
        )
        return found.x, found.population.std(axis=0)

    def start(self, generator: Generator, walkers: int) -> FloatArray:
        """Return over-dispersed starting points about a displaced centre, shape (walkers, d).

        Each ensemble has another displacement, so that ensembles start apart from each other. If
        hardly any point has a finite posterior, a ValueError is raised.
        """
        rough, spread = self.likelihood.start()
        if self.disagreements():
            rough, spread = self._compatible_start(generator)
        reach = _START_SPREAD_RATIO * spread
        centre = rough + reach * generator.normal(size=self.dimension)
        points = np.empty((0, self.dimension))
        for attempt in range(_MAX_START_ATTEMPTS):
            # A displaced centre may be outside the support, so the scatter grows.
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
