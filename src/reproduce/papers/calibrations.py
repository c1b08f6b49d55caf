"""Calibrations of the posteriors as stored studies: run, store, read back."""

from __future__ import annotations

from concurrent.futures import Executor
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reproduce.inference.calibration import Ranks, calibrate, intervals, simulated
from reproduce.inference.parts import Progress
from reproduce.papers.posteriors import posteriors
from reproduce.physics.validate import FloatArray
from reproduce.store import studies

__all__ = [
    "REPLICATES", "SEED", "load", "log_posteriors", "of_all", "renew", "run", "store", "stored",
    "study_name",
]  # fmt: skip

SEED = 20_240_105
REPLICATES = 1000
# Points near the posterior of the book at which a model is recognised.
POINTS = 8
PACKAGES = ("numpy", "scipy", "emcee")


def study_name(key: str) -> str:
    """Return the name of the study that holds the calibration of a posterior."""
    return f"sbc-{key}"


def run(
    key: str,
    replicates: int = REPLICATES,
    seed: int = SEED,
    *,
    executor: Executor | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> Ranks:
    """Calibrate the model of a posterior; the arguments are those of `calibrate`."""
    model = posteriors()[key].model()
    return calibrate(model, seed, replicates, executor=executor, folder=folder, progress=progress)


def log_posteriors(key: str, points: FloatArray, seed: int) -> FloatArray:
    """Return the fingerprint of a model, shape (2, POINTS): it knows data, likelihood and priors.

    Log posterior of the book's data at fixed points, and of the truth of as many replicates, which
    also knows how data are simulated.
    """
    model = posteriors()[key].model()
    pairs = (simulated(model, seed, index) for index in range(len(points)))
    return np.array(
        [model.log_posterior(points), [float(fit.log_posterior(t[None])[0]) for t, fit in pairs]]
    )


def store(key: str, found: Ranks, seed: int, where: Path | None = None) -> None:
    """Keep a calibration with what is needed to redo it."""
    command = f"reproduce calibrate {key} --replicates {found.replicates} --seed {seed} --store"
    note: dict[str, str | int | float] = {
        "command": command,
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
    studies.write(study_name(key), arrays, note, where)


def stored(key: str) -> bool:
    """Whether there is a stored calibration of a posterior."""
    return (studies.folder() / f"{study_name(key)}.toml").is_file()


def load(key: str, where: Path | None = None) -> Ranks:
    """Return the stored calibration of a posterior."""
    study = studies.read(study_name(key), where)
    names = tuple(str(study.note["names"]).split("\t"))
    ranks, failed, covered = (study.arrays[name] for name in ("ranks", "failed", "covered"))
    return Ranks(names, ranks.astype(np.int64), failed.astype(np.bool_), covered)


def renew(key: str, where: Path | None = None) -> Ranks:
    """Redo the published estimator's intervals of a stored calibration; its ranks stay."""
    study = studies.read(study_name(key), where)
    model = posteriors()[key].model()
    covered = intervals(model, int(study.note["seed"]), len(study.arrays["ranks"]))
    note = {name: value for name, value in study.note.items() if name != "sha256"}
    studies.write(study.name, {**study.arrays, "covered": covered}, note, where)
    return load(key, where)


def of_all() -> dict[str, Ranks]:
    """Return the stored calibration of every posterior, in the order of the book."""
    return {key: load(key) for key in posteriors()}
