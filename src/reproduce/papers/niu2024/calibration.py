"""What theory says of the calibration of niu2024: truth, bias by distortion, and least variance."""

from __future__ import annotations

from dataclasses import dataclass

from reproduce.papers.niu2024 import simulation, simulation_angles
from reproduce.physics.optics.simulate import channel_centroids
from reproduce.physics.registration.calibration import registration_bound
from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.registration.transforms import similarity_between
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

__all__ = ["Precision", "precision"]


@dataclass(frozen=True, eq=False)
class Precision:
    """Theory of one channel's four parameters, in the order k, theta, shift x, shift y."""

    truth: FloatArray  # what the imaging parameters imply, distortion left aside
    bias: FloatArray  # what the unequal distortions add to the fit without noise
    bound: FloatArray  # standard deviations of the Cramér-Rao bound


def precision(door: Given, channel: str) -> Precision:
    """Return the theory of one channel under the ledger's reading."""
    place = simulation.CHANNELS.index(channel)
    used, turns = simulation.cameras(door), simulation.rotations(door)
    true = channel_centroids(used, turns, simulation_angles.literal(door).angles)
    implied = similarity_between(used[place], turns[place], used[0])
    fitted = fit_registration(true[place], true[0], used[place].principal_point)
    sigma = door[f"{simulation.SETTINGS}#noise"]
    bound = registration_bound(true[place], implied, sigma, sigma).diagonal()
    return Precision(implied.parameters, fitted.parameters - implied.parameters, bound**0.5)
