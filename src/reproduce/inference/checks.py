"""Predictive checks: would the model have given data like these?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from reproduce.inference.posterior import Posterior
from reproduce.physics.validate import FloatArray

REPLICATES = 400


@dataclass(frozen=True)
class Check:
    """One number of the data among those of simulated data.

    Parameters
    ----------
    name : str
        What is compared.
    observed : float
        In the data.
    prior, posterior : tuple of float
        Ends of the central 95 % of the predictions, from prior and from posterior.
    tail : float
        Two-sided tail probability of the observed number under the posterior prediction.
    mcse : float
        Its Monte Carlo standard error.
    """

    name: str
    observed: float
    prior: tuple[float, float]
    posterior: tuple[float, float]
    tail: float
    mcse: float


def predictive_checks(posterior: Posterior, replicates: int = REPLICATES) -> list[Check]:
    """Compare the data with simulations from prior and posterior.

    Parameters
    ----------
    posterior : Posterior
        Draws with their model.
    replicates : int
        Simulated data sets from each.

    Returns
    -------
    list of Check
        One for every number of `Likelihood.checks`.
    """
    model = posterior.model
    generator = Generator(PCG64(SeedSequence(posterior.seed, spawn_key=(99,))))
    chosen = posterior.draws[np.linspace(0, len(posterior.draws) - 1, replicates).astype(int)]
    drawn = {"prior": model.draw_prior(generator, replicates), "posterior": chosen}
    found = {
        which: [model.likelihood.checks(model.simulate(one, generator)) for one in vectors]
        for which, vectors in drawn.items()
    }
    rows = []
    for name, observed in model.likelihood.checks().items():
        values = {which: np.array([c[name] for c in checks]) for which, checks in found.items()}
        tail = two_sided(values["posterior"], observed)
        ends = {which: np.quantile(v, (0.025, 0.975)) for which, v in values.items()}
        error = float(np.sqrt(max(tail * (1 - tail), 1 / replicates) / replicates))
        rows.append(
            Check(name, observed, _pair(ends["prior"]), _pair(ends["posterior"]), tail, error)
        )
    return rows


def two_sided(values: FloatArray, observed: float) -> float:
    """Two-sided tail probability of a number among draws, ties counted half.

    Examples
    --------
    >>> two_sided(np.array([1.0, 2.0, 3.0, 4.0]), 2.5)
    1.0
    """
    below = (values < observed).mean() + 0.5 * (values == observed).mean()
    return float(min(1.0, 2 * min(below, 1 - below)))


def _pair(ends: FloatArray) -> tuple[float, float]:
    return float(ends[0]), float(ends[1])
