"""Sampling a model with several independent emcee ensembles, on any executor.

Every ensemble has its own stream of random numbers, spawned from one seed: the draws do not depend
on the order of the ensembles, or on how many processes carry them.

The moves accept or reject a whole half-ensemble at once: emcee decides walker by walker in Python,
which for likelihoods that cost next to nothing is most of the time. `_Complement` adds a proposal
for the nearly Gaussian posteriors of this book; those that are far from it are moved in coordinates
of their own (`inference.model`).
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import emcee
import numpy as np
from emcee import moves
from emcee.state import State
from numpy.random import MT19937, PCG64, Generator, RandomState, SeedSequence
from scipy.special import gammaln

from reproduce.inference.diagnostics import UnconvergedError, require
from reproduce.inference.model import Coordinates, Model, Progress
from reproduce.inference.posterior import Sampled
from reproduce.physics.validate import FloatArray, whole_number

# Two widths of the proposal: degrees of freedom of a Student-t, and its width over the ensemble's.
# The near one fits a nearly Gaussian posterior; the far one, with its share, is heavier and wider
# than any posterior that is met here, so that no walker is left behind in a tail.
NEAR, FAR = (30.0, 1.05), (4.0, 1.5)
_FAR_SHARE = 0.2


# emcee has no types: what stands on its classes is of an unknown kind to mypy.
class _AtOnce(moves.RedBlueMove):  # type: ignore[misc]
    """A red-blue move, made in coordinates, whose acceptance is decided for a half at once."""

    def __init__(self, coordinates: Coordinates) -> None:
        self.coordinates = coordinates
        super().__init__()

    def propose(self, model: Any, state: State) -> tuple[State, Any]:
        """Move one half of the ensemble after the other, each given its complement."""
        self.setup(state.coords)
        walkers = len(state.coords)
        halves = np.arange(walkers) % 2
        model.random.shuffle(halves)
        accepted = np.zeros(walkers, dtype=bool)
        coords, log_prob = state.coords.copy(), np.array(state.log_prob)
        for half in (0, 1):
            moved, rest = halves == half, halves != half
            straight = self.coordinates.straight(coords)
            new, factors = self.get_proposal(
                straight[moved], [straight[rest]], model.random
            )
            with np.errstate(over="ignore"):  # far outside: infinite, and rejected
                proposed = self.coordinates.parameters(new)
            values = model.log_prob_fn(proposed)
            inside, density = np.isfinite(values), np.full(len(values), -np.inf)
            volume = self.coordinates.log_volume(proposed[inside])
            density[inside] = values[inside] + volume
            # Minus infinity less minus infinity cannot occur: a walker never stands on it.
            before = log_prob[moved] + self.coordinates.log_volume(coords[moved])
            gain = factors + density - before
            taken = np.log(model.random.rand(len(gain))) < gain
            index = np.flatnonzero(moved)[taken]
            coords[index], log_prob[index] = proposed[taken], values[taken]
            accepted[index] = True
        return State(
            coords, log_prob=log_prob, random_state=state.random_state
        ), accepted


class _Stretch(_AtOnce, moves.StretchMove):  # type: ignore[misc]
    """The affine-invariant stretch of Goodman and Weare, decided at once."""


class _DifferentialEvolution(_AtOnce, moves.DEMove):  # type: ignore[misc]
    """A step along the difference of two other walkers, decided at once."""


class _Complement(_AtOnce):
    """An independent draw from two Student-t with mean and covariance of the other half.

    The proposal depends on the other half alone, so the step leaves the posterior unchanged for
    any shape of it; the nearer to Gaussian, the more often it is accepted. It is affine
    invariant, as the stretch is.
    """

    def get_proposal(
        self,
        sample: FloatArray,
        complement: list[FloatArray],
        random: np.random.RandomState,
    ) -> tuple[FloatArray, FloatArray]:
        """Propose for every walker; the factor is the ratio of proposal densities."""
        others = complement[0]
        count, dimension = sample.shape
        mean = others.mean(axis=0)
        # Scales differ by many orders of magnitude; factorise the correlation, not the covariance.
        scale = others.std(axis=0) + np.finfo(float).tiny
        scaled = (others - mean) / scale
        correlation = scaled.T @ scaled / len(others) + 1e-10 * np.eye(dimension)
        root = np.linalg.cholesky(correlation)
        far = (random.rand(count) < _FAR_SHARE).astype(int)
        degrees, width = np.array([NEAR, FAR])[far].T
        reach = width / np.sqrt(random.chisquare(degrees) / degrees)
        steps = reach[:, None] * random.standard_normal(sample.shape)
        before = ((sample - mean) / scale) @ np.linalg.inv(root).T
        squares = [np.square(points).sum(axis=1) for points in (before, steps)]
        old, new = (_log_proposal(distance, dimension) for distance in squares)
        return mean + scale * (steps @ root.T), old - new


def _log_proposal(squared: FloatArray, dimension: int) -> FloatArray:
    """Log density of the proposal at a squared distance, but for a constant of the dimension."""
    near, far = (
        gammaln((degrees + dimension) / 2)
        - gammaln(degrees / 2)
        - dimension * np.log(np.sqrt(degrees) * width)
        - 0.5 * (degrees + dimension) * np.log1p(squared / (degrees * width**2))
        for degrees, width in (NEAR, FAR)
    )
    return np.asarray(
        np.logaddexp(np.log1p(-_FAR_SHARE) + near, np.log(_FAR_SHARE) + far)
    )


# Shares of the moves. In the warm-up the stretch and the differential evolution carry a far-off
# ensemble in; later they keep curved or heavy-tailed posteriors moving, and the complement makes
# draws nearly independent.
INWARD, STEADY = (0.3, 0.4, 0.3), (0.05, 0.1, 0.85)


def mixture(
    coordinates: Coordinates | None = None, shares: tuple[float, float, float] = STEADY
) -> list[tuple[moves.Move, float]]:
    """Return the moves of an ensemble for emcee, with their shares.

    Examples
    --------
    >>> [share for _, share in mixture()]
    [0.05, 0.1, 0.85]
    """
    kinds = (_Stretch, _DifferentialEvolution, _Complement)
    made = [kind(coordinates or Coordinates()) for kind in kinds]
    return list(zip(made, shares, strict=True))


# Steps beyond which a chain that asks for more is refused.
_MOST = 20_000


@dataclass(frozen=True)
class Plan:
    """How a model is sampled.

    - `seed`: root of all random numbers.
    - `ensembles`, `walkers`: independent ensembles (at least four for a posterior that is shown;
      calibration uses one per replicate) and walkers in each; zero walkers stands for the usual
      number.
    - `steps`, `warmup`: steps kept and steps dropped before them.
    """

    seed: int
    ensembles: int = 4
    walkers: int = 0
    steps: int = 1000
    warmup: int = 500

    def __post_init__(self) -> None:
        for name in ("seed", "ensembles", "walkers", "steps", "warmup"):
            whole_number(
                name, getattr(self, name), least=int(name in {"ensembles", "steps"})
            )

    def walkers_for(self, dimension: int) -> int:
        """Walkers of an ensemble: enough that half of them know the covariance."""
        walkers = self.walkers or max(32, 24 * dimension)
        if walkers < 2 * dimension + 2 or walkers % 2:
            raise ValueError(
                f"walkers: expected an even number of at least {2 * dimension + 2} for {dimension} "
                f"parameters, got {walkers}; give 0 for the usual number"
            )
        return walkers


def sample(
    model: Model,
    plan: Plan,
    *,
    longer: bool = False,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Sampled:
    """Sample the posterior of a model, and refuse chains that miss the gates.

    Chains that are too short may be run again, `longer`: with as many steps as they are found to
    need, up to `_MOST`. Without an executor the ensembles run here, one after the other.
    """
    run, results = partial(run_ensemble, model, plan), []
    for result in (map if executor is None else executor.map)(
        run, range(plan.ensembles)
    ):
        results.append(result)
        if progress is not None:
            progress(len(results), plan.ensembles)
    chain, log_posterior, accepted = (
        np.stack(column) for column in zip(*results, strict=True)
    )
    found = Sampled(model, plan.seed, chain, log_posterior, tuple(accepted.tolist()))
    try:
        require(found.rows, plan.steps, found.acceptance)
        if longer:
            found.summaries()
    except UnconvergedError as error:
        if not longer or error.steps is None or error.steps > _MOST:
            raise
        enough = replace(
            plan, steps=error.steps, warmup=max(plan.warmup, error.steps // 4)
        )
        return sample(model, enough, longer=True, executor=executor, progress=progress)
    return found


def run_ensemble(
    model: Model,
    plan: Plan,
    ensemble: int,
    lacking: Callable[[FloatArray], int] | None = None,
) -> tuple[FloatArray, FloatArray, float]:
    """Run one ensemble.

    Returns its chain (steps, walkers, d), log posterior (steps, walkers) and the share of moves
    that were accepted, all after the warm-up. `lacking`, if given, says of the chain how many
    steps more it needs; it goes on until that is none.
    """
    walkers = plan.walkers_for(model.dimension)
    warming, sampler = (
        emcee.EnsembleSampler(
            walkers,
            model.dimension,
            model.log_posterior,
            vectorize=True,
            moves=mixture(model.coordinates, shares),
        )
        for shares in (INWARD, STEADY)
    )
    here, there = (SeedSequence(plan.seed, spawn_key=(ensemble, i)) for i in (0, 1))
    random_state = RandomState(MT19937(there)).get_state(legacy=True)
    state = State(
        model.start(Generator(PCG64(here)), walkers), random_state=random_state
    )
    if plan.warmup:
        state = warming.run_mcmc(
            state, plan.warmup, skip_initial_state_check=True, store=False
        )
    sampler.run_mcmc(state, plan.steps, skip_initial_state_check=True)
    while lacking and (more := lacking(sampler.get_chain())) > 0:
        sampler.run_mcmc(None, more)
    return (
        sampler.get_chain(),
        sampler.get_log_prob(),
        float(sampler.acceptance_fraction.mean()),
    )
