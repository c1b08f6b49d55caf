"""Simulate the study of fused images that `reproduce.papers.niu2024.images` stores."""

from __future__ import annotations

from concurrent.futures import Executor
from functools import partial

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from reproduce.papers.niu2024.images import (
    INPUTS,
    MAGNITUDES,
    PLACES,
    RESULTS,
    STARS,
    compare_images,
    photons_from,
)
from reproduce.printed.inputs import load_inputs

Array = NDArray[np.float64]
SEED = 2024_0103
TRIALS = 60


def simulate(executor: Executor, trials: int = TRIALS) -> dict[str, Array]:
    """Return the results of `images.compare_images`; first axes: star, place, magnitude."""
    shape = (len(STARS), len(PLACES), len(MAGNITUDES))
    cells = executor.map(partial(_simulate_cell, trials), np.ndindex(shape))
    stacked = (np.stack(arrays) for arrays in zip(*cells, strict=True))
    whole = (array.reshape(*shape, *array.shape[1:]) for array in stacked)
    return dict(zip(RESULTS, whole, strict=True))


def _simulate_cell(trials: int, at: tuple[int, ...]) -> tuple[Array, ...]:
    inputs, (star, place, magnitude) = load_inputs(INPUTS), at
    light = photons_from(inputs, list(STARS)[star], MAGNITUDES[magnitude])
    seed = SeedSequence(SEED, spawn_key=at)
    return compare_images(inputs, list(PLACES.values())[place], light, trials, seed)
