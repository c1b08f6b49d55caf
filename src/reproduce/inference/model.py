"""A model is one frozen object: parameters with priors, likelihood, simulation, estimate.

Adding a model is one small file: a likelihood class with the five methods of `Likelihood`, and a
function that gives it parameters. Everything else (sampling, diagnostics, calibration, checks,
pages) works on any `Model`. Parameter vectors have shape (n, d), in SI units and px, in the order
of `Model.parameters`; n counts vectors that are evaluated together.

Coordinates in which a posterior is nearly Gaussian: what the moves of an ensemble work in.

Parameters stay as they are declared, in chains, files and summaries. Where one of them sets the
width of others (a noise that ranges over decades, say), proposals are made in coordinates that
take this out; the ratio of volumes in the acceptance keeps the posterior what it is. They depend
on the data alone, never on the ensemble, so the moves stay those of a fixed posterior.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, Self, TypeVar, runtime_checkable

import numpy as np
from numpy.random import Generator
from scipy.special import ndtr, ndtri

from reproduce.inference.priors import Prior
from reproduce.physics.validate import FloatArray


class Coordinates(Protocol):
    """A smooth one-to-one map of the parameters; all arrays have one row per vector."""

    def straight(self, parameters: FloatArray) -> FloatArray:
        """Coordinates of parameter vectors, shape (n, d)."""

    def parameters(self, straight: FloatArray) -> FloatArray:
        """Parameter vectors at coordinates, shape (n, d)."""

    def log_volume(self, parameters: FloatArray) -> FloatArray:
        """Log of the determinant of the derivatives of parameters by coordinates, shape (n,)."""


@runtime_checkable
class Straightened(Protocol):
    """A likelihood that knows such coordinates for its data."""

    def coordinates(self) -> Coordinates:
        """Coordinates for the data at hand."""


@runtime_checkable
class Mirrored(Protocol):
    """Coordinates in which the posterior may have two modes, images of each other."""

    def mirrored(self, straight: FloatArray) -> FloatArray:
        """Where the mirror takes them, shape (n, d): once more takes back, volumes are kept."""


class Declared:
    """The parameters themselves: for posteriors that are nearly Gaussian as declared."""

    def straight(self, parameters: FloatArray) -> FloatArray:
        """The same vectors, shape (n, d)."""
        return parameters

    def parameters(self, straight: FloatArray) -> FloatArray:
        """The same vectors, shape (n, d)."""
        return straight

    def log_volume(self, parameters: FloatArray) -> FloatArray:
        """Zeros, shape (n,)."""
        return np.zeros(len(parameters))


def scores(values: FloatArray, ends: tuple[float, float]) -> FloatArray:
    """Normal scores of values between two ends: uniform values become Gaussian.

    Examples
    --------
    >>> scores(np.array([0.5]), (0.0, 1.0))
    array([0.])
    """
    low, high = ends
    return np.asarray(ndtri((values - low) / (high - low)))


def from_scores(found: FloatArray, ends: tuple[float, float]) -> FloatArray:
    """Values between two ends from their normal scores.

    Examples
    --------
    >>> from_scores(np.array([0.0]), (2.0, 4.0))
    array([3.])
    """
    low, high = ends
    return np.asarray(low + (high - low) * ndtr(found))


def log_slope(values: FloatArray, ends: tuple[float, float]) -> FloatArray:
    """Log derivative of values by their normal scores; minus infinity at the ends.

    Examples
    --------
    >>> bool(np.isclose(log_slope(np.array([0.5]), (0.0, 1.0))[0], -0.5 * np.log(2 * np.pi)))
    True
    """
    width = ends[1] - ends[0]
    return np.asarray(np.log(width / np.sqrt(2 * np.pi)) - 0.5 * scores(values, ends) ** 2)


def weighted(
    estimate: FloatArray | float,
    error: FloatArray,
    prior: FloatArray | float,
    spread: FloatArray | float,
) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation of a Gaussian estimate with a Gaussian prior.

    Examples
    --------
    >>> mean, deviation = weighted(1.0, np.array([3.0]), 0.0, 4.0)
    >>> mean.round(2), deviation.round(2)
    (array([0.64]), array([2.4]))
    """
    share = spread**2 / (spread**2 + error**2)
    return np.asarray(share * estimate + (1 - share) * prior), np.asarray(error * np.sqrt(share))


Kind = TypeVar("Kind")

# A start is this many times wider than the posterior is expected to be.
OVERDISPERSION = 3.0
TRIES = 1000


class UnsuitableModelError(ValueError):
    """Something, such as a closed form, bound or quadrature, does not exist for this model."""


class StartError(ValueError):
    """No starting points with a finite posterior: the message says which prior excludes them."""


