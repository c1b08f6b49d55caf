"""Sampling a model with several independent emcee ensembles, resumable, on any executor.

Every ensemble has its own stream of random numbers, spawned from one seed: the draws do not depend
on the order of the ensembles, on how many processes carry them, or on interruptions.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from concurrent.futures import Executor, as_completed
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import emcee
import numpy as np
from emcee.state import State
from numpy.random import MT19937, PCG64, Generator, RandomState, SeedSequence

from reproduce.inference import moves
from reproduce.inference.checkpoints import CheckpointBackend
from reproduce.inference.diagnostics import Gates, diagnose, require
from reproduce.inference.model import Model
from reproduce.inference.posterior import Posterior
from reproduce.physics.validate import FloatArray, whole_number

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Plan:
    """How a model is sampled.

    Parameters
    ----------
    seed : int
        Root of all random numbers.
    ensembles, walkers : int
        Independent ensembles (at least four for a posterior that is shown; calibration uses one
        per replicate) and walkers in each; zero walkers stands for the usual number.
    steps, warmup : int
        Steps kept and steps dropped before them.
    checkpoint : int
        Steps between checkpoints, where results are stored.
    gates : Gates
        What the chains must reach.
    """

    seed: int
    ensembles: int = 4
    walkers: int = 0
    steps: int = 1000
    warmup: int = 500
    checkpoint: int = 250
    gates: Gates = field(default_factory=Gates)

    def __post_init__(self) -> None:
        for name in ("ensembles", "steps", "checkpoint"):
            whole_number(name, getattr(self, name))
        whole_number("warmup", self.warmup, least=0)
        whole_number("walkers", self.walkers, least=0)

    def walkers_for(self, dimension: int) -> int:
        """Walkers of an ensemble: enough that half of them know the covariance."""
        walkers = self.walkers or max(32, 12 * dimension)
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
    folder: Path | None = None


class ResumeError(ValueError):
    """A folder holds the results of another model, other data or another plan."""


def sample(
    model: Model,
    plan: Plan,
    *,
    executor: Executor | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> Posterior:
    """Sample the posterior of a model, and refuse chains that miss the gates.

    Parameters
    ----------
    model : Model
        With its data.
    plan : Plan
        Seed, ensembles, steps and gates.
    executor : concurrent.futures.Executor, optional
        Carries one task per ensemble: processes, or a Dask cluster through its executor. Without
        one the ensembles run here, one after the other.
    folder : pathlib.Path, optional
        Where the chains are stored, one HDF5 file per ensemble; what lies there already is
        continued. Workers must see the same folder.
    progress : callable, optional
        Called with the steps done and all steps.

    Returns
    -------
    Posterior
        Draws with their diagnosis.

    Raises
    ------
    ConvergenceError
        If the chains miss a gate; the error carries the numbers.
    ResumeError
        If the folder holds something else.
    """
    if folder is not None:
        _claim(folder, model, plan)
    jobs = [Job(model, plan, ensemble, folder) for ensemble in range(plan.ensembles)]
    whole = plan.ensembles * (plan.warmup + plan.steps)
    tell = progress or (lambda done, total: None)
    if executor is None:
        results = []
        for job in jobs:
            before = job.ensemble * (plan.warmup + plan.steps)
            results.append(run_ensemble(job, _offset(tell, before, whole)))
    else:
        futures = [executor.submit(run_ensemble, job) for job in jobs]
        for count, _ in enumerate(as_completed(futures), start=1):
            tell(count * (plan.warmup + plan.steps), whole)
        results = [future.result() for future in futures]
    return assembled(model, plan, results)


def _offset(tell: Progress, before: int, whole: int) -> Callable[[int], None]:
    return lambda done: tell(before + done, whole)


def assembled(model: Model, plan: Plan, results: list[tuple[Any, Any, float]]) -> Posterior:
    """Put ensembles together, diagnose them and hold them to the gates."""
    chain = np.stack([result[0] for result in results])
    log_posterior = np.stack([result[1] for result in results])
    acceptance = tuple(result[2] for result in results)
    diagnoses = diagnose(model.names, chain)
    require(diagnoses, acceptance, plan.gates)
    return Posterior(model, plan.seed, chain, log_posterior, acceptance, diagnoses, plan.gates)


def streams(seed: SeedSequence | int, ensemble: int) -> tuple[Generator, Any]:
    """Return the generator of the start and emcee's random state, for one ensemble."""
    root = seed if isinstance(seed, SeedSequence) else SeedSequence(seed)
    child = [SeedSequence(root.entropy, spawn_key=(*root.spawn_key, ensemble, i)) for i in (0, 1)]
    return Generator(PCG64(child[0])), RandomState(MT19937(child[1])).get_state(legacy=True)


