"""Calibrations of the posteriors as stored studies: run, store, read back."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from rich import box
from rich.table import Table

from reproduce.inference.calibration import SIMULATIONS, Calibration, calibrate, intervals
from reproduce.inference.posterior import digits
from reproduce.papers.posteriors import posteriors
from reproduce.store import studies

SEED = 20_240_105
REPLICATES = 1000
PACKAGES = ("numpy", "scipy", "emcee")


def study_name(model: str) -> str:
    """Return the name of the study that holds a model's calibration."""
    return f"sbc-{model}"


def run(
    model: str,
    replicates: int,
    seed: int = SEED,
    *,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Calibration:
    """Calibrate a model of the book, on the processors of this machine."""
    built = posteriors()[model].model()
    workers = workers or os.cpu_count() or 1
    if workers == 1:
        return calibrate(built, seed, replicates, progress=progress)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        return calibrate(built, seed, replicates, executor=pool, progress=progress)


def store(model: str, found: Calibration, seed: int, where: Path | None = None) -> None:
    """Keep a calibration with what is needed to redo it."""
    command = f"reproduce calibrate {model} --replicates {found.replicates} --seed {seed} --store"
    note: dict[str, str | int | float] = {
        "command": command,
        "seed": seed,
        "versions": ", ".join(f"{name} {version(name)}" for name in PACKAGES),
        "names": "\t".join(found.names),
    }
    arrays = {
        "ranks": found.ranks.astype(np.int16),
        "failed": found.failed.astype(bool),
        "covered": found.covered.astype(np.int8),
    }
    studies.write(study_name(model), arrays, note, where)


def load(model: str, where: Path | None = None) -> Calibration:
    """Return the stored calibration of a model."""
    study = studies.read(study_name(model), where)
    names = tuple(str(study.note["names"]).split("\t"))
    arrays = study.arrays
    ranks, covered = np.asarray(arrays["ranks"], dtype=np.int64), arrays["covered"]
    if covered.dtype != np.int8:
        raise studies.StudyError(
            f"{study.name}: expected intervals as int8, got {covered.dtype}; redo them without "
            f"sampling: reproduce calibrate {model} --intervals"
        )
    return Calibration(names, ranks, arrays["failed"].astype(np.bool_), covered)


def renew(model: str, where: Path | None = None) -> Calibration:
    """Redo the published estimator's intervals of a stored calibration; its ranks stay."""
    study = studies.read(study_name(model), where)
    built = posteriors()[model].model()
    covered = intervals(built, int(study.note["seed"]), len(study.arrays["ranks"]))
    note = {key: value for key, value in study.note.items() if key != "sha256"}
    studies.write(study.name, {**study.arrays, "covered": covered}, note, where)
    return load(model, where)


def terminal_table(found: Calibration) -> Table:
    """Return a calibration for the terminal: evenness of ranks, coverage, published estimator."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("quantity")
    for head in ("evenness, p", "50 % covers", "95 % covers", "published, 95 %"):
        table.add_column(head, justify="right")
    for row in coverage_rows(found):
        table.add_row(*row)
    return table


def coverage_rows(found: Calibration) -> list[tuple[str, ...]]:
    """Write evenness and coverage of every quantity, with binomial standard errors."""
    probabilities = found.probabilities()
    half, wide = found.coverage(0.5), found.coverage(0.95)
    # The test quantity, which comes last, is no parameter.
    squares = np.append(found.estimator_coverage(0.95), np.nan)
    rows: list[tuple[str, ...]] = []
    for i, name in enumerate(found.names):
        rows.append(
            (
                name,
                _chance(float(probabilities[i])),
                _share(float(half[i]), found.replicates),
                _share(float(wide[i]), found.replicates),
                "none" if np.isnan(squares[i]) else _share(float(squares[i]), found.replicates),
            )
        )
    return rows


def studies_of_all() -> dict[str, Calibration]:
    """Return the stored calibration of every model, in the order of the book."""
    return {name: load(name) for name in posteriors()}


def overview_rows(found: dict[str, Calibration]) -> list[tuple[str, ...]]:
    """Write every calibration in a line: replicates, failures, evenness, coverage."""
    rows: list[tuple[str, ...]] = []
    for name, one in found.items():
        wide = 100 * one.coverage(0.95)
        rows.append(
            (
                name,
                f"{one.replicates:,}",
                str(int(one.failed.sum())),
                str(len(one.names)),
                _chance(float(one.probabilities().min())),
                f"{wide.min():.1f} to {wide.max():.1f} %",
            )
        )
    return rows


def least_of_all(found: dict[str, Calibration]) -> tuple[float, int, float]:
    """Return the least evenness of all quantities of all models, and how surprising it is.

    How many of so many are expected to be as small by chance: their product. It holds though
    quantities of one model depend on each other, and models with a seed in common too.
    """
    all_of_them = np.concatenate([one.probabilities() for one in found.values()])
    least, count = float(all_of_them.min()), len(all_of_them)
    return least, count, count * least


def _chance(value: float) -> str:
    """Write a probability counted among simulated bands, with the digits that their number allows.

    Examples
    --------
    >>> _chance(0.0212), _chance(0.4267)
    ('0.02', '0.4')
    """
    error = np.sqrt(value * (1 - value) / SIMULATIONS)
    return digits(value, float(min(error, value / 5)))


def _share(value: float, count: int) -> str:
    error = np.sqrt(max(value * (1 - value), 1 / count) / count)
    return f"{100 * value:.1f} ± {100 * error:.1f} %"
