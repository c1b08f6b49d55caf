"""Draws of a posterior with all that is needed to report them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from reproduce.inference import diagnostics
from reproduce.inference.diagnostics import (
    Diagnosis,
    Gates,
    diagnose,
    diagnosed,
    require,
    thinned,
)
from reproduce.inference.model import Consequence, Model
from reproduce.physics.validate import FloatArray

LEVEL = 0.95


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
    diagnoses: tuple[Diagnosis, ...]
    gates: Gates | None = None

    @property
    def time(self) -> float:
        """The largest autocorrelation time of all parameters, in steps."""
        return max(one.time for one in self.diagnoses)

    @cached_property
    def draws(self) -> FloatArray:
        """Nearly independent draws, shape (n, d): thinned by the autocorrelation time."""
        return np.concatenate(thinned(self.chain, self.time))

    def rows(self) -> list[Summary]:
        """Return the summary of every parameter, in the unit shown."""
        return self._rows

    @cached_property
    def _rows(self) -> list[Summary]:
        known = self.diagnoses or diagnose(self.model.names, self.chain)
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
            require(diagnoses, self.acceptance, gates)
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
            row = _summarised(name, quantity.unit, values, diagnosed(name, values))
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
        draws = thinned(self.chain, self.time)
        parameters = self.model.parameters
        posterior = {one.name: draws[..., i] * one.shown for i, one in enumerate(parameters)}
        stats = {"lp": thinned(self.log_posterior, self.time)}
        tree = arviz_base.from_dict({"posterior": posterior, "sample_stats": stats})
        for one in parameters:
            prior = str(one.prior.in_unit(one.shown))
            tree["posterior"][one.name].attrs = {
                "units": one.unit, "prior": prior, "reason": one.prior.reason
            }  # fmt: skip
        tree["sample_stats"].attrs["acceptance"] = list(self.acceptance)
        tree.attrs |= {"model": self.model.name, "seed": self.seed}
        return tree


def _diagnosis(row: Summary, steps: int) -> Diagnosis:
    return Diagnosis(row.name, row.rhat, row.time, steps / row.time, row.bulk, row.tail, row.mcse)


def _summarised(name: str, unit: str, values: FloatArray, known: Diagnosis) -> Summary:
    """Summarise a quantity in the unit of its values, with its numbers from `diagnosed`."""
    ends = ((1 - LEVEL) / 2, (1 + LEVEL) / 2)
    low, median, high = np.quantile(values, (ends[0], 0.5, ends[1]))
    return Summary(
        name,
        unit,
        float(values.mean()),
        float(values.std()),
        float(low),
        float(median),
        float(high),
        known.mcse,
        max(diagnostics.mcse_quantile(values, end) for end in ends),
        known.rhat,
        known.bulk,
        known.tail,
        known.time,
    )
