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

Arrays of draws end with an axis of numbers, `MEASURED` or what is made of them; parameters are in
radians and px, residuals in px.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from reproduce.inference import Store, run_parts
from reproduce.papers.declare import draws
from reproduce.papers.niu2024 import simulation
from reproduce.papers.niu2024.index import LOOKS
from reproduce.papers.sketch import sized
from reproduce.papers.study import studied
from reproduce.papers.words import Column
from reproduce.physics.optics import channel_centroids, spawned_angles, spawned_normals
from reproduce.physics.registration import (
    Calibration,
    calibrate,
    fit_registration,
    model_points,
    random_starts,
    registration_bound,
    rmse,
    rmse_per_axis,
    similarity_between,
    starting_values,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.store import studies

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STUDY = "niu2024-readings"
SEED = 2024_0259
REPLICATES = 10_000
CHUNK = 500  # replicates simulated at once
# Replicates stored whole, so that a small part can be recomputed and compared.
_KEPT = 20
_QUANTILES = (0.005, 0.025, 0.5, 0.975, 0.995)
# What the principal points of red and blue are, by the option of `simulation`; draws averaged.
_SHIFTS = {"Table 1": "table-1", "Table 2": "table-2"}
REPEATS = (1, 10)
TESTS = ("over the range", "among the angles")
# Where there is noise, and how much of it in green and in the channel that is registered.
_NOISY = {"every channel": (1.0, 1.0), "red and blue": (0.0, 1.0), "green": (1.0, 0.0)}
# What one replicate of one channel yields, in this order, and what is printed of it.
_MEASURED = (*simulation.ROWS, "rmse-before-x", "rmse-before-y", "rmse-after-x", "rmse-after-y")
CELLS = (*simulation.ROWS, "rmse-before", "rmse-after")
# The printed cells of both channels, in the order of the numbers of a replicate.
ADDRESSES = tuple(
    f"{simulation.SETTINGS}#{cell}-{channel}"
    if cell.startswith("rmse")
    else f"niu2024/table-3#{cell}.{channel}"
    for channel in simulation.REGISTERED
    for cell in CELLS
)
# All that the ways of counting need, but for the root of two between both axes and their average.
_SUMMARISED = (*_MEASURED, "rmse-before", "rmse-after")
# Ways to count the axes, (26) as it stands first: places among `_SUMMARISED`, and a factor.
_RESIDUALS = {
    "both axes": ([8, 9], 1.0),
    "one axis on average": ([8, 9], np.sqrt(0.5)),
    "x alone": ([4, 6], 1.0),
    "y alone": ([5, 7], 1.0),
}
COUNTED = tuple(_RESIDUALS)
READS = (
    *simulation.READS,
    f"{simulation.TRUTH}#translation-*",
    f"{simulation.SETTINGS}#test-points",
)


@dataclass(frozen=True)
class Choices:
    """One choice for everything the text leaves open but how the RMSE counts the axes."""

    arrangement: int  # its place in `simulation.candidates`
    shifts: str  # one of `_SHIFTS`
    repeats: int  # draws averaged
    noisy: str  # one of `_NOISY`
    tests: str  # one of `TESTS`


def readings(door: Given) -> list[Choices]:
    """Return every reading, in the order in which `simulate` has them."""
    arrangements = range(len(simulation.candidates(door)))
    return [Choices(*c) for c in product(arrangements, _SHIFTS, REPEATS, _NOISY, TESTS)]


def literal(door: Given) -> Choices:
    """Return the literal reading, the one that the ledger uses where all give one verdict."""
    names = [found.name for found in simulation.candidates(door)]
    place = names.index(simulation.literal(door).name)
    return next(found for found in readings(door) if found.arrangement == place)


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
        tests = {TESTS[0]: at_random, TESTS[1]: np.moveaxis(true[:, drawn.chosen], 0, 1)}
        at_zero = simulation.zero_places(found.angles)
        for repeats, noisy in product(REPEATS, _NOISY):
            level = (sigma / np.sqrt(repeats) * np.array(_NOISY[noisy]))[:, None, None]
            green, source = np.moveaxis(true + level * drawn.calibration[:, pair], 1, 0)
            again = (zero + level * drawn.zero[:, pair])[:, 1, 0]
            pivot = source[:, at_zero[0]] if len(at_zero) else again
            similarity = fit_registration(source, green, pivot).transform
            for kind in TESTS:
                green, source = np.moveaxis(tests[kind] + level * drawn.test[:, pair], 1, 0)
                before = rmse_per_axis(source, green)
                after = rmse_per_axis(similarity.apply(source), green)
                yield np.concatenate([similarity.parameters, before, after], axis=-1)


def summarised(measured: FloatArray) -> FloatArray:
    """Return draws with the RMSE of both axes together beside those of each, as in `_SUMMARISED`.

    Examples
    --------
    >>> summarised(np.array([1.0, 0, 0, 0, 3, 4, 6, 8]))[-2:]
    array([ 5., 10.])
    """
    both = np.hypot(measured[..., 4::2], measured[..., 5::2])
    return np.concatenate([measured, both], axis=-1)


def counted(summaries: FloatArray, axes: str) -> FloatArray:
    """Return the numbers of `CELLS`, or quantiles of them, from those of `_SUMMARISED`.

    Examples
    --------
    >>> counted(np.arange(10.0), "y alone")
    array([0., 1., 2., 3., 5., 7.])
    """
    places, factor = _RESIDUALS[axes]
    return np.concatenate([summaries[..., :4], factor * summaries[..., places]], axis=-1)


def _part(span: tuple[int, int]) -> tuple[FloatArray]:
    first, count = span
    return (simulate(given(READS), count, first),)


def all_draws(
    replicates: int = REPLICATES, executor: Executor | None = None, store: Store | None = None
) -> FloatArray:
    """Simulate every reading on any executor, with the same result: as `simulate` returns it."""
    spans = [(begin, min(CHUNK, replicates - begin)) for begin in range(0, replicates, CHUNK)]
    parts = run_parts(_part, spans, executor, store)
    return np.concatenate([part for (part,) in parts], axis=1)


def summary(draws: FloatArray) -> dict[str, FloatArray]:
    """Return what is stored of all draws.

    ``mean``, ``sd`` (readings, 2, 8); ``quantiles`` (readings, 5, 2, 10), of what `_SUMMARISED`
    names; ``first``, the first replicates (readings, 20, 2, 8).
    """
    # One reading at a time: a second copy of the draws would not fit the promised memory.
    levels = [np.quantile(summarised(reading), _QUANTILES, axis=0) for reading in draws]
    return {
        "mean": draws.mean(axis=1),
        "sd": draws.std(axis=1, ddof=1),
        "quantiles": np.stack(levels),
        "first": draws[:, :_KEPT],
    }


def stored() -> studies.Study:
    """Return the stored run: arrays as in `summary`, and those of `tools/evidence/recompute.py`."""
    return studies.read(_STUDY)


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


def precision(door: Given, channel: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the theory of one channel's k, theta, shift x and shift y under the literal reading.

    What the imaging parameters imply, distortion left aside; what the unequal distortions add to
    the fit without noise; standard deviations of the Cramér-Rao bound.
    """
    place = simulation.CHANNELS.index(channel)
    cameras, turns = simulation.cameras(door), simulation.rotations(door)
    true = simulation.imaged(door, simulation.literal(door).angles)
    implied = similarity_between(cameras[place], turns[place], cameras[0])
    fitted = fit_registration(true[place], true[0], cameras[place].principal_point)
    sigma = door[simulation.NOISE]
    bound = registration_bound(true[place], implied, sigma, sigma).diagonal() ** 0.5
    return implied.parameters, fitted.parameters - implied.parameters, bound


@studied("niu2024/precision")
def _scheme_precision() -> Iterator[tuple[object, ...]]:
    """Bias, scatter, Cramér-Rao bound and efficiency of the paper's calibration scheme."""
    door, arrays = given(READS), stored().arrays
    row = readings(door).index(literal(door))
    for place, channel in enumerate(simulation.REGISTERED):
        drawn = (arrays[name][row, place, :4] for name in ("mean", "sd"))
        numbers = zip(simulation.ROWS, *drawn, *precision(door, channel), strict=True)
        for name, mean, scatter, truth, bias, bound in numbers:
            efficiency = (bound / scatter) ** 2
            found = (mean - truth, scatter / np.sqrt(REPLICATES), bias)
            error = efficiency * np.sqrt(2 / REPLICATES)
            yield name, channel, *found, scatter, bound, efficiency, error


_TITLES = ("k", "θ", "Δx", "Δy", "RMSE before", "RMSE after")


def chosen() -> dict[str, tuple[int, str]]:
    """Return readings to show: the literal one, and each other choice made in it alone.

    What is other, to the place of the reading in `readings` and the axes that are counted.
    """
    door = given(READS)
    every, first = readings(door), literal(door)
    both, *counted = COUNTED
    others = {
        "the literal one": first,
        "noise in red and blue": replace(first, noisy="red and blue"),
        "noise in green": replace(first, noisy="green"),
        "ten draws": replace(first, repeats=REPEATS[1]),
        "shifts of Table 2": replace(first, shifts="Table 2"),
        "tests among angles": replace(first, tests=TESTS[1]),
    }
    nearest = replace(first, shifts="Table 2", tests=TESTS[1])
    return {
        **{name: (every.index(reading), both) for name, reading in others.items()},
        **{f"RMSE of {axes}": (every.index(first), axes) for axes in counted},
        "Table 2, angles, y": (every.index(nearest), COUNTED[-1]),
    }


def _distances(printed: Mapping[str, float]) -> FloatArray:
    """Return how far each print lies from what each of the chosen readings predicts.

    Shape (readings, channels, numbers). From the middle of the central 99 %, in its half-widths: up
    to one it lies inside.
    """
    quantiles = stored().arrays["quantiles"]
    ends = np.array([counted(quantiles[n], way)[[0, -1]] for n, way in chosen().values()])
    values = np.array([printed[address] for address in ADDRESSES])
    low, high = ends.swapaxes(0, 1)
    result: FloatArray = np.abs(values.reshape(low.shape[1:]) - (low + high) / 2) * 2 / (high - low)
    return result


@draws("niu2024/drawing-distributions", marks=ADDRESSES)
def _draw_distributions(figure: Figure, printed: Mapping[str, float]) -> None:
    """Which readings predict which printed number, and how far the print lies from the others."""
    found, names = _distances(printed), list(chosen())
    narrow = sized(figure, 6.4, 4.4, 8.2)
    panels = figure.subplots(*((2, 1) if narrow else (1, 2)), sharey=True)
    for axes, channel, table in zip(
        panels, simulation.REGISTERED, found.swapaxes(0, 1), strict=True
    ):
        rows, columns = np.nonzero(table <= 1)
        look = LOOKS[channel]
        axes.plot(columns, rows, look.marker, color=look.colour, markersize=9, label="inside")
        for row, column in zip(*np.nonzero(table > 1), strict=True):
            away = table[row, column]
            text = f"{away:.1f}" if away < 10 else f"{away:.0f}"
            axes.text(column, row, text, ha="center", va="center", fontsize=8)
        axes.set_xticks(range(len(_TITLES)), _TITLES, rotation=90)
        axes.set(title=channel, xlim=(-0.6, len(_TITLES) - 0.4))
        axes.tick_params(length=0)
        axes.grid(visible=False)
    panels[0].set_yticks(range(len(names)), names, fontsize=8.5)
    panels[0].set_ylim(len(names) - 0.5, -0.5)


# The paper draws restarts "within a certain range" that it does not print; this one is ours.
_HALF_WIDTHS = (0.1, np.radians(5.0), 50.0, 50.0)
_RESTARTS = 20


def _imaged(door: Given) -> tuple[FloatArray, FloatArray]:
    """Return the angles of the simulation, and where the channels image them."""
    table = simulation.literal(door).angles
    return table, simulation.imaged(door, table)


def convergence() -> tuple[Calibration, Calibration]:
    """Calibrate the red channel of one replicate from the paper's start and from random ones."""
    door = given(READS)
    table, true = _imaged(door)
    noise = numbers(door, 1).calibration[0]
    green, red, _ = true + door[simulation.NOISE] * noise
    still = np.isclose(table[:, 1], 0.0)
    [zero] = simulation.zero_places(table)
    pivot, generator = red[zero], np.random.default_rng(SEED)
    start = starting_values(red[still], green[still], pivot, green[zero])
    starts = random_starts(start, _HALF_WIDTHS, _RESTARTS, generator)
    return calibrate(red, green, pivot, start), calibrate(red, green, pivot, starts)


def distance_to_end(calibration: Calibration) -> FloatArray:
    """Return how far the modelled points are from where they end, after every step.

    Shape (m + 1, ...). Root mean square over the table's points of one frame, in px; never below
    1e-11, where rounding takes over.
    """
    red = _imaged(given(READS))[1][1]
    at = model_points(calibration.history, red, calibration.pivot)
    return np.maximum(rmse(at, np.broadcast_to(at[-1], at.shape)), 1e-11)
