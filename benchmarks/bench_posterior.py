"""How fast posteriors are sampled, against the plain way.

The promises are ratios in one run on one machine, in effective draws per second of the slowest
parameter:

* registration of 137 points, at least 100 times a plain emcee loop: 32 walkers, emcee's own moves,
  a Python function per walker over the raw points;
* registration of 100,000 points, at least 2,000 times it, and within a twentieth of our own speed
  at 137 points;
* both misalignments, at least 50 times emcee's own moves over the same likelihood, all walkers at
  once.

And limits from the processor time that was used: all posteriors of the book,
and the calibration of a registration. No process may take a gibibyte, nor all of them together:
the resident memory at its peak, as Linux counts it for each process. It does not depend on the
number of cores or threads.
"""

from __future__ import annotations

import os
import re
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import emcee
import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from calibrations import REPLICATES, SEED, replicate
from reproduce.inference import Model, diagnose
from reproduce.inference.models import registration_model
from reproduce.inference.sampling import Job, Plan, run_ensemble, sample
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import Registration

Points = NDArray[np.float64]

PIVOT = np.array([1030.0, 770.0])
TRUTH = Registration.similarity(1.002, -0.001, (-1.0, -2.0), PIVOT)
MANY, PROMISED, PROMISED_MANY, SPREAD = 100_000, 100, 2000, 0.05
PROMISED_SPOTS = 50
WALKERS = posteriors()["registration"].plan().walkers
CORES, BOOK_SECONDS, CALIBRATION_SECONDS, REPLICATES_TIMED = 2, 90, 600, 60
GIBIBYTE = 1024**2  # in kibibytes


def forget_peak() -> None:
    """Begin to watch this process's memory again: what ran before in it does not count."""
    Path("/proc/self/clear_refs").write_text("5")


def peak() -> int:
    """Peak memory of this process, in KiB; getrusage would add its parent's, as of its start."""
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    if found is None:
        raise RuntimeError("expected VmHWM in /proc/self/status; measure memory on Linux")
    return int(found[1])


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


