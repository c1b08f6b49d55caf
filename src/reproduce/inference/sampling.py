"""Sampling a model with several independent emcee ensembles, on any executor.

Every ensemble has its own stream of random numbers, spawned from one seed: the draws do not depend
on the order of the ensembles, on how many processes carry them, or on interruptions.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import emcee
import numpy as np
from emcee.state import State
from numpy.random import MT19937, PCG64, Generator, RandomState, SeedSequence

from reproduce.inference import moves
from reproduce.inference.diagnostics import Gates, UnconvergedError, diagnose, require
from reproduce.inference.model import Model
from reproduce.inference.parts import Progress, Store, run_parts
from reproduce.inference.posterior import Sampled
from reproduce.physics.validate import FloatArray, whole_number

# Steps beyond which a chain that asks for more is refused.
MOST = 20_000


@dataclass(frozen=True)
class Plan:
    """How a model is sampled.

    - `seed`: root of all random numbers.
    - `ensembles`, `walkers`: independent ensembles (at least four for a posterior that is shown;
      calibration uses one per replicate) and walkers in each; zero walkers stands for the usual
      number.
    - `steps`, `warmup`: steps kept and steps dropped before them.
    - `gates`: what the chains must reach.
    """

    seed: int
    ensembles: int = 4
    walkers: int = 0
    steps: int = 1000
    warmup: int = 500
    gates: Gates = field(default_factory=Gates)

    def __post_init__(self) -> None:
        for name in ("ensembles", "steps"):
            whole_number(name, getattr(self, name))
        whole_number("warmup", self.warmup, least=0)
        whole_number("walkers", self.walkers, least=0)

    def walkers_for(self, dimension: int) -> int:
        """Walkers of an ensemble: enough that half of them know the covariance."""
        walkers = self.walkers or max(32, 24 * dimension)
        if walkers < 2 * dimension + 2 or walkers % 2:
            raise ValueError(
                f"walkers: expected an even number of at least {2 * dimension + 2} for {dimension} "
                f"parameters, got {walkers}; give 0 for the usual number"
            )
        return walkers


@dataclass(frozen=True)
class Job:
    """One ensemble to run; small enough to send to any worker."""

    model: Model
    plan: Plan
    ensemble: int


def sample(
    model: Model,
    plan: Plan,
    *,
    longer: bool = False,
    executor: Executor | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> Sampled:
    """Sample the posterior of a model, and refuse chains that miss the gates.

    Chains that are too short may be run again, `longer`: with as many steps as they are found to
    need, up to `MOST`. Without an executor the ensembles run here, one after the other. In a
    folder each finished ensemble of the first run is kept; what lies there is not run again.
    """
    store = None if folder is None else Store(folder, _note(model, plan))
    jobs = [Job(model, plan, ensemble) for ensemble in range(plan.ensembles)]
    results = run_parts(run_ensemble, jobs, executor, store, progress)
    chain, log_posterior, accepted = (np.stack(column) for column in zip(*results, strict=True))
    acceptance = tuple(accepted.tolist())
    diagnoses = diagnose(model.names, chain)
    found = Sampled(model, plan.seed, chain, log_posterior, acceptance, diagnoses, plan.gates)
    try:
        require(diagnoses, acceptance, plan.gates)
        if longer:
            found.consequences()
    except UnconvergedError as error:
        if not longer or error.steps is None or error.steps > MOST:
            raise
        enough = replace(plan, steps=error.steps, warmup=max(plan.warmup, error.steps // 4))
        return sample(model, enough, longer=True, executor=executor, progress=progress)
    return found


def run_ensemble(
    job: Job, lacking: Callable[[FloatArray], int] | None = None
) -> tuple[FloatArray, FloatArray, float]:
    """Run one ensemble.

    Returns its chain (steps, walkers, d), log posterior (steps, walkers) and the share of moves
    that were accepted, all after the warm-up. `lacking`, if given, says of the chain how many
    steps more it needs; it goes on until that is none.
    """
    plan, dimension = job.plan, job.model.dimension
    walkers = plan.walkers_for(dimension)
    warming, sampler = (
        emcee.EnsembleSampler(
            walkers, dimension, job.model.log_posterior, vectorize=True,
            moves=kinds(job.model.coordinates()),
        )
        for kinds in (moves.inward, moves.mixture)
    )  # fmt: skip
    generator, random_state = _streams(plan.seed, job.ensemble)
    state = State(job.model.start(generator, walkers), random_state=random_state)
    if plan.warmup:
        state = warming.run_mcmc(state, plan.warmup, skip_initial_state_check=True, store=False)
    sampler.run_mcmc(state, plan.steps, skip_initial_state_check=True)
    while lacking and (more := lacking(sampler.get_chain())) > 0:
        sampler.run_mcmc(None, more)
    return sampler.get_chain(), sampler.get_log_prob(), float(sampler.acceptance_fraction.mean())


def _streams(seed: int, ensemble: int) -> tuple[Generator, Any]:
    """Return the generator of the start and emcee's random state, for one ensemble."""
    child = [SeedSequence(seed, spawn_key=(ensemble, i)) for i in (0, 1)]
    return Generator(PCG64(child[0])), RandomState(MT19937(child[1])).get_state(legacy=True)


def _note(model: Model, plan: Plan) -> dict[str, Any]:
    """Return what a folder of chains is for: the model, its data and how it is sampled."""
    settings = {key: value for key, value in asdict(plan).items() if key != "gates"}
    return {"model": model.name, "parameters": list(model.names), **settings,
            "data": _fingerprint(model)}  # fmt: skip


def _fingerprint(model: Model) -> str:
    """Return a hash that changes with the data, the likelihood and the priors."""
    centre, spread = model.likelihood.start()
    points = np.concatenate([centre[None], model.start(Generator(PCG64(0)), 4)])
    # Rounded, so that another build of NumPy does not call the same data others.
    numbers = [np.round(model.log_posterior(points), 4), (centre / spread).round(4)]
    return hashlib.sha256(np.concatenate(numbers).tobytes()).hexdigest()
