"""How a posterior answers when prior or likelihood is made a little stronger or weaker.

Raising prior or likelihood to a power near one only reweights the draws (Kallioinen, Paananen,
Bürkner and Vehtari, 2024). A parameter that answers to the prior but not to the likelihood is held
by the prior alone; one that answers to both is a compromise of the two. A flat prior stays what it
is under any power, and its ends do not move: where they hold the posterior, only draws near an end
show it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reproduce.inference.evidence import smoothed
from reproduce.inference.posterior import Sampled
from reproduce.inference.priors import (
    HalfNormal,
    LogNormal,
    LogUniform,
    Normal,
    Prior,
    Uniform,
)
from reproduce.physics.validate import FloatArray

__all__ = ["CROWDED", "NEAR", "NOTABLE", "leanings", "sensitivities"]

POWERS = (0.8, 1.25)
# From here on a change is worth a word: the threshold of the method's authors.
NOTABLE = 0.05
# A posterior well inside a flat prior has hardly a draw so near to its ends.
NEAR, CROWDED = 0.02, 0.01

# A Gaussian that an end cuts two standard deviations from its mean has so large a share of its
# draws within so many standard deviations of the end; one that the end does not reach has none.
BESIDE, LEANING = 0.1, 0.005
# Further out than so many standard deviations a Gaussian prior contradicts the data.
CONTRADICTED = 3.0


@dataclass(frozen=True)
class Sensitivity:
    """The answers of one parameter.

    - `name`: the parameter.
    - `prior`, `likelihood`: change of the distribution per doubling of the power: the root of the
      cumulative Jensen-Shannon divergence between the posterior and that at another power, the mean
      of one power below and one above.
    - `shift`: change of the mean per doubling of the prior's power, in posterior standard
      deviations.
    - `errors`: Monte Carlo standard errors of these three.
    - `shape`: largest Pareto k of the weights; above 0.7 the numbers are not to be trusted.
    - `near_end`: share of draws within `NEAR` of an end of a flat prior, in widths of the prior.
    """

    name: str
    prior: float
    likelihood: float
    shift: float
    errors: tuple[float, ...]
    shape: float
    near_end: float

    @property
    def held_by_end(self) -> bool:
        """Whether the posterior reaches an end of a flat prior, which then bounds it."""
        return self.near_end > CROWDED

    @property
    def held_by(self) -> str:
        """What holds the posterior, in a few words."""
        if self.held_by_end:
            return "an end of the flat prior holds it"
        if self.prior < NOTABLE:
            return "as it should be"
        return "prior and data" if self.likelihood >= NOTABLE else "the prior holds it"


def sensitivities(posterior: Sampled) -> list[Sensitivity]:
    """Return the sensitivity of every parameter to prior and likelihood.

    The errors are those of the jackknife that leaves out one ensemble after the other.
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
    ends = [
        _near_end(parameter.prior, column)
        for parameter, column in zip(model.parameters, draws.T, strict=True)
    ]
    rows = zip(model.names, found.tolist(), errors.tolist(), ends, strict=True)
    return [
        Sensitivity(name, prior, likelihood, shift, tuple(error), shape, end)
        for name, (prior, likelihood, shift), error, end in rows
    ]


def _near_end(prior: Prior, draws: FloatArray) -> float:
    place = prior.place(draws)
    return 0.0 if place is None else float((np.minimum(place, 1 - place) < NEAR).mean())


