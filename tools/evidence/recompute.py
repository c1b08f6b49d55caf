"""Running a slow study again: `python tools/evidence/recompute.py NAME`.

A run that was killed goes on where it was: finished parts are kept until the study is stored.
"""

from __future__ import annotations

import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import every_reading
import fusion
import laws
from keep import write
from parts import Store, processes, run_parts
from reproduce.judge import readings as judged
from reproduce.judge.verdicts import judge_prediction
from reproduce.papers.niu2024 import readings
from reproduce.printed.cells import Cell, find
from reproduce.printed.given import given
from reproduce.printed.number import si_factor
from reproduce.version import __version__
from reproduce.views.computed import fingerprint

Array = NDArray[np.float64]
# What a comparison holds: the two-sided mid-p of each cell by counting draws, its decimal logarithm
# by the law of the draws; the same of each group; the Mahalanobis distance of each group. The first
# axes are the readings, and how (26) counts the axes.
COMPARED = ("tails", "law_tails", "joint", "law_joint", "distance")


def _simulated(span: tuple[int, int]) -> tuple[Array]:
    first, count = span
    return (every_reading.simulate(given(readings.READS), count, first),)


def all_draws(
    replicates: int = readings.REPLICATES,
    executor: Executor | None = None,
    store: Store | None = None,
) -> Array:
    """Simulate every reading on any executor: the same result as from `every_reading.simulate`."""
    spans = [
        (begin, min(every_reading.CHUNK, replicates - begin))
        for begin in range(0, replicates, every_reading.CHUNK)
    ]
    parts = run_parts(_simulated, spans, executor, store)
    return np.concatenate([part for (part,) in parts], axis=1)


def _readings(
    executor: Executor, folder: Path, note: Mapping[str, str]
) -> tuple[dict[str, Array], int]:
    """Simulate the paper under every reading, compare each with the print, and count replicates.

    The first replicates, shape (readings, 20, 2, 8), and arrays as in `COMPARED`.
    """
    note = {**note, "replicates": str(readings.REPLICATES)}
    draws = all_draws(readings.REPLICATES, executor, Store(folder / "draws", note))
    rows = run_parts(compare, list(draws), executor, Store(folder / "compared", note))
    return {"first": draws[:, : every_reading.KEPT], **stacked(rows)}, readings.REPLICATES


def stacked(rows: Iterable[tuple[Array, ...]]) -> dict[str, Array]:
    """Put the comparisons of all readings together, by the names of `COMPARED`."""
    arrays = (np.stack(parts) for parts in zip(*rows, strict=True))
    return dict(zip(COMPARED, arrays, strict=True))


def compare(draws: Array) -> tuple[Array, ...]:
    """Compare the print with the prediction of one reading: a row of each array of `COMPARED`."""
    cells = [find(address)[0] for address in readings.ADDRESSES]
    intervals = np.array([cell.number.interval() for cell in cells])
    rows: list[tuple[Array, ...]] = []
    for axes in readings.COUNTED:
        columns = _columns_in_print(draws, cells, axes)
        law = laws.fitted(columns, judged.RESIDUAL)
        found = [judge_prediction(c.number, d) for c, d in zip(cells, columns, strict=True)]
        joint = [laws.joint(law, columns, intervals, wanted) for wanted in judged.GROUPS.values()]
        tails = np.array([judgement.probability for judgement in found])
        rows.append((tails, laws.log_tails(law, intervals), *np.array(joint).T))
    return tuple(np.stack(arrays) for arrays in zip(*rows, strict=True))


def _columns_in_print(draws: Array, cells: list[Cell], axes: str) -> list[Array]:
    """Return the draws of one reading cell by cell, shape (replicates,), in the unit of print."""
    flat = every_reading.counted(draws, axes).reshape(len(draws), -1)
    return [flat[:, i] / si_factor(cell.unit) for i, cell in enumerate(cells)]


# What redoes a slow study, and the seed of it, by the name of its files.
SLOW = {
    "niu2024-readings": (_readings, every_reading.SEED),
    "niu2024-fusion": (fusion.recomputed, fusion.SEED),
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
        arrays, replicates = recomputed(pool, folder, {"sources": fingerprint()})
    note: dict[str, str | int | float] = {
        "command": f"python tools/evidence/recompute.py {name}",
        "seed": seed,
        "replicates": replicates,
        "versions": f"Python {platform.python_version()}, NumPy {np.__version__}, {__version__}",
        "processor_seconds": round(_processor_seconds() - begin, 1),
    }
    write(name, arrays, note, where)
    shutil.rmtree(folder)


if __name__ == "__main__":
    for wanted in sys.argv[1:]:
        run(wanted)
