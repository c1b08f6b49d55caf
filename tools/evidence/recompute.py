"""Compute a slow study again: `python tools/evidence/recompute.py NAME`."""

from __future__ import annotations

import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import fusion
from keep import write
from parts import processes
from reproduce.judge import readings
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import ROOT_SEED, Computation
from reproduce.version import __version__
from reproduce.views.computed import fingerprint

Array = NDArray[np.float64]
_Arrays = dict[str, Array]
_TOGETHER = 32  # readings of a part


class _Span(NamedTuple):
    """Readings of one computation."""

    computation: str
    first: int
    last: int


def stored_computations() -> dict[str, Computation]:
    """Return the computations whose readings are stored, by name."""
    every = (one for item in catalogue().values() for one in item.computations)
    return {one.name: one for one in every if one.replicates and one.options}


def _evaluated(span: _Span) -> _Arrays:
    computation = stored_computations()[span.computation]
    part = computation.readings[span.first : span.last]
    return readings.packed(readings.evaluate_readings(computation, part))


def _readings(
    executor: Executor, folder: Path, note: Mapping[str, str]
) -> tuple[_Arrays, dict[str, str | int]]:
    """Evaluate every reading of the stored computations."""
    spans = [
        _Span(name, first, first + _TOGETHER)
        for name, one in stored_computations().items()
        for first in range(0, len(one.readings), _TOGETHER)
    ]
    found: dict[str, list[Array]] = {}
    for part in executor.map(_evaluated, spans):
        for name, array in part.items():
            found.setdefault(name, []).append(array)
    digests: dict[str, str | int] = {
        n: readings.fingerprint(one) for n, one in stored_computations().items()
    }
    return {name: np.concatenate(some) for name, some in found.items()}, digests


def _fusion(
    executor: Executor, folder: Path, note: Mapping[str, str]
) -> tuple[_Arrays, dict[str, str | int]]:
    arrays, replicates = fusion.recomputed(executor, folder, note)
    return arrays, {"replicates": replicates}


_Recomputed = Callable[
    [Executor, Path, Mapping[str, str]], tuple[_Arrays, dict[str, str | int]]
]
# Function that computes a slow study, and its seed, by the name of its files.
SLOW: dict[str, tuple[_Recomputed, int]] = {
    "readings": (_readings, ROOT_SEED),
    "niu2024-fusion": (_fusion, fusion.SEED),
}


def _processor_seconds() -> float:
    """Return what this process and its finished children have worked, whatever else ran beside."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def run(name: str, where: Path | None = None, executor: Executor | None = None) -> None:
    """Run a study again and store it; the seconds are those of this run alone."""
    if name not in SLOW:
        raise KeyError(f"unknown study {name!r}; expected one of {', '.join(SLOW)}")
    recomputed, seed = SLOW[name]
    folder = Path(tempfile.gettempdir()) / f"reproduce-{name}-{fingerprint()[:12]}"
    begin = _processor_seconds()
    with executor or processes() as pool:
        arrays, own = recomputed(pool, folder, {"sources": fingerprint()})
    note: dict[str, str | int | float] = {
        "command": f"python tools/evidence/recompute.py {name}",
        "seed": seed,
        "versions": f"Python {platform.python_version()}, NumPy {np.__version__}, {__version__}",
        "processor_seconds": round(_processor_seconds() - begin, 1),
    }
    write(name, arrays, {**note, **own}, where)
    shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    for wanted in sys.argv[1:]:
        run(wanted)
