"""The fits of the laboratory, on its twin (niu2024, section 4.3).

The paper registers red and blue with green, and fits a focal length and a distortion to every
channel alone, whose closeness it takes as support for its approximations. Here the twin does both
many times, to show how well they can do. Nothing is judged with it.
"""

from __future__ import annotations

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.niu2024 import angles, laboratory
from reproduce.physics.optics.intrinsics import CameraFit, fit_camera
from reproduce.physics.optics.simulate import channel_centroids, noisy_centroids, table_starlight
from reproduce.physics.registration.fit import RegistrationFit, fit_registration
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given


def calibrated_alone(
    given: Given, seed: SeedSequence, replicates: int, error: float
) -> dict[str, CameraFit]:
    """Calibrate each channel's own camera on the twin, as the last two rows of Table 4 were.

    Nothing is judged with it: it shows how well such a fit can do.

    Channel to its calibrations, batch shape (replicates,).
    """
    table = angles.literal(given).angles
    true = channel_centroids(laboratory.cameras(given), laboratory.rotations(given), table)
    noisy = noisy_centroids(true, error, seed, replicates)
    directions, pitch = table_starlight(table), given[f"{laboratory.OPTICS}#pixel-pitch-x"]
    return {
        channel: fit_camera(
            directions, noisy[:, position], pitch, laboratory.rotations(given)[position]
        )
        for position, channel in enumerate(laboratory.CHANNELS)
    }


def registered(
    given: Given, seed: SeedSequence, replicates: int, error: float
) -> dict[str, RegistrationFit]:
    """Register both channels with green on the twin, as the first rows of Table 4 were.

    The fit is the closed form, which is where the paper's iteration ends; its pivot is the spot at
    the zero position, as in section 3.2.

    Parameters are those of `calibrated_alone`.

    Channel to its fits, batch shape (replicates,).
    """
    table = angles.literal(given).angles
    true = channel_centroids(laboratory.cameras(given), laboratory.rotations(given), table)
    noisy = noisy_centroids(true, error, seed, replicates)
    zero = np.flatnonzero(np.isclose(table, 0.0).all(axis=-1)).item()
    return {
        channel: fit_registration(noisy[:, place], noisy[:, 0], noisy[:, place, zero])
        for place, channel in enumerate(laboratory.REGISTERED, start=1)
    }


def distortion_range(given: Given, seed: SeedSequence, replicates: int, error: float) -> FloatArray:
    """Return how far apart the three calibrated distortions lie in each calibration of the twin.

    Parameters are those of `calibrated_alone`.

    Shape (replicates,). Largest minus smallest coefficient of the three channels, in m^-2.
    """
    fits = calibrated_alone(given, seed, replicates, error)
    return np.asarray(np.ptp([fit.camera.radial_distortion for fit in fits.values()], axis=0))