class Likelihood(Protocol):
    """What a model needs of a likelihood: a picklable object that holds the data."""

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,), of parameter vectors, shape (n, d)."""

    def simulate(self, parameters: FloatArray, generator: Generator) -> Any:
        """Data drawn for one parameter vector, shape (d,)."""

    def given(self, data: Any) -> Self:
        """The same likelihood with other data: what `simulate` returns."""

    def start(self) -> tuple[FloatArray, FloatArray]:
        """A rough estimate and its rough standard error, both of shape (d,)."""

    def checks(self, data: Any | None = None) -> dict[str, float]:
        """Numbers that predictive checks compare, of other data or of its own."""


@runtime_checkable
class Estimated(Protocol):
    """A likelihood whose data have a published estimator, with intervals of its own."""

    def estimate(self) -> tuple[FloatArray, FloatArray]:
        """Estimates and standard errors, both of shape (d,).

        They are those of the published method, which may know less than the model does. Both are
        NaN, whatever the data, where the method gives none for a parameter.
        """


@runtime_checkable
class Latent(Protocol):
    """A likelihood with something hidden that is summed out, and that the data tell of."""

    def repeat(self, parameters: FloatArray, generator: Generator) -> Any:
        """Data of a repeat, the hidden thing drawn given the present data, not from its prior."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model.

    - `name`: its name in tables and files, such as ``shift-x``.
    - `label`: its symbol for axes, in TeX without dollar signs.
    - `unit`: the unit in which it is shown.
    - `prior`: its prior, in SI units or px.
    - `shown`: how many shown units one SI unit is: ARCSEC_PER_RADIAN for an angle shown in arcsec.
    - `natural`: ends of the prior at which the quantity itself ends: to lie there is an answer.
    """

    name: str
    label: str
    unit: str
    prior: Prior
    shown: float = 1.0
    natural: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Model:
    """A model with its data.

    - `name`: what it is called in tables, messages and stored runs.
    - `parameters`: in the order of the columns of every parameter array.
    - `likelihood`: the log likelihood with its data.
    - `estimate`: the published or least-squares point estimate, by parameter, where there is one;
      SI.
    - `derived`, optional: consequences of the parameters.

    Examples
    --------
    See `reproduce.inference.models.registration.registration_model`.
    """

    name: str
    parameters: tuple[Parameter, ...]
    likelihood: Likelihood
    estimate: Mapping[str, float] = field(default_factory=dict)
    derived: Derived | None = None

    def likelihood_of(self, kind: type[Kind]) -> Kind:
        """The likelihood, if it is of a kind; else an `UnsuitableModelError`."""
        if not isinstance(self.likelihood, kind):
            got = type(self.likelihood).__name__
            raise UnsuitableModelError(f"{self.name}: expected a {kind.__name__}, got {got}")
        return self.likelihood

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def dimension(self) -> int:
        """The number of parameters."""
        return len(self.parameters)

    def log_prior(self, parameters: FloatArray) -> FloatArray:
        """Log prior density, shape (n,), of vectors of shape (n, d)."""
        total = np.zeros(len(parameters))
        for column, parameter in zip(parameters.T, self.parameters, strict=True):
            total += parameter.prior.log_density(column)
        return total

    def coordinates(self) -> Coordinates:
        """Coordinates in which ensembles move; they never show in the draws."""
        likelihood = self.likelihood
        return likelihood.coordinates() if isinstance(likelihood, Straightened) else Declared()

    def log_likelihood(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,), of vectors of shape (n, d)."""
        return self.likelihood(parameters)

    def log_posterior(self, parameters: FloatArray) -> FloatArray:
        """Log prior plus log likelihood, shape (n,); the likelihood sees supported values only."""
        total = self.log_prior(parameters)
        inside = np.isfinite(total)
        if inside.all():
            total += self.likelihood(parameters)
        elif inside.any():
            total[inside] += self.likelihood(parameters[inside])
        return np.where(np.isnan(total), -np.inf, total)

    def draw_prior(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws from the prior, shape (count, d)."""
        columns = [p.prior.draw(generator, count) for p in self.parameters]
        return np.stack(columns, axis=-1)

    def simulate(self, parameters: FloatArray, generator: Generator) -> Any:
        """Data that one parameter vector, shape (d,), would have given."""
        return self.likelihood.simulate(parameters, generator)

    def repeat(self, parameters: FloatArray, generator: Generator) -> Any:
        """Data of a repeat of this experiment, for one parameter vector of the posterior."""
        if isinstance(self.likelihood, Latent):
            return self.likelihood.repeat(parameters, generator)
        return self.likelihood.simulate(parameters, generator)

    def given(self, data: Any) -> Model:
        """The same model with other data; point estimates do not carry over."""
        return replace(self, likelihood=self.likelihood.given(data), estimate={})

    def start(self, generator: Generator, walkers: int) -> FloatArray:
        """Over-dispersed starting points about a displaced centre, shape (walkers, d).

        The displacement belongs to the ensemble, so that ensembles start apart from each other.
        Where hardly any point has a finite posterior, a `StartError` says so.
        """
        rough, spread = self.likelihood.start()
        centre = rough + OVERDISPERSION * spread * generator.normal(size=self.dimension)
        points = np.empty((0, self.dimension))
        for attempt in range(TRIES):
            # A displaced centre may lie outside the support: let the scatter grow back to it.
            wider = OVERDISPERSION * (1 + attempt / 20)
            tried = centre + wider * spread * generator.normal(size=(walkers, self.dimension))
            points = np.concatenate([points, tried[np.isfinite(self.log_posterior(tried))]])
            if len(points) >= walkers:
                return points[:walkers]
        raise StartError(f"{self.name}: nowhere to start from: {self._excluded(rough)}")

    def _excluded(self, rough: FloatArray) -> str:
        """Why a rough estimate, shape (d,), has no finite posterior, and what to do."""
        for value, one in zip(rough.tolist(), self.parameters, strict=True):
            if not np.isfinite(one.prior.log_density(np.array([value]))[0]):
                prior = one.prior.in_unit(one.shown)
                return (
                    f"the rough estimate of {one.name} is {value * one.shown:.6g} "
                    f"{one.unit}, its prior {prior}; check the data, or widen the prior"
                )
        return (
            "hardly any point near the rough estimate has a finite posterior; check the data for "
            "values that are alike, far off or without noise"
        )


class Derived(Protocol):
    """Consequences of a model's parameters."""

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Named consequences of parameter vectors of shape (n, d)."""


@dataclass(frozen=True, eq=False)
class Consequence:
    """A consequence with its draws.

    - `values`, (n,): in the unit shown.
    - `unit`: that unit.
    - `meaning`: what it is, in a few words.
    """

    values: FloatArray
    unit: str
    meaning: str
