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

from collections.abc import Callable

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.declare import (
    Blocked,
    Prediction,
    Reading,
    Result,
    Results,
    reproduces,
    split_seed,
)
from reproduce.papers.niu2024 import simulation_angles
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
    "CHANNELS",
    "IMAGING",
    "OPTICS",
    "READS",
    "REGISTERED",
    "SETTINGS",
    "SHIFTS",
    "TESTS",
    "TRUTH",
    "calibrations",
    "cameras",
    "rotations",
]

IMAGING = "niu2024/table-1"
TRUTH = "niu2024/table-2"
OPTICS = "niu2024/text-optics"
SETTINGS = "niu2024/text-simulation"
CHANNELS = ("green", "red", "blue")
REGISTERED = ("red", "blue")
REPLICATES = 2000
# Replicates calibrated at once: enough to be fast, few enough to stay in a processor's cache.
BATCH = 500
# What the principal points of red and blue are, and where the test points are.
SHIFTS = ("Table 1", "Table 2")
TESTS = ("over the range", "among the angles")
# What the printed noise is multiplied by in green, red and blue.
NOISY = {
    "every-channel": (1.0, 1.0, 1.0),
    "red-and-blue": (0.0, 1.0, 1.0),
    "green": (1.0, 0.0, 0.0),
}
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
READS = (
    *simulation_angles.READS,
    IMAGING,
    f"{TRUTH}#rotation.*",
    f"{OPTICS}#pixel-pitch-x",
    f"{SETTINGS}#noise",
)


def cameras(given: Given, shifts: str = SHIFTS[0]) -> list[Camera]:
    """Return the cameras of Table 1, green, red and blue, under one reading of their shifts."""
    if shifts not in SHIFTS:
        raise ValueError(f"shifts: expected one of {SHIFTS}, got {shifts!r}")

    def point(channel: str, axis: str) -> float:
        if shifts == SHIFTS[0] or channel == "green":
            return given[f"{IMAGING}#principal-point-{axis}.{channel}"]
        return point("green", axis) + given[f"{TRUTH}#translation-{axis}.{channel}"]

    return [
        Camera(
            given[f"{IMAGING}#focal-length.{channel}"],
            [point(channel, axis) for axis in "xy"],
            given[f"{IMAGING}#radial-distortion.{channel}"],
            given[f"{OPTICS}#pixel-pitch-x"],
        )
        for channel in CHANNELS
    ]


def rotations(given: Given) -> list[float]:
    """Return the detectors' rotation angles against green: green, red, blue, in radians."""
    return [0.0, *(given[f"{TRUTH}#rotation.{channel}"] for channel in REGISTERED)]


def calibrations(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    *,
    arrangement: str = simulation_angles.LITERAL,
    shifts: str = SHIFTS[0],
    noise: str = "every-channel",
    repeats: int = 1,
) -> dict[str, Registration]:
    """Simulate and calibrate both channels in every replicate.

    Where an arrangement has no zero position, which the starting values of section 3.2 need, it is
    measured beside the calibration points, and the fit is the closed form: that is where the
    iteration ends.

    Channel to its calibrated transforms, shape (replicates,).
    """
    table = simulation_angles.arrangement(given, arrangement).angles
    still = np.isclose(table[:, 1], 0.0)  # the external frame stays at zero
    at_zero = np.flatnonzero(still & np.isclose(table[:, 0], 0.0))
    measured_at = table if at_zero.size else np.concatenate([table, np.zeros((1, 2))])
    zero = at_zero.item() if at_zero.size else len(table)
    true = channel_centroids(cameras(given, shifts), rotations(given), measured_at)
    sigma = given[f"{SETTINGS}#noise"] * np.asarray(NOISY[noise])
    parts: dict[str, list[FloatArray]] = {channel: [] for channel in REGISTERED}
    for first in range(0, replicates, BATCH):
        batch = min(BATCH, replicates - first)
        measured = noisy_centroids(true, sigma, seed, batch, repeats=repeats, first=first)
        pivots, spots = measured[..., zero, :], measured[..., : len(table), :]
        green = spots[:, 0]
        for position, channel in enumerate(REGISTERED, start=1):
            source, pivot = spots[:, position], pivots[:, position]
            if at_zero.size:
                start = starting_values(source[:, still], green[:, still], pivot, pivots[:, 0])
                found = calibrate(source, green, pivot, start).parameters
            else:
                found = fit_registration(source, green, pivot).parameters
            parts[channel].append(np.concatenate([found, pivot], axis=-1))
    whole = {channel: np.concatenate(part) for channel, part in parts.items()}
    return {
        c: Registration.similarity(u[:, 0], u[:, 1], u[:, 2:4], u[:, 4:]) for c, u in whole.items()
    }