def run_ensemble(
    job: Job, progress: Callable[[int], None] | None = None
) -> tuple[FloatArray, FloatArray, float]:
    """Run one ensemble, from its last checkpoint if it has one.

    Parameters
    ----------
    job : Job
        The ensemble.
    progress : callable, optional
        Called with the steps done.

    Returns
    -------
    tuple
        Chain (steps, walkers, d) and log posterior (steps, walkers) after warm-up; share of moves
        that were accepted, warm-up included.
    """
    plan, total = job.plan, job.plan.warmup + job.plan.steps
    walkers = plan.walkers_for(job.model.dimension)
    path = None if job.folder is None else job.folder / f"ensemble-{job.ensemble}.h5"
    stored = None if path is None else CheckpointBackend(path)
    backend = stored or emcee.backends.Backend()
    sampler = emcee.EnsembleSampler(
        walkers, job.model.dimension, job.model.log_posterior, vectorize=True,
        moves=moves.mixture(job.model.coordinates()), backend=backend,
    )  # fmt: skip
    done = sampler.iteration
    state = sampler._previous_state if done else _start(job, walkers)
    while done < total:
        count = min(plan.checkpoint, total - done)
        state = sampler.run_mcmc(state, count, skip_initial_state_check=True)
        done += count
        if stored is not None:
            stored.store()
        if progress is not None:
            progress(done)
    if stored is not None:
        backend = stored.close()
    acceptance = float((backend.accepted / backend.iteration).mean())
    chain = backend.get_chain(discard=plan.warmup)
    return chain, backend.get_log_prob(discard=plan.warmup), acceptance


def _start(job: Job, walkers: int) -> State:
    generator, random_state = streams(job.plan.seed, job.ensemble)
    return State(job.model.start(generator, walkers), random_state=random_state)


def _claim(folder: Path, model: Model, plan: Plan) -> None:
    """Write down what the folder is for, or refuse one that is for something else."""
    settings = {k: v for k, v in asdict(plan).items() if k not in {"gates", "checkpoint"}}
    note = {"model": model.name, "parameters": list(model.names), **settings,
            "data": fingerprint(model)}  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "plan.json"
    if path.exists():
        try:
            found = dict(json.loads(path.read_text(encoding="utf-8")))
        except ValueError as error:
            raise ResumeError(
                f"{path}: expected the plan of a stored run in JSON, got something else; choose "
                "another folder"
            ) from error
        if found != note:
            different = sorted(k for k in note if found.get(k) != note[k])
            raise ResumeError(
                f"{folder}: expected an empty folder or the same run, got results that differ in "
                f"{', '.join(different)}; choose another folder"
            )
        return
    part = path.with_suffix(".part")
    part.write_text(json.dumps(note, indent=2), encoding="utf-8")
    part.replace(path)


def fingerprint(model: Model) -> str:
    """Return a hash that changes with the data, the likelihood and the priors."""
    centre, spread = model.likelihood.start()
    points = np.concatenate([centre[None], model.start(Generator(PCG64(0)), 4)])
    # Rounded, so that another build of NumPy does not call the same data others.
    numbers = [np.round(model.log_posterior(points), 4), (centre / spread).round(4)]
    return hashlib.sha256(np.concatenate(numbers).tobytes()).hexdigest()
