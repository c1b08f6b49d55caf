"""The numerical simulation: Table 3 and the four RMSE values (niu2024, sections 4.1 and 4.2).

The text leaves several readings open. The literal one, written down some minutes before the first
verdicts were:

* the angles are those of `reproduce.papers.niu2024.simulation_angles.literal`;
* centroids follow (21) to (23) with the imaging parameters of Table 1, principal points included,
  and the rotation angles of Table 2;
* every coordinate of every channel gets its own Gaussian noise of the printed standard deviation,
  drawn once: the averaging over ten repeats belongs to the laboratory procedure of section 3.1;
* the calibration is that of section 3.2: starting values from the row of angles with the external
  frame at zero and from the zero position, then the two-stage Gauss-Newton iteration;
* test points are directions at random, uniform over the printed range, imaged with the same noise;
* the RMSE is (26): one number for both axes.

Scales and rotations get one verdict under every reading of `reproduce.papers.niu2024.readings`, so
the literal one judges them. The verdict on translations and residuals depends on the reading. These
cells are blocked, with the readings that decide side by side; they were chosen after all of them
had been computed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.declare import (
    Blocked,
    Prediction,
    Reading,
    Results,
    reproduces,
    split_seed,
)
from reproduce.papers.niu2024 import simulation_angles
from reproduce.papers.niu2024.simulation_angles import SETTINGS
from reproduce.physics.optics.camera import Camera
from reproduce.physics.optics.simulate import (
    channel_centroids,
    noisy_centroids,
    spawned_angles,
    spawned_normals,
)
from reproduce.physics.registration.calibration import calibrate, starting_values
from reproduce.physics.registration.closed_form import rmse_per_axis
from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.registration.transforms import Registration
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

__all__ = [
    "CHANNELS", "IMAGING", "OPTICS", "READS", "REGISTERED", "SETTINGS", "TRUTH", "calibrations",
    "cameras", "cameras_of", "rotations",
]  # fmt: skip

IMAGING = "niu2024/table-1"
TRUTH = "niu2024/table-2"
OPTICS = "niu2024/text-optics"
CHANNELS = ("green", "red", "blue")
REGISTERED = ("red", "blue")
REPLICATES = 2000
# Replicates calibrated at once: enough to be fast, few enough to stay in the processor's memory.
BATCH = 500
# The days on which the literal reading and the others came into the history.
FIRST, LATER = "2026-11-21", "2026-11-22"
# What the printed noise is multiplied by in green, red and blue.
NOISY = {
    "every-channel": (1.0, 1.0, 1.0),
    "red-and-blue": (0.0, 1.0, 1.0),
    "green": (1.0, 0.0, 0.0),
}
DRAWS = {"one": 1, "ten": 10}
# What the text leaves open, as options of a rerun; the literal reading first.
CALIBRATION = {
    "angles": simulation_angles.ARRANGEMENTS,
    "noise": {
        "every-channel": "the printed noise in every channel",
        "red-and-blue": "green, the reference, without noise",
        "green": "red and blue without noise",
    },
    "repeats": {"one": "one draw of the noise", "ten": "the average of ten draws"},
}
TRANSLATIONS = {
    "translations": {
        "table-1": "principal points of Table 1",
        "table-2": "principal points of green, and the translations of Table 2 from there",
    }
}
TESTING = {
    "tests": {
        "range": "test points at random over the printed range",
        "angles": "test points among the angles of the calibration",
    },
    "rmse": {
        "both": "(26), which counts both axes",
        "one": "one axis on average",
        "x": "x alone",
        "y": "y alone",
    },
}
OPTIONS = CALIBRATION | TRANSLATIONS | TESTING
LITERAL = {name: next(iter(ways)) for name, ways in OPTIONS.items()}
READS = (
    *simulation_angles.READS,
    IMAGING,
    f"{TRUTH}#rotation.*",
    f"{OPTICS}#pixel-pitch-x",
    f"{SETTINGS}#noise",
)


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


def calibrations(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    first: int = 0,
    angles: str = LITERAL["angles"],
    noise: str = LITERAL["noise"],
    repeats: str = LITERAL["repeats"],
    translations: str = LITERAL["translations"],
) -> dict[str, Registration]:
    """Simulate and calibrate both channels in every replicate.

    Where an arrangement has no zero position, which the starting values of section 3.2 need, it is
    measured beside the calibration points, and the fit is the closed form: that is where the
    iteration ends.

    Channel to its calibrated transforms, shape (replicates,).
    """
    table = simulation_angles.arrangement(given, angles).angles
    still = np.isclose(table[:, 1], 0.0)  # the external frame stays at zero
    at_zero = np.flatnonzero(still & np.isclose(table[:, 0], 0.0))
    measured_at = table if at_zero.size else np.concatenate([table, np.zeros((1, 2))])
    zero = at_zero.item() if at_zero.size else len(table)
    true = channel_centroids(cameras(given, translations), rotations(given), measured_at)
    sigma = given[f"{SETTINGS}#noise"] * np.asarray(NOISY[noise])
    measured = noisy_centroids(true, sigma, seed, replicates, repeats=DRAWS[repeats], first=first)
    pivots, spots = measured[..., zero, :], measured[..., : len(table), :]
    green = spots[:, 0]
    found = {}
    for position, channel in enumerate(REGISTERED, start=1):
        source, pivot = spots[:, position], pivots[:, position]
        if at_zero.size:
            start = starting_values(source[:, still], green[:, still], pivot, pivots[:, 0])
            found[channel] = calibrate(source, green, pivot, start).transform
        else:
            found[channel] = fit_registration(source, green, pivot).transform
    return found


def _in_batches(
    compute: Callable[[int, int], Mapping[str, FloatArray]], replicates: int
) -> dict[str, FloatArray]:
    """Compute so many replicates from the first, part by part; by name, along the first axis."""
    parts = [
        compute(first, min(BATCH, replicates - first)) for first in range(0, replicates, BATCH)
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
    "niu2024/table-3",
    cells=["scale.*", "rotation.*"],
    given=READS,
    equations=["17", "18", "19", "20", "21", "22", "23", "24", "25"],
    replicates=REPLICATES,
    options=CALIBRATION,
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
    "niu2024/table-3",
    cells=["translation-*"],
    given=[*READS, f"{TRUTH}#translation-*"],
    equations=["14", "17", "18", "19", "20", "21", "22", "23", "24", "25"],
    replicates=REPLICATES,
    options=CALIBRATION | TRANSLATIONS,
)
def calibrated_translations(
    given: Given, seed: SeedSequence, replicates: int, **chosen: str
) -> Results:
    """Translations calibrated from centroids simulated with the shifts of Table 1 or of Table 2."""
    missing = "which principal points the simulation used, those of Table 1 or of Table 2"
    found = _parameters(given, seed, replicates, **chosen | {"translations": "table-1"})
    ways = (
        ("table-1", "principal points of Table 1", "section 4.1 with (21) to (23)", FIRST),
        ("table-2", "translations of Table 2", "sections 4.1 and 4.2, the true values", LATER),
    )
    points = [[camera.principal_point for camera in cameras(given, way)] for way, *_ in ways]
    # A channel's principal point carries its spots, its pivot and so its translation along.
    moved = np.array(points) - points[0]
    results = {}
    for position, channel in enumerate(REGISTERED, start=1):
        for place, axis in enumerate("xy"):
            draws = found[channel][:, 2 + place]
            readings = tuple(
                Reading(name, text, Prediction(draws + more), {"translations": way}, day)
                for (way, name, text, day), more in zip(
                    ways, moved[:, position, place], strict=True
                )
            )
            results[f"translation-{axis}.{channel}"] = Blocked(missing, readings=readings)
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
        half = simulation_angles.half_ranges(given)
        points = spawned_angles(for_angles, replicates, count, half, first=first)
    else:
        table = simulation_angles.arrangement(given, angles).angles
        # The order of independent numbers is a random order.
        order = spawned_normals(for_angles, replicates, (len(table),), first=first).argsort()
        points = table[order[:, :count]]
    true = channel_centroids(cameras(given, translations), rotations(given), points)
    sigma = given[f"{SETTINGS}#noise"] * np.asarray(NOISY[noise])
    return noisy_centroids(true, sigma, for_noise, replicates, repeats=DRAWS[repeats], first=first)


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


_SAME = "section 4.2, the same method as the calibration"
_AXIS = "section 4.3, an RMSE per axis"
# The readings that decide, before registration and after it: what the text does not say, the
# options that they choose (the others stay literal), and of each the name, the place, the choices.
DECIDING = {
    "before": (
        "the principal points and test points used, and which axes the RMSE counts",
        ("translations", "rmse", "tests"),
        (
            ("shifts of Table 1, (26)", "sections 4.1 and 4.2", "table-1 both range"),
            ("shifts of Table 2, (26)", "sections 4.1 and 4.2", "table-2 both range"),
            ("shifts of Table 2, (26), tests among the angles", _SAME, "table-2 both angles"),
            ("shifts of Table 2, one axis", _AXIS, "table-2 one range"),
            ("shifts of Table 2, one axis, tests among the angles", _SAME, "table-2 one angles"),
        ),
    ),
    "after": (
        "the noise of the reference, and which axes the RMSE counts",
        ("noise", "repeats", "rmse"),
        (
            ("noise in all channels, (26)", "sections 4.1 and 4.2", "every-channel one both"),
            (
                "green without noise, (26)",
                "section 4.2, green as reference",
                "red-and-blue one both",
            ),
            ("ten draws averaged, (26)", "section 3.1, ten repeats", "every-channel ten both"),
            ("noise in all channels, one axis", _AXIS, "every-channel one one"),
        ),
    ),
}


@reproduces(
    SETTINGS,
    cells=["rmse-*"],
    given=[*READS, f"{TRUTH}#translation-*", f"{SETTINGS}#test-points"],
    equations=["17", "18", "26"],
    replicates=REPLICATES,
    options=OPTIONS,
)
def registration_rmse(given: Given, seed: SeedSequence, replicates: int, **chosen: str) -> Results:
    """RMSE at test points before and after registration, under each reading that decides."""
    residuals = cache(partial(_residuals, given, seed, replicates))
    results = {}
    for when, (missing, names, deciding) in DECIDING.items():
        left = []
        for name, place, ways in deciding:
            choices = dict(zip(names, ways.split(), strict=True))
            if all(chosen.get(n, way) == way for n, way in choices.items()):
                left.append((name, place, choices))
        for channel in REGISTERED:
            readings = []
            # Without a reading that has all that is chosen, what is chosen is the only one.
            for name, place, choices in left or [("as chosen", "", {})]:
                *setting, axes = (LITERAL | choices | chosen).values()
                found = _counted(residuals(when, *setting)[channel], axes)
                added = LATER if choices.items() - LITERAL.items() else FIRST
                readings.append(Reading(name, place, Prediction(found), choices, added))
            results[f"rmse-{when}-{channel}"] = Blocked(missing, readings=tuple(readings))
    return results
