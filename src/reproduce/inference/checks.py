"""Data against simulations: predictive checks, and printed numbers among those of repeats.

A check asks whether the model would give data like these. A repeat asks whether the experiment
would print the same digits again: parameters are drawn from the posterior, the experiment is
simulated with them, and what the paper prints is computed in its way and rounded as in print.

Posteriors that lean on an end of a prior, or lie in its tail.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from reproduce.inference.posterior import Sampled
from reproduce.inference.priors import HalfNormal, LogNormal, LogUniform, Normal, Prior, Uniform
from reproduce.physics.validate import FloatArray

# Repeats of an experiment, and simulated data sets of a predictive check.
REPEATS, REPORTED = 4000, 1000
# A misfit is told that is so improbable, shared among all numbers, by chance.
MISSED = 0.01
ENDS = (0.025, 0.975)


@dataclass(frozen=True)
class Share:
    """A probability found by simulation.

    - `value`, `error`: the probability and its Monte Carlo standard error.
    - `count`: how many independent draws it rests on.
    - `sides`: two for a tail probability of both sides, which is twice a share.
    """

    value: float
    error: float
    count: int
    sides: int = 1

    @property
    def bound(self) -> float:
        """What none seen among so many leaves possible, with a probability of one in twenty."""
        return 3 * self.sides / self.count

    @classmethod
    def of(cls, values: FloatArray) -> Share:
        """Mean of probabilities, or of zeros and ones, of independent simulations.

        Examples
        --------
        >>> Share.of(np.array([0.0, 1.0, 1.0, 0.0])).value
        0.5
        """
        count = len(values)
        # All alike does not mean certain: as if one simulation in so many were different.
        least = np.sqrt(1 / count) if float(np.ptp(values)) == 0 else 0.0
        return cls(float(values.mean()), float(max(values.std(), least) / np.sqrt(count)), count)

    @classmethod
    def counted(cls, value: float, count: int) -> Share:
        """A share of so many simulations, with its binomial error.

        Examples
        --------
        >>> Share.counted(0.5, 100).error
        0.05
        """
        return cls(value, float(np.sqrt(max(value * (1 - value), 1 / count) / count)), count)


@dataclass(frozen=True)
class Range:
    """The central 95 % of predictions.

    - `low`, `high`: its ends.
    - `errors`: their Monte Carlo standard errors.
    """

    low: float
    high: float
    errors: tuple[float, float]

    @classmethod
    def of(cls, values: FloatArray) -> Range:
        """Range of independent predictions.

        Examples
        --------
        >>> Range.of(np.arange(1001.0)).low
        25.0
        """
        probabilities = np.array(ENDS)
        beside = np.sqrt(probabilities * (1 - probabilities) / len(values))
        low, high = np.quantile(values, ENDS)
        # Half the distance between the quantiles a standard error of the probability apart.
        above, below = (
            np.quantile(values, np.clip(probabilities + side * beside, 0, 1)) for side in (1, -1)
        )
        first, second = 0.5 * (above - below)
        return cls(float(low), float(high), (float(first), float(second)))

    def scaled(self, factor: float) -> Range:
        """The same in another unit."""
        first, second = (abs(factor) * error for error in self.errors)
        return Range(factor * self.low, factor * self.high, (first, second))


@dataclass(frozen=True)
class PredictiveCheck:
    """One number of the data among those of simulated data.

    - `name`: what is compared.
    - `observed`: in the data.
    - `posterior`: the central 95 % of the predictions from the posterior.
    - `tail`: two-sided tail probability of the observed number among them.
    """

    name: str
    observed: float
    posterior: Range
    tail: Share


def posterior_checks(posterior: Sampled, replicates: int = REPORTED) -> list[PredictiveCheck]:
    """Compare every number of `Likelihood.checks` with simulations from the posterior."""
    model, generator = posterior.model, _generator(posterior)
    chosen = posterior.draws[np.linspace(0, len(posterior.draws) - 1, replicates).astype(int)]
    found = [model.likelihood.checks(model.repeat(one, generator)) for one in chosen]
    rows = []
    for name, observed in model.likelihood.checks().items():
        values = np.array([one[name] for one in found])
        tail = tail_share(values, observed)
        rows.append(PredictiveCheck(name, observed, Range.of(values), tail))
    return rows


def misfit(checks: Sequence[PredictiveCheck]) -> str:
    """Say in one line which numbers of the data the model would not give; empty if there is none.

    Examples
    --------
    >>> rows = [PredictiveCheck("rms (px)", 4.0, Range(0.9, 1.1, (0, 0)), Share(0.0, 0.0, 1000))]
    >>> misfit(rows)
    'the model does not fit: rms (px) is 4, in 95 % of its repeats 0.9 to 1.1'
    """
    told = [
        f"{one.name} is {one.observed:.3g}, in 95 % of its repeats {one.posterior.low:.3g} to "
        f"{one.posterior.high:.3g}"
        for one in checks
        if one.tail.value < MISSED / len(checks)
    ]
    return f"the model does not fit: {'; '.join(told)}" if told else ""


def _generator(posterior: Sampled) -> Generator:
    return Generator(PCG64(SeedSequence(posterior.seed, spawn_key=(99,))))


def two_sided(values: FloatArray, observed: float) -> float:
    """Two-sided tail probability of a number among draws, ties counted half.

    Examples
    --------
    >>> two_sided(np.array([1.0, 2.0, 3.0, 4.0]), 2.5)
    1.0
    """
    below = (values < observed).mean() + 0.5 * (values == observed).mean()
    return float(min(1.0, 2 * min(below, 1 - below)))


def tail_share(values: FloatArray, observed: float) -> Share:
    """Two-sided tail probability of a number among independent draws, with its error.

    Examples
    --------
    >>> tail_share(np.array([1.0, 2.0, 3.0, 4.0]), 9.0).value
    0.0
    """
    tail, count = two_sided(values, observed), len(values)
    # Twice a share: its variance is four times that of the share of half the size.
    return Share(tail, float(np.sqrt(max(tail * (2 - tail), 1 / count) / count)), count, sides=2)


@dataclass(frozen=True, eq=False)
class Published:
    """What a paper prints of an experiment, and how a repeat of it is simulated.

    - `names`, `units`: of the m printed numbers.
    - `texts`: their digits.
    - `printed`, `half_units`, (m,): the numbers and half their last digits, in SI units or px.
    - `shown`, (m,): how many units of print one SI unit is.
    - `repeat`: gives the numbers of a repeat before rounding, shape (n, m), of parameter vectors of
      shape (n, d) and a generator.
    - `parameters`: the parameter that each number estimates, or an empty word.
    - `whole`, optional: log probability that a repeat prints all the same digits at once, shape
      (n,), of parameter vectors, where the likelihood knows it; else it is counted.
    - `note`: what the comparison cannot show, where the printed numbers made the data or are the
      data.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    texts: tuple[str, ...]
    printed: FloatArray
    half_units: FloatArray
    shown: FloatArray
    repeat: Callable[[FloatArray, Generator], FloatArray]
    parameters: tuple[str, ...]
    whole: Callable[[FloatArray], FloatArray] | None = None
    note: str = ""


