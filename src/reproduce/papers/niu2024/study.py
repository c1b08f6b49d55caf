"""The simulation under every reading that the text leaves open (niu2024, sections 4.1 and 4.2).

`reproduce.papers.niu2024.simulation` has the literal reading and those that decide a verdict. Here
are all of them, on common random numbers, so that two readings differ by their choices and not by
their luck.
Each choice, the literal one first:

* repeats: the noise of one draw, or the average of ten, at calibration and test points alike;
* noise: in every channel, in red and blue alone, or in green alone;
* shifts: the principal points of Table 1, or green's and the translations of Table 2;
* arrangement: each of those with the printed count (`angles.candidates`);
* tests: directions at random over the printed range, or rotation angles drawn among those of the
  calibration, none twice;
* rmse: (26), which counts both axes, one axis on average, x alone, or y alone.

Where an arrangement has no zero position, the starting values of section 3.2 need one all the same:
it is then measured once more, beside the calibration points. The fit is the closed form, which is
where the paper's iteration ends (a test holds the two together).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.niu2024 import angles, simulation
from reproduce.papers.niu2024.counting import MEASURED
from reproduce.papers.niu2024.simulation import SHIFTS, TESTS
from reproduce.physics.optics.simulate import channel_centroids, spawned_angles, spawned_normals
from reproduce.physics.registration.closed_form import rmse_per_axis
from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.registration.transforms import Registration
from reproduce.physics.validate import FloatArray, whole_number
from reproduce.printed.given import Given

SEED = 2024_0259
REPLICATES = 10_000
CHUNK = 500
REPEATS = (1, 10)
# Where there is noise, and how much of it in green and in the channel that is registered.
NOISY = {"every channel": (1.0, 1.0), "red and blue": (0.0, 1.0), "green": (1.0, 0.0)}
READS = (
    *simulation.READS,
    f"{simulation.TRUTH}#translation-*",
    f"{simulation.SETTINGS}#test-points",
)


@dataclass(frozen=True)
class Reading:
    """One choice for everything the text leaves open but how the RMSE counts the axes.

    Attributes
    ----------
    arrangement : int
        Place in `angles.candidates`.
    shifts, noisy, tests : str
        As listed in `SHIFTS`, `NOISY`, `TESTS`.
    repeats : int
        Draws averaged.
    """

    arrangement: int
    shifts: str
    repeats: int
    noisy: str
    tests: str


def readings(door: Given) -> list[Reading]:
    """Return every reading, in the order in which `simulate` has them."""
    arrangements = range(len(angles.candidates(door)))
    return [Reading(*c) for c in product(arrangements, SHIFTS, REPEATS, NOISY, TESTS)]


def literal(door: Given) -> Reading:
    """Return the literal reading, the one that the ledger uses where all give one verdict."""
    names = [found.name for found in angles.candidates(door)]
    place = names.index(angles.literal(door).name)
    return Reading(place, SHIFTS[0], REPEATS[0], next(iter(NOISY)), TESTS[0])


@dataclass(frozen=True, eq=False)
class Numbers:
    """The random numbers of a run of replicates, shared by all readings.

    Attributes
    ----------
    calibration : ndarray, shape (replicates, 3, n, 2)
        Standard normal, channels green, red, blue.
    zero : ndarray, shape (replicates, 3, 1, 2)
        The same for a zero position measured once more.
    test : ndarray, shape (replicates, 3, m, 2)
        The same for the test points.
    positions : ndarray, shape (replicates, m, 2)
        Random table angles, in radians.
    chosen : ndarray of int, shape (replicates, m)
        Random places among the calibration angles, none twice.
    """

    calibration: FloatArray
    zero: FloatArray
    test: FloatArray
    positions: FloatArray
    chosen: np.ndarray[tuple[int, ...], np.dtype[np.int64]]


def numbers(door: Given, replicates: int, first: int = 0, seed: int = SEED) -> Numbers:
    """Draw the random numbers of some replicates."""
    n = door.count(f"{simulation.SETTINGS}#angle-count")
    m = door.count(f"{simulation.SETTINGS}#test-points")
    streams = [SeedSequence(seed, spawn_key=(kind,)) for kind in range(5)]
    calibration, zero, test = (
        spawned_normals(stream, replicates, (3, count, 2), first=first)
        for stream, count in zip(streams[:3], (n, 1, m), strict=True)
    )
    half = angles.half_ranges(door)
    positions = spawned_angles(streams[3], replicates, m, half, first=first)
    # The order of independent numbers is a random order.
    order = spawned_normals(streams[4], replicates, (n,), first=first).argsort(axis=-1)
    return Numbers(calibration, zero, test, positions, order[:, :m])


def simulate(door: Given, replicates: int, first: int = 0, seed: int = SEED) -> FloatArray:
    """Simulate, calibrate and test both channels under every reading.

    Shape (readings, replicates, 2, 8). Readings as in `readings`, channels red and blue, numbers as
    in `MEASURED`; in radians and px. `counting.counted` makes of them what is printed.
    """
    replicates = whole_number("replicates", replicates)
    every = readings(door)
    results = np.empty((len(every), replicates, 2, len(MEASURED)))
    for begin in range(0, replicates, CHUNK):
        count = min(CHUNK, replicates - begin)
        drawn = numbers(door, count, first + begin, seed)
        for place, channel in enumerate(simulation.REGISTERED):
            found = simulate_channel(door, drawn, channel)
            results[:, begin : begin + count, place] = np.stack(list(found))
    return results


def simulate_channel(door: Given, drawn: Numbers, channel: str) -> Iterator[FloatArray]:
    """Yield what one channel gives under every reading, in the order of `readings`."""
    place = simulation.CHANNELS.index(channel)
    pair = [0, place]
    turns = simulation.rotations(door)
    sigma = door[f"{simulation.SETTINGS}#noise"]
    for found, shifts in product(angles.candidates(door), SHIFTS):
        used, turned = [simulation.cameras(door, shifts)[i] for i in pair], [turns[i] for i in pair]
        true = channel_centroids(used, turned, found.angles)
        zero = channel_centroids(used, turned, np.zeros((1, 2)))
        at_random = np.moveaxis(channel_centroids(used, turned, drawn.positions), -3, 1)
        tests = {TESTS[0]: at_random, TESTS[1]: np.moveaxis(true[:, drawn.chosen], 0, 1)}
        for repeats, noisy in product(REPEATS, NOISY):
            level = (sigma / np.sqrt(repeats) * np.array(NOISY[noisy]))[:, None, None]
            measured = true + level * drawn.calibration[:, pair]
            again = zero + level * drawn.zero[:, pair]
            similarity = _calibrated(measured, again, found.angles)
            for kind in TESTS:
                points = tests[kind] + level * drawn.test[:, pair]
                yield _outcome(similarity, points)


def _calibrated(measured: FloatArray, zero: FloatArray, table: FloatArray) -> Registration:
    green, source = measured[:, 0], measured[:, 1]
    at_zero = np.flatnonzero(np.isclose(table, 0.0).all(axis=-1))
    pivot = source[:, at_zero[0]] if len(at_zero) else zero[:, 1, 0]
    return fit_registration(source, green, pivot).transform


def _outcome(similarity: Registration, points: FloatArray) -> FloatArray:
    green, source = points[:, 0], points[:, 1]
    before = rmse_per_axis(source, green)
    after = rmse_per_axis(similarity.apply(source), green)
    return np.concatenate([similarity.parameters, before, after], axis=-1)
