"""Simulation-based calibration: does the sampled posterior know what it knows?

A parameter vector is drawn from the prior, data are simulated from it, the posterior is sampled,
and the true value is ranked among the draws. If model, likelihood and sampler are right, all ranks
are equally probable, for every parameter and for any quantity computed from parameters and data;
the log likelihood is such a quantity, and sees errors that no single parameter sees.
``python tools/evidence/calibrations.py`` calibrates every posterior of the book, or those that are
named, and stores its ranks; ``--table`` alone counts the stored ranks again. The book shows the
table of all, `calibrations`.
"""

from __future__ import annotations

import argparse
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pandas as pd
from numpy.random import PCG64, Generator, SeedSequence
from numpy.typing import NDArray
from scipy.special import ndtr
from scipy.stats import binom, norm

from estimators import estimate
from keep import write, write_table
from reproduce.inference import Model, autocorrelation_time, thinned
from reproduce.inference.sampling import Plan, run_ensemble
from reproduce.papers.posteriors import posteriors
from reproduce.physics.validate import FloatArray
from reproduce.store import studies

Counts = NDArray[np.int64]
Flags = NDArray[np.bool_]
Covered = NDArray[np.int8]

NAME = "calibrations"
COMMAND = "python tools/evidence/calibrations.py"
SEED, REPLICATES = 20_240_105, 1000
# Points near the posterior of the book at which a model is recognised.
POINTS = 8
PACKAGES = ("numpy", "scipy", "emcee")
# Shares by which a standard deviation may be too small, of which the power is told.
NARROW = {"narrow_10": 0.1, "narrow_5": 0.05}

# Ranks run from zero to this.
DRAWS = 99
# Kept steps of a replicate at first, and at most: it goes on until they are so many times the
# autocorrelation time, with a margin, since short chains find it too short.
STEPS, MOST = 250, 2000
TIMES, MARGIN = 50.0, 1.1
# Steps before them: the next number is tried where the gate on time is missed.
WARMUPS = (200, 1000)
LEVELS = (0.5, 0.9, 0.95)
QUANTITY = "log likelihood"
# Samples of even ranks that set the simultaneous band.
SIMULATIONS = 4000
# Calibrations that tell how often a fault is found.
TRIALS = 400


@dataclass(frozen=True, eq=False)
class Ranks:
    """Ranks of many replicates.

    - `names`: the parameters, their consequences, and the log likelihood.
    - `ranks`, (replicates, names): from 0 to `DRAWS`.
    - `failed`, (replicates,): replicates whose chain missed the gate on time even with the most
      steps. They keep their ranks: leaving them out would leave out the hard cases.
    - `covered`, (replicates, levels, parameters): whether the interval of each level of the
      published estimator covers: 1 or 0, and -1 for a parameter of which it gives no estimate.
    """

    names: tuple[str, ...]
    ranks: Counts
    failed: Flags
    covered: Covered

    @property
    def replicates(self) -> int:
        """How many replicates."""
        return len(self.ranks)

    def estimator_coverage(self, level: float) -> FloatArray:
        """Share of the published estimator's intervals of this level that cover, (parameters,).

        NaN where it gives no estimate.
        """
        covered = self.covered[:, LEVELS.index(level)]
        return np.where((covered >= 0).all(axis=0), covered.mean(axis=0), np.nan)

    def coverage(self, level: float) -> FloatArray:
        """Share of central posterior intervals of this level that cover, shape (names,).

        A rank on the end of an interval counts half, so that even ranks cover as often as claimed.
        """
        beside = np.abs(
            2 * self.ranks + 1 - (DRAWS + 1)
        )  # the middle of a rank, whole numbers
        reach = round(level * (DRAWS + 1), 9)
        return np.asarray(
            0.5 * ((beside < reach).mean(axis=0) + (beside <= reach).mean(axis=0))
        )

    def probabilities(self, seed: int = 1) -> FloatArray:
        """Probability of ranks at least as uneven, for each name, by the simultaneous band."""
        simulated = band_statistics(self.replicates, seed)
        smaller = np.searchsorted(simulated, _least(self.counts()), side="right")
        return np.asarray((smaller + 1) / (len(simulated) + 1))

    def counts(self) -> Counts:
        """Cumulated counts of ranks up to 0, 1, ..., shape (names, DRAWS + 1)."""
        table = [np.bincount(column, minlength=DRAWS + 1) for column in self.ranks.T]
        return np.cumsum(np.array(table), axis=1)


def simulated(model: Model, seed: int, index: int) -> tuple[FloatArray, Model]:
    """Draw the truth of one replicate, (d,), and the model with data simulated from it."""
    generator = Generator(PCG64(_stream(model, seed, index, 0)))
    truth = drawn_prior(model, generator, 1)[0]
    return truth, model.with_data(model.likelihood.simulate(truth, generator))


