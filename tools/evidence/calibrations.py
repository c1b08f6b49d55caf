"""Simulation-based calibration of the posteriors, and coverage of the published estimators.

A parameter vector is drawn from the prior, data are simulated from it, the posterior is sampled,
and the true value is ranked among the draws. If model, likelihood and sampler are right, all ranks
are equally probable, for every parameter and for any quantity computed from parameters and data.
The log likelihood is such a quantity. It shows errors that no single parameter shows.

``python tools/evidence/calibrations.py`` calibrates every posterior of the book, or the named ones,
and stores the ranks. ``--table`` stores only the table of all posteriors, `calibrations`.

The published estimators are the least-squares similarity of niu2024 and QUEST of chen2023. QUEST
neglects a drift within a group, takes the lasers as designed and the focal length as nominal, and
has the standard errors of the scatter of single images.
"""

from __future__ import annotations

import argparse
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.metadata import version
from multiprocessing import get_context
from typing import Any
from zlib import crc32

import numpy as np
import pandas as pd
from numpy.random import PCG64, Generator, SeedSequence
from numpy.typing import NDArray
from scipy.special import ndtr
from scipy.stats import binom, norm

from keep import write, write_table
from reproduce.inference import Model, autocorrelation_time, thinned
from reproduce.inference.models import (
    GaussianRegistration,
    MixtureRegistration,
    SpotLikelihood,
)
from reproduce.inference.sampling import Plan, run_ensemble
from reproduce.papers.posteriors import posteriors
from reproduce.physics.attitude import vector_from_rotation
from reproduce.physics.validate import FloatArray
from reproduce.store import studies

Counts = NDArray[np.int64]
Flags = NDArray[np.bool_]
Covered = NDArray[np.int8]
# Estimates of the parameters and their standard errors, both of shape (d,).
Estimate = tuple[FloatArray, FloatArray]

NAME = "calibrations"
COMMAND = "python tools/evidence/calibrations.py"
SEED, REPLICATES = 20_240_105, 1000
# Points near the posterior of the book at which a model is recognised.
POINTS = 8
PACKAGES = ("numpy", "scipy", "emcee")
# Fractions by which a standard deviation is too small, for the power of the calibration.
NARROW = {"narrow_10": 0.1, "narrow_5": 0.05}
# Ranks run from zero to this.
DRAWS = 99
# Kept steps of a replicate at first, and at most. The ensemble continues until they are the given
# multiple of the autocorrelation time, with a margin, since short chains underestimate it.
STEPS, MAX_STEPS = 250, 2000
TIMES, MARGIN = 50.0, 1.1
# Steps of the warm-up. The next number is tried if the criterion on time is missed.
WARMUPS = (200, 1000)
LEVELS = (0.5, 0.9, 0.95)
QUANTITY = "log likelihood"
# Samples of uniform ranks that set the simultaneous band.
SIMULATIONS = 4000
# Simulated calibrations that give the probability of finding a fault.
TRIALS = 400
_POWER_SEED = 2


