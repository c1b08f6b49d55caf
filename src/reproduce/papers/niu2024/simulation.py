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
a prime. The count therefore selects among those of `physics.optics.simulate`, and so it is an
input. The most literal of those that have it takes the step as the distance between neighbours of a
square lattice and holds the zero position, which the starting values of section 3.2 need.

Each choice is an option of the computations below; the ledger evaluates all combinations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from reproduce.papers.declare import (
    Prediction,
    Results,
    draws,
    reproduces,
    split_seed,
    words,
)
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
from reproduce.printed.given import Given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

IMAGING = "niu2024/table-1"
TRUTH = "niu2024/table-2"
_RESULTS = "niu2024/table-3"
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
_DRAWS = {"one": 1, "ten": 10}
_OPTIONS = words(SETTINGS).options
# Every arrangement that has the printed count, by the name of its alternative.
_ARRANGEMENTS = {name: way.text for name, way in _OPTIONS["angles"].items()}
ANGLES = (
    f"{SETTINGS}#angle-count",
    f"{SETTINGS}#range-x-*",
    f"{SETTINGS}#range-y-*",
    f"{SETTINGS}#step",
)
READS = (*ANGLES, IMAGING, f"{TRUTH}#rotation.*", f"{OPTICS}#pixel-pitch-x", NOISE)


@dataclass(frozen=True)
class _Setting:
    """The options of a simulated run, by their alternatives."""

    angles: str
    noise: str
    repeats: str
    translations: str


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
    if _ARRANGEMENTS[name] not in found:
        raise ValueError(
            f"angles={name}: this arrangement does not have "
            f"{door.count(f'{SETTINGS}#angle-count')} angles over the range; these do: "
            f"{', '.join(n for n, full in _ARRANGEMENTS.items() if full in found) or 'none'}"
        )
    return found[_ARRANGEMENTS[name]]


def literal(door: Given) -> Arrangement:
    """Return the arrangement that the ledger uses."""
    return _arrangement(door, next(iter(_ARRANGEMENTS)))


def cameras(given: Given, translations: str = "table-1") -> list[Camera]:
    """Return the cameras of Table 1, green, red and blue, under one reading of their shifts."""

    def point(channel: str, axis: str) -> float:
        if translations == "table-1" or channel == "green":
            return given[f"{IMAGING}#principal-point-{axis}.{channel}"]
        return point("green", axis) + given[f"{TRUTH}#translation-{axis}.{channel}"]

    return cameras_of(
        given, IMAGING, {c: [point(c, axis) for axis in "xy"] for c in CHANNELS}
    )


def cameras_of(
    given: Given, table: str, points: Mapping[str, Sequence[float]]
) -> list[Camera]:
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


def imaged(
    given: Given, angles: FloatArray, translations: str = "table-1"
) -> FloatArray:
    """Return where green, red and blue image the star without noise, shape (..., 3, n, 2)."""
    return channel_centroids(cameras(given, translations), rotations(given), angles)


def zero_places(angles: FloatArray) -> NDArray[np.intp]:
    """Return the places of the zero position among angles of shape (n, 2)."""
    return np.flatnonzero(np.isclose(angles, 0.0).all(axis=-1))


def _measured(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    first: int,
    angles: FloatArray,
    setting: _Setting,
) -> FloatArray:
    """Return the centroids of some replicates, shape (replicates, 3, n, 2)."""
    true = imaged(given, angles, setting.translations)
    sigma = given[NOISE] * np.asarray(_NOISY[setting.noise])
    repeats = _DRAWS[setting.repeats]
    return noisy_centroids(true, sigma, seed, replicates, repeats=repeats, first=first)


def _calibrations(
    given: Given, seed: SeedSequence, replicates: int, first: int, setting: _Setting
) -> dict[str, Registration]:
    """Simulate and calibrate both channels in every replicate.

    The fit is the closed form: that is where the iteration of section 3.2 ends. A zero position
    that is not in an arrangement is measured in addition to the calibration points.

    Channel to its calibrated transforms, shape (replicates,).
    """
    table = _arrangement(given, setting.angles).angles
    at_zero = zero_places(table)
    measured_at = table if at_zero.size else np.concatenate([table, np.zeros((1, 2))])
    zero = at_zero.item() if at_zero.size else len(table)
    measured = _measured(given, seed, replicates, first, measured_at, setting)
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
        compute(first, min(_BATCH, replicates - first))
        for first in range(0, replicates, _BATCH)
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


