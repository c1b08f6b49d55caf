"""The simulation of niu2024 under every reading of its text: what the stored run holds.

The readings are those of `reproduce.papers.niu2024.readings`; all are simulated on common random
numbers, so that two of them differ by their choices and not by their luck.

Where an arrangement has no zero position, the starting values of section 3.2 need one all the same:
it is then measured once more, beside the calibration points. The fit is the closed form, which is
where the paper's iteration ends (a test holds the two together).

Arrays of draws end with an axis of numbers, `_MEASURED` or what is made of them; parameters are in
radians and px, residuals in px.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from reproduce.papers.niu2024 import simulation
from reproduce.papers.niu2024.readings import AXES, NOISY, REPEATS, SHIFTS, TESTS
from reproduce.physics.optics import channel_centroids, spawned_angles, spawned_normals
from reproduce.physics.registration import fit_registration, rmse_per_axis
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

SEED = 2024_0259
CHUNK = 500  # replicates simulated at once
# Replicates stored whole, so that a small part can be recomputed and compared.
KEPT = 20
# What one replicate of one channel yields, in this order.
_MEASURED = (*simulation.ROWS, "rmse-before-x", "rmse-before-y", "rmse-after-x", "rmse-after-y")


@dataclass(frozen=True, eq=False)
class _Numbers:
    """The random numbers of a run of replicates, shared by all readings."""

    calibration: FloatArray  # standard normal, shape (replicates, 3, n, 2), green, red and blue
    zero: FloatArray  # the same for a zero position measured once more
    test: FloatArray  # the same for the test points
    positions: FloatArray  # random table angles in radians, shape (replicates, m, 2)
    chosen: NDArray[np.int64]  # random places among the calibration angles, none twice


def numbers(door: Given, replicates: int, first: int = 0) -> _Numbers:
    """Draw the random numbers of some replicates."""
    n = door.count(f"{simulation.SETTINGS}#angle-count")
    m = door.count(f"{simulation.SETTINGS}#test-points")
    streams = [SeedSequence(SEED, spawn_key=(kind,)) for kind in range(5)]
    calibration, zero, test = (
        spawned_normals(stream, replicates, (3, count, 2), first=first)
        for stream, count in zip(streams[:3], (n, 1, m), strict=True)
    )
    half = simulation.half_ranges(door)
    positions = spawned_angles(streams[3], replicates, m, half, first=first)
    # The order of independent numbers is a random order.
    order = spawned_normals(streams[4], replicates, (n,), first=first).argsort(axis=-1)
    return _Numbers(calibration, zero, test, positions, order[:, :m])


def simulate(door: Given, replicates: int, first: int = 0) -> FloatArray:
    """Simulate, calibrate and test both channels under every reading.

    Shape (readings, replicates, 2, 8). Readings as in `readings`, channels red and blue, numbers as
    in `_MEASURED`; `counted` makes of them what is printed.
    """
    drawn = numbers(door, replicates, first)
    channels = [list(simulate_channel(door, drawn, name)) for name in simulation.REGISTERED]
    return np.moveaxis(np.array(channels), 0, 2)


def simulate_channel(door: Given, drawn: _Numbers, channel: str) -> Iterator[FloatArray]:
    """Yield what one channel gives under every reading, in the order of `readings`."""
    place = simulation.CHANNELS.index(channel)
    pair = [0, place]
    turns = simulation.rotations(door)
    sigma = door[simulation.NOISE]
    for found, shifts in product(simulation.candidates(door), SHIFTS):
        cameras = simulation.cameras(door, SHIFTS[shifts])
        spots = partial(channel_centroids, [cameras[0], cameras[place]], [turns[0], turns[place]])
        true, zero = spots(found.angles), spots(np.zeros((1, 2)))
        at_random = np.moveaxis(spots(drawn.positions), -3, 1)
        tests = {TESTS[0]: at_random, TESTS[1]: np.moveaxis(true[:, drawn.chosen], 0, 1)}
        at_zero = simulation.zero_places(found.angles)
        for repeats, noisy in product(REPEATS, NOISY):
            level = (sigma / np.sqrt(repeats) * np.array(NOISY[noisy]))[:, None, None]
            green, source = np.moveaxis(true + level * drawn.calibration[:, pair], 1, 0)
            again = (zero + level * drawn.zero[:, pair])[:, 1, 0]
            pivot = source[:, at_zero[0]] if len(at_zero) else again
            similarity = fit_registration(source, green, pivot).transform
            for kind in TESTS:
                green, source = np.moveaxis(tests[kind] + level * drawn.test[:, pair], 1, 0)
                before = rmse_per_axis(source, green)
                after = rmse_per_axis(similarity.apply(source), green)
                yield np.concatenate([similarity.parameters, before, after], axis=-1)


def counted(measured: FloatArray, axes: str) -> FloatArray:
    """Return the printed numbers of a channel from those of `_MEASURED`.

    Examples
    --------
    >>> counted(np.arange(8.0), "y alone")
    array([0., 1., 2., 3., 5., 7.])
    """
    residuals = simulation.counted(measured[..., 4::2], measured[..., 5::2], AXES[axes])
    return np.concatenate([measured[..., :4], residuals], axis=-1)
