"""Posteriors of niu2024: registration of the simulated channels.

The centroids of the paper are not published. The registrations therefore take one simulation of
the same instrument, with the printed settings and a seed of our own. Their test points are
directions at random, uniform over the printed range, as for the printed RMSE.

A user's stars are one per line, in px: the place in the channel (``x``, ``y``) and in the reference
channel (``x_reference``, ``y_reference``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.random import PCG64, Generator, default_rng

from reproduce.inference import Model, Uniform, models
from reproduce.papers.niu2024 import simulation
from reproduce.papers.niu2024.simulation import IMAGING, NOISE, REGISTERED, SETTINGS
from reproduce.papers.posteriors import Declaration, File, data_stream
from reproduce.physics.optics import angle_from_pixels
from reproduce.physics.registration import (
    checked_pivot,
    diagnose_fit,
    fit_registration,
    similarity_between,
    tied,
)
from reproduce.physics.validate import FloatArray, weights_for
from reproduce.printed.given import Given
from reproduce.store.points import STARS, Table, TableFileError
from reproduce.units import ARCSEC_PER_RADIAN

# Share of stars that are matched wrongly on purpose.
_FALSE = 0.3
_TEST_POINTS = f"{SETTINGS}#test-points"
READS = (*simulation.READS, "niu2024/text-optics#pixel-pitch-*", _TEST_POINTS)
# Columns of the joint model that one channel's model takes: its transform, and the noise.
_JOINT_COLUMNS = ((0, 1, 2, 3, 8), (4, 5, 6, 7, 8))
# Fewer stars do not tell a wrong match from noise.
_FEW = 10
# Arguments of `fit_registration` that the posterior shares with `register`.
_FITTED = ("model", "weights", "source_covariance", "target_covariance")


def _centroids(given: Given) -> FloatArray:
    """Simulated centroids of green, red and blue, shape (3, n, 2), in px."""
    true, generator = true_centroids(given), default_rng(data_stream(given, 1, 0))
    return np.asarray(
        true + simulation.noise(given) * generator.standard_normal(true.shape)
    )


def true_centroids(given: Given) -> FloatArray:
    """Noise-free centroids of green, red and blue, shape (3, n, 2), in px."""
    return simulation.imaged(given, simulation.arrangement(given))


def truth(given: Given, channels: tuple[str, ...] = ("red",)) -> dict[str, float]:
    """The transforms that the simulation stands for, its distortions left aside, and its noise.

    One channel alone has the noise of both its images in `noise`; two have that of one image.
    """
    cameras = dict(zip(simulation.CHANNELS, simulation.cameras(given), strict=True))
    turns = dict(zip(simulation.CHANNELS, simulation.rotations(given), strict=True))
    found, noise = {}, given[NOISE]
    for channel in channels:
        prefix = f"{channel}-" if len(channels) > 1 else ""
        similarity = similarity_between(
            cameras[channel], turns[channel], cameras["green"]
        )
        pairs = zip(models.TRANSFORM, similarity.parameters.tolist(), strict=True)
        found.update({prefix + name: value for name, value in pairs})
    both = 1.0 if len(channels) > 1 else float(np.hypot(1, found["scale"]))
    return {**found, "noise": noise * both}


def _registration(given: Given) -> Model:
    """The red channel laid over green."""
    green, red, _ = _centroids(given)
    return _foretelling(
        given, models.registration_model(red, green, pivot(given, "red"))
    )


def pivot(given: Given, channel: str) -> FloatArray:
    """Principal point of a channel, shape (2,), in px."""
    return given.array(f"{IMAGING}#principal-point-?.{channel}")


def _foretelling(given: Given, model: Model) -> Model:
    """The same model with what it foretells of the test points in red."""
    likelihood = model.likelihood_of(models.GaussianRegistration)
    return replace(model, derived=_new_stars(given, likelihood, "red"))


def _joint(given: Given) -> Model:
    """Both channels laid over green at once."""
    green, red, blue = _centroids(given)
    pivots = (pivot(given, "red"), pivot(given, "blue"))
    model = models.joint_model((red, blue), green, pivots)
    likelihood = model.likelihood_of(models.JointRegistration)
    parts = [
        _new_stars(
            given, likelihood.single(i), channel, _JOINT_COLUMNS[i], f"{channel} "
        )
        for i, channel in enumerate(REGISTERED)
    ]
    return replace(model, derived=models.Together(tuple(parts)))


def _distortion(given: Given) -> Model:
    """The red channel with both distortions free."""
    return _foretelling(given, models.distortion_model(_registration(given)))


def _mixture(given: Given) -> Model:
    """The red channel, three stars of ten matched with the wrong green one."""
    green, red, _ = _centroids(given)
    order = Generator(PCG64(data_stream(given, 4))).permutation(len(red))
    false = order[: round(_FALSE * len(red))]
    green[false] = green[np.roll(false, 1)]
    matched = models.registration_model(red, green, pivot(given, "red"))
    return _foretelling(given, models.mixture_model(matched))


def _mixture_truth(given: Given) -> dict[str, float]:
    """The truth of the red channel, and how many stars are matched wrongly."""
    return {**truth(given), "false-share": _FALSE}


def _test_points(given: Given) -> FloatArray:
    """Measured test points in green, red and blue, shape (3, points, 2), in px."""
    places, errors = (default_rng(data_stream(given, 3, part, 0)) for part in (0, 1))
    half = simulation.half_ranges(given)
    directions = places.uniform(-half, half, (given.count(_TEST_POINTS), 2))
    true = simulation.imaged(given, directions)
    return np.asarray(
        true + simulation.noise(given) * errors.standard_normal(true.shape)
    )


def _new_stars(
    given: Given,
    likelihood: models.GaussianRegistration,
    channel: str,
    columns: tuple[int, ...] = (),
    prefix: str = "",
) -> models.NewStars:
    """Return the consequences of one channel's registration at the test points.

    The transform in use is the least-squares one; where stars may be false, of those that agree.
    """
    true = (
        likelihood.agreeing
        if isinstance(likelihood, models.MixtureRegistration)
        else slice(None)
    )
    fit = fit_registration(
        likelihood.source[true], likelihood.target[true], likelihood.pivot
    )
    source = _test_points(given)[simulation.CHANNELS.index(channel)]
    registered = fit.transform.apply(source)
    stars = likelihood.elsewhere(source)
    return models.NewStars(stars, registered, _pixel_angle(given), columns, prefix)


def _pixel_angle(given: Given) -> float:
    """Return the angle that a pixel of the green channel spans, in arcsec."""
    pitch = given["niu2024/text-optics#pixel-pitch-x"]
    focal_length = given[f"{IMAGING}#focal-length.green"]
    return float(angle_from_pixels(1.0, pitch, focal_length)) * ARCSEC_PER_RADIAN


def _fitted(table: Table, given: Mapping[str, Any]) -> models.FittedRegistration:
    """Return your stars with their errors; a star of weight zero is left out."""
    source, target = np.split(table.values, 2, axis=1)
    weights = weights_for(given.get("weights"), len(source))
    used = weights > 0
    errors: dict[str, Any] = {
        key: np.broadcast_to(value, (len(source), 2, 2))[used]
        for key, value in given.items()
        if key.endswith("_covariance")
    }
    # An unknown noise is that of a star of mean weight.
    mean = 1.0 if errors else weights[used].mean()
    return models.FittedRegistration(
        source[used],
        target[used],
        _centre(table, given),
        weights=weights[used] / mean,
        model=given.get("model", "similarity"),
        **errors,
    )


def _users_registration(
    table: Table, given: Mapping[str, Any]
) -> tuple[Model, list[str]]:
    """Return the registration of your stars, and the findings of `register`."""
    return models.fitted_model(_fitted(table, given)), _findings(table, given)


def _users_mixture(table: Table, given: Mapping[str, Any]) -> tuple[Model, list[str]]:
    """Return the registration of your stars of which some may be matched wrongly."""
    if len(table.values) < _FEW:
        raise TableFileError(
            f"{table.path}: expected {_FEW} or more stars, got {len(table.values)}; fewer do not "
            "tell a wrong match from noise: take registration, or add some"
        )
    # A density that may be as narrow as the rounding that hides the noise has no bound.
    if tied(*np.split(table.values, 2, axis=1)):
        raise TableFileError(
            f"{table.path}: expected coordinates with more digits, got equal displacements of many "
            "stars, in which this model finds no noise. Take registration, or add digits"
        )
    model = _turning(models.mixture_model(models.fitted_model(_fitted(table, given))))
    # The mixture names mismatches itself.
    return model, [
        one for one in _findings(table, given) if "do not fit the others" not in one
    ]


def _turning(model: Model) -> Model:
    """Any rotation, about that of the stars that agree: wrong matches may turn least squares."""
    theta = float(model.likelihood.start()[0][1])
    turn = Uniform(
        theta - np.pi,
        theta + np.pi,
        "any: the full turn, cut opposite to the fit of those stars that agree",
    )
    return model.with_priors({"rotation": turn})


def _centre(table: Table, given: Mapping[str, Any]) -> FloatArray:
    """Return the given pivot, or the mean of the stars of the channel."""
    return checked_pivot(given.get("pivot"), table.values[:, :2])


def _findings(table: Table, given: Mapping[str, Any]) -> list[str]:
    """Return the findings of `register` for your stars."""
    source, target = np.split(table.values, 2, axis=1)
    settings = {key: value for key, value in given.items() if key != "pivot"}
    fit = fit_registration(source, target, _centre(table, given), **settings)
    found, _ = diagnose_fit(fit, named=table.named)
    return list(dict.fromkeys(one.text for one in found if one.kind != "sensitive"))


def _file(read: Callable[..., tuple[Model, list[str]]], *accepts: str) -> File:
    meaning = "one star per line, in px: its place in the channel and in the reference channel"
    return File(STARS, meaning, read, ("pivot", *accepts))


_NO_FILE = (
    "it is for the data of the book; registration and registration-mixture take stars"
)


POSTERIORS = (
    Declaration(
        "registration",
        "Registration of one channel: similarity and Gaussian noise",
        "niu2024",
        READS,
        _registration,
        _file(_users_registration, *_FITTED),
        truth,
        walkers=240,
    ),
    Declaration(
        "registration-joint",
        "Registration of both channels: they share the green noise",
        "niu2024",
        READS,
        _joint,
        _NO_FILE,
        partial(truth, channels=REGISTERED),
    ),
    Declaration(
        "registration-mixture",
        "Registration with wrong matches: a good/bad mixture",
        "niu2024",
        READS,
        _mixture,
        _file(_users_mixture),
        _mixture_truth,
        steps=350,
        walkers=96,
    ),
    Declaration(
        "registration-distortion",
        "Registration with both distortions free",
        "niu2024",
        READS,
        _distortion,
        _NO_FILE,
        truth,
    ),
)
