"""The numerical simulation: Table 3 and the four RMSE values (niu2024, sections 4.1 and 4.2).

The text leaves several readings open. The ledger uses the most literal one, fixed here before its
result was known:

* the angles are those of `reproduce.papers.niu2024.angles.literal`;
* centroids follow (21) to (23) with the imaging parameters of Table 1, principal points included,
  and the rotation angles of Table 2;
* every coordinate of every channel gets its own Gaussian noise of the printed standard deviation,
  drawn once: the averaging over ten repeats belongs to the laboratory procedure of section 3.1;
* the calibration is that of section 3.2: starting values from the row of angles with the external
  frame at zero and from the zero position, then the two-stage Gauss-Newton iteration;
* test points are directions at random, uniform over the printed range, imaged with the same noise;
* the RMSE is (26): one number for both axes.
"""

from __future__ import annotations

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.declare import Prediction, Results, reproduces
from reproduce.papers.niu2024 import angles
from reproduce.physics.calibration import Calibration, calibrate
from reproduce.physics.camera import Camera
from reproduce.physics.registration import rmse
from reproduce.physics.simulate import channel_centroids, noisy_centroids, spawned_angles
from reproduce.physics.starting import starting_values
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

IMAGING = "niu2024/table-1"
TRUTH = "niu2024/table-2"
OPTICS = "niu2024/text-optics"
SETTINGS = "niu2024/text-simulation"
CHANNELS = ("green", "red", "blue")
REGISTERED = ("red", "blue")
REPLICATES = 2000
READS = (
    *angles.READS,
    IMAGING,
    f"{TRUTH}#rotation.*",
    f"{OPTICS}#pixel-pitch-x",
    f"{SETTINGS}#noise",
)


def cameras(given: Given) -> list[Camera]:
    """Return the cameras of Table 1.

    Parameters
    ----------
    given : Given
        Holds Table 1 and the pixel pitch.

    Returns
    -------
    list of Camera
        Green, red, blue.
    """
    return [
        Camera(
            given[f"{IMAGING}#focal-length.{channel}"],
            [given[f"{IMAGING}#principal-point-{axis}.{channel}"] for axis in "xy"],
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


def calibrations(given: Given, seed: SeedSequence, replicates: int) -> dict[str, Calibration]:
    """Simulate and calibrate both channels in every replicate.

    Parameters
    ----------
    given : Given
        Holds the cells of `READS`.
    seed : numpy.random.SeedSequence
        Of the noise.
    replicates : int
        How many.

    Returns
    -------
    dict
        Channel to its calibrations, shape (replicates,).
    """
    table = angles.literal(given).angles
    true = channel_centroids(cameras(given), rotations(given), table)
    noisy = noisy_centroids(true, given[f"{SETTINGS}#noise"], seed, replicates)
    still = np.isclose(table[:, 1], 0.0)  # the external frame stays at zero
    zero = np.flatnonzero(still & np.isclose(table[:, 0], 0.0)).item()
    green = noisy[:, 0]
    found = {}
    for position, channel in enumerate(REGISTERED, start=1):
        source = noisy[:, position]
        start = starting_values(source[:, still], green[:, still], source[:, zero], green[:, zero])
        found[channel] = calibrate(source, green, source[:, zero], start)
    return found


@reproduces(
    "niu2024/table-3",
    given=READS,
    equations=["17", "18", "19", "20", "21", "22", "23", "24", "25"],
    replicates=REPLICATES,
)
def calibrated_parameters(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """Registration parameters calibrated from noisy simulated centroids."""
    results: dict[str, Prediction] = {}
    for channel, calibration in calibrations(given, seed, replicates).items():
        rows = ("scale", "rotation", "translation-x", "translation-y")
        for row, draws in zip(rows, calibration.parameters.T, strict=True):
            results[f"{row}.{channel}"] = Prediction(draws)
    return results


@reproduces(
    SETTINGS,
    cells=["rmse-*"],
    given=[*READS, f"{SETTINGS}#test-points"],
    equations=["17", "18", "26"],
    replicates=REPLICATES,
)
def registration_rmse(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """RMSE at random test points before and after registration."""
    for_noise, for_angles, for_test_noise = _streams(seed, 3)
    found = calibrations(given, for_noise, replicates)
    half_ranges = angles.half_ranges(given)
    points = spawned_angles(
        for_angles, replicates, given.count(f"{SETTINGS}#test-points"), half_ranges
    )
    true = channel_centroids(cameras(given), rotations(given), points)
    measured = noisy_centroids(true, given[f"{SETTINGS}#noise"], for_test_noise, replicates)
    results: dict[str, Prediction] = {}
    for position, channel in enumerate(REGISTERED, start=1):
        before, after = _before_and_after(measured[:, position], measured[:, 0], found[channel])
        results[f"rmse-before-{channel}"] = Prediction(before)
        results[f"rmse-after-{channel}"] = Prediction(after)
    return results


def _streams(seed: SeedSequence, count: int) -> list[SeedSequence]:
    """Return independent seeds; built by hand because spawn() would count up inside `seed`."""
    return [SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, i)) for i in range(count)]


def _before_and_after(
    source: FloatArray, green: FloatArray, calibration: Calibration
) -> tuple[FloatArray, FloatArray]:
    registered = calibration.similarity.transform(source)
    return rmse(source, green), rmse(registered, green)