@reproduces(
    "niu2024/table-3",
    cells=["scale.*", "rotation.*"],
    given=READS,
    equations=["17", "18", "19", "20", "21", "22", "23", "24", "25"],
    replicates=REPLICATES,
    options=CALIBRATION,
)
def calibrated_parameters(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    *,
    angles: str = simulation_angles.LITERAL,
    noise: str = "every-channel",
    repeats: str = "one",
) -> Results:
    """Scale and rotation calibrated from noisy simulated centroids."""
    found = calibrations(
        given, seed, replicates, arrangement=angles, noise=noise, repeats=DRAWS[repeats]
    )
    return {
        f"{row}.{channel}": Prediction(draws)
        for channel, calibration in found.items()
        for row, draws in zip(("scale", "rotation"), calibration.parameters.T[:2], strict=True)
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
    given: Given,
    seed: SeedSequence,
    replicates: int,
    *,
    angles: str = simulation_angles.LITERAL,
    noise: str = "every-channel",
    repeats: str = "one",
) -> Results:
    """Translations calibrated from centroids simulated with the shifts of Table 1 or of Table 2."""
    missing = "which principal points the simulation used, those of Table 1 or of Table 2"
    found = calibrations(
        given, seed, replicates, arrangement=angles, noise=noise, repeats=DRAWS[repeats]
    )
    first, second = (
        np.array([camera.principal_point for camera in cameras(given, shifts)]) for shifts in SHIFTS
    )
    # A channel's principal point carries its spots, its pivot and so its translation along.
    moved = second - first
    results = {}
    for position, channel in enumerate(REGISTERED, start=1):
        for axis, draws, more in zip(
            "xy", found[channel].parameters.T[2:], moved[position], strict=True
        ):
            readings = (
                Reading(
                    "principal points of Table 1",
                    "section 4.1 with (21) to (23)",
                    Prediction(draws),
                    {"translations": "table-1"},
                ),
                Reading(
                    "translations of Table 2",
                    "sections 4.1 and 4.2, the true values",
                    Prediction(draws + more),
                    {"translations": "table-2"},
                ),
            )
            results[f"translation-{axis}.{channel}"] = Blocked(missing, readings=readings)
    return results


