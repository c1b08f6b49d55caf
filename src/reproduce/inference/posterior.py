"""Draws of a posterior with all that is needed to report them, and warnings.

A predictive check asks whether the model would give data like these: parameters are drawn from the
posterior, and data are simulated with them. Draws may pile up at a bound of a prior, prior and data
may disagree, and a parameter may have two modes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence
from numpy.typing import NDArray

from reproduce.inference import diagnostics
from reproduce.inference.diagnostics import Summary
from reproduce.inference.model import LogUniform, Model, Normal, Prior
from reproduce.inference.modes import Modes, two_modes
from reproduce.physics.validate import FloatArray

Simulate = Callable[[FloatArray, Generator], Any]
# Draws of each ensemble, numbers of a group, and draws of the prior in a saved file.
_DRAWS, _VALUES, _PRIOR = 250, 2_000_000, 250
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
        for name, quantity in self.model.derived(
            chain.reshape(-1, self.model.dimension)
        ).items():
            values = quantity.values.reshape(chain.shape[:3])
            row = diagnostics.summarised(name, quantity.unit, values)
            rows.append(replace(row, time=stride * row.time))
        diagnostics.require(rows, self.chain.shape[1], self.acceptance, times=0.0)
        return rows

    @cached_property
    def thin(self) -> FloatArray:
        """Some nearly independent draws of each ensemble, shape (ensembles, n, d).

        There are fewer of them if the observations are many.
        """
        size = sum(one.size for one in self.model.likelihood.observed.values())
        draws = diagnostics.thinned(self.chain, self.time)
        most = min(_DRAWS, max(_VALUES // (size * len(draws)), 1))
        return draws[:, _spread(draws.shape[1], most)]

    def log_likelihood(self) -> FloatArray:
        """Return that of each observation for these draws, shape (ensembles, n, ...)."""
        found = self.model.likelihood.pointwise(
            self.thin.reshape(-1, self.model.dimension)
        )
        return found.reshape(*self.thin.shape[:2], *found.shape[1:])

    def to_datatree(self) -> Any:
        """Convert to the groups that ArviZ reads; a chain is an ensemble, thinned by its time.

        Parameters are in the displayed unit, which is an attribute, as the prior is. The groups
        ``log_likelihood`` and ``posterior_predictive`` have fewer draws, with their numbers. An
        observation is a star, or the mean of a spot.
        """
        import xarray

        model, parameters = self.model, self.model.parameters
        generator = Generator(PCG64(SeedSequence(self.seed, spawn_key=(98,))))
        draws = diagnostics.thinned(self.chain, self.time)
        prior = np.stack(
            [one.prior.draw(generator, _PRIOR) for one in parameters], axis=-1
        )[None]

        def named(rows: FloatArray) -> dict[str, FloatArray]:
            return {
                one.name: rows[..., i] * one.shown for i, one in enumerate(parameters)
            }

        def simulated(rows: FloatArray, simulate: Simulate) -> dict[str, FloatArray]:
            flat = rows.reshape(-1, model.dimension)
            found = [
                model.given(simulate(one, generator)).likelihood.observed
                for one in flat
            ]
            return {
                name: np.stack([one[name] for one in found]).reshape(
                    *rows.shape[:2], *data.shape
                )
                for name, data in model.likelihood.observed.items()
            }

        last = list(model.likelihood.observed)[-1]
        chosen = _spread(draws.shape[1], self.thin.shape[1])
        tree = xarray.DataTree.from_dict(
            {
                "posterior": _dataset(named(draws)),
                "sample_stats": _dataset(
                    {"lp": diagnostics.thinned(self.log_posterior, self.time)}
                ),
                "log_likelihood": _dataset({last: self.log_likelihood()}, chosen),
                "posterior_predictive": _dataset(
                    simulated(self.thin, model.repeat), chosen
                ),
                "prior": _dataset(named(prior)),
                "prior_predictive": _dataset(
                    simulated(prior, model.likelihood.simulate)
                ),
                "observed_data": _dataset(model.likelihood.observed, sampled=()),
            }
        )
        for one in parameters:
            text = str(one.prior.in_unit(one.shown))
            attributes = {"units": one.unit, "prior": text, "reason": one.prior.reason}
            tree["posterior"][one.name].attrs = tree["prior"][one.name].attrs = (
                attributes
            )
        tree["sample_stats"].attrs["acceptance"] = list(self.acceptance)
        tree.attrs |= {"model": model.name, "seed": self.seed}
        return tree


def _dataset(
    variables: Mapping[str, FloatArray],
    draws: NDArray[np.int64] | None = None,
    sampled: tuple[str, ...] = ("chain", "draw"),
) -> Any:
    """Return variables as an xarray Dataset, with the numbers of their draws."""
    import xarray

    found, coordinates = {}, {"draw": draws} if draws is not None else {}
    for name, values in variables.items():
        axes = ("group", "light", "axis") if name == "spots" else ("star", "axis")
        dimensions = (*sampled, *axes)
        found[name] = (dimensions[: values.ndim], values)
    return xarray.Dataset(found, coordinates)


def _spread(count: int, most: int) -> NDArray[np.int64]:
    """Return `most` row numbers of `count` at most, spread evenly."""
    return np.linspace(0, count - 1, min(most, count)).astype(int)


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


def posterior_checks(
    posterior: Sampled, replicates: int = REPORTED
) -> list[PredictiveCheck]:
    """Compare every number of `Likelihood.checks` with simulations from the posterior."""
    model = posterior.model
    generator = Generator(PCG64(SeedSequence(posterior.seed, spawn_key=(99,))))
    chosen = posterior.draws[
        np.linspace(0, len(posterior.draws) - 1, replicates).astype(int)
    ]
    found = [model.likelihood.checks(model.repeat(one, generator)) for one in chosen]
    rows = []
    for name, observed in model.likelihood.checks().items():
        values = np.array([one[name] for one in found])
        low, high = np.quantile(values, diagnostics.ENDS).tolist()
        rows.append(
            PredictiveCheck(name, observed, low, high, _two_sided(values, observed))
        )
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
    near = {
        end: np.abs(values - scale(end)) < beside for end in (prior.low, prior.high)
    }
    return [end for end, close in near.items() if close.mean() > LEANING]


def bimodal(posterior: Sampled) -> dict[str, Modes]:
    """Return the modes of each parameter with two modes, in the unit shown."""
    parameters = zip(posterior.model.parameters, posterior.draws.T, strict=True)
    modes = {one.name: two_modes(one.shown * column) for one, column in parameters}
    return {name: found for name, found in modes.items() if found}