@reproduces(
    _RESULTS,
    cells=["scale.*", "rotation.*", "translation-*"],
    given=[*READS, f"{TRUTH}#translation-*"],
    equations=["14", "17", "18", "19", "20", "21", "22", "23", "24", "25"],
    replicates=_REPLICATES,
    options=_OPTIONS,
)
def calibrated_parameters(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    *,
    angles: str,
    noise: str,
    repeats: str,
    translations: str,
) -> Results:
    """Registration parameters calibrated from noisy simulated centroids."""
    setting = _Setting(angles, noise, repeats, translations)

    def part(first: int, count: int) -> dict[str, FloatArray]:
        found = _calibrations(given, seed, count, first, setting)
        return {channel: transform.parameters for channel, transform in found.items()}

    return {
        f"{row}.{channel}": Prediction(draws)
        for channel, parameters in _in_batches(part, replicates).items()
        for row, draws in zip(ROWS, parameters.T, strict=True)
    }


def _tested(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    first: int,
    tests: str,
    setting: _Setting,
) -> FloatArray:
    """Simulate the test points, shape (replicates, channels, points, 2)."""
    _, for_angles, for_noise = split_seed(seed, 3)
    count = given.count(f"{SETTINGS}#test-points")
    if tests == "range":
        half = half_ranges(given)
        points = spawned_angles(for_angles, replicates, count, half, first=first)
    else:
        table = _arrangement(given, setting.angles).angles
        # The order of independent numbers is a random order.
        order = spawned_normals(
            for_angles, replicates, (len(table),), first=first
        ).argsort()
        points = table[order[:, :count]]
    return _measured(given, for_noise, replicates, first, points, setting)


def _printed_transforms(given: Given, translations: str) -> dict[str, Registration]:
    """Return the transforms of Table 3 as printed, about the principal points of the channels."""
    points = dict(zip(CHANNELS, cameras(given, translations), strict=True))
    found = {}
    for channel in REGISTERED:
        scale, rotation, *shift = (given[f"{_RESULTS}#{row}.{channel}"] for row in ROWS)
        pivot = points[channel].principal_point
        found[channel] = Registration.similarity(scale, rotation, shift, pivot)
    return found


@lru_cache(maxsize=2)
def _residuals(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    tests: str,
    parameters: str,
    setting: _Setting,
) -> dict[str, FloatArray]:
    """Return the RMSE per axis at test points, before and after registration, for one setting.

    Name of the printed number to its RMSE, shape (replicates, 2).
    """
    for_noise = split_seed(seed, 3)[0]

    def part(first: int, count: int) -> dict[str, FloatArray]:
        measured = _tested(given, seed, count, first, tests, setting)
        points = {channel: measured[:, place] for place, channel in enumerate(CHANNELS)}
        green = points.pop(CHANNELS[0])
        if parameters == "table-3":
            transforms = _printed_transforms(given, setting.translations)
        else:
            transforms = _calibrations(given, for_noise, count, first, setting)
        laid = {
            channel: transforms[channel].apply(points[channel])
            for channel in REGISTERED
        }
        return {
            f"rmse-before-{c}": rmse_per_axis(points[c], green) for c in REGISTERED
        } | {f"rmse-after-{c}": rmse_per_axis(laid[c], green) for c in REGISTERED}

    return _in_batches(part, replicates)


def _counted(residuals: FloatArray, axes: str) -> FloatArray:
    """Return residuals of both axes, shape (replicates, 2), as one alternative counts them."""
    if axes in {"x", "y"}:
        return residuals[:, "xy".index(axes)]
    both = np.hypot(*residuals.T)
    return np.asarray(both if axes == "both" else both / np.sqrt(2))


@reproduces(
    SETTINGS,
    cells=["rmse-*"],
    given=[
        *READS,
        f"{TRUTH}#translation-*",
        f"{SETTINGS}#test-points",
        f"{_RESULTS}#*",
    ],
    equations=["17", "18", "26"],
    replicates=_REPLICATES,
)
def registration_rmse(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    *,
    angles: str,
    noise: str,
    repeats: str,
    translations: str,
    tests: str,
    parameters: str,
    rmse: str,
) -> Results:
    """RMSE at test points before and after registration."""
    setting = _Setting(angles, noise, repeats, translations)
    found = _residuals(given, seed, replicates, tests, parameters, setting)
    return {name: Prediction(_counted(axes, rmse)) for name, axes in found.items()}


@draws("niu2024/fig-4", given=ANGLES)
def _draw_angles(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Rotation angles of the rotary table in the simulation."""
    angles = np.degrees(literal(door).angles)
    axes = figure.add_subplot()
    axes.plot(
        *angles.T, "o", markersize=4, label=f"{len(angles)} angles of the simulation"
    )
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
    outline = np.degrees(corners * half_ranges(door)).T
    axes.plot(*outline, linestyle="--", linewidth=1, label="printed range")
    axes.set(aspect="equal", xlabel="middle frame (°)", ylabel="external frame (°)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
