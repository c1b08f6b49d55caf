"""The simulation under every reading that the text leaves open (niu2024, sections 4.1 and 4.2).

`reproduce.papers.niu2024.simulation` has the literal reading and those that decide a verdict. Here
are all of them, on common random numbers, so that two readings differ by their choices and not by
their luck. Each choice, the literal one first:

* repeats: the noise of one draw, or the average of ten, at calibration and test points alike;
* noise: in every channel, in red and blue alone, or in green alone;
* shifts: the principal points of Table 1, or green's and the translations of Table 2;
* arrangement: each of those with the printed count (`simulation.candidates`);
* tests: directions at random over the printed range, or rotation angles drawn among those of the
  calibration, none twice;
* rmse: (26), which counts both axes, one axis on average, x alone, or y alone.

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

from reproduce.papers.declare import Column
from reproduce.papers.niu2024 import simulation
from reproduce.physics.optics import channel_centroids, spawned_angles, spawned_normals
from reproduce.physics.registration import fit_registration, rmse_per_axis
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.store import studies

SEED = 2024_0259
REPLICATES = 10_000
CHUNK = 500  # replicates simulated at once
# Replicates stored whole, so that a small part can be recomputed and compared.
KEPT = 20
# What the principal points of red and blue are, by the option of `simulation`; draws averaged.
_SHIFTS = {"Table 1": "table-1", "Table 2": "table-2"}
_REPEATS = (1, 10)
_TESTS = ("over the range", "among the angles")
# Where there is noise, and how much of it in green and in the channel that is registered.
_NOISY = {"every channel": (1.0, 1.0), "red and blue": (0.0, 1.0), "green": (1.0, 0.0)}
# What one replicate of one channel yields, in this order, and what is printed of it.
_MEASURED = (*simulation.ROWS, "rmse-before-x", "rmse-before-y", "rmse-after-x", "rmse-after-y")
_CELLS = (*simulation.ROWS, "rmse-before", "rmse-after")
# The printed cells of both channels, in the order of the numbers of a replicate.
ADDRESSES = tuple(
    f"{simulation.SETTINGS}#{cell}-{channel}"
    if cell.startswith("rmse")
    else f"niu2024/table-3#{cell}.{channel}"
    for channel in simulation.REGISTERED
    for cell in _CELLS
)
# Ways to count the axes, (26) as it stands first, by the option of `simulation`.
_AXES = {"both axes": "both", "one axis on average": "one", "x alone": "x", "y alone": "y"}
COUNTED = tuple(_AXES)
READS = (
    *simulation.READS,
    f"{simulation.TRUTH}#translation-*",
    f"{simulation.SETTINGS}#test-points",
)


@dataclass(frozen=True)
class _Choices:
    """One choice for everything the text leaves open but how the RMSE counts the axes."""

    arrangement: int  # its place in `simulation.candidates`
    shifts: str  # one of `_SHIFTS`
    repeats: int  # draws averaged
    noisy: str  # one of `_NOISY`
    tests: str  # one of `_TESTS`


def readings(door: Given) -> list[_Choices]:
    """Return every reading, in the order in which `simulate` has them."""
    arrangements = range(len(simulation.candidates(door)))
    return [_Choices(*c) for c in product(arrangements, _SHIFTS, _REPEATS, _NOISY, _TESTS)]


def literal(door: Given) -> _Choices:
    """Return the literal reading, the one that the ledger uses where all give one verdict."""
    return readings(door)[0]


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
    for found, shifts in product(simulation.candidates(door), _SHIFTS):
        cameras = simulation.cameras(door, _SHIFTS[shifts])
        spots = partial(channel_centroids, [cameras[0], cameras[place]], [turns[0], turns[place]])
        true, zero = spots(found.angles), spots(np.zeros((1, 2)))
        at_random = np.moveaxis(spots(drawn.positions), -3, 1)
        tests = {_TESTS[0]: at_random, _TESTS[1]: np.moveaxis(true[:, drawn.chosen], 0, 1)}
        at_zero = simulation.zero_places(found.angles)
        for repeats, noisy in product(_REPEATS, _NOISY):
            level = (sigma / np.sqrt(repeats) * np.array(_NOISY[noisy]))[:, None, None]
            green, source = np.moveaxis(true + level * drawn.calibration[:, pair], 1, 0)
            again = (zero + level * drawn.zero[:, pair])[:, 1, 0]
            pivot = source[:, at_zero[0]] if len(at_zero) else again
            similarity = fit_registration(source, green, pivot).transform
            for kind in _TESTS:
                green, source = np.moveaxis(tests[kind] + level * drawn.test[:, pair], 1, 0)
                before = rmse_per_axis(source, green)
                after = rmse_per_axis(similarity.apply(source), green)
                yield np.concatenate([similarity.parameters, before, after], axis=-1)


def counted(measured: FloatArray, axes: str) -> FloatArray:
    """Return the numbers of `_CELLS` from those of `_MEASURED`.

    Examples
    --------
    >>> counted(np.arange(8.0), "y alone")
    array([0., 1., 2., 3., 5., 7.])
    """
    residuals = simulation.counted(measured[..., 4::2], measured[..., 5::2], _AXES[axes])
    return np.concatenate([measured[..., :4], residuals], axis=-1)


def stored() -> studies.Study:
    """Return the stored run: its first replicates, and arrays of `tools/evidence/recompute.py`."""
    return studies.read("niu2024-readings")


# The columns that tell readings apart, and the one by whose values they are folded.
ARRANGEMENT = "Angles"
CHOICES = tuple(
    Column(name) for name in (ARRANGEMENT, "Shifts", "Draws", "Noise in", "Test points")
)


def choices() -> Iterator[tuple[str, ...]]:
    """Yield every reading in the words of `CHOICES`."""
    door = given(READS)
    names = [found.name for found in simulation.candidates(door)]
    for reading in readings(door):
        repeats = str(reading.repeats)
        yield names[reading.arrangement], reading.shifts, repeats, reading.noisy, reading.tests
