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
# Draws per ensemble and values per group in a saved file.
_MAX_DRAWS, _MAX_VALUES = 250, 2_000_000
# Simulated data sets of the predictive checks, and the probability of a misfit by chance, of all
# numbers together.
REPLICATES, MISFIT_PROBABILITY = 1000, 0.01
# Draws pile up at a bound if more than this fraction lies within so many standard deviations. A
# Gaussian that a bound cuts two standard deviations from its mean has that fraction.
BOUND_DISTANCE, BOUND_FRACTION = 0.1, 0.005


@dataclass(frozen=True, eq=False)
class PosteriorSamples:
    """Draws that met the convergence criteria.

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

        One that fails a criterion is an `UnconvergedError`; the number of autocorrelation times is
        that of the parameters.
        """
        stride, rows = max(1, int(np.ceil(self.time))), []
        chain = self.chain[:, ::stride]
        draws = chain.reshape(-1, self.model.dimension)
        for name, quantity in self.model.consequences(draws).items():
            values = quantity.values.reshape(chain.shape[:3])
            row = diagnostics.summarised(name, quantity.unit, values)
            rows.append(replace(row, time=stride * row.time))
        diagnostics.require(rows, self.chain.shape[1], self.acceptance, times=0.0)
        return rows

    @cached_property
    def selected(self) -> tuple[NDArray[np.int64], FloatArray]:
        """Numbers and values of some of `draws` per ensemble, (n,), (ensembles, n, d).

        There are fewer of them if the observations are many.
        """
        draws = diagnostics.thinned(self.chain, self.time)
        size = len(draws) * sum(
            one.size for one in self.model.likelihood.observed.values()
        )
        most = min(_MAX_DRAWS, max(_MAX_VALUES // size, 1))
        rows = _spread(draws.shape[1], most)
        return rows, draws[:, rows]

    def log_likelihood(self) -> FloatArray:
        """Return that of each observation for these draws, shape (ensembles, n, ...)."""
        draws = self.selected[1]
        found = self.model.likelihood.pointwise(draws.reshape(-1, draws.shape[-1]))
        return found.reshape(*draws.shape[:2], *found.shape[1:])

    def to_datatree(self) -> Any:
        """Convert to the groups that ArviZ reads; a chain is an ensemble, thinned by its time.

        Parameters are in the displayed unit, which is an attribute, as the prior is. The groups
        ``log_likelihood`` and ``posterior_predictive`` have fewer draws, with their numbers. An
        observation is a star, or the mean of a spot.
        """
        import xarray

        model, parameters = self.model, self.model.parameters
        generator = Generator(PCG64(SeedSequence(self.seed, spawn_key=(98,))))
        prior = [one.prior.draw(generator, _MAX_DRAWS) for one in parameters]
        priors, (rows, selected) = np.stack(prior, axis=-1)[None], self.selected
        observed = model.likelihood.observed

        def named(draws: FloatArray) -> Any:
            columns = zip(parameters, np.moveaxis(draws, -1, 0), strict=True)
            found = _dataset({one.name: one.shown * values for one, values in columns})
            for one in parameters:
                found[one.name].attrs = {
                    "units": one.unit,
                    "prior": str(one.prior.in_unit(one.shown)),
                    "reason": one.prior.reason,
                }
            return found

        def simulated(draws: FloatArray, simulate: Simulate) -> dict[str, FloatArray]:
            flat = draws.reshape(-1, model.dimension)
            data = [
                model.likelihood.with_data(simulate(one, generator)) for one in flat
            ]
            return {
                name: np.reshape(
                    [one.observed[name] for one in data],
                    (*draws.shape[:2], *values.shape),
                )
                for name, values in observed.items()
            }

        log_posterior = diagnostics.thinned(self.log_posterior, self.time)
        repeats = simulated(selected, model.repeat)
        groups = {
            "posterior": named(diagnostics.thinned(self.chain, self.time)),
            "sample_stats": _dataset({"lp": log_posterior}),
            "log_likelihood": _dataset({[*observed][-1]: self.log_likelihood()}, rows),
            "posterior_predictive": _dataset(repeats, rows),
            "prior": named(priors),
            "prior_predictive": _dataset(simulated(priors, model.likelihood.simulate)),
            "observed_data": _dataset(observed, sampled=()),
        }
        groups["sample_stats"].attrs["acceptance"] = list(self.acceptance)
        tree = xarray.DataTree.from_dict(groups)
        tree.attrs |= {"model": model.name, "seed": self.seed}
        return tree


def _dataset(
    variables: Mapping[str, FloatArray],
    draws: NDArray[np.int64] | None = None,
    sampled: tuple[str, ...] = ("chain", "draw"),
) -> Any:
    """Return variables as an xarray Dataset, with the numbers of their draws."""
    import xarray

    found = {}
    for name, values in variables.items():
        axes = ("group", "light", "axis") if name == "spots" else ("star", "axis")
        found[name] = ((*sampled, *axes)[: values.ndim], values)
    return xarray.Dataset(found, {} if draws is None else {"draw": draws})


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
    posterior: PosteriorSamples, replicates: int = REPLICATES
) -> list[PredictiveCheck]:
    """Compare each number of `Likelihood.checks` with simulations from the posterior."""
    model, draws = posterior.model, posterior.draws
    generator = Generator(PCG64(SeedSequence(posterior.seed, spawn_key=(99,))))
    chosen = draws[np.linspace(0, len(draws) - 1, replicates).astype(int)]
    found = [model.likelihood.checks(model.repeat(one, generator)) for one in chosen]
    rows = []
    for name, observed in model.likelihood.checks().items():
        values = np.array([one[name] for one in found])
        low, high = np.quantile(values, diagnostics.ENDS).tolist()
        # Two-sided, ties counted half.
        below = float((values < observed).mean() + 0.5 * (values == observed).mean())
        tail = min(1.0, 2 * min(below, 1 - below))
        rows.append(PredictiveCheck(name, observed, low, high, tail))
    return rows


def misfit(checks: Sequence[PredictiveCheck]) -> str:
    """Return a warning of the numbers that the model would not give; empty if there is none.

    Examples
    --------
    >>> misfit([PredictiveCheck("rms (px)", 4.0, 0.9, 1.1, 0.0)])
    'the model does not fit: rms (px) is 4, in 95 % of its repeats 0.9 to 1.1'
    """
    found = [
        f"{one.name} is {one.observed:.3g}, in 95 % of its repeats {one.low:.3g} to {one.high:.3g}"
        for one in checks
        if one.tail < MISFIT_PROBABILITY / len(checks)
    ]
    return f"the model does not fit: {'; '.join(found)}" if found else ""


def prior_warnings(posterior: PosteriorSamples) -> list[str]:
    """Return a warning for each prior that the data contradict, or at whose bound draws pile up."""
    found, apart = [], posterior.model.disagreements()
    for i, one in enumerate(posterior.model.parameters):
        unit, prior = one.shown_unit, one.prior.in_unit(one.shown)
        if one.name in apart:
            value, error, distance = apart[one.name]
            found.append(
                f"prior and data disagree on {one.name}: from the data {one.shown * value:.6g} ± "
                f"{one.shown * error:.2g}{unit}, {distance:.3g} standard deviations from its prior "
                f"({prior}{unit})"
            )
            continue
        found += [
            f"{one.name} piles up at the bound {bound * one.shown:.4g}{unit} of its prior ("
            f"{prior}{unit}): what is printed of it is a limit, not an estimate"
            for bound in _reached(one.prior, posterior.chain[..., i])
            if bound not in one.natural
        ]
    return found


def _reached(prior: Prior, draws: FloatArray) -> list[float]:
    """Return the bounds of a prior at which draws pile up, in the scale of a flat prior."""
    if isinstance(prior, Normal):
        return []
    scale = np.log if isinstance(prior, LogUniform) else np.asarray
    values = scale(draws)
    width = BOUND_DISTANCE * values.std()
    return [
        bound
        for bound in (prior.low, prior.high)
        if (np.abs(values - scale(bound)) < width).mean() > BOUND_FRACTION
    ]


def bimodal(posterior: PosteriorSamples) -> dict[str, Modes]:
    """Return the modes of each parameter with two modes, in the displayed unit."""
    parameters = zip(posterior.model.parameters, posterior.draws.T, strict=True)
    modes = {one.name: two_modes(one.shown * column) for one, column in parameters}
    return {name: found for name, found in modes.items() if found}
