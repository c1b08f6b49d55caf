"""The slow study of fused images, run again: what `reproduce.papers.niu2024.images` stores."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from functools import partial
from pathlib import Path

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from parts import Store, run_parts
from reproduce.papers.niu2024.images import (
    MAGNITUDES,
    PHASES,
    PLACES,
    READS,
    RESULTS,
    STARS,
    cell,
    light_of,
)
from reproduce.printed.given import given

Array = NDArray[np.float64]
SEED = 2024_0103
TRIALS = 60


def simulate(
    trials: int = TRIALS, executor: Executor | None = None, store: Store | None = None
) -> dict[str, Array]:
    """Run the comparison, on any executor, with the same result.

    Arrays as `images.cell` returns them, by star, place and magnitude, which are the first axes.
    """
    shape = (len(STARS), len(PLACES), len(MAGNITUDES))
    found = run_parts(partial(_part, trials), list(np.ndindex(shape)), executor, store)
    stacked = (np.stack(arrays) for arrays in zip(*found, strict=True))
    whole = (array.reshape(*shape, *array.shape[1:]) for array in stacked)
    return dict(zip(RESULTS, whole, strict=True))


def _part(trials: int, at: tuple[int, ...]) -> tuple[Array, ...]:
    door, (star, place, magnitude) = given(READS), at
    light = light_of(door, list(STARS)[star], MAGNITUDES[magnitude])
    return cell(
        door,
        list(PLACES.values())[place],
        light,
        trials,
        SeedSequence(SEED, spawn_key=at),
    )


def recomputed(
    executor: Executor, folder: Path, note: Mapping[str, str]
) -> tuple[dict[str, Array], int]:
    """Simulate again in parts that a folder keeps: arrays as in `simulate`, and their number."""
    store = Store(folder, {**note, "trials": str(TRIALS)})
    return simulate(TRIALS, executor=executor, store=store), PHASES * TRIALS
