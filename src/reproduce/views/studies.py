"""Running the slow studies again: `python -m reproduce.views.studies NAME`.

A run that was killed goes on where it was: finished parts are kept until the study is stored.
"""

from __future__ import annotations

import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reproduce.inference.parts import Store, processes, run_parts
from reproduce.judge import readings as judged
from reproduce.papers.niu2024 import images_fusion, readings
from reproduce.store import studies
from reproduce.version import __version__
from reproduce.views.build import fingerprint

__all__ = ["STUDIES", "run"]

Arrays = dict[str, NDArray[Any]]


def niu2024_readings(
    executor: Executor, folder: Path, replicates: int = readings.REPLICATES
) -> Arrays:
    """Simulate niu2024 under every reading and compare each with the print.

    Arrays as in `readings.summary` and in `judge.readings.COMPARED`.
    """
    note = {"sources": fingerprint(), "replicates": replicates}
    draws = readings.all_draws(replicates, executor, Store(folder / "draws", note))
    compared = run_parts(judged.compare, list(draws), executor, Store(folder / "compared", note))
    return {**readings.summary(draws), **judged.stacked(compared)}


def niu2024_fusion(executor: Executor, folder: Path, trials: int = images_fusion.TRIALS) -> Arrays:
    """Compare centroids and signals with and without registration: arrays as in `simulate`."""
    note = {"sources": fingerprint(), "trials": trials}
    return images_fusion.simulate(trials, executor=executor, store=Store(folder, note))


STUDIES: dict[str, tuple[Callable[[Executor, Path], Arrays], int, int]] = {
    readings.STUDY: (niu2024_readings, readings.SEED, readings.REPLICATES),
    images_fusion.STUDY: (
        niu2024_fusion,
        images_fusion.SEED,
        images_fusion.PHASES * images_fusion.TRIALS,
    ),
}


def versions() -> str:
    """Return what a study is run with: Python, NumPy and this project."""
    return f"Python {platform.python_version()}, NumPy {np.__version__}, {__version__}"


def processor_seconds() -> float:
    """Return what this process and its finished children have worked, whatever else ran beside."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def run(name: str, where: Path | None = None, executor: Executor | None = None) -> None:
    """Run a study again and store it; the seconds are those of this run alone."""
    if name not in STUDIES:
        raise KeyError(f"unknown study {name!r}; expected one of {', '.join(STUDIES)}")
    function, seed, replicates = STUDIES[name]
    folder = Path(tempfile.gettempdir()) / f"reproduce-{name}-{fingerprint()[:12]}"
    begin = processor_seconds()
    with executor or processes() as pool:
        arrays = function(pool, folder)
    note: dict[str, str | int | float] = {
        "command": f"python -m reproduce.views.studies {name}",
        "seed": seed,
        "replicates": replicates,
        "versions": versions(),
        "processor_seconds": round(processor_seconds() - begin, 1),
    }
    studies.write(name, arrays, note, where)
    shutil.rmtree(folder)


if __name__ == "__main__":
    for wanted in sys.argv[1:]:
        run(wanted)