def plain_chain(count: int, steps: int) -> tuple[Points, float]:
    """Chain of the plain loop after its warm-up, and its seconds per step."""
    source, target = data(count)
    model = registration_model(source, target, PIVOT)
    centre, spread = model.likelihood.start()
    start = centre + spread * np.random.default_rng(2).normal(size=(32, 5))
    sampler = emcee.EnsembleSampler(32, 5, plain_log_posterior, args=(source, target))
    state = sampler.run_mcmc(start, max(5, steps // 4))
    sampler.reset()
    begin = time.perf_counter()
    sampler.run_mcmc(state, steps)
    return sampler.get_chain(), (time.perf_counter() - begin) / steps


@cache
def plain_size() -> float:
    """Least effective draws per step of the plain loop, from a long chain at 137 points."""
    chain, _ = plain_chain(137, 6000)
    return _least(chain) / len(chain)


def plain_rate(count: int, steps: int) -> float:
    """Least effective draws per second of the plain loop.

    Effective draws per step are those of a long chain at 137 points: the posterior has the same
    shape for any number of points, the stretch is affine invariant, and a short chain would not
    know its own autocorrelation time. Seconds per step are measured at `count` points.
    """
    _, seconds = plain_chain(count, steps)
    return plain_size() / seconds


def our_rate(count: int, steps: int = 3000) -> tuple[float, float]:
    """Least effective draws per second of ours, the warm-up counted, and runs per second.

    Runs per second tell two numbers of points apart better: effective draws are the same for any
    number, and are themselves known to a tenth.
    """
    model = registration_model(*data(count), PIVOT)
    model.likelihood(model.likelihood.start()[0][None])  # reduces the data once
    begin = time.perf_counter()
    chain, _, _ = run_ensemble(Job(model, Plan(1, walkers=WALKERS, steps=steps, warmup=200), 0))
    seconds = time.perf_counter() - begin
    return _least(chain) / seconds, 1 / seconds


def _least(chain: Points) -> float:
    names = tuple(str(i) for i in range(chain.shape[-1]))
    return min(min(one.bulk, one.tail) for one in diagnose(names, chain[None]))


@pytest.mark.benchmark(group="posterior")
def bench_registration_posterior(benchmark: BenchmarkFixture) -> None:
    """Time one ensemble at 137 points, and hold the ratio to the plain loop to the promise."""
    model = registration_model(*data(137), PIVOT)
    benchmark.pedantic(
        lambda: run_ensemble(Job(model, Plan(1, walkers=WALKERS, steps=500, warmup=200), 0)),
        rounds=3,
    )
    # Turn about and the best of each, so that other work on the machine disturbs both alike.
    pairs = [(our_rate(137)[0], plain_rate(137, 2000)) for _ in range(3)]
    ours, plain = (max(rates) for rates in zip(*pairs, strict=True))
    ratio = ours / plain
    print(f"\nregistration posterior, 137 points: {ratio:.0f} times a plain loop")
    assert ratio > PROMISED


@pytest.mark.benchmark(group="posterior")
def bench_registration_posterior_of_many_points(benchmark: BenchmarkFixture) -> None:
    """The same at 100,000 points, where the plain loop is measured over fewer steps."""
    forget_peak()
    model = registration_model(*data(MANY), PIVOT)
    benchmark.pedantic(
        lambda: run_ensemble(Job(model, Plan(1, walkers=WALKERS, steps=500, warmup=200), 0)),
        rounds=3,
    )
    rounds = [(*our_rate(MANY), our_rate(137)[1], plain_rate(MANY, 30)) for _ in range(4)]
    rate, many, few, plain = (max(rates) for rates in zip(*rounds, strict=True))
    ratio = rate / plain
    print(f"\n100,000 points: {ratio:.0f} times a plain loop, {many / few:.2f} of our own at 137")
    assert ratio > PROMISED_MANY
    assert many > (1 - SPREAD) * few
    assert peak() < GIBIBYTE


def stretched_rate(model: Model, steps: int = 8000) -> float:
    """Least effective draws per second of emcee's own moves over the likelihood of the book."""
    sampler = emcee.EnsembleSampler(32, model.dimension, model.log_posterior, vectorize=True)
    start = model.start(np.random.default_rng(1), 32)
    state = sampler.run_mcmc(start, steps // 4, skip_initial_state_check=True)
    sampler.reset()
    begin = time.perf_counter()
    sampler.run_mcmc(state, steps)
    return _least(sampler.get_chain()) / (time.perf_counter() - begin)


@pytest.mark.benchmark(group="posterior")
@pytest.mark.parametrize("name", ["misalignment", "misalignment-drift"])
def bench_misalignment_posterior(benchmark: BenchmarkFixture, name: str) -> None:
    """Time one ensemble, and hold the ratio to emcee's own moves to the promise."""
    model = posteriors()[name].model()
    plan = Plan(1, steps=1000, warmup=200)
    chain = benchmark.pedantic(lambda: run_ensemble(Job(model, plan, 0))[0], rounds=3)
    ours, plain = _least(chain) / benchmark.stats.stats.min, stretched_rate(model)
    print(f"\n{name}: {ours:,.0f} effective draws a second, {ours / plain:.0f} times emcee's moves")
    assert ours > PROMISED_SPOTS * plain


def sampled(name: str) -> tuple[int, float, int]:
    """Sample one model of the book; returns process, its seconds and its peak memory so far."""
    before = time.process_time()
    declared = posteriors()[name]
    sample(declared.model(), declared.plan())
    return os.getpid(), time.process_time() - before, peak()


def all_posteriors() -> tuple[dict[int, float], dict[int, int]]:
    """Sample all posteriors from nothing on two cores: seconds and peak memory of each process."""
    seconds: dict[int, float] = defaultdict(float)
    memory: dict[int, int] = defaultdict(int)
    with ProcessPoolExecutor(CORES, mp_context=get_context("spawn")) as pool:
        for process, spent, peak in pool.map(sampled, posteriors()):
            seconds[process] += spent
            memory[process] = max(memory[process], peak)
    return seconds, memory


@pytest.mark.benchmark(group="posterior")
def bench_all_posteriors_of_the_book(benchmark: BenchmarkFixture) -> None:
    """From fresh processes, every posterior; the time is that of all processes."""
    seconds, memory = benchmark.pedantic(all_posteriors, rounds=1)
    print(
        f"\nall posteriors: {sum(seconds.values()):.0f} s of processor; "
        f"{sum(memory.values()) / 1024:.0f} MiB in all, "
        f"{max(memory.values()) / 1024:.0f} MiB in the larger one"
    )
    assert len(seconds) == CORES
    assert sum(seconds.values()) < BOOK_SECONDS
    assert sum(memory.values()) < GIBIBYTE


@pytest.mark.benchmark(group="posterior")
def bench_calibration_of_a_registration(benchmark: BenchmarkFixture) -> None:
    """A share of the replicates, here, in seconds of processor time; the rest takes as long."""
    forget_peak()
    model = posteriors()["registration"].model()
    before = time.process_time()
    benchmark.pedantic(
        lambda: [replicate(model, SEED, index) for index in range(REPLICATES_TIMED)], rounds=1
    )
    spent = (time.process_time() - before) * REPLICATES / REPLICATES_TIMED / CORES
    print(f"\ncalibration, {REPLICATES} replicates: {spent:.0f} s on {CORES} cores")
    assert spent < CALIBRATION_SECONDS
    assert peak() < GIBIBYTE