def residuals(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    *,
    arrangement: str = simulation_angles.LITERAL,
    shifts: str = SHIFTS[0],
    noise: str = "every-channel",
    repeats: int = 1,
    tests: str = TESTS[0],
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Simulate, calibrate and test both channels in every replicate.

    Channel to its RMSE per axis before and after registration, each of shape (replicates, 2).
    """
    for_noise, for_angles, for_test_noise = split_seed(seed, 3)
    found = calibrations(
        given,
        for_noise,
        replicates,
        arrangement=arrangement,
        shifts=shifts,
        noise=noise,
        repeats=repeats,
    )
    count = given.count(f"{SETTINGS}#test-points")
    if tests == TESTS[0]:
        points = spawned_angles(for_angles, replicates, count, simulation_angles.half_ranges(given))
    else:
        table = simulation_angles.arrangement(given, arrangement).angles
        # The order of independent numbers is a random order.
        order = spawned_normals(for_angles, replicates, (len(table),)).argsort(axis=-1)
        points = table[order[:, :count]]
    true = channel_centroids(cameras(given, shifts), rotations(given), points)
    sigma = given[f"{SETTINGS}#noise"] * np.asarray(NOISY[noise])
    measured = noisy_centroids(true, sigma, for_test_noise, replicates, repeats=repeats)
    return {
        channel: (
            rmse_per_axis(measured[:, place], measured[:, 0]),
            rmse_per_axis(found[channel].apply(measured[:, place]), measured[:, 0]),
        )
        for place, channel in enumerate(REGISTERED, start=1)
    }


DRAWS = {"one": 1, "ten": 10}
SHIFTED = dict(zip(TRANSLATIONS["translations"], SHIFTS, strict=True))
TESTED = dict(zip(TESTING["tests"], TESTS, strict=True))
COUNTED: dict[str, Callable[[FloatArray], FloatArray]] = {
    "both": lambda per_axis: np.hypot(per_axis[..., 0], per_axis[..., 1]),
    "one": lambda per_axis: np.hypot(per_axis[..., 0], per_axis[..., 1]) / np.sqrt(2),
    "x": lambda per_axis: per_axis[..., 0],
    "y": lambda per_axis: per_axis[..., 1],
}
RMSE_OPTIONS = CALIBRATION | TRANSLATIONS | TESTING


def _deciding(
    options: str, *readings: tuple[str, str, str]
) -> list[tuple[str, str, dict[str, str]]]:
    names = options.split()
    return [
        (name, at, dict(zip(names, choices.split(), strict=True))) for name, at, choices in readings
    ]


_SAME = "section 4.2, the same method as the calibration"
_AXIS = "section 4.3, an RMSE per axis"
# The readings that decide, before registration and after it: name, place, and what each one
# chooses of the options; the others stay literal.
DECIDING = {
    "before": _deciding(
        "translations rmse tests",
        ("shifts of Table 1, (26)", "sections 4.1 and 4.2", "table-1 both range"),
        ("shifts of Table 2, (26)", "sections 4.1 and 4.2", "table-2 both range"),
        ("shifts of Table 2, (26), tests among the angles", _SAME, "table-2 both angles"),
        ("shifts of Table 2, one axis", _AXIS, "table-2 one range"),
        ("shifts of Table 2, one axis, tests among the angles", _SAME, "table-2 one angles"),
    ),
    "after": _deciding(
        "noise repeats rmse",
        ("noise in all channels, (26)", "sections 4.1 and 4.2", "every-channel one both"),
        ("green without noise, (26)", "section 4.2, green as reference", "red-and-blue one both"),
        ("ten draws averaged, (26)", "section 3.1, ten repeats", "every-channel ten both"),
        ("noise in all channels, one axis", _AXIS, "every-channel one one"),
    ),
}
MISSING = {
    "before": "the principal points and test points used, and which axes the RMSE counts",
    "after": "the noise of the reference, and which axes the RMSE counts",
}


@reproduces(
    SETTINGS,
    cells=["rmse-*"],
    given=[*READS, f"{TRUTH}#translation-*", f"{SETTINGS}#test-points"],
    equations=["17", "18", "26"],
    replicates=REPLICATES,
    options=RMSE_OPTIONS,
)
def registration_rmse(given: Given, seed: SeedSequence, replicates: int, **chosen: str) -> Results:
    """RMSE at test points before and after registration, under each reading that decides."""
    literal = {name: next(iter(choices)) for name, choices in RMSE_OPTIONS.items()}
    made: dict[tuple[str, ...], dict[str, tuple[FloatArray, FloatArray]]] = {}

    def found(setting: dict[str, str], channel: str, which: int) -> Prediction:
        simulated = tuple(setting[name] for name in literal if name != "rmse")
        if simulated not in made:
            made[simulated] = residuals(
                given,
                seed,
                replicates,
                arrangement=setting["angles"],
                shifts=SHIFTED[setting["translations"]],
                noise=setting["noise"],
                repeats=DRAWS[setting["repeats"]],
                tests=TESTED[setting["tests"]],
            )
        return Prediction(COUNTED[setting["rmse"]](made[simulated][channel][which]))

    results: dict[str, Result] = {}
    for which, (when, deciding) in enumerate(DECIDING.items()):
        left = [
            reading
            for reading in deciding
            if all(chosen.get(name, choice) == choice for name, choice in reading[2].items())
        ]
        for channel in REGISTERED:
            results[f"rmse-{when}-{channel}"] = (
                Blocked(
                    MISSING[when],
                    readings=tuple(
                        Reading(name, place, found(literal | choices | chosen, channel, which))
                        for name, place, choices in left
                    ),
                )
                if left
                else found(literal | chosen, channel, which)
            )
    return results