def drawn_prior(model: Model, generator: Generator, count: int) -> FloatArray:
    """Return independent draws from the prior, (count, d)."""
    return np.stack([p.prior.draw(generator, count) for p in model.parameters], axis=-1)


def _stream(model: Model, seed: int, index: int, part: int) -> SeedSequence:
    """Return the random numbers of a part of a replicate: each model has its own."""
    return SeedSequence(seed, spawn_key=(crc32(model.name.encode()), index, part))


def replicate(model: Model, seed: int, index: int) -> tuple[Counts, bool, Covered]:
    """Run one replicate, which is the same for any number of them and on any machine.

    Ranks, (names,); whether the chain missed the gate; covered, (levels, d).
    """
    truth, fitted = simulated(model, seed, index)
    entropy = int(_stream(model, seed, index, 1).generate_state(1, np.uint64)[0])
    for warmup in WARMUPS:
        plan = Plan(entropy, ensembles=1, steps=STEPS, warmup=warmup)
        chain, _, _ = run_ensemble(fitted, plan, 0, _lacking)
        time = _time(chain)
        if not (failed := len(chain) / time < TIMES):
            break
    draws = thinned(chain[None], time)[0]
    draws = draws[np.linspace(0, len(draws) - 1, DRAWS).astype(int)]
    # In random order: a consequence with random numbers of its own must not know the truth's place.
    order = Generator(PCG64(_stream(model, seed, index, 2))).permutation(len(draws) + 1)
    values = quantities(fitted, np.concatenate([truth[None], draws])[order])
    ranks = (values < values[order == 0]).sum(axis=0)
    return ranks, failed, _covered(fitted, truth)


def quantities(model: Model, parameters: FloatArray) -> FloatArray:
    """What is ranked: parameters, their consequences, the log likelihood; shape (n, names).

    A consequence may take its zero point from all vectors together, that of the truth among them:
    ranks of the truth are even all the same, since it is one of a kind with the draws.
    """
    derived = model.consequences(parameters).values()
    columns = [*parameters.T, *(one.values for one in derived)]
    return np.stack([*columns, model.likelihood(parameters)], axis=-1)


def named(model: Model) -> tuple[str, ...]:
    """Names of what is ranked, in the order of `quantities`."""
    derived = model.consequences(drawn_prior(model, Generator(PCG64(0)), 2))
    return (*model.names, *derived, QUANTITY)


def _time(chain: FloatArray) -> float:
    return max(
        autocorrelation_time(chain[None, ..., i]) for i in range(chain.shape[-1])
    )


def _lacking(chain: FloatArray) -> int:
    """Steps that a chain needs more to pass the gate on time."""
    return min(int(np.ceil(MARGIN * TIMES * _time(chain))), MOST) - len(chain)


def intervals(model: Model, seed: int, replicates: int) -> Covered:
    """Redo what `calibrate` tells of the published estimator, from the same data, unsampled.

    Shape (replicates, levels, parameters), as in `Ranks`.
    """
    found = [simulated(model, seed, index) for index in range(replicates)]
    return np.array([_covered(fitted, truth) for truth, fitted in found])


def _covered(model: Model, truth: FloatArray) -> Covered:
    centre, spread = estimate(model.likelihood)
    reach = norm.ppf(0.5 + np.array(LEVELS) / 2)[:, None]
    inside = np.abs(truth - centre) <= reach * spread
    return np.where(np.isnan(centre), -1, inside).astype(np.int8)


def calibrate(
    model: Model, seed: int, replicates: int, executor: Executor | None = None
) -> Ranks:
    """Run simulation-based calibration, on any executor; the model's own data play no part."""
    run = partial(replicate, model, seed)
    found = (map if executor is None else executor.map)(run, range(replicates))
    ranks, failed, covered = (np.array(column) for column in zip(*found, strict=True))
    return Ranks(named(model), ranks, failed, covered)


@lru_cache(maxsize=32)
def band_statistics(
    replicates: int, seed: int, simulations: int = SIMULATIONS
) -> FloatArray:
    """Smallest pointwise probability along a curve of even ranks, sorted, (simulations,)."""
    generator = Generator(PCG64(seed))
    even = np.full(DRAWS + 1, 1 / (DRAWS + 1))
    counts = np.cumsum(generator.multinomial(replicates, even, simulations), axis=1)
    return np.sort(_least(counts))


@lru_cache(maxsize=32)
def _tails(total: int) -> FloatArray:
    """Two-sided pointwise probabilities of every count up to each rank, (total + 1, DRAWS)."""
    counts = np.arange(total + 1)[:, None]
    share = np.arange(1, DRAWS + 1) / (DRAWS + 1)
    below, above = binom.cdf(counts, total, share), binom.sf(counts - 1, total, share)
    return np.asarray(2 * np.minimum(below, above))


def _least(counts: Counts) -> FloatArray:
    """Smallest pointwise probability of cumulated counts, shape (..., DRAWS + 1)."""
    table = _tails(int(counts.reshape(-1, DRAWS + 1)[0, -1]))
    return np.asarray(table[counts[..., :-1], np.arange(DRAWS)].min(axis=-1))