@dataclass(frozen=True)
class Repeat:
    """One printed number among those of repeats.

    - `name`, `unit`: which, and the unit of print.
    - `printed`: the printed digits.
    - `range`: the central 95 % of repeats.
    - `tail`: two-sided tail probability of the printed number among the rounded ones of repeats.
    - `same`: probability that a repeat prints the same digits.
    - `estimated`, optional: two-sided tail probability in the posterior of the parameter that the
      number estimates.
    """

    name: str
    unit: str
    printed: str
    range: Range
    tail: Share
    same: Share
    estimated: Share | None


def repeats(
    posterior: Sampled, published: Published, replicates: int = REPEATS
) -> tuple[list[Repeat], Share]:
    """Simulate repeats of the experiment under the posterior and compare their digits.

    One `Repeat` for each printed number, and the probability that a repeat prints all of them
    alike, at once.
    """
    draws = posterior.draws
    chosen = draws[np.linspace(0, len(draws) - 1, min(replicates, len(draws))).astype(int)]
    generator = Generator(PCG64(SeedSequence(posterior.seed, spawn_key=(98,))))
    found = published.repeat(chosen, generator)
    same = _same_digits(found, published)
    together = same.all(axis=1).astype(float)
    if published.whole is not None:
        together = np.exp(published.whole(chosen))
    rows = [_row(posterior, published, found[:, i], same[:, i], i) for i in range(found.shape[1])]
    return rows, Share.of(together)


def _row(
    posterior: Sampled, published: Published, found: FloatArray, same: FloatArray, i: int
) -> Repeat:
    unit, printed = 2 * published.half_units[i], float(published.printed[i])
    name, estimated = published.parameters[i], None
    if name:
        column = posterior.draws[:, posterior.model.names.index(name)]
        estimated = tail_share(column, printed)
    return Repeat(
        published.names[i],
        published.units[i],
        published.texts[i],
        Range.of(found).scaled(published.shown[i]),
        tail_share(np.round(found / unit), float(np.round(printed / unit))),
        Share.of(same.astype(float)),
        estimated,
    )


def _same_digits(found: FloatArray, published: Published) -> FloatArray:
    """Tell which numbers of repeats, shape (n, m), round to the printed digits."""
    # Numbers that come rounded lie in the middle of the interval, so its ends do not matter.
    return np.asarray(np.abs(found - published.printed) <= published.half_units)


# A Gaussian that an end cuts two standard deviations from its mean has so large a share of its
# draws within so many standard deviations of the end; one that the end does not reach has none.
BESIDE, LEANING = 0.1, 0.005
# Further out than so many standard deviations a Gaussian prior contradicts the data.
CONTRADICTED = 3.0


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
            if end in parameter.natural:
                continue
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
