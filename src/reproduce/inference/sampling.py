"""Sampling a model with several independent emcee ensembles, on any executor.

Each ensemble has its own stream of random numbers, spawned from one seed: the draws do not depend
on the order of the ensembles, or on the number of processes. The moves are the stretch and the
differential evolution of emcee, and a proposal for the nearly Gaussian posteriors of this book.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import emcee
import numpy as np
from emcee import moves
from emcee.state import State
from numpy.random import MT19937, PCG64, Generator, RandomState, SeedSequence
from scipy.special import gammaln

from reproduce.inference.diagnostics import UnconvergedError, require
from reproduce.inference.model import Model, Progress
from reproduce.inference.posterior import PosteriorSamples
from reproduce.physics.validate import FloatArray, whole_number

# Degrees of freedom and relative width of two Student-t proposals. The near one fits a nearly
# Gaussian posterior. The far one is heavier and wider than the posteriors of this book, so that no
# walker is left behind in a tail.
NEAR, FAR = (30.0, 1.05), (4.0, 1.5)
_FAR_SHARE = 0.2


class _ComplementMove(moves.RedBlueMove):  # type: ignore[misc]  # emcee has no types
    """Propose an independent draw from two Student-t with the moments of the other half.

    The proposal depends only on the other half of the ensemble, so the step leaves any posterior
    unchanged. It is affine invariant, as the stretch is.
    """

    def get_proposal(
        self,
        sample: FloatArray,
        complement: list[FloatArray],
        random: RandomState,
    ) -> tuple[FloatArray, FloatArray]:
        """Return proposals and the log ratios of proposal densities."""
        others = complement[0]
        count, dimension = sample.shape
        mean = others.mean(axis=0)
        # Scales differ by orders of magnitude: factorise the correlation, not the covariance.
        scale = others.std(axis=0) + np.finfo(float).tiny
        scaled = (others - mean) / scale
        correlation = scaled.T @ scaled / len(others) + 1e-10 * np.eye(dimension)
        root = np.linalg.cholesky(correlation)
        far = (random.rand(count) < _FAR_SHARE).astype(int)
        degrees, width = np.array([NEAR, FAR])[far].T
        reach = width / np.sqrt(random.chisquare(degrees) / degrees)
        steps = reach[:, None] * random.standard_normal(sample.shape)
        before = ((sample - mean) / scale) @ np.linalg.inv(root).T
        return mean + scale * (steps @ root.T), _log_proposal(before) - _log_proposal(
            steps
        )


def _log_proposal(steps: FloatArray) -> FloatArray:
    """Return the log density of scaled proposals, (n, d), without a constant."""
    squared, dimension = np.square(steps).sum(axis=1), steps.shape[1]
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


# Shares of stretch, differential evolution and complement. In the warm-up the first two move a
# distant ensemble in; later they keep curved or heavy-tailed posteriors moving, and the complement
# makes draws nearly independent.
WARMUP_SHARES, STEADY_SHARES = (0.3, 0.4, 0.3), (0.05, 0.1, 0.85)


def move_mixture(
    shares: tuple[float, float, float] = STEADY_SHARES,
) -> list[tuple[moves.Move, float]]:
    """Return the moves of an ensemble for emcee, with their shares."""
    kinds = (moves.StretchMove(), moves.DEMove(), _ComplementMove())
    return list(zip(kinds, shares, strict=True))


# A chain that needs more steps is rejected.
_MAX_STEPS = 20_000


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
) -> PosteriorSamples:
    """Sample the posterior of a model, and reject chains that fail a convergence criterion.

    Chains that are too short may be run again, `longer`: with as many steps as they are found to
    need, up to `_MAX_STEPS`. Without an executor the ensembles run here, one after the other.
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
    found = PosteriorSamples(
        model, plan.seed, chain, log_posterior, tuple(accepted.tolist())
    )
    try:
        require(found.rows, plan.steps, found.acceptance)
        if longer:
            found.summaries()
    except UnconvergedError as error:
        if not longer or error.steps is None or error.steps > _MAX_STEPS:
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
    missing_steps: Callable[[FloatArray], int] | None = None,
) -> tuple[FloatArray, FloatArray, float]:
    """Run one ensemble.

    Returns its chain (steps, walkers, d), log posterior (steps, walkers) and the fraction of
    accepted moves, all after the warm-up. `missing_steps`, if given, returns the number of further
    steps that a chain needs; the ensemble goes on until it is zero.
    """
    walkers = plan.walkers_for(model.dimension)
    warming, sampler = (
        emcee.EnsembleSampler(
            walkers,
            model.dimension,
            model.log_density,
            vectorize=True,
            moves=move_mixture(shares),
        )
        for shares in (WARMUP_SHARES, STEADY_SHARES)
    )
    here, there = (SeedSequence(plan.seed, spawn_key=(ensemble, i)) for i in (0, 1))
    points = model.start(Generator(PCG64(here)), walkers)
    state = State(
        model.coordinates.straight(points),
        random_state=RandomState(MT19937(there)).get_state(legacy=True),
    )
    if plan.warmup:
        state = warming.run_mcmc(
            state, plan.warmup, skip_initial_state_check=True, store=False
        )
    more = plan.steps
    while more > 0:
        state = sampler.run_mcmc(state, more, skip_initial_state_check=True)
        chain = model.coordinates.parameters(sampler.get_chain())
        more = missing_steps(chain) if missing_steps else 0
    log_posterior = sampler.get_log_prob() - model.coordinates.log_volume(chain)
    return chain, log_posterior, float(sampler.acceptance_fraction.mean())
