"""Posteriors of niu2024: registration of the simulated channels, and the noise of Table 3.

The centroids of the paper are not published. The registrations therefore take one simulation of
the same instrument, with the printed settings and a seed of our own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from reproduce.inference.checks import Published
from reproduce.inference.model import Model
from reproduce.inference.models.centroid_noise import CentroidNoiseLikelihood, centroid_noise_model
from reproduce.inference.models.joint import JointRegistration, joint_model
from reproduce.inference.models.least_squares import noise_growth
from reproduce.inference.models.mixture import mixture_model
from reproduce.inference.models.new_stars import Together
from reproduce.inference.models.registration import GaussianRegistration, registration_model
from reproduce.inference.models.variants import (
    PointwiseRegistration,
    distortion_model,
)
from reproduce.papers.declare import ROOT_SEED
from reproduce.papers.declare_posterior import (
    OWN_DATA,
    Aside,
    Declaration,
    published_cells,
    simulated,
)
from reproduce.papers.niu2024 import simulation, simulation_angles
from reproduce.papers.niu2024.posteriors import users_stars
from reproduce.papers.niu2024.posteriors.new_stars import (
    COMPARED,
    ESTIMATES,
    JOINT_COLUMNS,
    RESULTS,
    ROWS,
    TEST_POINTS,
    NoiseAlone,
    both_channels,
    new_stars,
    one_channel,
    pixel_angle,
)
from reproduce.physics.optics.chromatic import scale_factor
from reproduce.physics.optics.simulate import channel_centroids, noisy_centroids
from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.registration.transforms import similarity_between
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

__all__ = ["beside_the_registration"]

DATA_SEED, FALSE_SEED = (SeedSequence(ROOT_SEED, spawn_key=(i,)) for i in (1, 4))
# Share of stars that are matched wrongly on purpose.
FALSE = 0.3
# How well a laboratory may know a principal point, in px.
PRINCIPAL_POINT = 2.0
READS = (*simulation.READS, "niu2024/text-optics#pixel-pitch-*", TEST_POINTS)


def centroids(given: Given) -> FloatArray:
    """Simulated centroids of green, red and blue, shape (3, n, 2), in px."""
    noise = given[f"{simulation.SETTINGS}#noise"]
    return np.asarray(noisy_centroids(true_centroids(given), noise, DATA_SEED, 1)[0])


def true_centroids(given: Given) -> FloatArray:
    """Noise-free centroids of green, red and blue, shape (3, n, 2), in px."""
    table = simulation_angles.literal(given).angles
    return channel_centroids(simulation.cameras(given), simulation.rotations(given), table)


def truth(given: Given, channels: tuple[str, ...]) -> dict[str, float]:
    """The transforms that the simulation stands for, its distortions left aside, and its noise.

    One channel alone has the noise of both its images in `noise`; two have that of one image.
    """
    cameras = dict(zip(simulation.CHANNELS, simulation.cameras(given), strict=True))
    turns = dict(zip(simulation.CHANNELS, simulation.rotations(given), strict=True))
    found, noise = {}, given[f"{simulation.SETTINGS}#noise"]
    for channel in channels:
        prefix = f"{channel}-" if len(channels) > 1 else ""
        similarity = similarity_between(cameras[channel], turns[channel], cameras["green"])
        pairs = zip(ESTIMATES, similarity.parameters.tolist(), strict=True)
        found.update({prefix + name: value for name, value in pairs})
    both = 1.0 if len(channels) > 1 else float(np.hypot(1, found["scale"]))
    return {**found, "noise": noise * both}


def registration(given: Given) -> Model:
    """The red channel laid over green."""
    green, red, _ = centroids(given)
    return _with_new_stars(given, registration_model(red, green, pivot(given, "red")))


def pivot(given: Given, channel: str) -> FloatArray:
    """Principal point of a channel, shape (2,), in px."""
    return given.array(f"{simulation.IMAGING}#principal-point-?.{channel}")


def _with_new_stars(given: Given, model: Model) -> Model:
    likelihood = model.likelihood
    if not isinstance(likelihood, GaussianRegistration | PointwiseRegistration):
        raise TypeError(f"model: expected a registration, got {type(likelihood).__name__}")
    return replace(model, derived=new_stars(given, likelihood, "red"))


def joint(given: Given) -> Model:
    """Both channels laid over green at once."""
    green, red, blue = centroids(given)
    pivots = (pivot(given, "red"), pivot(given, "blue"))
    likelihood = JointRegistration((red, blue), green, pivots)
    consequences = Together(
        tuple(
            new_stars(given, likelihood.single(i), channel, JOINT_COLUMNS[i], f"{channel} ")
            for i, channel in enumerate(simulation.REGISTERED)
        )
    )
    return joint_model((red, blue), green, pivots, consequences)


def distortion(given: Given) -> Model:
    """The red channel with both distortions free."""
    return _with_new_stars(given, distortion_model(registration(given)))


def mixture(given: Given) -> Model:
    """The red channel, three stars of ten matched with the wrong green one."""
    green, red, _ = centroids(given)
    false = Generator(PCG64(FALSE_SEED)).permutation(len(red))[: round(FALSE * len(red))]
    green[false] = green[np.roll(false, 1)]
    matched = registration_model(red, green, pivot(given, "red"))
    return _with_new_stars(given, mixture_model(matched))


def mixture_truth(given: Given) -> dict[str, float]:
    """The truth of the red channel, and how many stars are matched wrongly."""
    return {**truth(given, ("red",)), "false-share": FALSE}


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
    half = [given.half_unit(address) for address in addresses]
    likelihood = CentroidNoiseLikelihood(expected, response @ response.T, printed, np.array(half))
    model = centroid_noise_model(likelihood, given[f"{simulation.SETTINGS}#noise"])
    return replace(model, derived=NoiseAlone(pixel_angle(given)))


def _response(true: FloatArray, step: float = 1e-3) -> FloatArray:
    """Response of the calibrated parameters of both channels to every coordinate, (8, 6 n)."""
    coordinates = true.size
    moved = true + step * np.eye(coordinates).reshape(coordinates, *true.shape)
    batch = np.concatenate([true[None], moved])
    # The zero position gives the pivot, as in the calibration of section 3.2.
    zero = int(np.argmin(np.hypot(*(true[0] - true[0].mean(axis=0)).T)))
    found = np.concatenate(
        [fit_registration(batch[:, i], batch[:, 0], batch[:, i, zero]).parameters for i in (1, 2)],
        axis=-1,
    )
    return np.asarray((found[1:] - found[0]).T / step)


def published_table(given: Given, model: Model) -> Published:
    """The printed parameters of both channels, which are this model's data."""
    addresses = [f"{RESULTS}#{row}.{channel}" for channel in ("red", "blue") for row in ROWS]

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        return simulated(model, parameters, generator)

    return published_cells(given, addresses, repeat, whole=model.log_likelihood, note=OWN_DATA)


