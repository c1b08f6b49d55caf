"""Posteriors, in the time of one effective draw of the slowest parameter, against plain emcee.

Plain is emcee as one would first write it: 32 walkers, its own moves, a Python function per walker
over the raw points. No sampling may take a gibibyte.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import emcee
import numpy as np
import pytest
from numpy.typing import NDArray

from reproduce.inference import Model, summarised
from reproduce.inference.models import registration_model
from reproduce.inference.sampling import Plan, run_ensemble, sample
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import Registration

Points = NDArray[np.float64]
Promise = Callable[..., None]

PIVOT = np.array([1030.0, 770.0])
TRUTH = Registration.similarity(1.002, -0.001, (-1.0, -2.0), PIVOT)
FEW, MANY, WALKERS = 137, 100_000, 32
GIBIBYTE = 1024**2  # in kibibytes


def data(count: int) -> tuple[Points, Points]:
    generator = np.random.default_rng(1)
    source = generator.uniform((0, 0), (2064, 1544), (count, 2))
    return source, TRUTH.apply(source) + 0.07 * generator.normal(size=source.shape)


def plain_log_posterior(u: Points, source: Points, target: Points) -> float:
    """The model as one would write it, as lean as NumPy makes it."""
    k, theta, shift_x, shift_y, noise = u
    if not (0.5 < k < 2 and abs(theta) < 0.5 and 1e-4 < noise < 20):
        return -np.inf
    cosine, sine = k * np.cos(theta), k * np.sin(theta)
    x, y = source[:, 0] - PIVOT[0], source[:, 1] - PIVOT[1]
    left_x = target[:, 0] - (cosine * x - sine * y + PIVOT[0] - shift_x)
    left_y = target[:, 1] - (sine * x + cosine * y + PIVOT[1] - shift_y)
    squares = left_x @ left_x + left_y @ left_y
    return float(-(2 * len(x) + 1) * np.log(noise) - squares / (2 * noise**2))


def plain_chain(count: int, steps: int) -> Points:
    source, target = data(count)
    centre, spread = registration_model(source, target, PIVOT).likelihood.start()
    start = centre + spread * np.random.default_rng(2).normal(size=(WALKERS, 5))
    sampler = emcee.EnsembleSampler(
        WALKERS, 5, plain_log_posterior, args=(source, target)
    )
    sampler.run_mcmc(start, steps)
    return np.asarray(sampler.get_chain())


def our_chain(model: Model, steps: int) -> Points:
    walkers = posteriors()["registration"].plan().walkers
    plan = Plan(1, walkers=walkers, steps=steps, warmup=200)
    return run_ensemble(model, plan, 0)[0]


def stretched_chain(model: Model, steps: int, walkers: int = WALKERS) -> Points:
    """emcee's own moves over a likelihood of the book, all walkers at once."""
    sampler = emcee.EnsembleSampler(
        walkers, model.dimension, model.log_posterior, vectorize=True
    )
    start = model.start(np.random.default_rng(1), walkers)
    sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    return np.asarray(sampler.get_chain())


def effective(chain: Points) -> float:
    """Effective draws of the slowest parameter, once a quarter is left out as the way there."""
    columns = np.moveaxis(chain[None, len(chain) // 4 :], -1, 0)
    found = [summarised("", "", column) for column in columns]
    return min(min(one.bulk, one.tail) for one in found)


def peak() -> int:
    """Peak memory of this process, in KiB; getrusage would add its parent's, as of its start."""
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    if found is None:
        raise RuntimeError(
            "expected VmHWM in /proc/self/status; measure memory on Linux"
        )
    return int(found[1])


def bench_registration_posterior(promise: Promise) -> None:
    """At 137 points and at 100,000; the latter's plain chain is timed over few steps.

    Effective draws per step are those of a long chain at 137 points: the posterior has the same
    shape for any number of points, the stretch is affine invariant, and a short chain would not
    know its own autocorrelation time.
    """
    steps, timed, few_timed = 3000, 2000, 30
    per_step = effective(plain_chain(FEW, 6000)) / (0.75 * 6000)
    models = {count: registration_model(*data(count), PIVOT) for count in (FEW, MANY)}
    for count, plain_steps, times in ((FEW, timed, 100), (MANY, few_timed, 2000)):
        ours = partial(our_chain, models[count], steps)
        work = effective(ours()) / (per_step * plain_steps)
        name = f"registration posterior of {count:,} points, plain emcee"
        promise(
            name,
            ours,
            partial(plain_chain, count, plain_steps),
            1 / times,
            rounds=3,
            work=work,
        )
    few, many = (partial(our_chain, models[count], steps) for count in (FEW, MANY))
    promise("registration posterior of 100,000 points, our own of 137", many, few, 1.3)


@pytest.mark.parametrize("name", ["misalignment", "misalignment-drift"])
def bench_misalignment_posterior(promise: Promise, name: str) -> None:
    """Against emcee's own moves over the same likelihood, all walkers at once."""
    model = posteriors()[name].model()
    ours, theirs = (
        partial(our_chain, model, 1000),
        partial(stretched_chain, model, 8000),
    )
    work = effective(ours()) / effective(theirs())
    promise(
        f"posterior of {name}, emcee's own moves",
        ours,
        theirs,
        1 / 50,
        rounds=3,
        work=work,
    )


def bench_all_posteriors_of_the_book(promise: Promise) -> None:
    """As the book samples them, against emcee's own moves for as many steps, whatever they give."""
    declared = [(one.model(), one.plan()) for one in posteriors().values()]

    def ours() -> None:
        for model, plan in declared:
            sample(model, plan)

    def theirs() -> None:
        for model, plan in declared:
            walkers = plan.walkers_for(model.dimension)
            stretched_chain(model, plan.ensembles * (plan.steps + plan.warmup), walkers)

    promise(
        "all posteriors of the book, as many plain steps", ours, theirs, 2.5, rounds=1
    )
    assert peak() < GIBIBYTE
