"""Posteriors of niu2024: registration of the simulated channels.

The centroids of the paper are not published. The registrations therefore take one simulation of
the same instrument, with the printed settings and a seed of this project. Their test points are
random directions, uniform over the printed range, as for the printed RMSE.

Your stars are one per line, in px: the position in the channel (``x``, ``y``) and in the reference
channel (``x_reference``, ``y_reference``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.random import default_rng
from numpy.typing import ArrayLike

from reproduce.inference import Derived, Model, models
from reproduce.papers.niu2024 import published, simulation
from reproduce.papers.niu2024.simulation import NOISE
from reproduce.papers.posteriors import Declaration, Supplied, book_plan
from reproduce.physics.optics import angle_from_pixels, channel_centroids
from reproduce.physics.registration import (
    Problem,
    checked_pivot,
    diagnose_fit,
    fit_problem,
    fit_registration,
    prepare,
    similarity_between,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.store.points import STARS, matched_stars
from reproduce.units import ARCSEC_PER_RADIAN

# Function that returns the likelihood of the stars of a problem.
_Likelihood = Callable[[Problem], models.GaussianRegistration]
# Fraction of stars that are matched wrongly on purpose.
_FALSE_FRACTION = 0.3
_TEST_POINTS = "niu2024/text-simulation#test-points"
INPUTS = (*simulation.INPUTS, "niu2024/text-optics#pixel-pitch-*", _TEST_POINTS)
# With fewer stars a wrong match is indistinguishable from noise.
_MIN_STARS_MIXTURE = 10
# Fraction of stars with equal displacements above which rounding hides the noise.
_MAX_TIED = 0.1


def true_centroids(inputs: Inputs) -> FloatArray:
    """Return noise-free centroids of green, red and blue, shape (3, n, 2), in px."""
    angles = simulation.arrangement(inputs)
    return channel_centroids(simulation.instrument(inputs), angles)


def _noisy(inputs: Inputs, true: FloatArray, *key: int) -> FloatArray:
    """Return simulated centroids of green, red and blue, shape (3, n, 2), in px."""
    unit = default_rng(inputs.seed(*key, 0)).standard_normal(true.shape)
    return true + simulation.noise(inputs) * unit


def truth(inputs: Inputs) -> dict[str, float]:
    """Return the similarity of red without noise, and the noise of both its images.

    The similarity contains the mean effect of the distortions.
    """
    green, red, _ = true_centroids(inputs)
    fit = fit_registration(red, green, pivot(inputs))
    values = dict(zip(models.TRANSFORM, fit.parameters, strict=True))
    return {**values, "noise": inputs[NOISE] * np.hypot(1, values["scale"])}


def _distorted_truth(inputs: Inputs) -> dict[str, float]:
    """Return the transform of ideal points in red, the noise, and both distortions at the edge."""
    green, red, _ = simulation.instrument(inputs)
    ideal = similarity_between(red, green).parameters
    offsets = true_centroids(inputs)[1] - red.principal_point
    edge = np.hypot(*offsets.T).max()
    moved = {
        f"{side}-distortion": camera.radial_distortion * edge**3 * camera.pixel_pitch**2
        for side, camera in (("source", red), ("target", green))
    }
    return truth(inputs) | dict(zip(models.TRANSFORM, ideal, strict=True)) | moved


def pivot(inputs: Inputs) -> FloatArray:
    """Return the principal point of red, shape (2,), in px."""
    return inputs.array("niu2024/table-1#principal-point-?.red")


def _model(
    inputs: Inputs,
    kind: _Likelihood = models.GaussianRegistration,
    true: Callable[[Inputs], dict[str, float]] = truth,
    wrong: float = 0.0,
) -> Model:
    """Return red registered to green, with a fraction of stars matched wrongly.

    Its consequences are those at the test points.
    """
    green, red, _ = _noisy(inputs, true_centroids(inputs), 1)
    order = default_rng(inputs.seed(4)).permutation(len(red))
    false = order[: round(wrong * len(red))]
    green[false] = green[np.roll(false, 1)]
    likelihood = kind(prepare(red, green, pivot(inputs)))
    return replace(
        models.registration_model(likelihood),
        consequences=_new_stars(inputs, likelihood),
        truth=true(inputs) | {"false-share": wrong},
    )


def _new_stars(inputs: Inputs, likelihood: models.GaussianRegistration) -> Derived:
    """Return the consequences of the registration of red at the test points."""
    generator = default_rng(inputs.seed(3, 0, 0))
    half = simulation.half_ranges(inputs)
    count = inputs.count(_TEST_POINTS)
    directions = generator.uniform(-half, half, (count, 2))
    true = channel_centroids(simulation.instrument(inputs), directions)
    _, source, _ = _noisy(inputs, true, 3, 1)
    pitch = inputs["niu2024/text-optics#pixel-pitch-x"]
    focal_length = inputs["niu2024/table-1#focal-length.green"]
    angle = float(angle_from_pixels(1.0, pitch, focal_length)) * ARCSEC_PER_RADIAN
    return partial(likelihood.new_stars, source=source, arcsec_per_px=angle)


def _your_registration(
    data: Any,
    kind: _Likelihood = models.GaussianRegistration,
    pivot: ArrayLike | None = None,
    **settings: Any,
) -> Supplied:
    """Return your stars with their weights, their registration, and the findings of `register`.

    Stars of weight zero are omitted. An unknown noise is the noise of a star of mean weight. With
    wrong matches the findings belong to the robust fit.
    """
    robust = kind is not models.GaussianRegistration
    table, arguments = matched_stars(data, **settings)
    pivot = checked_pivot(pivot, arguments["source"])
    problem = prepare(pivot=pivot, **arguments)
    used = problem.rows(problem.counts > 0)
    if not problem.errors_known:
        used = replace(used, counts=used.counts / used.counts.mean())
    if robust:
        _check_mixture(used)
    model = models.fitted_model(kind(used))
    found, _ = diagnose_fit(fit_problem(problem, robust))
    # The mixture reports wrong matches.
    hidden = {"sensitive", "mismatched", "dropped"} if robust else {"sensitive"}
    texts = (one.text for one in found if one.kind not in hidden)
    table = replace(table, numbers={**table.numbers, "weight": problem.counts})
    return table, model, list(texts)


def _check_mixture(problem: Problem) -> None:
    """Raise `ValueError` if wrong matches are indistinguishable from the noise."""
    if len(problem.source) < _MIN_STARS_MIXTURE:
        raise ValueError(
            f"data: expected {_MIN_STARS_MIXTURE} or more stars, got "
            f"{len(problem.source)}. Use the posterior registration, or add stars."
        )
    # Equal displacements have no bound of the density, as their noise may be zero.
    moves = (problem.target - problem.source).round(9)
    if np.unique(moves, axis=0, return_counts=True)[1].max() > max(
        2, _MAX_TIED * len(moves)
    ):
        raise ValueError(
            "data: expected coordinates with more digits, got equal displacements of "
            "many stars. Use the posterior registration, or add digits."
        )


_RED = partial(Declaration, paper="niu2024", inputs=INPUTS)
_STARS = partial(
    _RED,
    meaning="one star per line, in px: its position in the channel and in the reference channel",
    columns=STARS,
    accepts=("model", "pivot", "weights", "source_covariance", "target_covariance"),
)

POSTERIORS = (
    *published.POSTERIORS,
    _STARS(
        "registration",
        "Registration of one channel: similarity and Gaussian noise",
        build=_model,
        read=_your_registration,
        plan=book_plan(walkers=240),
    ),
    _STARS(
        "registration-mixture",
        "Registration with wrong matches: a good/bad mixture",
        build=partial(
            _model, kind=models.MixtureRegistration.of, wrong=_FALSE_FRACTION
        ),
        read=partial(_your_registration, kind=models.MixtureRegistration.of),
        plan=book_plan(steps=350, walkers=96),
    ),
    _RED(
        "registration-distortion",
        "Registration with both distortions free",
        build=partial(_model, kind=models.DistortedRegistration, true=_distorted_truth),
        meaning="it is for the data of the book; registration and registration-mixture take stars",
    ),
)
