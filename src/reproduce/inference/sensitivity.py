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
    errors : tuple of float
        Monte Carlo standard errors of these three.
    shape : float
        Largest Pareto k of the weights; above 0.7 the numbers are not to be trusted.
    """

    name: str
    prior: float
    likelihood: float
    shift: float
    errors: tuple[float, ...]
    shape: float


def sensitivities(posterior: Posterior) -> list[Sensitivity]:
    """Return the sensitivity of every parameter to prior and likelihood.

    The errors are those of the jackknife that leaves out one ensemble after the other.

    Parameters
    ----------
    posterior : Posterior
        Draws.

    Returns
    -------
    list of Sensitivity
        In the order of the parameters.
    """
    draws, model = posterior.draws, posterior.model
    logs = (model.log_prior(draws), model.log_likelihood(draws))
    found, shape = _answers(draws, logs)
    ensembles = len(posterior.chain)
    blocks = np.arange(len(draws)) * ensembles // len(draws)
    without = np.stack(
        [
            _answers(draws[rest], tuple(log[rest] for log in logs))[0]
            for rest in (blocks != block for block in range(ensembles))
        ]
    )
    errors = np.sqrt((ensembles - 1) * without.var(axis=0))
    rows = zip(model.names, found.tolist(), errors.tolist(), strict=True)
    return [
        Sensitivity(name, prior, likelihood, shift, tuple(error), shape)
        for name, (prior, likelihood, shift), error in rows
    ]


def _answers(draws: FloatArray, logs: tuple[FloatArray, ...]) -> tuple[FloatArray, float]:
    """Distances under prior and likelihood and shift of the mean, (d, 3); largest Pareto k."""
    weighted = [[smoothed((power - 1) * log) for power in POWERS] for log in logs]
    shape = max(shape for pair in weighted for _, shape in pair)
    pairs = [[np.exp(log) for log, _ in pair] for pair in weighted]
    doublings = np.log2(POWERS[1] / POWERS[0])
    rows = []
    for column in draws.T:
        apart = [_distance(column, left, right) for left, right in pairs]
        less, more = (float(column @ weights) for weights in pairs[0])
        rows.append([*apart, (more - less) / column.std()])
    return np.array(rows) / doublings, shape


def _distance(values: FloatArray, left: FloatArray, right: FloatArray) -> float:
    """Root of the Jensen-Shannon divergence (base 2) of two weightings, over thirty bins."""
    edges = np.quantile(values, np.linspace(0, 1, 31))
    bins = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, 29)
    one, two = (np.bincount(bins, weights, minlength=30) for weights in (left, right))
    middle = 0.5 * (one + two)
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = [np.where(p > 0, p * np.log2(p / middle), 0.0).sum() for p in (one, two)]
    return float(np.sqrt(max(0.5 * sum(parts), 0.0)))
