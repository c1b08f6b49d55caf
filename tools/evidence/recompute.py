"""Compute a stored study again: `python tools/evidence/recompute.py NAME`."""

from __future__ import annotations

import os
import platform
import sys
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

import fusion
from keep import write
from reproduce.judge import readings
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Computation, computations
from reproduce.papers.niu2024.images import PHASES
from reproduce.printed.inputs import ROOT_SEED
from reproduce.store.studies import StoredStudy
from reproduce.version import __version__

Array = NDArray[np.float64]
READINGS_PER_TASK = 32


def stored_computations() -> dict[str, Computation]:
    """Return the computations whose readings are stored, by name."""
    every = (one for key in catalogue() for one in computations(key))
    return {one.name: one for one in every if one.replicates and one.options}


def packed(evaluation: readings.Evaluation) -> dict[str, Array]:
    """Return an evaluation as arrays, by the names under which the study stores them."""
    lead = f"{evaluation.computation.name}:"
    arrays = {
        f"{lead}{name}": np.array(evaluation.stored_rows(name))
        for name in evaluation.cells
    }
    return {**arrays, f"{lead}joint": evaluation.joint}


def _evaluate(task: tuple[str, int]) -> dict[str, Array]:
    name, first = task
    computation = stored_computations()[name]
    part = computation.readings[first : first + READINGS_PER_TASK]
    return packed(readings.evaluate_readings(computation, part))


def evaluate_readings(executor: Executor) -> StoredStudy:
    """Evaluate every reading of the stored computations."""
    computations = stored_computations()
    tasks = [
        (name, first)
        for name, one in computations.items()
        for first in range(0, len(one.readings), READINGS_PER_TASK)
    ]
    found: dict[str, list[Array]] = {}
    for part in executor.map(_evaluate, tasks):
        for name, array in part.items():
            found.setdefault(name, []).append(array)
    digests = {name: readings.fingerprint(one) for name, one in computations.items()}
    arrays = {name: np.concatenate(parts) for name, parts in found.items()}
    return arrays, {"seed": ROOT_SEED, **digests}


def simulate_fusion(executor: Executor) -> StoredStudy:
    """Simulate the fused images."""
    repeats = PHASES * fusion.TRIALS
    return fusion.simulate(executor), {"seed": fusion.SEED, "replicates": repeats}


STUDIES = {"readings": evaluate_readings, "niu2024-fusion": simulate_fusion}


def main(names: list[str]) -> None:
    """Compute studies and store them with the processor time that they took."""
    for name in names:
        before = sum(os.times()[:4])  # of this process and its finished children
        with ProcessPoolExecutor(mp_context=get_context("spawn")) as executor:
            arrays, own = STUDIES[name](executor)
        seconds = sum(os.times()[:4]) - before
        versions = (platform.python_version(), np.__version__, __version__)
        note = {
            "command": f"python tools/evidence/recompute.py {name}",
            "seed": own["seed"],
            "versions": "Python {}, NumPy {}, {}".format(*versions),
            "processor_seconds": round(seconds, 1),
        }
        write(name, arrays, {**note, **own})


if __name__ == "__main__":
    main(sys.argv[1:])
