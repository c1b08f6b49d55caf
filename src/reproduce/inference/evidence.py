"""Importance sampling: weights smoothed by a Pareto tail, and the evidence of a sampled model.

The proposal is a Student-t laid over posterior draws; the estimate is unbiased for any proposal
that covers the posterior, and the Pareto k of its weights tells whether this one does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import PCG64, Generator
from scipy.special import logsumexp
from scipy.stats import multivariate_t

from reproduce.inference.model import Model, UnsuitableModelError
from reproduce.inference.posterior import Sampled
from reproduce.physics.validate import FloatArray

__all__ = ["Compared", "compared", "exact_evidence", "log_evidence", "smoothed"]

DEGREES = 5
WIDER = 1.3
# Below this shape the weighted mean is reliable (Vehtari et al., 2024).
RELIABLE = 0.7


@dataclass(frozen=True)
class Evidence:
    """A log evidence.

    - `name`: the model.
    - `value`, `error`: natural logarithm, and its Monte Carlo standard error.
    - `shape`: Pareto k of the importance weights.
    """

    name: str
    value: float
    error: float
    shape: float

    @property
    def reliable(self) -> bool:
        """Whether the weights can be trusted."""
        return self.shape < RELIABLE


@dataclass(frozen=True)
class Compared:
    """The evidence of one of several models of the same data.

    - `name`: the model.
    - `sampled`, optional: by importance sampling; none for a rival that has an exact one.
    - `exact`, optional: natural logarithm, in closed form or by quadrature, where there is one.
    - `less`, `error`: its best value less that of the first model, and the Monte Carlo standard
      error of that.
    """

    name: str
    sampled: Evidence | None
    exact: float | None
    less: float
    error: float


def log_evidence(posterior: Sampled, seed: int, draws: int = 8_000) -> Evidence:
    """Return the log evidence of a sampled model, from so many draws of the proposal."""
    model = posterior.model
    flat = posterior.draws
    mean, scale = flat.mean(axis=0), flat.std(axis=0)
    covariance = np.atleast_2d(np.cov((flat - mean) / scale, rowvar=False)) * WIDER**2
    proposal = multivariate_t(np.zeros(model.dimension), covariance, DEGREES)
    generator = Generator(PCG64(seed))
    scaled = np.asarray(proposal.rvs(draws, random_state=generator)).reshape(draws, -1)
    logs = model.log_posterior(mean + scale * scaled) - proposal.logpdf(scaled)
    logs = logs + np.log(scale).sum()
    largest = logs.max()
    weights = np.exp(logs - largest)
    error = weights.std() / weights.mean() / np.sqrt(draws)
    _, shape = smoothed(logs[np.isfinite(logs)])
    return Evidence(model.name, float(largest + np.log(weights.mean())), float(error), shape)


def exact_evidence(model: Model, way: Callable[[Model], float] | None) -> float | None:
    """Return the log evidence of a model without sampling, where there is a way to it."""
    try:
        return None if way is None else way(model)
    except UnsuitableModelError:
        return None


def compared(
    posterior: Sampled,
    rivals: Sequence[Model],
    way: Callable[[Model], float] | None,
    sample: Callable[[Model], Sampled],
) -> list[Compared]:
    """Compare a sampled model with its rivals, which are sampled only where nothing else does."""
    found: list[Compared] = []
    first, first_error = 0.0, 0.0
    for model in (posterior.model, *rivals):
        exact, sampled = exact_evidence(model, way), None
        value, error = exact or 0.0, 0.0
        if exact is None or not found:
            draws = sample(model) if found else posterior
            sampled = log_evidence(draws, draws.seed)
            value, error = (sampled.value, sampled.error) if exact is None else (exact, 0.0)
        if not found:
            first, first_error = value, error
        apart = float(np.hypot(error, first_error)) if found else 0.0
        found.append(Compared(model.name, sampled, exact, value - first, apart))
    return found


def smoothed(log_weights: FloatArray) -> tuple[FloatArray, float]:
    """Normalised log weights with the largest smoothed, and the Pareto shape k of the upper tail.

    Above 0.7 the weights are not to be trusted.

    Examples
    --------
    >>> weights, shape = smoothed(np.random.default_rng(1).normal(size=2000))
    >>> round(float(np.exp(weights).sum()), 9), shape < 0.7
    (1.0, True)
    """
    weights = log_weights - log_weights.max()
    count = len(weights)
    tail = int(np.ceil(min(0.2 * count, 3 * np.sqrt(count))))
    order = np.argsort(weights)
    cut = weights[order[-tail - 1]]
    excess = np.exp(weights[order[-tail:]]) - np.exp(cut)
    shape = -np.inf
    if tail >= 5 and excess[0] >= 0 and excess[-1] > 0:
        shape, scale = fitted_pareto(excess)
        quantiles = (np.arange(tail) + 0.5) / tail
        grown = (
            -np.log1p(-quantiles) if shape == 0 else np.expm1(-shape * np.log1p(-quantiles)) / shape
        )
        weights[order[-tail:]] = np.minimum(np.log(np.exp(cut) + scale * grown), 0.0)
    return weights - np.log(np.exp(weights).sum()), float(shape)


def fitted_pareto(values: FloatArray) -> tuple[float, float]:
    """Shape and scale of a generalised Pareto distribution (Zhang and Stephens, 2009).

    Of excesses over a threshold, sorted, the largest above zero. The shape is pulled a little
    towards one half as usual for small tails.
    """
    count = len(values)
    grid = 30 + int(np.sqrt(count))
    steps = 1 - np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))
    quarter = values[int(count / 4 + 0.5) - 1]
    slopes = steps / (3 * max(quarter, np.finfo(float).tiny)) + 1 / values[-1]
    shapes = np.log1p(-slopes[:, None] * values).mean(axis=1)
    likelihoods = count * (np.log(-slopes / shapes) - shapes - 1)
    weights = np.exp(likelihoods - logsumexp(likelihoods))
    slope = float((slopes * weights).sum())
    shape = float(np.log1p(-slope * values).mean())
    scale = -shape / slope
    return (shape * count + 5.0) / (count + 10), scale
