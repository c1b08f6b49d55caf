"""Times of physics compared with SciPy, photutils, ERFA and loops over NumPy."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import erfa
import numpy as np
from numpy.random import default_rng
from numpy.typing import NDArray
from photutils.centroids import centroid_com
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from reproduce.papers.chen2023 import platform_twin, resolution
from reproduce.physics.attitude import attitude
from reproduce.physics.ground import image_vectors, imaged_position, local_axes
from reproduce.physics.images import centre_of_gravity, spot_windows
from reproduce.physics.registration import (
    Registration,
    fit_registration,
)
from reproduce.printed.inputs import load_inputs

Array = NDArray[np.float64]
Promise = Callable[..., None]

POINTS = 137
TRUTH = Registration.similarity(1.002, -0.001, (-1.0, -2.0), (1030.0, 770.0))
START = (1.0, 0.0, 0.0, 0.0)
SOURCE = default_rng(1).uniform((0, 0), (2064, 1544), (POINTS, 2))
TARGET = TRUTH.apply(SOURCE) + 0.05 * default_rng(2).normal(size=(POINTS, 2))
CHANNELS = np.stack([SOURCE, TRUTH.apply(SOURCE)])


def residuals(u: Array, target: Array = TARGET) -> Array:
    """Return residuals in plain NumPy, so that the time of SciPy dominates."""
    cosine, sine = u[0] * np.cos(u[1]), u[0] * np.sin(u[1])
    x, y = SOURCE[:, 0] - TRUTH.pivot[0], SOURCE[:, 1] - TRUTH.pivot[1]
    left = np.empty(2 * POINTS)
    left[:POINTS] = cosine * x - sine * y + (TRUTH.pivot[0] - u[2]) - target[:, 0]
    left[POINTS:] = sine * x + cosine * y + (TRUTH.pivot[1] - u[3]) - target[:, 1]
    return left


def by_scipy() -> Array:
    return least_squares(residuals, START).x


def one_fit() -> Array:
    return fit_registration(SOURCE, TARGET, TRUTH.pivot).parameters


def bench_one_registration(promise: Promise) -> None:
    """Compare a fit with the solver of SciPy."""
    np.testing.assert_allclose(one_fit(), by_scipy(), rtol=1e-6, atol=1e-6)
    promise(
        f"one registration of {POINTS} points, SciPy's solver", one_fit, by_scipy, 1 / 4
    )


def bench_simulated_calibrations(promise: Promise) -> None:
    """Compare simulated fits in one call with a loop over the solver of SciPy."""
    many, few = 1000, 20

    def package() -> object:
        unit = default_rng(3).standard_normal((many, *np.shape(CHANNELS)))
        noisy = CHANNELS + 0.05 * unit
        return fit_registration(noisy[:, 0], noisy[:, 1], TRUTH.pivot)

    def loop() -> None:
        for seed in range(few):
            target = TARGET + 0.05 * default_rng(seed).normal(size=TARGET.shape)
            least_squares(residuals, START, args=(target,))

    promise(f"{many} simulated calibrations", package, loop, 1 / 20, work=many / few)


def four_spots(frames: int) -> tuple[Array, Array]:
    """Return frames of four directions 0.5 deg apart, with a noise of 1 µrad."""
    generator = default_rng(1)
    source = np.array([[0, 5e-3, 1], [0, -5e-3, 1], [5e-3, 0, 1], [-5e-3, 0, 1]])
    source /= np.linalg.norm(source, axis=-1, keepdims=True)
    turn = Rotation.from_rotvec([0.3, -1.2, 2.0]).as_matrix()
    target = source @ turn.T + 1e-6 * generator.standard_normal((frames, 4, 3))
    return target / np.linalg.norm(target, axis=-1, keepdims=True), source


def bench_wahba(promise: Promise) -> None:
    """Compare 800 frames of four spots with a loop over the solver of SciPy."""
    target, source = four_spots(800)

    def loop() -> Array:
        return np.array(
            [Rotation.align_vectors(row, source)[0].as_matrix() for row in target]
        )

    np.testing.assert_allclose(attitude(target, source), loop(), atol=1e-8)
    promise("Wahba", lambda: attitude(target, source), loop, 1 / 15)


def bench_centre_of_gravity(promise: Promise) -> None:
    """Compare 20,000 spots in one call with photutils, spot by spot."""
    generator, many, few = default_rng(2), 20_000, 500
    places = generator.uniform(-0.5, 0.5, (many, 2))
    windows = generator.poisson(spot_windows(places, 2000.0, 0.6, [-2, -2], 5)).astype(
        float
    )

    def other() -> Array:
        return np.array([centroid_com(window) for window in windows[:few]])

    np.testing.assert_allclose(
        centre_of_gravity(windows[:few], [0.0, 0.0]), other(), atol=1e-12
    )
    package = partial(centre_of_gravity, windows, [0.0, 0.0])
    promise("centre of gravity, photutils", package, other, 1 / 200, work=many / few)


def bench_frames_of_the_bench(promise: Promise) -> None:
    """Render, extract and solve 800 frames of four spots; photutils only extracts."""
    platform = platform_twin.SimulatedBench(load_inputs(platform_twin.INPUTS))
    frames = 800
    window = default_rng(1).uniform(size=(7, 7))

    def package() -> Array:
        spots = platform.centroids(
            platform.spots, platform.flux[0], frames, default_rng(1)
        )
        return platform.design.transform(spots)

    def other() -> None:
        for _ in range(4 * frames):
            centroid_com(window)

    promise(f"{frames} frames of the laboratory bench", package, other, 1 / 5)


def bench_study_of_figure_11(promise: Promise) -> None:
    """Compare 71 resolutions, 50 phases and 500 trials with the draws of their photons."""
    inputs = load_inputs(resolution.INPUTS)
    size = len(resolution._resolutions(inputs)), inputs.count(resolution.PHASES)
    trials = inputs.count("chen2023/text-resolution#trials")

    def photons() -> None:
        for row in range(size[0]):
            default_rng(row).poisson(9.0, (size[1], trials, 5, 5))

    promise(
        "study of Figure 11",
        lambda: resolution.terms.__wrapped__(inputs),
        photons,
        0.5,
        rounds=3,
    )


def bench_lines_of_sight(promise: Promise) -> None:
    """Compare 100,000 points on the ellipsoid with the geodetic coordinates of ERFA."""
    satellite = erfa.gd2gc(erfa.WGS84, 0.3, 0.8, 5e5)
    east, north, up = local_axes(satellite)
    down = np.stack([north, east, -up], axis=-1)
    vectors = image_vectors(default_rng(3).uniform(-0.3, 0.3, (100_000, 2)), 14.0)
    places = satellite + 1e5 * vectors
    package = partial(imaged_position, vectors, satellite, down)
    promise("100,000 lines of sight", package, partial(erfa.gc2gd, 1, places), 4)
