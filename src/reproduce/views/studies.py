"""Running the slow studies again: `python -m reproduce.views.studies NAME`."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reproduce.judge import readings
from reproduce.papers.niu2024 import counting, fusion, images, study
from reproduce.printed.given import given
from reproduce.store import studies
from reproduce.version import __version__

Arrays = dict[str, NDArray[Any]]
READINGS = "niu2024-readings"
FUSION = "niu2024-fusion"
QUANTILES = (0.005, 0.025, 0.5, 0.975, 0.995)
# Replicates stored whole, so that a small part can be recomputed and compared.
KEPT = 20
PARTS = 20


def _part(span: tuple[int, int]) -> NDArray[np.float64]:
    first, count = span
    return study.simulate(given(study.READS), count, first)


def all_draws(replicates: int, processes: int) -> NDArray[np.float64]:
    """Simulate every reading, in parallel; the result does not depend on how.

    Shape (readings, replicates, 2, 8). As `study.simulate` returns it.
    """
    size = -(-replicates // PARTS)
    spans = [(begin, min(size, replicates - begin)) for begin in range(0, replicates, size)]
    shape = (len(study.readings(given(study.READS))), replicates, 2, len(counting.MEASURED))
    draws = np.empty(shape)  # filled part by part: two copies would not fit the promised memory
    with ProcessPoolExecutor(processes) as pool:
        for (begin, count), part in zip(spans, pool.map(_part, spans), strict=True):
            draws[:, begin : begin + count] = part
    return draws


def _compared(draws: NDArray[np.float64], processes: int) -> readings.Comparison:
    with ProcessPoolExecutor(processes) as pool:
        found = list(pool.map(readings.compare_one, draws))
    return readings.Comparison(*(np.stack(part) for part in zip(*found, strict=True)))


def niu2024_readings(replicates: int = study.REPLICATES, processes: int = 2) -> Arrays:
    """Simulate niu2024 under every reading and compare each with the print.

    ``mean``, ``sd`` (readings, 2, 8); ``quantiles`` (readings, 5, 2, 10), of what
    `counting.SUMMARISED` names; ``first``, the first replicates (readings, 20, 2, 8); the rest as
    in `judge.readings.Comparison`.
    """
    draws = all_draws(replicates, processes)
    found = _compared(draws, processes)
    # One reading at a time: a second copy of the draws would not fit the promised memory.
    levels = [np.quantile(counting.summarised(one), QUANTILES, axis=0) for one in draws]
    return {
        "mean": draws.mean(axis=1),
        "sd": draws.std(axis=1, ddof=1),
        "quantiles": np.stack(levels),
        "first": draws[:, :KEPT],
        "tails": found.tails,
        "law_tails": found.law_tails,
        "joint": found.joint,
        "law_joint": found.law_joint,
        "distance": found.distance,
    }


def niu2024_fusion(trials: int = fusion.TRIALS) -> Arrays:
    """Compare centroids and signals with and without registration, on simulated images."""
    found = fusion.simulate(given(images.READS), trials)
    return {
        "error": found.error,
        "bias": found.bias,
        "signal_to_noise": found.signal_to_noise,
        "colour": found.colour,
    }


STUDIES: dict[str, tuple[Callable[[], Arrays], int, int]] = {
    READINGS: (niu2024_readings, study.SEED, study.REPLICATES),
    FUSION: (niu2024_fusion, fusion.SEED, fusion.PHASES * fusion.TRIALS),
}


def versions() -> str:
    """Return what a study is run with: Python, NumPy and this project."""
    return f"Python {platform.python_version()}, NumPy {np.__version__}, {__version__}"


def processor_seconds() -> float:
    """Return what this process and its finished children have worked, whatever else ran beside."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def run(name: str, where: Path | None = None) -> None:
    """Run a study again and store it."""
    if name not in STUDIES:
        raise KeyError(f"unknown study {name!r}; expected one of {', '.join(STUDIES)}")
    function, seed, replicates = STUDIES[name]
    begin = processor_seconds()
    arrays = function()
    note: dict[str, str | int | float] = {
        "command": f"python -m reproduce.views.studies {name}",
        "seed": seed,
        "replicates": replicates,
        "versions": versions(),
        "processor_seconds": round(processor_seconds() - begin, 1),
    }
    studies.write(name, arrays, note, where)


if __name__ == "__main__":
    for wanted in sys.argv[1:]:
        run(wanted)
