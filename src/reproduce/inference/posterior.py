"""Draws of a posterior, their summaries and groups of ArviZ, and warnings.

The warnings are predictive checks, draws that pile up at a bound of a prior, priors that the data
contradict, and two modes of a parameter. A predictive check compares a number of the data with data
that are simulated with parameters from the posterior.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng

from reproduce.inference import diagnostics
from reproduce.inference._modes import Modes, two_modes
from reproduce.inference.diagnostics import Summary
from reproduce.inference.model import LogUniform, Model, Uniform
from reproduce.physics.validate import FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd

_Simulate = Callable[[FloatArray, Generator], Any]
# Dimensions of the observed arrays of a saved file that have more than one dimension.
_DIMENSIONS: dict[str, tuple[str, ...]] = {
    "target": ("star", "axis"),
    "spots": ("group", "light", "axis"),
    "angles": ("axis", "state"),
}
# Draws per ensemble and values per group in a saved file.
_MAX_SAVED_DRAWS, _MAX_SAVED_VALUES = 250, 2_000_000
# Simulated data sets of the predictive checks, and the probability of a misfit by chance, of all
# numbers together.
_REPLICATES, _MISFIT_PROBABILITY = 1000, 0.01
# Draws pile up at a bound if more than this fraction is within this number of standard deviations.
# A Gaussian that a bound cuts two standard deviations from its mean has this fraction.
_BOUND_DISTANCE, _BOUND_FRACTION = 0.1, 0.005


@dataclass(frozen=True, eq=False)
class PosteriorSamples:
    """Draws that meet the convergence criteria.

    - `model`: sampled model.
    - `seed`: root of its random numbers.
    - `chain`, (ensembles, steps, walkers, d): all draws after warm-up.

    - `acceptance`, (ensembles,): fraction of accepted moves of each ensemble.
    """

    model: Model
    seed: int
    chain: FloatArray
    acceptance: FloatArray

    @property
    def time(self) -> float:
        """The largest autocorrelation time of all parameters, in steps."""
        return max(row.time for row in self.rows)

    @cached_property
    def _thinned(self) -> FloatArray:
        """Draws of each ensemble, thinned by the autocorrelation time, (ensembles, n, d)."""
        return diagnostics.thinned(self.chain, self.time)

    @property
    def draws(self) -> FloatArray:
        """Nearly independent draws, shape (n, d): thinned by the autocorrelation time."""
        return np.concatenate(self._thinned)

    @cached_property
    def rows(self) -> list[Summary]:
        """The summary of every parameter, in the displayed unit."""
        return [
            diagnostics.summarised(name, one.unit, one.values)
            for name, one in self.model.displayed(self.chain).items()
        ]

    @cached_property
    def modes(self) -> dict[str, Modes]:
        """Two modes of each parameter that has two, in the displayed unit."""
        quantities = self.model.displayed(self.draws).items()
        return {n: modes for n, q in quantities if (modes := two_modes(q.values))}

    @cached_property
    def summaries(self) -> list[Summary]:
        """The summaries of parameters, then of consequences, from draws thinned as `draws`.

        A consequence that fails a criterion is an `UnconvergedError`. The number of autocorrelation
        times is a criterion of the parameters only.
        """
        stride = ceil(self.time)
        shape = len(self.chain), -1, self.chain.shape[2]
        rows = [
            diagnostics.summarised(name, one.unit, one.values.reshape(shape), stride)
            for name, one in self.model.consequences(self.draws).items()
        ]
        diagnostics.require(rows, self.chain.shape[1], self.acceptance, times=0.0)
        return [*self.rows, *rows]

    @cached_property
    def selected(self) -> tuple[IntArray, FloatArray]:
        """Numbers and values of some of `draws` per ensemble, (n,), (ensembles, n, d).

        Their number is smaller for many observations.
        """
        draws = self._thinned
        sizes = (values.size for values in self.model.likelihood.observed.values())
        most = max(_MAX_SAVED_VALUES // (len(draws) * sum(sizes)), 1)
        count = min(_MAX_SAVED_DRAWS, most, draws.shape[1])
        rows = np.linspace(0, draws.shape[1] - 1, count).astype(int)
        return rows, draws[:, rows]

    def log_likelihood(self) -> FloatArray:
        """Return the log likelihood of each observation, shape (ensembles, n, ...)."""
        draws = self.selected[1]
        found = self.model.likelihood.pointwise(draws.reshape(-1, draws.shape[-1]))
        return found.reshape(*draws.shape[:2], *found.shape[1:])

    def to_datatree(self) -> Any:
        """Convert to the groups of ArviZ; a chain is an ensemble, thinned by its time.

        Parameters are in the displayed unit. The unit and the prior are attributes. The groups
        ``log_likelihood`` and ``posterior_predictive`` have fewer draws, with their numbers. An
        observation is a star, or the mean of a spot. For printed numbers, ``data`` in
        ``log_likelihood`` contains the parts of `Likelihood.pointwise`, such as all estimates.
        """
        import arviz_base

        model = self.model
        likelihood = model.likelihood
        generator = default_rng(SeedSequence(self.seed, spawn_key=(98,)))
        prior = model.drawn_prior(generator, _MAX_SAVED_DRAWS)[None]
        rows, selected = self.selected
        log = model.log_posterior(self.draws)
        pointwise = self.log_likelihood()
        # Parts of printed numbers are no elements of the observed arrays.
        name, values = [*likelihood.observed.items()][-1]
        name = name if len(values) == pointwise.shape[2] else "data"

        def parameters(draws: FloatArray) -> dict[str, FloatArray]:
            return {name: one.values for name, one in model.displayed(draws).items()}

        def predictive(draws: FloatArray, simulate: _Simulate) -> dict[str, FloatArray]:
            data = [
                [simulate(row, generator).observed for row in chain] for chain in draws
            ]
            return {
                name: np.array([[one[name] for one in chain] for chain in data])
                for name in likelihood.observed
            }

        groups = {
            "posterior": parameters(self._thinned),
            "sample_stats": {"lp": log.reshape(self._thinned.shape[:2])},
            "log_likelihood": {name: pointwise},
            "posterior_predictive": predictive(selected, likelihood.repeat),
            "prior": parameters(prior),
            "prior_predictive": predictive(prior, likelihood.simulate),
            "observed_data": likelihood.observed,
        }
        tree = arviz_base.from_dict(groups, dims=_DIMENSIONS)
        tree.attrs |= {"model": model.name, "seed": self.seed}
        tree["sample_stats"].attrs["acceptance"] = self.acceptance
        for part in tree.children.values():  # equal draws give equal files
            del part.attrs["created_at"]
        for group in ("log_likelihood", "posterior_predictive"):
            tree[group].coords["draw"] = rows
        for group, p in product(("posterior", "prior"), model.parameters):
            text = {"units": p.unit, "prior": p.text, "reason": p.prior.reason}
            tree[group][p.name].attrs |= text
        return tree

    @cached_property
    def checks(self) -> pd.DataFrame:
        """Each number of `Likelihood.checks`, compared with simulations from the posterior.

        It has one row per number: the observed value, the bounds of the central 95 % of the
        predictions, and the two-sided tail probability of the observed value.
        """
        import pandas as pd

        likelihood = self.model.likelihood
        draws = self.draws
        generator = default_rng(SeedSequence(self.seed, spawn_key=(99,)))
        rows = draws[np.linspace(0, len(draws) - 1, _REPLICATES).astype(int)]
        repeats = (likelihood.repeat(row, generator) for row in rows)
        predicted = pd.DataFrame(map(likelihood.checks, repeats))
        found = pd.DataFrame({"observed": likelihood.checks(likelihood)})
        found["low"], found["high"] = np.quantile(predicted, diagnostics.ENDS, axis=0)
        # Ties count half.
        signs = (predicted - found["observed"]).apply(np.sign)
        found["tail"] = 1 - signs.mean(skipna=False).abs()
        return found.rename_axis("name")

    def warnings(self) -> Iterator[str]:
        """Yield warnings on priors, parameters with two modes, and wrong predictions."""
        yield from self.prior_warnings()
        units = {row.name: row.unit for row in self.rows}
        for name, one in self.modes.items():
            yield (
                f"{name} has two modes: {100 * one.below:.0f} % of the draws near {one.low:.3g}, "
                f"{100 * one.above:.0f} % near {one.high:.3g} (in {units[name]}). Its mean is in "
                "neither mode"
            )
        misfits = [
            f"{name} is {observed:.3g}, in 95 % of its repeats {low:.3g} to {high:.3g}"
            for name, observed, low, high, tail in self.checks.itertuples()
            if not tail >= _MISFIT_PROBABILITY / len(self.checks)  # NaN does not fit
        ]
        if misfits:
            yield f"the model does not fit: {'; '.join(misfits)}"

    def prior_warnings(self) -> Iterator[str]:
        """Yield a warning for each prior that the data contradict, or whose bound limits draws."""
        apart = self.model.disagreements()
        for i, one in enumerate(self.model.parameters):
            unit = "" if one.unit == "1" else f" {one.unit}"
            prior = f"its prior ({one.text}{unit})"
            if one.name in apart:
                value, error, distance = apart[one.name]
                yield (
                    f"prior and data disagree on {one.name}: from the data "
                    f"{one.shown * value:.6g} ± {one.shown * error:.2g}{unit}, {distance:.3g} "
                    f"standard deviations from {prior}"
                )
            elif isinstance(one.prior, Uniform):
                # Distances on the scale on which the prior is flat.
                scale = np.log if isinstance(one.prior, LogUniform) else np.asarray
                values = scale(self.chain[..., i])
                reach = _BOUND_DISTANCE * values.std()
                for bound in (one.prior.low, one.prior.high):
                    near = np.abs(values - scale(bound)) < reach
                    if near.mean() > _BOUND_FRACTION and bound != one.natural:
                        yield (
                            f"{one.name} piles up at the bound {bound * one.shown:.4g}{unit} of "
                            f"{prior}: it is a limit, not an estimate"
                        )