@lru_cache(maxsize=32)
def power(replicates: int, stretch: float, level: float = 0.95, seed: int = 2) -> float:
    """How often a calibration finds a posterior too wide by the factor `stretch`, or too narrow.

    The share of simulated calibrations of a Gaussian posterior whose curve of ranks leaves the
    band of this level.
    """
    generator = Generator(PCG64(seed))
    truths = generator.standard_normal((TRIALS, replicates))
    ranks = generator.binomial(DRAWS, ndtr(truths / stretch))
    counts = np.array([np.bincount(one, minlength=DRAWS + 1) for one in ranks]).cumsum(
        axis=1
    )
    limit = np.quantile(band_statistics(replicates, seed), 1 - level)
    return float((_least(counts) < limit).mean())


def log_posteriors(key: str, points: FloatArray, seed: int) -> FloatArray:
    """Return the fingerprint of a model, shape (2, POINTS): it knows data, likelihood and priors.

    Log posterior of the book's data at fixed points, and of the truth of as many replicates, which
    also knows how data are simulated.
    """
    model = posteriors()[key].model()
    pairs = (simulated(model, seed, index) for index in range(len(points)))
    return np.array(
        [
            model.log_posterior(points),
            [float(fit.log_posterior(t[None])[0]) for t, fit in pairs],
        ]
    )


def store(key: str, found: Ranks, seed: int, where: Path | None = None) -> None:
    """Keep a calibration with what is needed to redo it."""
    note: dict[str, str | int | float] = {
        "command": f"{COMMAND} {key} --replicates {found.replicates} --seed {seed}",
        "seed": seed,
        "versions": ", ".join(f"{name} {version(name)}" for name in PACKAGES),
        "names": "\t".join(found.names),
    }
    points = posteriors()[key].model().start(np.random.default_rng(0), POINTS)
    arrays: dict[str, NDArray[Any]] = {
        "points": points,
        "log_posterior": log_posteriors(key, points, seed),
        "ranks": found.ranks.astype(np.int16),
        "failed": found.failed.astype(bool),
        "covered": found.covered.astype(np.int8),
    }
    write(f"sbc-{key}", arrays, note, where)


def load(key: str, where: Path | None = None) -> Ranks:
    """Return the stored calibration of a posterior."""
    study = studies.read(f"sbc-{key}", where)
    names = tuple(str(study.note["names"]).split("\t"))
    ranks, failed, covered = (
        study.arrays[name] for name in ("ranks", "failed", "covered")
    )
    return Ranks(names, ranks.astype(np.int64), failed.astype(np.bool_), covered)


def table() -> pd.DataFrame:
    """Return how every quantity fares, and how often a posterior too narrow would be found out.

    `even`: probability of ranks at least as uneven, with the error that the number of simulated
    bands leaves; `covers_95`: how often central posterior intervals of 95 % cover; `published_95`:
    the same of the published estimator's, where it gives them; `narrow_10`: the share of
    calibrations with as many replicates that find a standard deviation 10 % too small.
    """
    rows = []
    for key in posteriors():
        found = load(key)
        theirs = found.estimator_coverage(0.95)
        # Consequences and the log likelihood are no parameters.
        published = np.append(theirs, np.full(len(found.names) - len(theirs), np.nan))
        chances = found.probabilities()
        errors = np.minimum(np.sqrt(chances * (1 - chances) / SIMULATIONS), chances / 5)
        powers = [power(found.replicates, 1 - share) for share in NARROW.values()]
        columns = zip(
            found.names, chances, errors, found.coverage(0.95), published, strict=True
        )
        failed = int(found.failed.sum())
        rows += [
            (key, name, found.replicates, failed, *map(float, numbers), *powers)
            for name, *numbers in columns
        ]
    heads = (
        "posterior",
        "quantity",
        "replicates",
        "failed",
        "even",
        "even_error",
        "covers_95",
        "published_95",
        *NARROW,
    )
    return pd.DataFrame(rows, columns=list(heads))


def main() -> None:
    """Calibrate what is asked for, and store ranks and table."""
    parser = argparse.ArgumentParser(description="Calibrate posteriors of the book.")
    parser.add_argument("posteriors", nargs="*")
    parser.add_argument("--replicates", type=int, default=REPLICATES)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--table", action="store_true", help="store the table alone")
    asked = parser.parse_args()
    if not asked.table:
        with ProcessPoolExecutor(mp_context=get_context("spawn")) as executor:
            for key in asked.posteriors or posteriors():
                model = posteriors()[key].model()
                store(
                    key,
                    calibrate(model, asked.seed, asked.replicates, executor),
                    asked.seed,
                )
    write_table(NAME, table(), {"command": f"{COMMAND} --table", "trials": TRIALS})


if __name__ == "__main__":
    main()
