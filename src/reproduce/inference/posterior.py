"""Draws of a posterior with all that is needed to report them, and warnings.

A predictive check asks whether the model would give data like these: parameters are drawn from the
posterior, and data are simulated with them. A posterior may lean on an end of a prior, or lie in
its tail.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from reproduce.inference import diagnostics
from reproduce.inference.model import Consequence, LogUniform, Model, Normal, Prior
from reproduce.physics.validate import FloatArray

_ENDS = (0.025, 0.975)
# Simulated data sets of a predictive check; a misfit is told that is so improbable, shared among
# all numbers, by chance.
REPORTED, MISSED = 1000, 0.01
# A Gaussian that an end cuts two standard deviations from its mean has so large a share of its
# draws within so many standard deviations of the end; one that the end does not reach has none.
BESIDE, LEANING = 0.1, 0.005
# Further out than so many standard deviations a Gaussian prior contradicts the data.
_CONTRADICTED = 3.0


@dataclass(frozen=True)
class Summary:
    """The summary of one parameter or consequence, in the unit shown.

    - `name`, `unit`: which, and its unit.
    - `mean`, `deviation`, `low`, `median`, `high`: mean, standard deviation, and the median between
      the ends of the central 95 %.
    - `mcse`, `mcse_end`: Monte Carlo standard error of the mean, and the larger one of the two
      ends.
    - `rhat`, `bulk`, `tail`, `time`: split R-hat, effective sample sizes, autocorrelation time in
      steps.
    """

    name: str
    unit: str
    mean: float
    deviation: float
    low: float
    median: float
    high: float
    mcse: float
    mcse_end: float
    rhat: float
    bulk: float
    tail: float
    time: float


@dataclass(frozen=True, eq=False)
class Sampled:
    """Draws that passed the gates.

    - `model`: what was sampled.
    - `seed`: root of its random numbers.
    - `chain`, (ensembles, steps, walkers, d): all draws after warm-up.
    - `log_posterior`, (ensembles, steps, walkers): unnormalised.
    - `acceptance`: of each ensemble.
    - `diagnoses`: of each parameter.
    - `gates`, optional: what consequences must reach too, but for the number of autocorrelation
      times, which is that of the parameters.
    """

    model: Model
    seed: int
    chain: FloatArray
    log_posterior: FloatArray
    acceptance: tuple[float, ...]
    diagnoses: tuple[diagnostics.Diagnosis, ...]
    gates: diagnostics.Gates | None = None

    @property
    def time(self) -> float:
        """The largest autocorrelation time of all parameters, in steps."""
        return max(one.time for one in self.diagnoses)

    @cached_property
    def draws(self) -> FloatArray:
        """Nearly independent draws, shape (n, d): thinned by the autocorrelation time."""
        return np.concatenate(diagnostics.thinned(self.chain, self.time))

    def rows(self) -> list[Summary]:
        """Return the summary of every parameter, in the unit shown."""
        return self._rows

    @cached_property
    def _rows(self) -> list[Summary]:
        known = self.diagnoses or diagnostics.diagnose(self.model.names, self.chain)
        return [
            _summarised(
                parameter.name,
                parameter.unit,
                self.chain[..., column] * parameter.shown,
                replace(one, mcse=one.mcse * parameter.shown),
            )
            for column, (parameter, one) in enumerate(
                zip(self.model.parameters, known, strict=True)
            )
        ]

    def summaries(self) -> list[Summary]:
        """Return the summaries of parameters, then of consequences."""
        return [*self.rows(), *(row for row, _ in self.consequences())]

    def consequences(self) -> list[tuple[Summary, Consequence]]:
        """Return the summary of every derived quantity, of draws thinned as `draws` are.

        One that misses a gate is an `UnconvergedError`.
        """
        if self.gates is not None:
            gates = replace(self.gates, times=0.0)
            diagnoses = tuple(_diagnosis(row, self.chain.shape[1]) for row, _ in self._consequences)
            diagnostics.require(diagnoses, self.acceptance, gates)
        return self._consequences

    @cached_property
    def _consequences(self) -> list[tuple[Summary, Consequence]]:
        if self.model.derived is None:
            return []
        stride = max(1, int(np.ceil(self.time)))
        chain = self.chain[:, ::stride]
        found = self.model.derived(chain.reshape(-1, self.model.dimension))
        rows = []
        for name, quantity in found.items():
            values = quantity.values.reshape(chain.shape[:3])
            row = _summarised(name, quantity.unit, values, diagnostics.diagnosed(name, values))
            rows.append((replace(row, time=stride * row.time), quantity))
        return rows

    def to_datatree(self) -> Any:
        """Convert to a DataTree as ArviZ reads it: a chain per ensemble, thinned by its time.

        Its groups are ``posterior`` (a variable per parameter, in the unit shown, with that unit
        and its prior as attributes) and ``sample_stats`` (log posterior; acceptance of each chain).
        """
        try:
            import arviz_base
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError(
                "expected arviz-base, got none; install reproduce-pointing[netcdf]"
            ) from error
        draws = diagnostics.thinned(self.chain, self.time)
        parameters = self.model.parameters
        posterior = {one.name: draws[..., i] * one.shown for i, one in enumerate(parameters)}
        stats = {"lp": diagnostics.thinned(self.log_posterior, self.time)}
        tree = arviz_base.from_dict({"posterior": posterior, "sample_stats": stats})
        for one in parameters:
            prior = str(one.prior.in_unit(one.shown))
            tree["posterior"][one.name].attrs = {
                "units": one.unit, "prior": prior, "reason": one.prior.reason
            }  # fmt: skip
        tree["sample_stats"].attrs["acceptance"] = list(self.acceptance)
        tree.attrs |= {"model": self.model.name, "seed": self.seed}
        return tree


def _diagnosis(row: Summary, steps: int) -> diagnostics.Diagnosis:
    return diagnostics.Diagnosis(
        row.name, row.rhat, row.time, steps / row.time, row.bulk, row.tail, row.mcse
    )


def _summarised(name: str, unit: str, values: FloatArray, known: diagnostics.Diagnosis) -> Summary:
    """Summarise a quantity in the unit of its values, with its numbers from `diagnosed`."""
    low, median, high = np.quantile(values, (_ENDS[0], 0.5, _ENDS[1]))
    return Summary(
        name,
        unit,
        float(values.mean()),
        float(values.std()),
        float(low),
        float(median),
        float(high),
        known.mcse,
        max(diagnostics.mcse_quantile(values, end) for end in _ENDS),
        known.rhat,
        known.bulk,
        known.tail,
        known.time,
    )


@dataclass(frozen=True)
class PredictiveCheck:
    """One number of the data among those of simulated data.

    - `name`: what is compared.
    - `observed`: in the data.
    - `low`, `high`: the central 95 % of the predictions from the posterior.
    - `tail`: two-sided tail probability of the observed number among them.
    """

    name: str
    observed: float
    low: float
    high: float
    tail: float


def posterior_checks(posterior: Sampled, replicates: int = REPORTED) -> list[PredictiveCheck]:
    """Compare every number of `Likelihood.checks` with simulations from the posterior."""
    model = posterior.model
    generator = Generator(PCG64(SeedSequence(posterior.seed, spawn_key=(99,))))
    chosen = posterior.draws[np.linspace(0, len(posterior.draws) - 1, replicates).astype(int)]
    found = [model.likelihood.checks(model.repeat(one, generator)) for one in chosen]
    rows = []
    for name, observed in model.likelihood.checks().items():
        values = np.array([one[name] for one in found])
        low, high = np.quantile(values, _ENDS).tolist()
        rows.append(PredictiveCheck(name, observed, low, high, _two_sided(values, observed)))
    return rows


def misfit(checks: Sequence[PredictiveCheck]) -> str:
    """Say in one line which numbers of the data the model would not give; empty if there is none.

    Examples
    --------
    >>> misfit([PredictiveCheck("rms (px)", 4.0, 0.9, 1.1, 0.0)])
    'the model does not fit: rms (px) is 4, in 95 % of its repeats 0.9 to 1.1'
    """
    told = [
        f"{one.name} is {one.observed:.3g}, in 95 % of its repeats {one.low:.3g} to {one.high:.3g}"
        for one in checks
        if one.tail < MISSED / len(checks)
    ]
    return f"the model does not fit: {'; '.join(told)}" if told else ""


def _two_sided(values: FloatArray, observed: float) -> float:
    """Two-sided tail probability of a number among draws, ties counted half.

    Examples
    --------
    >>> _two_sided(np.array([1.0, 2.0, 3.0, 4.0]), 2.5)
    1.0
    """
    below = (values < observed).mean() + 0.5 * (values == observed).mean()
    return float(min(1.0, 2 * min(below, 1 - below)))


@dataclass(frozen=True)
class _Leaning:
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


def leanings(posterior: Sampled) -> list[_Leaning]:
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
            found.append(_Leaning(parameter.name, place, parameter.unit, str(shown), share))
    return found


def _leaning(prior: Prior, draws: FloatArray) -> list[tuple[float | None, float]]:
    if isinstance(prior, Normal):
        out = float(abs(draws.mean() - prior.mean) / prior.sigma)
        return [(None, out)] if out > _CONTRADICTED else []
    # In the scale in which the prior is flat.
    scale = np.log if isinstance(prior, LogUniform) else np.asarray
    values = scale(draws)
    beside = BESIDE * values.std()
    shares = [
        (end, float((np.abs(values - scale(end)) < beside).mean()))
        for end in (prior.low, prior.high)
    ]
    return [(end, share) for end, share in shares if share > LEANING]
