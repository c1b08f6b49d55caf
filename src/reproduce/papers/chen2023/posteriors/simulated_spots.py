"""The platform as designed, and its laser spots simulated: single images are not printed.

With the printed spots, their printed scatter and a seed of our own.
"""

from __future__ import annotations

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from reproduce.papers.chen2023.platform import INSTRUMENT, SCATTER, SIGMAS, as_designed
from reproduce.papers.declare import ROOT_SEED
from reproduce.physics.attitude import Platform
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

__all__ = ["READS", "images"]

DATA_SEED = (ROOT_SEED, 2)
READS = (*INSTRUMENT, SCATTER)


def images(
    given: Given, turns: list[tuple[FloatArray, FloatArray]], frames: int, stream: int
) -> list[FloatArray]:
    """Simulate spots of groups of images.

    Shape (frames, 4, 2). In px.
    """
    seed = SeedSequence(DATA_SEED[0], spawn_key=(DATA_SEED[1], stream))
    generator = Generator(PCG64(seed))
    design = as_designed(given)
    noise = np.sqrt(np.square(given.array(SCATTER) / SIGMAS).mean())
    # The printed spots fill less than the designed square: simulate what was printed.
    scale = np.full(frames, _pattern_scale(design))
    groups = []
    for first, last in turns:
        turn = first + np.linspace(0, 1, frames)[:, None] * (last - first)
        true = design.predicted(
            np.zeros((frames, 3)), turn[:, None], scale, design.camera_focal_length
        )[:, 0]
        groups.append(true + noise * generator.normal(size=true.shape))
    return groups


def _pattern_scale(design: Platform) -> float:
    sizes = [np.ptp(points, axis=0).mean() for points in (design.spots, design.lasers)]
    magnification = design.tracker_focal_length / design.camera_focal_length / design.pixel_pitch
    return float(sizes[0] / (sizes[1] * magnification))
