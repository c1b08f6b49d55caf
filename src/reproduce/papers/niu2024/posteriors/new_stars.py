"""Test points of the simulation, and what a repeat of it would print (niu2024, section 4).

The test points are directions at random, uniform over the printed range, as for the printed RMSE.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator, SeedSequence

from reproduce.inference.checks import Published
from reproduce.inference.model import Consequence, Model
from reproduce.inference.models.joint import JointRegistration
from reproduce.inference.models.mixture import MixtureRegistration
from reproduce.inference.models.new_stars import NewStars, StarModel, rmse_at
from reproduce.inference.models.registration import GaussianRegistration
from reproduce.inference.models.variants import PointwiseRegistration
from reproduce.papers.declare import ROOT_SEED
from reproduce.papers.declare_posterior import published_cells, simulated
from reproduce.papers.niu2024 import simulation, simulation_angles
from reproduce.physics.optics.camera import angle_from_pixels
from reproduce.physics.optics.simulate import channel_centroids, noisy_centroids, spawned_angles
from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

__all__ = [
    "COMPARED",
    "ESTIMATES",
    "JOINT_COLUMNS",
    "RESULTS",
    "ROWS",
    "TEST_POINTS",
    "NoiseAlone",
    "both_channels",
    "new_stars",
    "one_channel",
    "pixel_angle",
]

ANGLES, NOISE = (SeedSequence(ROOT_SEED, spawn_key=(3, i)) for i in (0, 1))
RESULTS = "niu2024/table-3"
ROWS = ("scale", "rotation", "translation-x", "translation-y")
ESTIMATES = ("scale", "rotation", "shift-x", "shift-y")
TEST_POINTS = f"{simulation.SETTINGS}#test-points"
COMPARED = (RESULTS, f"{simulation.SETTINGS}#rmse-after-*")
# Columns of the joint model that one channel's model takes: its transform, and the noise.
JOINT_COLUMNS = ((0, 1, 2, 3, 8), (4, 5, 6, 7, 8))

SIMULATED = (
    "The stars are our own simulation with the imaging parameters of Table 1. The paper seems to "
    "have simulated with the translations of Table 2, which do not follow from them: that, and no "
    "noise, is why its shifts lie far outside."
)

Registration = GaussianRegistration | PointwiseRegistration


def test_points(given: Given) -> FloatArray:
    """Measured test points in green, red and blue, shape (3, points, 2), in px."""
    count, half_ranges = given.count(TEST_POINTS), simulation_angles.half_ranges(given)
    directions = spawned_angles(ANGLES, 1, count, half_ranges)[0]
    true = channel_centroids(simulation.cameras(given), simulation.rotations(given), directions)
    return np.asarray(noisy_centroids(true, given[f"{simulation.SETTINGS}#noise"], NOISE, 1)[0])


def new_stars(
    given: Given,
    likelihood: Registration,
    channel: str,
    columns: tuple[int, ...] = (),
    prefix: str = "",
) -> NewStars:
    """Return the consequences of one channel's registration at the test points.

    The transform in use is the least-squares one; where stars may be false, of those that agree.
    """
    true = likelihood.agreeing if isinstance(likelihood, MixtureRegistration) else slice(None)
    fit = fit_registration(likelihood.source[true], likelihood.target[true], likelihood.pivot)
    source = _source(given, channel)
    registered = fit.transform.apply(source)
    stars = likelihood.elsewhere(source)
    return NewStars(stars, registered, pixel_angle(given), columns, prefix)


def pixel_angle(given: Given) -> float:
    """Return the angle that a pixel of the green channel spans, in arcsec."""
    pitch = given["niu2024/text-optics#pixel-pitch-x"]
    focal_length = given[f"{simulation.IMAGING}#focal-length.green"]
    return float(angle_from_pixels(1.0, pitch, focal_length)) * ARCSEC_PER_RADIAN


@dataclass(frozen=True)
class NoiseAlone:
    """What centroid noise leaves of a star of which a channel is laid over green without error.

    Parameters
    ----------
    arcsec_per_px : float
        Of the green channel.
    """

    arcsec_per_px: float

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Root mean square distance of the two images: two noisy axes of two noisy stars."""
        rmse = 2 * parameters[:, 0]
        angle = rmse * self.arcsec_per_px
        return {
            "registered star, RMSE": Consequence(rmse, "px", "both axes, the transform exact"),
            "registered star, pointing error": Consequence(angle, "arcsec", "the same as an angle"),
        }


def one_channel(given: Given, model: Model, channel: str) -> Published:
    """Return what the paper prints of one channel, calibrated by least squares."""
    likelihood = model.likelihood
    if not isinstance(likelihood, GaussianRegistration | PointwiseRegistration):
        raise TypeError(f"model: expected a registration, got {type(likelihood).__name__}")
    stars = likelihood.elsewhere(_source(given, channel))

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        targets = simulated(model, parameters, generator)
        return _calibrated(likelihood, likelihood.source, targets, stars, parameters, generator)

    return published_cells(given, _addresses(channel), repeat, (*ESTIMATES, ""), note=SIMULATED)


def both_channels(given: Given, model: Model) -> Published:
    """Return what the paper prints of both channels; the arguments are those of `one_channel`."""
    likelihood = model.likelihood_of(JointRegistration)
    parts = [(likelihood.single(i), JOINT_COLUMNS[i]) for i in (0, 1)]
    stars = [part.elsewhere(_source(given, channel))
             for (part, _), channel in zip(parts, simulation.REGISTERED, strict=True)]  # fmt: skip

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        drawn = [model.repeat(one, generator) for one in parameters]
        blue, green = (np.stack(column) for column in zip(*drawn, strict=True))
        sources = (likelihood.sources[0], blue)
        found = [
            _calibrated(part, source, green, new, parameters[:, columns], generator)
            for (part, columns), source, new in zip(parts, sources, stars, strict=True)
        ]
        return np.concatenate(found, axis=1)

    addresses = [address for channel in simulation.REGISTERED for address in _addresses(channel)]
    names = [f"{c}-{name}" if name else "" for c in simulation.REGISTERED
             for name in (*ESTIMATES, "")]  # fmt: skip
    return published_cells(given, addresses, repeat, names, note=SIMULATED)


def _calibrated(
    likelihood: Registration,
    source: FloatArray,
    target: FloatArray,
    stars: StarModel,
    parameters: FloatArray,
    generator: Generator,
) -> FloatArray:
    """Least-squares parameters of many calibrations and their RMSE at test points, (n, 5)."""
    fit = fit_registration(source, target, likelihood.pivot)
    registered = fit.transform.apply(stars.source)
    return np.column_stack([fit.parameters, rmse_at(stars, registered, parameters, generator)])


def _source(given: Given, channel: str) -> FloatArray:
    points: FloatArray = test_points(given)[simulation.CHANNELS.index(channel)]
    return points


def _addresses(channel: str) -> list[str]:
    cells = [f"{RESULTS}#{row}.{channel}" for row in ROWS]
    return [*cells, f"{simulation.SETTINGS}#rmse-after-{channel}"]
