"""Running the slow studies again: `python -m reproduce.views.studies NAME`."""

from __future__ import annotations

import platform
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import reproduce
from reproduce.judge import readings
from reproduce.papers.niu2024 import fusion, images, study
from reproduce.printed.given import given
from reproduce.store import studies

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

    Parameters
    ----------
    replicates : int
        How many.
    processes : int
        How many work at once.

    Returns
    -------
    ndarray, shape (readings, replicates, 2, 6)
        As `study.simulate` returns it.
    """
    size = -(-replicates // PARTS)
    spans = [(begin, min(size, replicates - begin)) for begin in range(0, replicates, size)]
    if processes == 1:
        return np.concatenate([_part(span) for span in spans], axis=1)
    with ProcessPoolExecutor(processes) as pool:
        return np.concatenate(list(pool.map(_part, spans)), axis=1)


def niu2024_readings(replicates: int = study.REPLICATES, processes: int = 2) -> Arrays:
    """Simulate niu2024 under every reading and compare each with the print.

    Parameters
    ----------
    replicates : int
        How many.
    processes : int
        How many work at once.

    Returns
    -------
    dict
        ``mean``, ``sd`` (readings, 2, 6); ``quantiles`` (readings, 5, 2, 6); ``first``, the first
        replicates (readings, 20, 2, 6); ``tails`` and ``joint`` as in `judge.readings`.
    """
    draws = all_draws(replicates, processes)
    found = readings.compare(draws)
    return {
        "mean": draws.mean(axis=1),
        "sd": draws.std(axis=1, ddof=1),
        "quantiles": np.moveaxis(np.quantile(draws, QUANTILES, axis=1), 0, 1),
        "first": draws[:, :KEPT],
        "tails": found.tails,
        "joint": found.joint,
    }


def niu2024_fusion(trials: int = fusion.TRIALS) -> Arrays:
    """Compare centroids and signals with and without registration, on simulated images.

    Parameters
    ----------
    trials : int
        Exposures of each star in each place.

    Returns
    -------
    dict
        The arrays of `papers.niu2024.fusion.Outcome`.
    """
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
    return f"Python {platform.python_version()}, NumPy {np.__version__}, {reproduce.__version__}"


def run(name: str, where: Path | None = None) -> None:
    """Run a study again and store it.

    Parameters
    ----------
    name : str
        One of `STUDIES`.
    where : pathlib.Path, optional
        The folder; the project's own by default.

    Raises
    ------
    KeyError
        If there is no such study.
    """
    if name not in STUDIES:
        raise KeyError(f"unknown study {name!r}; expected one of {', '.join(STUDIES)}")
    function, seed, replicates = STUDIES[name]
    begin = time.perf_counter()
    arrays = function()
    note: dict[str, str | int | float] = {
        "command": f"python -m reproduce.views.studies {name}",
        "seed": seed,
        "replicates": replicates,
        "versions": versions(),
        "seconds": round(time.perf_counter() - begin, 1),
    }
    studies.write(name, arrays, note, where)


if __name__ == "__main__":
    for wanted in sys.argv[1:]:
        run(wanted)
