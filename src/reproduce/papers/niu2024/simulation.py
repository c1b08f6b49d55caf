"""The numerical simulation: Table 3 and the four RMSE values (niu2024, sections 4.1 and 4.2).

The text leaves several readings open. The literal one, written down some minutes before the first
verdicts were:

* the angles are those of `reproduce.papers.niu2024.angles.literal`;
* centroids follow (21) to (23) with the imaging parameters of Table 1, principal points included,
  and the rotation angles of Table 2;
* every coordinate of every channel gets its own Gaussian noise of the printed standard deviation,
  drawn once: the averaging over ten repeats belongs to the laboratory procedure of section 3.1;
* the calibration is that of section 3.2: starting values from the row of angles with the external
  frame at zero and from the zero position, then the two-stage Gauss-Newton iteration;
* test points are directions at random, uniform over the printed range, imaged with the same noise;
* the RMSE is (26): one number for both axes.

Scales and rotations get one verdict under every reading that `reproduce.papers.niu2024.study` has,
so the literal one judges them. The verdict on translations and residuals depends on the reading.
These cells are blocked, with the readings that decide side by side; they were chosen after all of
them had been computed.
"""

from __future__ import annotations

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import ArrayLike

from reproduce.papers.declare import Blocked, Prediction, Reading, Results, reproduces
from reproduce.papers.niu2024 import angles
from reproduce.physics.optics.camera import Camera
from reproduce.physics.optics.simulate import (
    channel_centroids,
    noisy_centroids,
    spawned_angles,
    spawned_normals,
)
from reproduce.physics.registration.calibration import Calibration, calibrate, starting_values
from reproduce.physics.registration.closed_form import rmse_per_axis
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

IMAGING = "niu2024/table-1"
TRUTH = "niu2024/table-2"
OPTICS = "niu2024/text-optics"
SETTINGS = "niu2024/text-simulation"
CHANNELS = ("green", "red", "blue")
REGISTERED = ("red", "blue")
REPLICATES = 2000
# What the principal points of red and blue are, and where the test points are.
SHIFTS = ("Table 1", "Table 2")
TESTS = ("over the range", "among the angles")
READS = (
    *angles.READS,
    IMAGING,
    f"{TRUTH}#rotation.*",
    f"{OPTICS}#pixel-pitch-x",
    f"{SETTINGS}#noise",
)


def cameras(given: Given, shifts: str = SHIFTS[0]) -> list[Camera]:
    """Return the cameras of Table 1, under one reading of the principal points.

    Parameters
    ----------
    given : Given
        Holds Table 1 and the pixel pitch; for the second reading the translations of Table 2, too.
    shifts : str
        One of `SHIFTS`: the principal points are those of Table 1, or green's and the translations
        of Table 2 from there.

    Returns
    -------
    list of Camera
        Green, red, blue.

    Raises
    ------
    ValueError
        If `shifts` is none of them.
    """
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
    """Return the detectors' rotation angles against green.

    Parameters
    ----------
    given : Given
        Holds the rotation angles of Table 2.

    Returns
    -------
    list of float
        Green, red, blue, in radians.
    """
    return [0.0, *(given[f"{TRUTH}#rotation.{channel}"] for channel in REGISTERED)]


def calibrations(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    *,
    shifts: str = SHIFTS[0],
    noisy: ArrayLike = 1.0,
    repeats: int = 1,
) -> dict[str, Calibration]:
    """Simulate and calibrate both channels in every replicate.

    Parameters
    ----------
    given : Given
        Holds the cells of `READS`.
    seed : numpy.random.SeedSequence
        Of the noise.
    replicates : int
        How many.
    shifts : str
        One of `SHIFTS`.
    noisy : array_like, shape () or (3,)
        What the printed noise is multiplied by, in all channels or in green, red, blue.
    repeats : int
        How many draws are averaged.

    Returns
    -------
    dict
        Channel to its calibrations, shape (replicates,).
    """
    table = angles.literal(given).angles
    true = channel_centroids(cameras(given, shifts), rotations(given), table)
    sigma = given[f"{SETTINGS}#noise"] * np.asarray(noisy)
    measured = noisy_centroids(true, sigma, seed, replicates, repeats=repeats)
    still = np.isclose(table[:, 1], 0.0)  # the external frame stays at zero
    zero = np.flatnonzero(still & np.isclose(table[:, 0], 0.0)).item()
    green = measured[:, 0]
    found = {}
    for position, channel in enumerate(REGISTERED, start=1):
        source = measured[:, position]
        start = starting_values(source[:, still], green[:, still], source[:, zero], green[:, zero])
        found[channel] = calibrate(source, green, source[:, zero], start)
    return found


