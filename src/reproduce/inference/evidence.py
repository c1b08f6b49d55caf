"""Evidence of a model by importance sampling, with its uncertainty.

The proposal is a Student-t laid over posterior draws; the estimate is unbiased for any proposal
that covers the posterior, and the Pareto k of its weights tells whether this one does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import PCG64, Generator
from scipy.stats import multivariate_t

from reproduce.inference.pareto import RELIABLE, smoothed
from reproduce.inference.posterior import Posterior

DEGREES = 5
WIDER = 1.3


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
