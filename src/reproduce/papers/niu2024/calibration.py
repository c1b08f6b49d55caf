"""What theory says of the calibration of niu2024: truth, bias by distortion, and least variance."""

from __future__ import annotations

from reproduce.papers.niu2024 import simulation, simulation_angles
from reproduce.physics.optics.simulate import channel_centroids
from reproduce.physics.registration.calibration import registration_bound
from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.registration.transforms import similarity_between
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

__all__ = ["precision"]


def precision(door: Given, channel: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the theory of one channel's k, theta, shift x and shift y under the literal reading.

    What the imaging parameters imply, distortion left aside; what the unequal distortions add to
    the fit without noise; standard deviations of the Cramér-Rao bound.
    """
    place = simulation.CHANNELS.index(channel)
    cameras, turns = simulation.cameras(door), simulation.rotations(door)
    true = channel_centroids(cameras, turns, simulation_angles.literal(door).angles)
    implied = similarity_between(cameras[place], turns[place], cameras[0])
    fitted = fit_registration(true[place], true[0], cameras[place].principal_point)
    sigma = door[f"{simulation.SETTINGS}#noise"]
    bound = registration_bound(true[place], implied, sigma, sigma).diagonal() ** 0.5
    return implied.parameters, fitted.parameters - implied.parameters, bound