@dataclass(frozen=True, eq=False)
class Ranks:
    """Ranks of many replicates.

    - `names`: names of the parameters, their consequences, and the log likelihood.
    - `ranks`, (replicates, names): from 0 to `DRAWS`.
    - `failed`, (replicates,): replicates whose chain missed the criterion on time with the most
      steps. Their ranks count, because these are the hard cases.
    - `covered`, (replicates, levels, parameters): whether the interval of each level of the
      published estimator covers: 1 or 0, and -1 for a parameter without an estimate.
    """

    names: tuple[str, ...]
    ranks: Counts
    failed: Flags
    covered: Covered

    @property
    def replicates(self) -> int:
        """Number of replicates."""
        return len(self.ranks)

    def estimator_coverage(self, level: float) -> FloatArray:
        """Return the fraction of intervals of the published estimator that cover, (parameters,).

        It is NaN without an estimate.
        """
        covered = self.covered[:, LEVELS.index(level)]
        return np.where((covered >= 0).all(axis=0), covered.mean(axis=0), np.nan)

    def coverage(self, level: float) -> FloatArray:
        """Return the fraction of central posterior intervals of this level that cover, (names,).

        A rank on the end of an interval counts half, so that uniform ranks have the exact coverage.
        """
        # Twice the distance of the middle of a rank from the median.
        beside = np.abs(2 * self.ranks + 1 - (DRAWS + 1))
        reach = round(level * (DRAWS + 1), 9)
        return np.asarray(
            0.5 * ((beside < reach).mean(axis=0) + (beside <= reach).mean(axis=0))
        )

    def probabilities(self) -> FloatArray:
        """Return the probability of ranks at least as uneven, shape (names,)."""
        simulated = band_statistics(self.replicates, seed=1)
        smaller = np.searchsorted(simulated, _least(self.counts()), side="right")
        return np.asarray((smaller + 1) / (len(simulated) + 1))

    def counts(self) -> Counts:
        """Return the cumulated counts of ranks up to 0, 1, ..., shape (names, DRAWS + 1)."""
        table = [np.bincount(column, minlength=DRAWS + 1) for column in self.ranks.T]
        return np.cumsum(np.array(table), axis=1)


def simulated(model: Model, seed: int, index: int) -> tuple[FloatArray, Model]:
    """Return the truth of one replicate, (d,), and the model with data simulated from it."""
    generator = Generator(PCG64(_stream(model, seed, index, 0)))
    truth = model.drawn_prior(generator, 1)[0]
    return truth, replace(model, likelihood=model.likelihood.simulate(truth, generator))


def _stream(model: Model, seed: int, index: int, part: int) -> SeedSequence:
    """Return the seed of a part of a replicate, different for each model."""
    return SeedSequence(seed, spawn_key=(crc32(model.name.encode()), index, part))


def replicate(model: Model, seed: int, index: int) -> tuple[Counts, bool, Covered]:
    """Run one replicate, which does not depend on the other replicates.

    Returns ranks, (names,), whether the chain missed the criterion on time, and the coverage of
    the published estimator, (levels, d).
    """
    truth, fitted = simulated(model, seed, index)
    entropy = int(_stream(model, seed, index, 1).generate_state(1, np.uint64)[0])
    for warmup in WARMUPS:
        plan = Plan(entropy, ensembles=1, steps=STEPS, warmup=warmup)
        chain, _ = run_ensemble(fitted, plan, 0)
        while (steps := _needed(chain)) > len(chain):
            chain, _ = run_ensemble(fitted, replace(plan, steps=steps), 0)
        time = _time(chain)
        if not (failed := len(chain) / time < TIMES):
            break
    draws = thinned(chain[None], time)[0]
    draws = draws[np.linspace(0, len(draws) - 1, DRAWS).astype(int)]
    # In random order, because a consequence with random numbers depends on the row.
    order = Generator(PCG64(_stream(model, seed, index, 2))).permutation(len(draws) + 1)
    values = quantities(fitted, np.concatenate([truth[None], draws])[order])
    below = values < values[order == 0]
    # Equal values, such as a probability of one, are ranked in the random order.
    below |= (values == values[order == 0]) & (np.cumsum(order == 0) == 0)[:, None]
    ranks = below.sum(axis=0)
    return ranks, failed, _covered(fitted, truth)


def quantities(model: Model, parameters: FloatArray) -> FloatArray:
    """Return parameters, their consequences and the log likelihood, shape (n, names).

    A consequence may have its zero point at the mean of all vectors. The ranks of the truth are
    uniform nevertheless, because its vector is one of them.
    """
    derived = model.consequences(parameters).values()
    columns = [*parameters.T, *(one.values for one in derived)]
    return np.stack([*columns, model.likelihood(parameters)], axis=-1)


def named(model: Model) -> tuple[str, ...]:
    """Return the names of the `quantities`, in order."""
    derived = model.consequences(model.drawn_prior(Generator(PCG64(0)), 2))
    return (*model.names, *derived, QUANTITY)


def _time(chain: FloatArray) -> float:
    return max(
        autocorrelation_time(chain[None, ..., i]) for i in range(chain.shape[-1])
    )


