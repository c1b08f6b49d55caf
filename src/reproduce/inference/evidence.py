"""Evidence of a model by importance sampling, with its uncertainty.

The proposal is a Student-t laid over posterior draws; the estimate is unbiased for any proposal
that covers the posterior, and the Pareto k of its weights tells whether this one does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import PCG64, Generator
from scipy.special import logsumexp
from scipy.stats import multivariate_t

from reproduce.inference.model import UnsuitableModelError
from reproduce.inference.pareto import RELIABLE, smoothed
from reproduce.inference.posterior import Posterior
from reproduce.inference.priors import Prior
from reproduce.physics.validate import FloatArray

DEGREES = 5
WIDER = 1.3
# Nodes per parameter, and how far beyond the draws they reach, in widths of the draws.
NODES = {1: 300, 2: 120}
BEYOND = 0.25
# Points that are worked on at once: bounds the memory.
CHUNK = 1000


@dataclass(frozen=True)
class Evidence:
    """A log evidence.

    Parameters
    ----------
    name : str
        The model.
    value, error : float
        Natural logarithm, and its Monte Carlo standard error.
    shape : float
        Pareto k of the importance weights.
    """

    name: str
    value: float
    error: float
    shape: float

    @property
    def reliable(self) -> bool:
        """Whether the weights can be trusted."""
        return self.shape < RELIABLE


def log_evidence(posterior: Posterior, seed: int, draws: int = 8_000) -> Evidence:
    """Return the log evidence of a sampled model.

    Parameters
    ----------
    posterior : Posterior
        Draws that place the proposal.
    seed : int
        Of the importance draws.
    draws : int
        How many of them.

    Returns
    -------
    Evidence
        Value, error and Pareto k.
    """
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


def small_log_evidence(posterior: Posterior, finer: float = 1) -> float:
    """Log evidence of a model of one or two parameters by Gauss-Legendre quadrature.

    Parameters
    ----------
    posterior : Posterior
        Draws that tell where the posterior lies.
    finer : float
        Multiplies the number of nodes.

    Returns
    -------
    float
        The sum adds an error far below a thousandth, for the posteriors are smooth. What remains
        is the error of the log likelihood itself: for boxes of printed numbers, that of
        `boxes.log_box_by_rule` or `censored.log_box`, averaged over the posterior.

    Raises
    ------
    UnsuitableModelError
        If the model has more parameters.
    """
    model = posterior.model
    if model.dimension not in NODES:
        raise UnsuitableModelError(
            f"{model.name}: expected at most {max(NODES)} parameters, got {model.dimension}; use "
            "`log_evidence`"
        )
    nodes, weights = np.polynomial.legendre.leggauss(round(finer * NODES[model.dimension]))
    axes, logs = [], []
    for column, parameter in zip(posterior.draws.T, model.parameters, strict=True):
        low, high = _reach(parameter.prior, column)
        axes.append(low + (nodes + 1) / 2 * (high - low))
        logs.append(np.log(weights * (high - low) / 2))
    points = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=-1)
    total = sum(axis.ravel() for axis in np.meshgrid(*logs, indexing="ij"))
    parts = [model.log_posterior(points[i : i + CHUNK]) for i in range(0, len(points), CHUNK)]
    return float(logsumexp(np.concatenate(parts) + total))


def _reach(prior: Prior, draws: FloatArray) -> tuple[float, float]:
    """Ends well beyond the draws, but not beyond the support of the prior."""
    least, most = float(draws.min()), float(draws.max())
    beyond = BEYOND * (most - least)
    return _supported(prior, least, least - beyond), _supported(prior, most, most + beyond)


def _supported(prior: Prior, inside: float, outside: float) -> float:
    """The farthest point between two, from the first on, where the prior is not zero."""
    if np.isfinite(prior.log_density(np.array(outside))):
        return outside
    for _ in range(60):
        middle = 0.5 * (inside + outside)
        supported = np.isfinite(prior.log_density(np.array(middle)))
        inside, outside = (middle, outside) if supported else (inside, middle)
    return inside
