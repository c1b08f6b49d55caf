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
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from reproduce.papers.declare import Column
from reproduce.papers.niu2024 import simulation
from reproduce.printed.given import Given, given
from reproduce.store import studies

REPLICATES = 10_000
# What the principal points of red and blue are, by the option of `simulation`; draws averaged.
SHIFTS = {"Table 1": "table-1", "Table 2": "table-2"}
REPEATS = (1, 10)
TESTS = ("over the range", "among the angles")
# Where there is noise, and how much of it in green and in the channel that is registered.
NOISY = {"every channel": (1.0, 1.0), "red and blue": (0.0, 1.0), "green": (1.0, 0.0)}
# What is printed of one channel.
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
AXES = {"both axes": "both", "one axis on average": "one", "x alone": "x", "y alone": "y"}
COUNTED = tuple(AXES)
READS = (
    *simulation.READS,
    f"{simulation.TRUTH}#translation-*",
    f"{simulation.SETTINGS}#test-points",
)


@dataclass(frozen=True)
class _Choices:
    """One choice for everything the text leaves open but how the RMSE counts the axes."""

    arrangement: int  # its place in `simulation.candidates`
    shifts: str  # one of `SHIFTS`
    repeats: int  # draws averaged
    noisy: str  # one of `NOISY`
    tests: str  # one of `TESTS`


def readings(door: Given) -> list[_Choices]:
    """Return every reading, in the order of the stored run."""
    arrangements = range(len(simulation.candidates(door)))
    return [_Choices(*c) for c in product(arrangements, SHIFTS, REPEATS, NOISY, TESTS)]


def literal(door: Given) -> _Choices:
    """Return the literal reading, the one that the ledger uses where all give one verdict."""
    return readings(door)[0]


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