def _needed(chain: FloatArray) -> int:
    """Return the steps that a chain needs for the criterion on time."""
    return min(int(np.ceil(MARGIN * TIMES * _time(chain))), MAX_STEPS)


def intervals(model: Model, seed: int, replicates: int) -> Covered:
    """Return the coverage of the published estimator for the data of `calibrate`, without sampling.

    Shape (replicates, levels, parameters), as in `Ranks`.
    """
    found = [simulated(model, seed, index) for index in range(replicates)]
    return np.array([_covered(fitted, truth) for truth, fitted in found])


def _covered(model: Model, truth: FloatArray) -> Covered:
    centre, spread = estimate(model.likelihood)
    reach = norm.ppf(0.5 + np.array(LEVELS) / 2)[:, None]
    inside = np.abs(truth - centre) <= reach * spread
    return np.where(np.isnan(centre), -1, inside).astype(np.int8)


def estimate(likelihood: Any) -> Estimate:
    """Return the published estimates of the parameters; NaN for a parameter without an estimate."""
    if isinstance(likelihood, SpotLikelihood):
        return _quest(likelihood)
    if not isinstance(likelihood, GaussianRegistration):
        unknown = np.full(len(likelihood.start()[0]), np.nan)
        return unknown, unknown
    centre, spread = GaussianRegistration(likelihood.problem).start()
    # The residuals of wrong matches do not determine the noise.
    known = 4 if isinstance(likelihood, MixtureRegistration) else 5
    missing = np.full(len(likelihood.start()[0]) - known, np.nan)
    return np.append(centre[:known], missing), np.append(spread[:known], missing)


def _quest(data: SpotLikelihood) -> Estimate:
    """Return mount, misalignment and noise by QUEST, without drift and laser scale."""
    platform = data.platform
    zero = platform.transform(data.spots[0])
    mount = vector_from_rotation(platform.reference.T @ zero)
    angles = platform.misalignment(data.spots[1], zero)
    # The scatter about the mean of a group: a drift counts as noise.
    drift = np.square(data.moments[1]).sum(axis=(-2, -1)) @ data.weights[1]
    freedom = int((data.counts - 1).sum()) * data.spots[0].size
    noise = float(np.sqrt((data.squares + drift) / freedom))
    response = platform.response(data.spots).reshape(len(data.spots), 3, -1)
    first, second = (noise**2 / data.counts)[:, None, None] * (response @ response.mT)
    # Response of a rotation vector to a small rotation after it. The pattern determines the roll
    # hundreds of times worse than the tilts, so a vector of some arc minutes already transfers
    # the error of the roll to the tilts.
    after, later = (np.eye(3) + 0.5 * np.cross(np.eye(3), v) for v in (mount, angles))
    covariances = (
        after @ first @ after.T,
        later @ second @ later.T + later.T @ first @ later,
    )
    missing = np.full(4 if data.drifts else 1, np.nan)
    errors = [np.sqrt(np.diagonal(one)) for one in covariances]
    return (
        np.concatenate([mount, angles, missing, [noise]]),
        np.concatenate([*errors, missing, [noise / np.sqrt(2 * freedom)]]),
    )


def calibrate(
    model: Model, seed: int, replicates: int, executor: Executor | None = None
) -> Ranks:
    """Run simulation-based calibration, on any executor. The data of the model are not used."""
    run = partial(replicate, model, seed)
    found = (map if executor is None else executor.map)(run, range(replicates))
    ranks, failed, covered = (np.array(column) for column in zip(*found, strict=True))
    return Ranks(named(model), ranks, failed, covered)


@cache
def band_statistics(replicates: int, seed: int) -> FloatArray:
    """Return smallest pointwise probabilities for uniform ranks, sorted, (SIMULATIONS,)."""
    generator = Generator(PCG64(seed))
    even = np.full(DRAWS + 1, 1 / (DRAWS + 1))
    counts = np.cumsum(generator.multinomial(replicates, even, SIMULATIONS), axis=1)
    return np.sort(_least(counts))


