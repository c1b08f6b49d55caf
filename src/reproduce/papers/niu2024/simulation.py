"""The numerical simulation: Figure 4, Table 3 and the four RMSE values (niu2024, 4.1 and 4.2).

The text leaves several readings open. The literal one, written down some minutes before the first
verdicts were:

* the angles are those of `literal`;
* centroids follow (21) to (23) with the imaging parameters of Table 1, principal points included,
  and the rotation angles of Table 2;
* every coordinate of every channel gets its own Gaussian noise of the printed standard deviation,
  drawn once: the averaging over ten repeats belongs to the laboratory procedure of section 3.1;
* the calibration is that of section 3.2: starting values from the row of angles with the external
  frame at zero and from the zero position, then the two-stage Gauss-Newton iteration;
* test points are directions at random, uniform over the printed range, imaged with the same noise;
* the RMSE is (26): one number for both axes.

Of the angles the text gives a count, a range and a step; no full rectangle has that count, which is
a prime. The count therefore selects among those of `physics.optics.arrangements`, and so it is an
input. The most literal of those that have it takes the step as the distance between neighbours of a
square lattice and holds the zero position, which the starting values of section 3.2 need.

Scales and rotations get one verdict under every reading of `reproduce.papers.niu2024.readings`, so
the literal one judges them. The verdict on translations and residuals depends on the reading. These
cells are blocked, with the readings that decide side by side; they were chosen after all of them
had been computed.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from reproduce.papers.declare import (
    Blocked,
    Marks,
    Prediction,
    Result,
    Results,
    agree,
    draws,
    read,
    reproduces,
    split_seed,
)
from reproduce.papers.sketch import INK, sized, thin
from reproduce.papers.study import Fact
from reproduce.papers.words import Way, words
from reproduce.physics.optics import (
    Arrangement,
    Camera,
    arrangements_with,
    channel_centroids,
    noisy_centroids,
    spawned_angles,
    spawned_normals,
)
from reproduce.physics.registration import (
    Registration,
    fit_registration,
    rmse_per_axis,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

IMAGING = "niu2024/table-1"
TRUTH = "niu2024/table-2"
RESULTS = "niu2024/table-3"
OPTICS = "niu2024/text-optics"
SETTINGS = "niu2024/text-simulation"
NOISE = f"{SETTINGS}#noise"
CHANNELS = ("green", "red", "blue")
REGISTERED = ("red", "blue")
ROWS = ("scale", "rotation", "translation-x", "translation-y")
_REPLICATES = 2000
# Replicates calibrated at once: enough to be fast, few enough to stay in the processor's memory.
_BATCH = 500
# What the printed noise is multiplied by in green, red and blue.
_NOISY = {
    "every-channel": (1.0, 1.0, 1.0),
    "red-and-blue": (0.0, 1.0, 1.0),
    "green": (1.0, 0.0, 0.0),
}
# Ends of the central 99 %, which counts as consistent, and the median.
_LEVELS = (0.005, 0.5, 0.995)
_DRAWS = {"one": 1, "ten": 10}
# What the text leaves open, as options of a rerun; of each the literal reading first.
_WORDS = words(SETTINGS)
_OPTIONS = _WORDS.options
_CALIBRATION = {name: _OPTIONS[name] for name in ("angles", "noise", "repeats")}
_TRANSLATIONS = {"translations": _OPTIONS["translations"]}
_LITERAL = {name: next(iter(ways)) for name, ways in _OPTIONS.items()}
# Every arrangement that has the printed count, by the name under which a reader asks for it.
ARRANGEMENTS = _OPTIONS["angles"]
ANGLES = (
    f"{SETTINGS}#angle-count",
    f"{SETTINGS}#range-x-*",
    f"{SETTINGS}#range-y-*",
    f"{SETTINGS}#step",
)
READS = (*ANGLES, IMAGING, f"{TRUTH}#rotation.*", f"{OPTICS}#pixel-pitch-x", NOISE)


def half_ranges(door: Given) -> tuple[float, float]:
    """Return half the printed range about x and about y, in radians."""
    low, high = (door.array(f"{SETTINGS}#range-?-{end}") for end in ("low", "high"))
    x, y = ((high - low) / 2).tolist()
    return x, y


@cache
def candidates(door: Given) -> tuple[Arrangement, ...]:
    """Return every arrangement that has the printed number of angles, in the family's order."""
    count = door.count(f"{SETTINGS}#angle-count")
    return tuple(arrangements_with(count, *half_ranges(door), door[f"{SETTINGS}#step"]))


