"""The twin of the laboratory: the eight RMSE values of the experiment (niu2024, section 4.3).

The measured centroids are not published. The twin is the same camera, simulated from the printed
settings. Its reading, fixed here before its result was known, is that of the simulation carried
over to Table 4:

* centroids follow (21) to (23) with the focal lengths, distortions and rotation angles of Table 4;
  the principal points differ by the translations of Table 4, by the definition (14);
* the test positions are directions at random, uniform over the printed field of view;
* what is left after registration, per axis and channel, measures the centroid errors: the printed
  residuals are inputs here, and split evenly between green and the other channel, so that both
  channels share the errors of green. The rotary table's own error moves all channels alike;
* the RMSE is printed per axis, so it is computed per axis.

So the RMSE before registration is predicted, with the RMSE after it as an input. The RMSE after it
is little more than the centroid errors of the laboratory, which no other printed number states; it
stays blocked. As a stand-in it is computed with the noise of the simulation, which the paper calls
close to the real conditions.

One more reading is open, because Table 4 contradicts itself: its scale factors are not the ratios
of its focal lengths. `before_by_similarity` takes the scale factors; the ledger does not use it.
"""

from __future__ import annotations

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.declare import Blocked, Prediction, Results, reproduces
from reproduce.physics.camera import Camera
from reproduce.physics.registration import fit_similarity, rmse_per_axis
from reproduce.physics.similarity import Similarity
from reproduce.physics.simulate import (
    channel_centroids,
    spawned_angles,
    spawned_normals,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

CALIBRATION = "niu2024/table-4"
OUTCOME = "niu2024/text-registration"
OPTICS = "niu2024/text-optics"
SETTINGS = "niu2024/text-simulation"
CHANNELS = ("green", "red", "blue")
REGISTERED = ("red", "blue")
REPLICATES = 10_000
INSTRUMENT = (
    f"{CALIBRATION}#focal-length.*",
    f"{CALIBRATION}#radial-distortion.*",
    f"{CALIBRATION}#rotation.*",
    f"{CALIBRATION}#translation-*",
    f"{OPTICS}#pixel-pitch-x",
    f"{OPTICS}#field-of-view-*",
)


def cameras(given: Given) -> list[Camera]:
    """Return the cameras of Table 4, image points counted from the green principal point.

    Parameters
    ----------
    given : Given
        Holds the cells of `INSTRUMENT`.

    Returns
    -------
    list of Camera
        Green, red, blue.
    """
    shifts = {"green": (0.0, 0.0)} | {
        channel: tuple(given[f"{CALIBRATION}#translation-{axis}.{channel}"] for axis in "xy")
        for channel in REGISTERED
    }
    return [
        Camera(
            given[f"{CALIBRATION}#focal-length.{channel}"],
            shifts[channel],
            given[f"{CALIBRATION}#radial-distortion.{channel}"],
            given[f"{OPTICS}#pixel-pitch-x"],
        )
        for channel in CHANNELS
    ]


def rotations(given: Given) -> list[float]:
    """Return the detectors' calibrated angles against green.

    Parameters
    ----------
    given : Given
        Holds the rotation angles of Table 4.

    Returns
    -------
    list of float
        Green, red, blue, in radians.
    """
    return [0.0, *(given[f"{CALIBRATION}#rotation.{channel}"] for channel in REGISTERED)]


def half_field(given: Given) -> tuple[float, float]:
    """Return half the printed field of view about each axis.

    Parameters
    ----------
    given : Given
        Holds the field of view.

    Returns
    -------
    tuple of float
        Along x and y, in radians.
    """
    return (
        given[f"{OPTICS}#field-of-view-x"] / 2,
        given[f"{OPTICS}#field-of-view-y"] / 2,
    )


def centroid_errors(given: Given) -> FloatArray:
    """Return the centroid errors that the printed residuals imply.

    Parameters
    ----------
    given : Given
        Holds the RMSE values after registration.

    Returns
    -------
    ndarray, shape (3, 1, 2)
        Standard deviation by channel (green, red, blue) and axis, in px: green has half the mean
        squared residual, the others have what is then missing to their own.
    """
    after = np.array(
        [[given[f"{OUTCOME}#rmse-after-{c}-{axis}"] for axis in "xy"] for c in REGISTERED]
    )
    green = np.square(after).mean(axis=0) / 2
    return np.asarray(np.sqrt(np.stack([green, *(np.square(after) - green)]))[:, None, :])


def true_centroids(given: Given, seed: SeedSequence, replicates: int) -> FloatArray:
    """Return the centroids at random test positions without errors.

    Parameters
    ----------
    given : Given
        Holds the cells of `INSTRUMENT` and the number of test positions.
    seed : numpy.random.SeedSequence
        Of the positions.
    replicates : int
        How many sets.

    Returns
    -------
    ndarray, shape (replicates, 3, positions, 2)
        In px from the green principal point; channels green, red, blue.
    """
    count = given.count(f"{OUTCOME}#test-points")
    positions = spawned_angles(seed, replicates, count, half_field(given))
    return channel_centroids(cameras(given), rotations(given), positions)


@reproduces(
    OUTCOME,
    cells=["rmse-before-*"],
    given=[*INSTRUMENT, f"{OUTCOME}#test-points", f"{OUTCOME}#rmse-after-*"],
    equations=["21", "22", "23"],
    replicates=REPLICATES,
)
def rmse_before(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """RMSE before registration, from the calibrated cameras and the printed residuals."""
    for_positions, for_errors = _streams(seed, 2)
    true = true_centroids(given, for_positions, replicates)
    errors = centroid_errors(given) * spawned_normals(for_errors, replicates, true.shape[1:])
    return _per_axis(true + errors)


def by_similarity(given: Given, green: FloatArray) -> FloatArray:
    """Return the points of all channels that the similarities of Table 4 lay over green ones.

    Parameters
    ----------
    given : Given
        Holds the cells of `INSTRUMENT` and the scale factors of Table 4.
    green : ndarray, shape (..., n, 2)
        In px from the green principal point.

    Returns
    -------
    ndarray, shape (..., 3, n, 2)
        Channels green, red, blue.
    """
    points = [green]
    for position, channel in enumerate(REGISTERED, start=1):
        # The source's principal point is the shift, as green's is the origin here.
        shift = cameras(given)[position].principal_point
        scale = given[f"{CALIBRATION}#scale.{channel}"]
        laid = Similarity(scale, rotations(given)[position], shift, shift)
        points.append(laid.inverse().transform(green))
    return np.stack(points, axis=-3)


def before_by_similarity(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """Return the RMSE before registration under the other reading: the scale factors of Table 4.

    Parameters
    ----------
    given : Given
        Holds the inputs of `rmse_before` and the scale factors of Table 4.
    seed : numpy.random.SeedSequence
        Of positions and errors.
    replicates : int
        How many.

    Returns
    -------
    dict
        Predictions by cell name. Red and blue points are those that the printed similarity lays
        over green.
    """
    for_positions, for_errors = _streams(seed, 2)
    true = by_similarity(given, true_centroids(given, for_positions, replicates)[:, 0])
    errors = centroid_errors(given) * spawned_normals(for_errors, replicates, true.shape[1:])
    return _per_axis(true + errors)


@reproduces(
    OUTCOME,
    cells=["rmse-after-*"],
    given=[*INSTRUMENT, f"{SETTINGS}#noise"],
    equations=["17", "18"],
)
def rmse_after(given: Given) -> Results:
    """RMSE after registration: it needs centroid errors that are not published."""
    missing = "the centroid errors of the laboratory; our stand-in has the simulation's noise"
    half_x, half_y = half_field(given)
    grid = np.meshgrid(np.linspace(-half_x, half_x, 33), np.linspace(-half_y, half_y, 25))
    true = channel_centroids(cameras(given), rotations(given), np.stack(grid, -1).reshape(-1, 2))
    results: dict[str, Blocked] = {}
    for position, channel in enumerate(REGISTERED, start=1):
        pivot = cameras(given)[position].principal_point
        fit = fit_similarity(true[position], true[0], pivot)
        misfit = np.square(fit.residuals).mean(axis=0)
        expected = np.sqrt(misfit + 2 * given[f"{SETTINGS}#noise"] ** 2)
        for axis, value in zip("xy", expected, strict=True):
            results[f"rmse-after-{channel}-{axis}"] = Blocked(missing, float(value))
    return results


def _per_axis(measured: FloatArray) -> dict[str, Prediction]:
    results: dict[str, Prediction] = {}
    for position, channel in enumerate(REGISTERED, start=1):
        found = rmse_per_axis(measured[:, position], measured[:, 0])
        for axis, draws in zip("xy", found.T, strict=True):
            results[f"rmse-before-{channel}-{axis}"] = Prediction(draws)
    return results


def _streams(seed: SeedSequence, count: int) -> list[SeedSequence]:
    """Return independent seeds; built by hand because spawn() would count up inside `seed`."""
    return [SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, i)) for i in range(count)]
