"""How a posterior answers when prior or likelihood is made a little stronger or weaker.

Raising prior or likelihood to a power near one only reweights the draws (Kallioinen, Paananen,
Bürkner and Vehtari, 2024). A parameter that answers to the prior but not to the likelihood is held
by the prior alone; one that answers to both is a compromise of the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reproduce.inference.pareto import smoothed
from reproduce.inference.posterior import Posterior
from reproduce.physics.validate import FloatArray

POWERS = (0.8, 1.25)
# From here on a change is worth a word: the threshold of the method's authors.
NOTABLE = 0.05


@dataclass(frozen=True)
class Sensitivity:
    """The answers of one parameter.

    Parameters
    ----------
    name : str
        The parameter.
    prior, likelihood : float
        Change of the distribution per doubling of the power: distance between the distributions
        at the two powers, as the root of the Jensen-Shannon divergence of their histograms.
    shift : float
        Change of the mean per doubling of the prior's power, in posterior standard deviations.
    shape : float
        Largest Pareto k of the weights; above 0.7 the numbers are not to be trusted.
    """

    name: str
    prior: float
    likelihood: float
    shift: float
    shape: float


def sensitivities(posterior: Posterior) -> list[Sensitivity]:
    """Return the sensitivity of every parameter to prior and likelihood.

    Parameters
    ----------
    posterior : Posterior
        Draws.

    Returns
    -------
    list of Sensitivity
        In the order of the parameters.
    """
    draws = posterior.draws
    model = posterior.model
    logs = {"prior": model.log_prior(draws), "likelihood": model.log_likelihood(draws)}
    weights, shapes = {}, []
    for which, log in logs.items():
        for power in POWERS:
            found, shape = smoothed((power - 1) * log)
            weights[which, power] = np.exp(found)
            shapes.append(shape)
    doublings = np.log2(POWERS[1] / POWERS[0])
    rows = []
    for name, column in zip(model.names, draws.T, strict=True):
        apart = {
            which: _distance(column, weights[which, POWERS[0]], weights[which, POWERS[1]])
            / doublings
            for which in logs
        }
        means = [float(column @ weights["prior", power]) for power in POWERS]
        shift = (means[1] - means[0]) / doublings / column.std()
        rows.append(
            Sensitivity(name, apart["prior"], apart["likelihood"], float(shift), max(shapes))
        )
    return rows


def _distance(values: FloatArray, left: FloatArray, right: FloatArray) -> float:
    """Root of the Jensen-Shannon divergence (base 2) of two weightings, over thirty bins."""
    edges = np.quantile(values, np.linspace(0, 1, 31))
    bins = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, 29)
    one, two = (np.bincount(bins, weights, minlength=30) for weights in (left, right))
    middle = 0.5 * (one + two)
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = [np.where(p > 0, p * np.log2(p / middle), 0.0).sum() for p in (one, two)]
    return float(np.sqrt(max(0.5 * sum(parts), 0.0)))