@cache
def _tails(total: int) -> FloatArray:
    """Return two-sided probabilities of every count up to each rank, (total + 1, DRAWS)."""
    counts = np.arange(total + 1)[:, None]
    share = np.arange(1, DRAWS + 1) / (DRAWS + 1)
    below, above = binom.cdf(counts, total, share), binom.sf(counts - 1, total, share)
    return np.asarray(2 * np.minimum(below, above))


def _least(counts: Counts) -> FloatArray:
    """Return the smallest pointwise probability of cumulated counts, shape (..., DRAWS + 1)."""
    table = _tails(int(counts.reshape(-1, DRAWS + 1)[0, -1]))
    return np.asarray(table[counts[..., :-1], np.arange(DRAWS)].min(axis=-1))


@cache
def power(replicates: int, stretch: float) -> float:
    """Return the probability of finding a posterior whose width is wrong by the factor `stretch`.

    The fraction of simulated calibrations of a Gaussian posterior whose curve of ranks leaves the
    band of 95 %.
    """
    generator = Generator(PCG64(_POWER_SEED))
    truths = generator.standard_normal((TRIALS, replicates))
    ranks = generator.binomial(DRAWS, ndtr(truths / stretch))
    counts = np.array([np.bincount(one, minlength=DRAWS + 1) for one in ranks]).cumsum(
        axis=1
    )
    limit = np.quantile(band_statistics(replicates, _POWER_SEED), 0.05)
    return float((_least(counts) < limit).mean())


def log_posteriors(key: str, points: FloatArray, seed: int) -> FloatArray:
    """Return the fingerprint of a model, shape (2, POINTS): data, likelihood, priors, simulation.

    Log posterior of the data of the book at fixed points, and of the truth of the first replicates.
    """
    model = posteriors()[key].model()
    pairs = (simulated(model, seed, index) for index in range(len(points)))
    return np.array(
        [
            model.log_posterior(points),
            [float(fit.log_posterior(t[None])[0]) for t, fit in pairs],
        ]
    )


def store(key: str, found: Ranks, seed: int) -> None:
    """Store a calibration with its command, seed and versions."""
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
    write(f"sbc-{key}", arrays, note)


def load(key: str) -> Ranks:
    """Return the stored calibration of a posterior."""
    arrays, note = studies.read(f"sbc-{key}")
    names = tuple(str(note["names"]).split("\t"))
    ranks, failed, covered = (arrays[name] for name in ("ranks", "failed", "covered"))
    return Ranks(names, ranks.astype(np.int64), failed.astype(np.bool_), covered)


def table() -> pd.DataFrame:
    """Return the table of all posteriors, one row per quantity.

    `even`: probability of ranks at least as uneven, with its error from the number of simulated
    bands. `covers_95`: coverage of central posterior intervals of 95 %. `published_95`: coverage of
    the published estimator. `narrow_10`: probability of finding a standard deviation that is 10 %
    too small with this number of replicates.
    """
    tables = []
    for key in posteriors():
        found = load(key)
        theirs = found.estimator_coverage(0.95)
        # Consequences and the log likelihood have no published estimator.
        missing = np.full(len(found.names) - len(theirs), np.nan)
        chances = found.probabilities()
        errors = np.minimum(np.sqrt(chances * (1 - chances) / SIMULATIONS), chances / 5)
        columns = {
            "posterior": key,
            "quantity": found.names,
            "replicates": found.replicates,
            "failed": found.failed.sum(),
            "even": chances,
            "even_error": errors,
            "covers_95": found.coverage(0.95),
            "published_95": np.append(theirs, missing),
        }
        powers = {
            name: power(found.replicates, 1 - share) for name, share in NARROW.items()
        }
        tables.append(pd.DataFrame(columns | powers))
    return pd.concat(tables, ignore_index=True)


def main() -> None:
    """Calibrate the named posteriors, and store ranks and table."""
    parser = argparse.ArgumentParser(description="Calibrate posteriors of the book.")
    parser.add_argument("posteriors", nargs="*")
    parser.add_argument("--replicates", type=int, default=REPLICATES)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--table", action="store_true", help="store only the table")
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
