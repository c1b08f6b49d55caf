"""Simulated images with a known transform, and the errors of their registration.

Two images of one field are simulated, with photon noise, read noise and whole digital numbers. Some
stars of the second image are displaced, so that they are matched wrongly.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import reproduce as rp
from reproduce.physics.images import Detector, expose, render_frame
from reproduce.physics.registration import Registration

FloatArray = NDArray[np.float64]
ROWS, PITCH, RADIUS = 6, 40, 1.2
SIDE = ROWS * PITCH
TRUTH = Registration.similarity(
    1.002, 0.003, (1.3, -0.7), ((SIDE - 1) / 2, (SIDE - 1) / 2)
)
DETECTOR = Detector(read_noise=5.0, offset=100.0, bits=16)
BACKGROUND, LEVELS = 100.0, (0.6827, 0.95)
# How far a star that is matched wrongly is displaced along each axis, in px.
DISPLACED = (0.5, 1.2)


@dataclass(frozen=True)
class Field:
    """Places and light of stars in both pictures, and the pictures."""

    source: FloatArray
    target: FloatArray
    light: FloatArray
    pictures: tuple[FloatArray, FloatArray]


def exposed(
    points: FloatArray,
    light: FloatArray,
    generator: np.random.Generator,
    radius: float = RADIUS,
) -> FloatArray:
    """Return a picture of stars, in digital numbers."""
    frame = render_frame(points, light, radius, (SIDE, SIDE)) + BACKGROUND
    return expose(frame, DETECTOR, generator)


def simulated(seed: int, wrong: float = 0.0, radius: float = RADIUS) -> Field:
    """Return a field, no star too close to another; a share of them displaced in the target."""
    generator = np.random.default_rng([26, seed])
    places = np.arange(ROWS) * PITCH + PITCH / 2
    grid = np.stack(np.meshgrid(places, places), axis=-1).reshape(-1, 2)
    source = grid + generator.uniform(-8, 8, grid.shape)
    target = TRUTH.apply(source)
    moved = generator.choice(len(source), round(wrong * len(source)), replace=False)
    signs = generator.choice((-1.0, 1.0), (len(moved), 2))
    target[moved] += signs * generator.uniform(*DISPLACED, (len(moved), 2))
    light = 10 ** generator.uniform(3.3, 4.6, len(source))
    first, second = (exposed(one, light, generator, radius) for one in (source, target))
    return Field(source, target, light, (first, second))


def centre_pulls(field: Field) -> FloatArray:
    """Return errors of the centres of the source in their deviations, (n, 2)."""
    found = rp.stars(field.pictures[0])
    apart = np.hypot(*np.moveaxis(found.points[:, None] - field.source, -1, 0))
    error = found.points - field.source[apart.argmin(axis=1)]
    sigma = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    return np.asarray((error / sigma)[apart.min(axis=1) < 1])


def recovered(field: Field) -> tuple[FloatArray, FloatArray, float]:
    """Return the pulls of the parameters, whether intervals hold them, and the freedom."""
    fit: Any = rp.register(*field.pictures)
    pulls = (fit.parameters - TRUTH.parameters) / fit.fit.standard_errors
    held = [
        (low < TRUTH.parameters) & (TRUTH.parameters < high)
        for low, high in (fit.interval(level).T for level in LEVELS)
    ]
    return pulls, np.array(held), float(fit.fit.degrees_of_freedom)


def summary(seeds: Iterable[int], wrong: float) -> dict[str, float]:
    """Return the width of the pulls of parameters, over that of Student's law, and the coverage."""
    pulls, held, freedom = map(
        np.array,
        zip(*(recovered(simulated(seed, wrong)) for seed in seeds), strict=True),
    )
    student = np.sqrt(freedom / (freedom - 2))[:, None]
    shares = 100 * held.mean(axis=(0, 2))
    return {
        "width": float(np.std(pulls / student)),
        "68 %": shares[0],
        "95 %": shares[1],
    }


def errors(seeds: Iterable[int], radius: float = RADIUS) -> dict[str, float]:
    """Return the root mean square error along an axis, in px, of our centres and of others."""
    from photutils.centroids import centroid_2dg, centroid_com, centroid_quadratic
    from photutils.segmentation import SourceCatalog, detect_sources

    left: dict[str, list[FloatArray]] = {}
    for seed in seeds:
        field = simulated(seed, radius=radius)
        found = rp.stars(field.pictures[0])
        image = field.pictures[0] - found.facts["background"]
        limit = 5 * found.facts["noise"]
        catalogue = SourceCatalog(image, detect_sources(image, limit, 3))
        others = {
            "ours": found.points,
            "photutils, isophotal": np.asarray(catalogue.centroid),
            "photutils, windowed": np.asarray(catalogue.centroid_win),
        }
        half = int(np.ceil(3 * radius))
        for name, centre in (
            ("centre of gravity", centroid_com),
            ("parabola", centroid_quadratic),
            ("fitted Gaussian", centroid_2dg),
        ):
            corners = np.round(found.points).astype(int) - half
            parts = [
                image[y : y + 2 * half + 1, x : x + 2 * half + 1] for x, y in corners
            ]
            others[f"photutils, {name}"] = corners + [centre(part) for part in parts]
        for name, points in others.items():
            apart = np.hypot(*np.moveaxis(points[:, None] - field.source, -1, 0))
            near = apart.min(axis=1) < 1
            left.setdefault(name, []).append(
                (points - field.source[apart.argmin(axis=1)])[near]
            )
    return {
        name: float(np.sqrt(np.square(np.concatenate(one)).mean()))
        for name, one in left.items()
    }
