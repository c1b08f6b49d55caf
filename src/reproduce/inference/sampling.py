"""Sampling of a model with several independent emcee ensembles, on any executor.

Each ensemble has a separate stream of random numbers, spawned from one seed, so the draws do not
depend on the order of the ensembles or on the number of processes. The moves are the stretch and
the differential evolution of emcee, and a proposal for nearly Gaussian posteriors.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import emcee
import numpy as np
from emcee import moves
from emcee.state import State
from numpy.random import MT19937, RandomState, SeedSequence, default_rng
from scipy.stats import multivariate_t

from reproduce.inference.diagnostics import UnconvergedError, require
from reproduce.inference.model import Model, Progress
from reproduce.inference.posterior import PosteriorSamples
from reproduce.physics.validate import FloatArray, whole_number

# Degrees of freedom and relative width of two Student-t proposals. The near one fits a nearly
# Gaussian posterior. The far one is heavier and wider than the posteriors of this book, so that no
# walker remains in a tail.
_NEAR_PROPOSAL, _FAR_PROPOSAL = (30, 1.05), (4, 1.5)
_FAR_FRACTION = 0.2
# Fractions of stretch, differential evolution and complement moves. In the warm-up the first two
# bring a distant ensemble to the posterior. Later they move curved or heavy-tailed posteriors, and
# the complement makes draws nearly independent.
_WARMUP_FRACTIONS, _STEADY_FRACTIONS = (0.3, 0.4, 0.3), (0.05, 0.1, 0.85)
# Fewest steps of a default warm-up. A chain that needs more than the most steps is rejected.
_MIN_WARMUP, _MAX_STEPS = 100, 20_000


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
        far = (random.rand(count) < _FAR_FRACTION).astype(int)
        degrees, width = np.array([_NEAR_PROPOSAL, _FAR_PROPOSAL])[far].T
        reach = width / np.sqrt(random.chisquare(degrees) / degrees)
        steps = reach[:, None] * random.standard_normal(sample.shape)
        before = ((sample - mean) / scale) @ np.linalg.inv(root).T
        ratios = _log_proposal(before) - _log_proposal(steps)
        return mean + scale * (steps @ root.T), ratios


def _log_proposal(steps: FloatArray) -> FloatArray:
    """Return the log density of scaled proposals, (n, d)."""
    near, far = (one.logpdf(steps) for one in _proposals(steps.shape[1]))
    return np.logaddexp(np.log1p(-_FAR_FRACTION) + near, np.log(_FAR_FRACTION) + far)


@cache
def _proposals(dimension: int) -> list[Any]:
    """Return the near and the far proposal."""
    return [
        multivariate_t(shape=width**2 * np.eye(dimension), df=degrees)
        for degrees, width in (_NEAR_PROPOSAL, _FAR_PROPOSAL)
    ]


def _move_mixture(
    fractions: tuple[float, float, float] = _STEADY_FRACTIONS,
) -> list[tuple[moves.Move, float]]:
    """Return the moves of an ensemble for emcee, with their fractions."""
    kinds = (moves.StretchMove(), moves.DEMove(), _ComplementMove())
    return list(zip(kinds, fractions, strict=True))


@dataclass(frozen=True)
class Plan:
    """Numbers of a sampling run.

    - `seed`: root of all random numbers.
    - `ensembles`, `walkers`: independent ensembles (at least four for a displayed posterior,
      one per replicate in a calibration) and walkers in each; zero walkers is the default number.
    - `steps`, `warmup`: kept steps, by default more than fifty autocorrelation times, and dropped
      steps before them; zero is a quarter of the kept steps, and 100 at least.
    """

    seed: int
    ensembles: int = 4
    walkers: int = 0
    steps: int = 270
    warmup: int = 0

    def __post_init__(self) -> None:
        for name, number in vars(self).items():
            whole_number(name, number, least=int(name in {"ensembles", "steps"}))

    def walkers_for(self, dimension: int) -> int:
        """Return the walkers of an ensemble: half of them determine the covariance."""
        walkers = self.walkers or max(32, 24 * dimension)
        if walkers < 2 * dimension + 2 or walkers % 2:
            raise ValueError(
                f"walkers: expected an even number of at least {2 * dimension + 2} for {dimension} "
                f"parameters, got {walkers}. Use 0 for the default number"
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
    """Sample the posterior of a model.

    Parameters
    ----------
    model : Model
        Model with its data.
    plan : Plan
        Numbers of the sampling run.
    longer : bool
        Whether chains that are too short are run again, with the advised number of steps, up to
        20,000.
    executor : concurrent.futures.Executor, optional
        Executor of the ensembles. Default: this process, one ensemble after the other.
    progress : callable, optional
        Callback with the number of finished ensembles and the number of all ensembles.

    Returns
    -------
    PosteriorSamples
        Draws, with the criteria of convergence.

    Raises
    ------
    UnconvergedError
        If the chains fail a convergence criterion.
    """
    execute = map if executor is None else executor.map
    while True:
        run = partial(run_ensemble, model, plan)
        results = []
        for result in execute(run, range(plan.ensembles)):
            results.append(result)
            if progress is not None:
                progress(len(results), plan.ensembles)
        arrays = map(np.stack, zip(*results, strict=True))
        found = PosteriorSamples(model, plan.seed, *arrays)
        try:
            require(found.rows, plan.steps, found.acceptance)
            if longer:
                _ = found.summaries  # checks consequences
            return found
        except UnconvergedError as error:
            if not longer or error.steps is None or error.steps > _MAX_STEPS:
                raise
            plan = replace(plan, steps=error.steps)


def run_ensemble(model: Model, plan: Plan, ensemble: int) -> tuple[FloatArray, float]:
    """Run one ensemble.

    Parameters
    ----------
    model : Model
        Model with its data.
    plan : Plan
        Numbers of the sampling run.
    ensemble : int
        Number of the ensemble, which selects its random numbers. A longer run of the same
        ensemble begins with the same steps.

    Returns
    -------
    chain : ndarray, shape (steps, walkers, d)
        Parameters after the warm-up.
    acceptance : float
        Fraction of accepted moves.
    """
    warming, sampler = (
        emcee.EnsembleSampler(
            plan.walkers_for(model.dimension),
            model.dimension,
            model.log_density,
            vectorize=True,
            moves=_move_mixture(fractions),
        )
        for fractions in (_WARMUP_FRACTIONS, _STEADY_FRACTIONS)
    )
    starts, steps = (SeedSequence(plan.seed, spawn_key=(ensemble, i)) for i in (0, 1))
    points = model.start(default_rng(starts), sampler.nwalkers)
    state = State(
        model.coordinates(points),
        random_state=RandomState(MT19937(steps)).get_state(legacy=True),
    )
    warmup = plan.warmup or max(_MIN_WARMUP, plan.steps // 4)
    state = warming.run_mcmc(state, warmup, skip_initial_state_check=True, store=False)
    sampler.run_mcmc(state, plan.steps, skip_initial_state_check=True)
    chain = model.parameters_at(sampler.get_chain())
    return chain, sampler.acceptance_fraction.mean()