def beside_the_registration(model: Model) -> dict[str, Aside]:
    """Whether the noise grows across the field, and what a principal point that is off does."""
    plain = model.likelihood_of(GaussianRegistration)
    scale, rotation = fit_registration(plain.source, plain.target, plain.pivot).parameters[:2]
    # A principal point off by d moves the shift by (w - 1) d.
    moved = abs(scale * np.exp(1j * rotation) - 1) * PRINCIPAL_POINT
    return {
        "noise-growth": Aside(*noise_growth(plain.source, plain.target, plain.pivot), "1"),
        "principal-point": Aside(PRINCIPAL_POINT, 0.0, "px"),
        "shift-by-principal-point": Aside(float(moved), 0.0, "px"),
    }


_red = partial(
    Declaration, paper="niu2024", given=READS, truth=partial(truth, channels=("red",)),
    published=partial(one_channel, channel="red"), compared=COMPARED,
)  # fmt: skip
POSTERIORS = (
    _red(
        "registration", "Registration of one channel: similarity and Gaussian noise",
        build=registration, file=users_stars.PLAIN,
        asides=beside_the_registration, walkers=240,
    ),
    Declaration(
        "registration-joint", "Registration of both channels: they share the green noise",
        "niu2024", READS, joint, users_stars.JOINT, partial(truth, channels=simulation.REGISTERED),
        both_channels, COMPARED,
    ),
    Declaration(
        "registration-mixture", "Registration with wrong matches: a good/bad mixture", "niu2024",
        READS, mixture, users_stars.MIXTURE, mixture_truth, steps=350, walkers=96,
    ),
    _red(
        "registration-distortion", "Registration with both distortions free", build=distortion,
        file=users_stars.DISTORTION,
    ),
    Declaration(
        "centroid-noise", "Effective centroid noise, from the errors of the calibrated parameters",
        "niu2024", (*READS, simulation.TRUTH, RESULTS), centroid_noise,
        "its likelihood is the response of one calibration, that of Table 3, to the noise of its "
        "own simulated angles; for centroids of your own take registration, which estimates their "
        "noise",
        published=published_table, steps=200,
    ),
)  # fmt: skip
