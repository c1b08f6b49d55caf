"""Posteriors of niu2024: registration of the simulated channels, and the noise of Table 3.

The centroids of the paper are not published. The registrations therefore take one simulation of
the same instrument, with the printed settings and a seed of our own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import SeedSequence

from reproduce.inference.centroid_noise import CentroidNoiseLikelihood, centroid_noise_model
from reproduce.inference.joint import joint_model
from reproduce.inference.model import Model, Quantity
from reproduce.inference.registration import (
    as_similarity,
    principal_point_model,
    registration_model,
)
from reproduce.inference.variants import distortion_model, field_noise_model, student_model
from reproduce.papers.declare import ROOT_SEED
from reproduce.papers.niu2024 import angles, simulation
from reproduce.papers.posteriors import Declared
from reproduce.physics.chromatic import scale_factor
from reproduce.physics.pixel_angles import angle_from_pixels
from reproduce.physics.registration import fit_similarity
from reproduce.physics.simulate import channel_centroids, noisy_centroids
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

ARCSEC = 206264.80624709636
DATA_SEED = SeedSequence(ROOT_SEED, spawn_key=(1,))
RESULTS = "niu2024/table-3"
READS = (*simulation.READS, "niu2024/text-optics#pixel-pitch-*")
ROWS = ("scale", "rotation", "translation-x", "translation-y")


def centroids(given: Given) -> FloatArray:
    """Simulated centroids of green, red and blue, shape (3, n, 2), in px."""
    noise = given["niu2024/text-simulation#noise"]
    return np.asarray(noisy_centroids(true_centroids(given), noise, DATA_SEED, 1)[0])


def true_centroids(given: Given) -> FloatArray:
    """Noise-free centroids of green, red and blue, shape (3, n, 2), in px."""
    table = angles.literal(given).angles
    return channel_centroids(simulation.cameras(given), simulation.rotations(given), table)


@dataclass(frozen=True)
class Residuals:
    """What registration leaves at a new star: root mean square, as (26), and as an angle.

    Parameters
    ----------
    pixel_pitch, focal_length : float
        Of the reference channel, in metres.
    corner : tuple of float
        Offset of a corner star from the pivot, in px.
    """

    pixel_pitch: float
    focal_length: float
    corner: tuple[float, float]
    pivot: tuple[float, float]

    def __call__(self, parameters: FloatArray) -> dict[str, Quantity]:
        """Consequences of parameter vectors whose first five are those of a registration."""
        noise = parameters[:, 4]
        angle = angle_from_pixels(noise, self.pixel_pitch, self.focal_length) * ARCSEC
        corner = (np.array(self.pivot) + self.corner)[None]
        landed = as_similarity(parameters, np.array(self.pivot)).transform(corner)[:, 0]
        off = np.hypot(*(landed - landed.mean(axis=0)).T)
        return {
            "new star, RMSE": Quantity(noise * np.sqrt(2), "px", "as (26), both axes together"),
            "new star, pointing error": Quantity(angle, "arcsec", "one axis, one sigma"),
            "corner star, misregistration": Quantity(off, "px", "from the transform's own error"),
        }


def _consequences(given: Given, channel: str) -> Residuals:
    pivot = tuple(given[f"{simulation.IMAGING}#principal-point-{a}.{channel}"] for a in "xy")
    return Residuals(
        given["niu2024/text-optics#pixel-pitch-x"],
        given[f"{simulation.IMAGING}#focal-length.green"],
        (pivot[0], pivot[1]),
        (pivot[0], pivot[1]),
    )


def registration(given: Given) -> Model:
    """The red channel laid over green."""
    green, red, _ = centroids(given)
    consequences = _consequences(given, "red")
    return registration_model(red, green, np.array(consequences.pivot), derived=consequences)


def registration_blue(given: Given) -> Model:
    """The blue channel laid over green."""
    green, _, blue = centroids(given)
    consequences = _consequences(given, "blue")
    return registration_model(
        blue, green, np.array(consequences.pivot), name="registration-blue", derived=consequences
    )


def joint(given: Given) -> Model:
    """Both channels laid over green at once."""
    green, red, blue = centroids(given)
    pivots = [np.array(_consequences(given, channel).pivot) for channel in ("red", "blue")]
    return joint_model((red, blue), green, (pivots[0], pivots[1]))


def student(given: Given) -> Model:
    """The red channel with Student-t noise."""
    return student_model(registration(given))


def field_noise(given: Given) -> Model:
    """The red channel with noise that varies across the field."""
    return field_noise_model(registration(given))


def distortion(given: Given) -> Model:
    """The red channel with both distortions free."""
    return distortion_model(registration(given))


def principal_point(given: Given) -> Model:
    """The red channel with an uncertain principal point."""
    return principal_point_model(registration(given), 2.0)


def centroid_noise(given: Given) -> Model:
    """The noise that the errors of Table 3 tell of."""
    true = true_centroids(given)
    response = _response(true)
    cells = [f"{row}.{channel}" for channel in ("red", "blue") for row in ROWS]
    # The truth is Table 2; its scale, rounded in print, is taken from the focal lengths.
    green = given[f"{simulation.IMAGING}#focal-length.green"]
    expected = np.array(
        [
            float(scale_factor(green, given[f"{simulation.IMAGING}#focal-length.{cell[6:]}"]))
            if cell.startswith("scale")
            else given[f"{simulation.TRUTH}#{cell}"]
            for cell in cells
        ]
    )
    addresses = [f"{RESULTS}#{cell}" for cell in cells]
    printed = np.array([given[address] for address in addresses])
    half = [abs(given.shifted({a: 1.0})[a] - given[a]) for a in addresses]
    likelihood = CentroidNoiseLikelihood(expected, response @ response.T, printed, np.array(half))
    return centroid_noise_model(likelihood, given["niu2024/text-simulation#noise"])


def _response(true: FloatArray, step: float = 1e-3) -> FloatArray:
    """Response of the calibrated parameters of both channels to every coordinate, (8, 6 n)."""
    coordinates = true.size
    moved = true + step * np.eye(coordinates).reshape(coordinates, *true.shape)
    batch = np.concatenate([true[None], moved])
    # The zero position gives the pivot, as in the calibration of section 3.2.
    zero = int(np.argmin(np.hypot(*(true[0] - true[0].mean(axis=0)).T)))
    found = np.concatenate(
        [fit_similarity(batch[:, i], batch[:, 0], batch[:, i, zero]).parameters for i in (1, 2)],
        axis=-1,
    )
    return np.asarray((found[1:] - found[0]).T / step)


POSTERIORS = (
    Declared("registration", "niu2024", READS, registration, True, (student, field_noise)),
    Declared("registration-blue", "niu2024", READS, registration_blue, True),
    Declared("registration-joint", "niu2024", READS, joint, True),
    Declared("registration-student", "niu2024", READS, student, True),
    Declared("registration-field-noise", "niu2024", READS, field_noise, True),
    Declared("registration-distortion", "niu2024", READS, distortion, True),
    Declared("registration-principal-point", "niu2024", READS, principal_point, True),
    Declared(
        "centroid-noise", "niu2024", (*READS, simulation.TRUTH, RESULTS), centroid_noise, False
    ),
)  # fmt: skip