@dataclass(frozen=True)
class Leaning:
    """A parameter whose posterior leans on its prior.

    - `parameter`: which.
    - `end`: the end of the prior on which it leans, in the unit shown; none for a Gaussian prior,
      in whose tail it lies.
    - `unit`, `prior`: the unit shown, and the prior in words.
    - `share`: share of draws beside the end; for a Gaussian prior how many of its standard
      deviations the posterior's mean lies out.
    """

    parameter: str
    end: float | None
    unit: str
    prior: str
    share: float

    def __str__(self) -> str:
        """What leans where, in one line."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        if self.end is None:
            return (
                f"{self.parameter} lies {self.share:.1f} standard deviations out in its prior "
                f"({self.prior}{unit}), which pulls it"
            )
        return (
            f"{self.parameter} leans on the end {self.end:.4g}{unit} of its prior ({self.prior}"
            f"{unit}): what is printed of it is a limit, not an estimate"
        )


def leanings(posterior: Sampled) -> list[Leaning]:
    """Return the parameters whose posterior leans on an end of a prior, or lies in its tail."""
    found = []
    for parameter, column in zip(
        posterior.model.parameters, np.moveaxis(posterior.chain, -1, 0), strict=True
    ):
        shown = parameter.prior.in_unit(parameter.shown)
        for end, share in _leaning(parameter.prior, column.ravel()):
            place = None if end is None else end * parameter.shown
            found.append(Leaning(parameter.name, place, parameter.unit, str(shown), share))
    return found


def _leaning(prior: Prior, draws: FloatArray) -> list[tuple[float | None, float]]:
    if isinstance(prior, Normal | LogNormal):
        place = prior.mean if isinstance(prior, Normal) else np.log(prior.median)
        values = draws if isinstance(prior, Normal) else np.log(draws)
        out = float(abs(values.mean() - place) / prior.sigma)
        return [(None, out)] if out > CONTRADICTED else []
    ends: tuple[float, ...] = ()
    if isinstance(prior, Uniform | LogUniform):
        ends = (prior.low, prior.high)
    elif isinstance(prior, HalfNormal):
        ends = (0.0,)
    # In the scale in which the prior is flat.
    scale = np.log if isinstance(prior, LogUniform) else np.asarray
    values = scale(draws)
    beside = BESIDE * values.std()
    shares = [(end, float((np.abs(values - scale(end)) < beside).mean())) for end in ends]
    return [(end, share) for end, share in shares if share > LEANING]


def _answers(draws: FloatArray, logs: tuple[FloatArray, ...]) -> tuple[FloatArray, float]:
    """Distances under prior and likelihood and shift of the mean, (d, 3); largest Pareto k."""
    weighted = [[smoothed((power - 1) * log) for power in POWERS] for log in logs]
    shape = max(shape for pair in weighted for _, shape in pair)
    pairs = [[np.exp(log) for log, _ in pair] for pair in weighted]
    doublings = np.abs(np.log2(POWERS))
    rows = []
    for column in draws.T:
        order = np.argsort(column)
        apart = [
            np.mean([_distance(column[order], one[order]) for one in pair] / doublings)
            for pair in pairs
        ]
        less, more = (float(column @ weights) for weights in pairs[0])
        rows.append([*apart, (more - less) / column.std() / doublings.sum()])
    return np.array(rows), shape


def _distance(values: FloatArray, weights: FloatArray) -> float:
    """Root of the cumulative Jensen-Shannon divergence of sorted draws and draws with weights.

    Symmetric, over its upper bound, so from zero to one; the larger of that of the values and that
    of their negatives, since distribution functions count from below (Kallioinen et al., 2024,
    after Nguyen and Vreeken, 2015).
    """
    steps = np.diff(values)
    from_below = np.cumsum(weights)[:-1]
    even = np.arange(1, len(values)) / len(values)
    return max(
        _root(even, from_below, steps), _root(1 - even, np.maximum(1 - from_below, 0), steps)
    )


def _root(one: FloatArray, two: FloatArray, steps: FloatArray) -> float:
    """The same of two distribution functions, each constant over steps between values."""
    middle = 0.5 * (one + two)
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = [np.where(p > 0, p * np.log2(p / middle), 0.0) @ steps for p in (one, two)]
    # The integrals of both, which the divergence adds with opposite signs, cancel in the sum.
    return float(np.sqrt(max(sum(parts), 0.0) / ((one + two) @ steps)))
