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
from reproduce.inference.diagnostics import Summary
from reproduce.inference.model import LogUniform, Model, Normal, Prior
from reproduce.inference.modes import Modes, two_modes
from reproduce.physics.validate import FloatArray

# Simulated data sets of a predictive check; a misfit is told that is so improbable, shared among
# all numbers, by chance.
REPORTED, MISSED = 1000, 0.01
# A Gaussian that an end cuts two standard deviations from its mean has so large a share of its
# draws within so many standard deviations of the end; one that the end does not reach has none.
BESIDE, LEANING = 0.1, 0.005


@dataclass(frozen=True, eq=False)
class Sampled:
    """Draws that passed the gates.

    - `model`: what was sampled.
    - `seed`: root of its random numbers.
    - `chain`, (ensembles, steps, walkers, d): all draws after warm-up.
    - `log_posterior`, (ensembles, steps, walkers): unnormalised.
    - `acceptance`: of each ensemble.
    """

    model: Model
    seed: int
    chain: FloatArray
    log_posterior: FloatArray
    acceptance: tuple[float, ...]

    @property
    def time(self) -> float:
        """The largest autocorrelation time of all parameters, in steps."""
        return max(row.time for row in self.rows)

    @cached_property
    def draws(self) -> FloatArray:
        """Nearly independent draws, shape (n, d): thinned by the autocorrelation time."""
        return np.concatenate(diagnostics.thinned(self.chain, self.time))

    @cached_property
    def rows(self) -> list[Summary]:
        """The summary of every parameter, in the unit shown."""
        parameters, columns = self.model.parameters, np.moveaxis(self.chain, -1, 0)
        return [
            diagnostics.summarised(one.name, one.unit, column, one.shown)
            for one, column in zip(parameters, columns, strict=True)
        ]

    def summaries(self) -> list[Summary]:
        """Return the summaries of parameters, then of consequences."""
        return [*self.rows, *self.consequences]

    @cached_property
    def consequences(self) -> list[Summary]:
        """The summary of every derived quantity, of draws thinned as `draws` are.

        One that misses a gate, but for the number of autocorrelation times, which is that of the
        parameters, is an `UnconvergedError`.
        """
        if self.model.derived is None:
            return []
        stride, rows = max(1, int(np.ceil(self.time))), []
        chain = self.chain[:, ::stride]
        for name, quantity in self.model.derived(chain.reshape(-1, self.model.dimension)).items():
            values = quantity.values.reshape(chain.shape[:3])
            row = diagnostics.summarised(name, quantity.unit, values)
            rows.append(replace(row, time=stride * row.time))
        diagnostics.require(rows, self.chain.shape[1], self.acceptance, times=0.0)
        return rows

    def to_datatree(self) -> Any:
        """Convert to a DataTree as ArviZ reads it: a chain per ensemble, thinned by its time.

        Its groups are ``posterior`` (a variable per parameter, in the unit shown, with that unit
        and its prior as attributes) and ``sample_stats`` (log posterior; acceptance of each chain).
        """
        import arviz_base

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
        low, high = np.quantile(values, diagnostics.ENDS).tolist()
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


def leanings(posterior: Sampled) -> list[str]:
    """Return a warning for each prior that the data contradict, or at whose bound draws pile up."""
    found, disagreements = [], posterior.model.disagreements()
    for one, column in zip(
        posterior.model.parameters, np.moveaxis(posterior.chain, -1, 0), strict=True
    ):
        unit = "" if one.unit == "1" else f" {one.unit}"
        prior = f"its prior ({one.prior.in_unit(one.shown)}{unit})"
        if one.name in disagreements:
            value, error, distance = disagreements[one.name]
            found.append(
                f"prior and data disagree on {one.name}: from the data {one.shown * value:.6g} ± "
                f"{one.shown * error:.2g}{unit}, {distance:.3g} standard deviations from {prior}"
            )
            continue
        found += [
            f"{one.name} leans on the end {end * one.shown:.4g}{unit} of {prior}: what "
            "is printed of it is a limit, not an estimate"
            for end in _reached(one.prior, column.ravel())
            if end not in one.natural
        ]
    return found


def _reached(prior: Prior, draws: FloatArray) -> list[float]:
    """Return the bounds of a prior at which draws pile up."""
    if isinstance(prior, Normal):
        return []
    # In the scale in which the prior is flat.
    scale = np.log if isinstance(prior, LogUniform) else np.asarray
    values = scale(draws)
    beside = BESIDE * values.std()
    near = {end: np.abs(values - scale(end)) < beside for end in (prior.low, prior.high)}
    return [end for end, close in near.items() if close.mean() > LEANING]


def bimodal(posterior: Sampled) -> dict[str, Modes]:
    """Return the modes of each parameter with two modes, in the unit shown."""
    parameters = zip(posterior.model.parameters, posterior.draws.T, strict=True)
    modes = {one.name: two_modes(one.shown * column) for one, column in parameters}
    return {name: found for name, found in modes.items() if found}