@reproduces(
    "niu2024/table-3",
    cells=["scale.*", "rotation.*"],
    given=READS,
    equations=["17", "18", "19", "20", "21", "22", "23", "24", "25"],
    replicates=REPLICATES,
)
def calibrated_parameters(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """Scale and rotation calibrated from noisy simulated centroids."""
    return {
        f"{row}.{channel}": Prediction(draws)
        for channel, calibration in calibrations(given, seed, replicates).items()
        for row, draws in zip(("scale", "rotation"), calibration.parameters.T[:2], strict=True)
    }


@reproduces(
    "niu2024/table-3",
    cells=["translation-*"],
    given=[*READS, f"{TRUTH}#translation-*"],
    equations=["14", "17", "18", "19", "20", "21", "22", "23", "24", "25"],
    replicates=REPLICATES,
)
def calibrated_translations(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """Translations calibrated from centroids simulated with the shifts of Table 1 or of Table 2."""
    missing = "which principal points the simulation used, those of Table 1 or of Table 2"
    places = {
        SHIFTS[0]: ("principal points of Table 1", "section 4.1 with (21) to (23)"),
        SHIFTS[1]: ("translations of Table 2", "sections 4.1 and 4.2, the true values"),
    }
    readings: dict[str, list[Reading]] = {}
    for shifts, (name, place) in places.items():
        for channel, found in calibrations(given, seed, replicates, shifts=shifts).items():
            for axis, draws in zip("xy", found.parameters.T[2:], strict=True):
                cell = readings.setdefault(f"translation-{axis}.{channel}", [])
                cell.append(Reading(name, place, Prediction(draws)))
    return {name: Blocked(missing, readings=tuple(cell)) for name, cell in readings.items()}


def residuals(
    given: Given,
    seed: SeedSequence,
    replicates: int,
    *,
    shifts: str = SHIFTS[0],
    noisy: ArrayLike = 1.0,
    repeats: int = 1,
    tests: str = TESTS[0],
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Simulate, calibrate and test both channels in every replicate.

    Parameters
    ----------
    given : Given
        Holds the cells of `READS`, the number of test points, and for the second of `SHIFTS` the
        translations of Table 2.
    seed : numpy.random.SeedSequence
        Of noise and test points.
    replicates : int
        How many.
    shifts, noisy, repeats
        As in `calibrations`; the noise is the same kind at the test points.
    tests : str
        One of `TESTS`: directions at random over the printed range, or rotation angles drawn among
        those of the calibration, none twice.

    Returns
    -------
    dict
        Channel to its RMSE per axis before and after registration, each of shape (replicates, 2).
    """
    for_noise, for_angles, for_test_noise = _streams(seed, 3)
    found = calibrations(given, for_noise, replicates, shifts=shifts, noisy=noisy, repeats=repeats)
    count = given.count(f"{SETTINGS}#test-points")
    if tests == TESTS[0]:
        points = spawned_angles(for_angles, replicates, count, angles.half_ranges(given))
    else:
        table = angles.literal(given).angles
        # The order of independent numbers is a random order.
        order = spawned_normals(for_angles, replicates, (len(table),)).argsort(axis=-1)
        points = table[order[:, :count]]
    true = channel_centroids(cameras(given, shifts), rotations(given), points)
    sigma = given[f"{SETTINGS}#noise"] * np.asarray(noisy)
    measured = noisy_centroids(true, sigma, for_test_noise, replicates, repeats=repeats)
    return {
        channel: (
            rmse_per_axis(measured[:, place], measured[:, 0]),
            rmse_per_axis(found[channel].transform.apply(measured[:, place]), measured[:, 0]),
        )
        for place, channel in enumerate(REGISTERED, start=1)
    }


def both_axes(per_axis: FloatArray) -> FloatArray:
    """Return the RMSE of (26) from that of each axis."""
    return np.asarray(np.hypot(*np.moveaxis(per_axis, -1, 0)))


def one_axis(per_axis: FloatArray) -> FloatArray:
    """Return the RMSE of one axis on average from that of each."""
    return np.asarray(both_axes(per_axis) / np.sqrt(2))


@reproduces(
    SETTINGS,
    cells=["rmse-*"],
    given=[*READS, f"{TRUTH}#translation-*", f"{SETTINGS}#test-points"],
    equations=["17", "18", "26"],
    replicates=REPLICATES,
)
def registration_rmse(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """RMSE at test points before and after registration, under each reading that decides."""
    literal = residuals(given, seed, replicates)
    second = residuals(given, seed, replicates, shifts=SHIFTS[1])
    among = residuals(given, seed, replicates, shifts=SHIFTS[1], tests=TESTS[1])
    reference = residuals(given, seed, replicates, noisy=[0.0, 1.0, 1.0])
    averaged = residuals(given, seed, replicates, repeats=10)
    same = "section 4.2, the same method as the calibration"
    before = [
        ("shifts of Table 1, (26)", "sections 4.1 and 4.2", literal, both_axes),
        ("shifts of Table 2, (26)", "sections 4.1 and 4.2", second, both_axes),
        ("shifts of Table 2, (26), tests among the angles", same, among, both_axes),
        ("shifts of Table 2, one axis", "section 4.3, an RMSE per axis", second, one_axis),
        ("shifts of Table 2, one axis, tests among the angles", same, among, one_axis),
    ]
    after = [
        ("noise in all channels, (26)", "sections 4.1 and 4.2", literal, both_axes),
        ("green without noise, (26)", "section 4.2, green as reference", reference, both_axes),
        ("ten draws averaged, (26)", "section 3.1, ten repeats", averaged, both_axes),
        ("noise in all channels, one axis", "section 4.3, an RMSE per axis", literal, one_axis),
    ]
    missing = {
        "before": "the principal points and test points used, and which axes the RMSE counts",
        "after": "the noise of the reference, and which axes the RMSE counts",
    }
    return {
        f"rmse-{when}-{channel}": Blocked(
            missing[when],
            readings=tuple(
                Reading(name, place, Prediction(counted(found[channel][which])))
                for name, place, found, counted in readings
            ),
        )
        for which, (when, readings) in enumerate((("before", before), ("after", after)))
        for channel in REGISTERED
    }


def _streams(seed: SeedSequence, count: int) -> list[SeedSequence]:
    """Return independent seeds; built by hand because spawn() would count up inside `seed`."""
    return [SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, i)) for i in range(count)]