def _arrangement(door: Given, name: str) -> Arrangement:
    """Return one arrangement."""
    found = {candidate.name: candidate for candidate in candidates(door)}
    if ARRANGEMENTS[name] not in found:
        raise ValueError(
            f"angles={name}: this arrangement does not have "
            f"{door.count(f'{SETTINGS}#angle-count')} angles over the range; these do: "
            f"{', '.join(n for n, full in ARRANGEMENTS.items() if full in found) or 'none'}"
        )
    return found[ARRANGEMENTS[name]]


def literal(door: Given) -> Arrangement:
    """Return the arrangement that the ledger uses."""
    return _arrangement(door, next(iter(ARRANGEMENTS)))


def cameras(given: Given, translations: str = "table-1") -> list[Camera]:
    """Return the cameras of Table 1, green, red and blue, under one reading of their shifts."""

    def point(channel: str, axis: str) -> float:
        if translations == "table-1" or channel == "green":
            return given[f"{IMAGING}#principal-point-{axis}.{channel}"]
        return point("green", axis) + given[f"{TRUTH}#translation-{axis}.{channel}"]

    return cameras_of(given, IMAGING, {c: [point(c, axis) for axis in "xy"] for c in CHANNELS})


def cameras_of(given: Given, table: str, points: Mapping[str, Sequence[float]]) -> list[Camera]:
    """Return the cameras of a table by channel, with their principal points."""
    return [
        Camera(
            given[f"{table}#focal-length.{channel}"],
            point,
            given[f"{table}#radial-distortion.{channel}"],
            given[f"{OPTICS}#pixel-pitch-x"],
        )
        for channel, point in points.items()
    ]


def rotations(given: Given) -> list[float]:
    """Return the detectors' rotation angles against green: green, red, blue, in radians."""
    return [0.0, *(given[f"{TRUTH}#rotation.{channel}"] for channel in REGISTERED)]


def imaged(given: Given, angles: FloatArray, translations: str = "table-1") -> FloatArray:
    """Return where green, red and blue image the star without noise, shape (..., 3, n, 2)."""
    return channel_centroids(cameras(given, translations), rotations(given), angles)


def zero_places(angles: FloatArray) -> NDArray[np.intp]:
    """Return the places of the zero position among angles of shape (n, 2)."""
    return np.flatnonzero(np.isclose(angles, 0.0).all(axis=-1))


def calibrations(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    first: int = 0,
    angles: str = _LITERAL["angles"],
    noise: str = _LITERAL["noise"],
    repeats: str = _LITERAL["repeats"],
    translations: str = _LITERAL["translations"],
) -> dict[str, Registration]:
    """Simulate and calibrate both channels in every replicate.

    The fit is the closed form: that is where the iteration of section 3.2 ends. A zero position
    that is not in an arrangement is measured beside the calibration points.

    Channel to its calibrated transforms, shape (replicates,).
    """
    table = _arrangement(given, angles).angles
    at_zero = zero_places(table)
    measured_at = table if at_zero.size else np.concatenate([table, np.zeros((1, 2))])
    zero = at_zero.item() if at_zero.size else len(table)
    true = imaged(given, measured_at, translations)
    sigma = given[NOISE] * np.asarray(_NOISY[noise])
    measured = noisy_centroids(true, sigma, seed, replicates, repeats=_DRAWS[repeats], first=first)
    pivots, spots = measured[..., zero, :], measured[..., : len(table), :]
    green = spots[:, 0]
    found = {}
    for position, channel in enumerate(REGISTERED, start=1):
        fit = fit_registration(spots[:, position], green, pivots[:, position])
        found[channel] = fit.transform
    return found


