"""Times of one effective draw of the slowest parameter, compared with plain emcee.

Plain emcee has 32 walkers, its default moves, and a Python function of the points for each walker.
No sampling may use 1 GiB.
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
from reproduce.inference.models import GaussianRegistration, registration_model
from reproduce.inference.sampling import Plan, run_ensemble, sample
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import Registration, prepare

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


def likelihood(count: int) -> GaussianRegistration:
    return GaussianRegistration(prepare(*data(count), PIVOT))


def plain_log_posterior(u: Points, source: Points, target: Points) -> float:
    """Return the log density of a user in plain NumPy."""
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
    centre, spread = likelihood(count).start()
    start = centre + spread * np.random.default_rng(2).normal(size=(WALKERS, 5))
    sampler = emcee.EnsembleSampler(
        WALKERS, 5, plain_log_posterior, args=(source, target)
    )
    sampler.run_mcmc(start, steps)
    return np.asarray(sampler.get_chain())


def package_chain(model: Model, steps: int) -> Points:
    walkers = posteriors()["registration"].plan.walkers
    plan = Plan(1, walkers=walkers, steps=steps, warmup=200)
    return run_ensemble(model, plan, 0)[0]


def stretched_chain(model: Model, steps: int, walkers: int = WALKERS) -> Points:
    """Sample a likelihood of the book with the default moves of emcee, vectorised."""
    sampler = emcee.EnsembleSampler(
        walkers, model.dimension, model.log_posterior, vectorize=True
    )
    start = model.start(np.random.default_rng(1), walkers)
    sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    return np.asarray(sampler.get_chain())


def effective(chain: Points) -> float:
    """Return the effective draws of the slowest parameter, without the first quarter."""
    columns = np.moveaxis(chain[None, len(chain) // 4 :], -1, 0)
    found = [summarised("", "", column) for column in columns]
    return min(min(one.bulk, one.tail) for one in found)


def peak() -> int:
    """Return the peak memory of this process in KiB; getrusage includes that of the parent."""
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    if found is None:
        raise RuntimeError(
            "expected VmHWM in /proc/self/status; measure memory on Linux"
        )
    return int(found[1])


def bench_registration_posterior(promise: Promise) -> None:
    """Compare samples of 137 and 100,000 points with plain chains of few steps.

    Effective draws per step are those of a long chain at 137 points: the posterior has the same
    shape for any number of points, the stretch move is affine invariant, and the autocorrelation
    time of a short chain is unknown.
    """
    steps, timed, few_timed = 3000, 2000, 30
    per_step = effective(plain_chain(FEW, 6000)) / (0.75 * 6000)
    models = {count: registration_model(likelihood(count)) for count in (FEW, MANY)}
    for count, plain_steps, times in ((FEW, timed, 100), (MANY, few_timed, 2000)):
        package = partial(package_chain, models[count], steps)
        work = effective(package()) / (per_step * plain_steps)
        name = f"registration posterior of {count:,} points, plain emcee"
        promise(
            name,
            package,
            partial(plain_chain, count, plain_steps),
            1 / times,
            rounds=3,
            work=work,
        )
    few, many = (partial(package_chain, models[count], steps) for count in (FEW, MANY))
    promise("registration posterior of 100,000 points, our own of 137", many, few, 1.3)


@pytest.mark.parametrize("name", ["misalignment", "misalignment-drift"])
def bench_misalignment_posterior(promise: Promise, name: str) -> None:
    """Compare with the default moves of emcee for the same likelihood."""
    model = posteriors()[name].model()
    package, other = (
        partial(package_chain, model, 1000),
        partial(stretched_chain, model, 8000),
    )
    work = effective(package()) / effective(other())
    promise(
        f"posterior of {name}, emcee's own moves",
        package,
        other,
        1 / 50,
        rounds=3,
        work=work,
    )


def bench_all_posteriors_of_the_book(promise: Promise) -> None:
    """Compare the posteriors of the book with the same number of steps of emcee."""
    declared = [(one.model(), one.plan) for one in posteriors().values()]

    def package() -> None:
        for model, plan in declared:
            sample(model, plan)

    def other() -> None:
        for model, plan in declared:
            walkers = plan.walkers_for(model.dimension)
            stretched_chain(model, plan.ensembles * (plan.steps + plan.warmup), walkers)

    promise(
        "all posteriors of the book, as many plain steps", package, other, 2.5, rounds=1
    )
    assert peak() < GIBIBYTE