def _in_batches(
    compute: Callable[[int, int], Mapping[str, FloatArray]], replicates: int
) -> dict[str, FloatArray]:
    """Compute so many replicates from the first, part by part; by name, along the first axis."""
    parts = [
        compute(first, min(_BATCH, replicates - first)) for first in range(0, replicates, _BATCH)
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _parameters(
    given: Given, seed: SeedSequence, replicates: int, **chosen: str
) -> dict[str, FloatArray]:
    """Calibrate both channels in every replicate: channel to (scale, rotation, shifts)."""

    def part(first: int, count: int) -> dict[str, FloatArray]:
        found = calibrations(given, seed, count, first, **chosen)
        return {channel: transform.parameters for channel, transform in found.items()}

    return _in_batches(part, replicates)


@reproduces(
    RESULTS,
    cells=["scale.*", "rotation.*"],
    given=READS,
    equations=["17", "18", "19", "20", "21", "22", "23", "24", "25"],
    replicates=_REPLICATES,
    options=_CALIBRATION,
)
def calibrated_parameters(
    given: Given, seed: SeedSequence, replicates: int, **chosen: str
) -> Results:
    """Scale and rotation calibrated from noisy simulated centroids."""
    return {
        f"{row}.{channel}": Prediction(draws)
        for channel, parameters in _parameters(given, seed, replicates, **chosen).items()
        for row, draws in zip(("scale", "rotation"), parameters.T[:2], strict=True)
    }


@reproduces(
    RESULTS,
    cells=["translation-*"],
    given=[*READS, f"{TRUTH}#translation-*"],
    equations=["14", "17", "18", "19", "20", "21", "22", "23", "24", "25"],
    replicates=_REPLICATES,
    options=_CALIBRATION | _TRANSLATIONS,
)
def calibrated_translations(
    given: Given, seed: SeedSequence, replicates: int, **chosen: str
) -> Results:
    """Translations calibrated from centroids simulated with the shifts of Table 1 or of Table 2."""
    found = _parameters(given, seed, replicates, **chosen | {"translations": "table-1"})
    text = words(RESULTS)
    [(name, ways)] = text.readings.items()
    tables = (cameras(given, way.choices["translations"]) for way in ways)
    points = np.array([[camera.principal_point for camera in table] for table in tables])
    # A channel's principal point carries its spots, its pivot and so its translation along.
    moved = points - points[0]
    results = {}
    for (position, channel), (place, axis) in product(enumerate(REGISTERED, 1), enumerate("xy")):
        draws = found[channel][:, 2 + place] + moved[:, position, place, None]
        readings = tuple(map(read, ways, map(Prediction, draws)))
        results[f"{name}-{axis}.{channel}"] = Blocked(text.missing[name], readings=readings)
    return results


def _tested(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    first: int,
    angles: str,
    noise: str,
    repeats: str,
    translations: str,
    tests: str,
) -> FloatArray:
    """Simulate the test points, shape (replicates, channels, points, 2)."""
    _, for_angles, for_noise = split_seed(seed, 3)
    count = given.count(f"{SETTINGS}#test-points")
    if tests == "range":
        half = half_ranges(given)
        points = spawned_angles(for_angles, replicates, count, half, first=first)
    else:
        table = _arrangement(given, angles).angles
        # The order of independent numbers is a random order.
        order = spawned_normals(for_angles, replicates, (len(table),), first=first).argsort()
        points = table[order[:, :count]]
    true = imaged(given, points, translations)
    sigma = given[NOISE] * np.asarray(_NOISY[noise])
    return noisy_centroids(true, sigma, for_noise, replicates, repeats=_DRAWS[repeats], first=first)


def _residuals(
    given: Given, seed: SeedSequence, replicates: int, when: str, *setting: str
) -> dict[str, FloatArray]:
    """Return the RMSE per axis at test points, before or after registration, for one setting.

    Channel to its RMSE, shape (replicates, 2). `calibrations` is only asked for those after.
    """
    for_noise = split_seed(seed, 3)[0]

    def part(first: int, count: int) -> dict[str, FloatArray]:
        measured = _tested(given, seed, count, first, *setting)
        points = {channel: measured[:, place] for place, channel in enumerate(CHANNELS)}
        green = points.pop(CHANNELS[0])
        if when == "after":
            found = calibrations(given, for_noise, count, first, *setting[:-1])
            points = {channel: found[channel].apply(points[channel]) for channel in REGISTERED}
        return {channel: rmse_per_axis(laid, green) for channel, laid in points.items()}

    return _in_batches(part, replicates)


def _counted(per_axis: FloatArray, axes: str) -> FloatArray:
    x, y = per_axis.T
    both = np.hypot(x, y)
    found: FloatArray = {"both": both, "one": both / np.sqrt(2), "x": x, "y": y}[axes]
    return found


@reproduces(
    SETTINGS,
    cells=["rmse-*"],
    given=[*READS, f"{TRUTH}#translation-*", f"{SETTINGS}#test-points"],
    equations=["17", "18", "26"],
    replicates=_REPLICATES,
    options=_OPTIONS,
)
def registration_rmse(given: Given, seed: SeedSequence, replicates: int, **chosen: str) -> Results:
    """RMSE at test points before and after registration, under each reading that decides."""
    residuals = cache(partial(_residuals, given, seed, replicates))
    chosen_alone = Way("as chosen", "", "", {})
    results = {}
    for when, channel in product(("before", "after"), REGISTERED):
        name = f"rmse-{when}"
        left = [way for way in _WORDS.readings[name] if agree(way.choices, chosen)]
        readings = []
        # Without a reading that has all that is chosen, what is chosen is the only one.
        for way in left or [chosen_alone]:
            *setting, axes = (_LITERAL | way.choices | chosen).values()
            found = _counted(residuals(when, *setting)[channel], axes)
            readings.append(read(way, Prediction(found)))
        results[f"{name}-{channel}"] = Blocked(_WORDS.missing[name], readings=tuple(readings))
    return results


@draws("niu2024/fig-4", given=ANGLES)
def _draw_angles(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Rotation angles of the rotary table in the simulation."""
    angles = np.degrees(literal(door).angles)
    axes = figure.add_subplot()
    axes.plot(*angles.T, "o", markersize=4, label=f"{len(angles)} angles of the simulation")
    axes.plot(*_range(door), linestyle="--", linewidth=1, label="printed range")
    axes.set(aspect="equal", xlabel="middle frame (°)", ylabel="external frame (°)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)


def _range(door: Given) -> FloatArray:
    """Return the outline of the printed range, in degrees, shape (2, 5)."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
    return np.degrees(corners * half_ranges(door)).T


def _arrangement_facts() -> dict[str, Fact]:
    """Return how many arrangements have the printed count, and how many of them hold zero."""
    found = candidates(given(ANGLES))
    return {
        "arrangements": Fact(len(found), "d"),
        "angles": Fact(len(found[0].angles), "d"),
        "with-zero": Fact(sum(map(_holds_zero, found)), "d"),
    }


def _holds_zero(one: Arrangement) -> bool:
    return len(zero_places(one.angles)) > 0


@draws("niu2024/drawing-arrangements", given=ANGLES, named=_arrangement_facts)
def _draw_arrangements(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Every arrangement of rotation angles that has the printed count."""
    found, used = candidates(door), literal(door).name
    columns = 2 if thin(figure) else 3
    rows = -(-len(found) // columns)
    sized(figure, 6.4, 1.85 * rows, narrow=1.7 * rows)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True).ravel()
    for axes, one in zip(grid, found, strict=False):
        axes.plot(*np.degrees(one.angles).T, "o", markersize=1.5)
        axes.plot(*_range(door), color=INK, linewidth=0.6)
        if _holds_zero(one):
            axes.plot(0, 0, "o", markersize=6, fillstyle="none", color=INK)
        name = one.name + (" (in use)" if one.name == used else "")
        axes.set_title("\n".join(textwrap.wrap(name, 26)), fontsize=8)
        axes.set(aspect="equal")
    for axes in grid[len(found) :]:
        axes.set_axis_off()
    figure.supxlabel("middle frame (°)", fontsize=9)
    figure.supylabel("external frame (°)", fontsize=9)


# Half-widths of the prediction shown to either side; what lies further out is an arrow at the edge.
_REACH = 12.0
_PREDICTED = "#2E8BC0"


def predicted_rows() -> Iterator[tuple[str, str, FloatArray]]:
    """Yield address, label, and (low, median, high) of Table 3; of a translation under each table.

    Low and high are the ends of the central 99 %.
    """
    results: dict[str, Result] = {}
    for computation in (calibrated_parameters, calibrated_translations):
        results |= computation(given(computation.given))
    for row, channel in product(ROWS, REGISTERED):
        result = results[f"{row}.{channel}"]
        label = f"{row.replace('translation-', 'shift ')}, {channel}"
        ways: dict[str, Result] = {label: result}
        if isinstance(result, Blocked):
            tables = ((one.choices["translations"], one.result) for one in result.readings)
            ways = {f"{label}: {table.replace('table-', 'Table ')}": way for table, way in tables}
        for name, way in ways.items():
            if isinstance(way, Prediction):
                yield f"{RESULTS}#{row}.{channel}", name, np.quantile(way.draws, _LEVELS)


@draws("niu2024/drawing-table-3", marks=[RESULTS])
def _draw_table_3(figure: Figure, printed: Marks) -> None:
    """Table 3 printed against predicted: each prediction scaled to the same width."""
    from matplotlib.lines import Line2D

    rows = list(predicted_rows())
    narrow = sized(figure, 4.9, 4.9, 5.2)
    axes = figure.add_subplot()
    for height, (address, _, (low, median, high)) in enumerate(rows):
        values = np.array([median, printed[address], *printed.intervals[address]])
        middle, *mark = ((values - (low + high) / 2) / ((high - low) / 2)).tolist()
        axes.plot([-1, 1], [height, height], color=_PREDICTED, linewidth=8, solid_capstyle="butt")
        axes.plot(middle, height, "|", color=INK, markersize=13, markeredgewidth=1.2)
        _mark_print(axes, height, *mark)
    axes.set_yticks(range(len(rows)), [label for _, label, _ in rows], fontsize=9)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(-_REACH, _REACH)
    axes.axvline(0, color=INK, linewidth=0.6, alpha=0.5, zorder=0)
    axes.grid(visible=False, axis="y")
    gap = "\n" if narrow else " "
    axes.set_xlabel(f"distance from the median{gap}(half-widths)", fontsize=9)
    axes.tick_params(axis="x", labelsize=9)
    kinds = [
        Line2D([], [], color=_PREDICTED, linewidth=8, label="predicted, central 99 %"),
        Line2D([], [], color=INK, marker="|", markersize=13, linewidth=0, label="median"),
        Line2D([], [], color=INK, marker="D", markersize=4.5, label="printed, with its rounding"),
    ]
    figure.legend(handles=kinds, loc="outside lower center", ncols=1 if narrow else 2, fontsize=9)


def _mark_print(axes: Axes, height: int, place: float, low: float, high: float) -> None:
    """Mark a printed value with its rounding, in half-widths; one far out by an arrow."""
    if abs(place) < _REACH:
        axes.plot([low, high], [height, height], color=INK, linewidth=1.3)
        axes.plot([low, high], [height, height], "|", color=INK, markersize=7)
        axes.plot(place, height, "D", color=INK, markersize=4.5)
        return
    side = float(np.sign(place))
    axes.plot(0.97 * side * _REACH, height, "<" if side < 0 else ">", color=INK, markersize=7)
    where = "left" if side < 0 else "right"
    axes.text(
        0.86 * side * _REACH, height, f"{abs(place):.0f} away", ha=where, va="center", fontsize=9
    )
