"""From starlight to a fused image on real pixels, with the camera of niu2024.

Bands, detector size, pixel pitch, exposure and the calibrated camera of Table 4 are the paper's.
What it does not print is ours, in the constants below, and typical of a small camera with a
modern CMOS sensor: the aperture, what the optics let through, the sensor's parameters, the spot's
size. The results on these images are therefore examples and carry no verdict.

Images are arrays [y, x] in electrons, dark signal and offset taken away; channels are always in the
order green, red, blue; positions are in px, x before y, the centre of the first pixel at (0, 0).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator, SeedSequence
from numpy.typing import ArrayLike

from reproduce.papers.niu2024 import laboratory
from reproduce.physics.images.centroids import cut_windows, detect_spots
from reproduce.physics.images.detector import Detector, electrons, expose
from reproduce.physics.images.spectra import blackbody_band, tabulated_star
from reproduce.physics.images.spot_fit import fitted_centre
from reproduce.physics.images.spots import render_frame, window_corners
from reproduce.physics.optics.camera import Camera, detector_centre
from reproduce.physics.optics.simulate import channel_centroids
from reproduce.physics.registration.resample import fused_image, registered_image
from reproduce.physics.registration.transforms import Registration, similarity_between
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.store.stars import spectra

OPTICS, OUTCOME = laboratory.OPTICS, laboratory.OUTCOME
READS = (
    *laboratory.INSTRUMENT,
    f"{OPTICS}#pixels-*",
    f"{OPTICS}#band-*",
    f"{OUTCOME}#exposure",
)
APERTURE = 12.5e-3  # diameter in metres: half the focal length, f/2
TRANSMISSION = 0.8
RADIUS = 0.8  # of a spot, in px
WINDOW = 9


# The detector of every channel: a 12-bit sensor of small pixels.
SENSOR = Detector(
    quantum_efficiency=0.6,
    gain=4095 / 10_500,
    dark_signal=1.0,
    read_noise=3.0,
    full_well=10_500,
    offset=60,
    bits=12,
)


def shape(door: Given) -> tuple[int, int]:
    """Return width and height of the detector, in px."""
    return int(door[f"{OPTICS}#pixels-x"]), int(door[f"{OPTICS}#pixels-y"])


def cameras(door: Given) -> list[Camera]:
    """Return the cameras of Table 4 with green's principal point in the middle of the detector.

    Green, red, blue.
    """
    middle = detector_centre(shape(door))
    return [
        Camera(c.focal_length, c.principal_point + middle, c.radial_distortion, c.pixel_pitch)
        for c in laboratory.cameras(door)
    ]


def similarities(door: Given) -> list[Registration]:
    """Return the transforms of red and blue onto green that a perfect calibration would find."""
    used, turns = cameras(door), laboratory.rotations(door)
    return [similarity_between(used[i], turns[i], used[0]) for i in (1, 2)]


def star_photons(door: Given, magnitude: ArrayLike, temperature: ArrayLike) -> FloatArray:
    """Return the photons that stars send to each detector in one exposure.

    Shape (3, n). Green, red, blue.
    """
    bands = [blackbody_band(magnitude, temperature, *edges) for edges in _bands(door)]
    return _collected(door) * np.stack(bands)


def tabulated_photons(door: Given, magnitude: ArrayLike, name: str) -> FloatArray:
    """Return the photons that stars with a tabulated spectrum send to each detector.

    Shape (3, n). Green, red, blue, in one exposure.
    """
    table = spectra()[name]
    bands = [tabulated_star(magnitude, *table, *edges) for edges in _bands(door)]
    return _collected(door) * np.stack(bands)


def _bands(door: Given) -> list[tuple[float, float]]:
    """Return the edges of the bands of green, red and blue, in metres."""
    edges = [(f"{OPTICS}#band-{c}-low", f"{OPTICS}#band-{c}-high") for c in laboratory.CHANNELS]
    return [(door[low], door[high]) for low, high in edges]


def _collected(door: Given) -> float:
    """Return the square metres and seconds that an exposure collects."""
    return float(np.pi / 4 * APERTURE**2 * TRANSMISSION * door[f"{OUTCOME}#exposure"])


@dataclass(frozen=True, eq=False)
class Frames:
    """Three exposures of the same stars, with the truth.

    Attributes
    ----------
    images : list of ndarray, each of shape (height, width)
        Green, red, blue, in electrons.
    positions : ndarray, shape (3, n, 2)
        True positions of the spots, in px.
    photons : ndarray, shape (3, n)
        Their light.
    """

    images: list[FloatArray]
    positions: FloatArray
    photons: FloatArray


def exposed(image: FloatArray, generator: Generator) -> FloatArray:
    """Return one exposure of a noiseless image, brought back to electrons."""
    detector = SENSOR
    return electrons(expose(image, detector, generator), detector)


def frames(
    door: Given, angles: ArrayLike, magnitude: ArrayLike, temperature: ArrayLike, seed: int
) -> Frames:
    """Render and expose a full frame in all three channels."""
    positions = channel_centroids(cameras(door), laboratory.rotations(door), angles)
    photons = star_photons(door, magnitude, temperature)
    streams = [np.random.default_rng(s) for s in SeedSequence(seed).spawn(len(photons))]

    def one(channel: int) -> FloatArray:
        clean = render_frame(positions[channel], photons[channel], RADIUS, shape(door))
        return exposed(clean, streams[channel])

    # NumPy lets other threads run while it draws; every channel has its own generator.
    with ThreadPoolExecutor(2) as pool:
        images = list(pool.map(one, range(len(photons))))
    return Frames(images, positions, photons)


def register(images: Sequence[FloatArray], transforms: Sequence[Registration]) -> list[FloatArray]:
    """Return green as it is, and the other images on the pixels of green.

    Green, red, blue.
    """
    with ThreadPoolExecutor(2) as pool:
        moved = list(pool.map(registered_image, images[1:], transforms))
    return [images[0], *moved]


def extract(image: FloatArray, layers: int, significance: float = 6.0) -> FloatArray:
    """Find the spots of an image and their centres.

    Shape (n, 2). Maximum-likelihood centres, the brightest spot first, in px; spots whose window
    would reach over the edge are left out, and those whose fit does not converge.
    """
    noise = SENSOR.noise_electrons() * np.sqrt(layers)
    found = detect_spots(image, significance * noise)
    half = WINDOW // 2
    height, width = image.shape
    inside = (found >= half) & (found < np.array([width, height]) - half)
    kept = found[inside.all(axis=-1)]
    if not len(kept):
        return np.empty((0, 2))
    corners = window_corners(kept, WINDOW)
    windows = cut_windows(image, corners, WINDOW)
    fit = fitted_centre(windows, corners, RADIUS, read_noise=noise)
    return fit.centre[fit.converged]


def matched_errors(found: FloatArray, truth: FloatArray, within: float = 3.0) -> FloatArray:
    """Return found minus true position for every star that was found.

    Shape (n, 2). Not a number for stars that were not found.
    """
    if not len(found):
        return np.full(truth.shape, np.nan)
    difference = found[None] - truth[:, None]
    distance = np.hypot(difference[..., 0], difference[..., 1])
    nearest = distance.argmin(axis=1)
    rows = np.arange(len(truth))
    errors = difference[rows, nearest]
    errors[distance[rows, nearest] > within] = np.nan
    return np.asarray(errors)


def fused(images: Sequence[FloatArray]) -> FloatArray:
    """Return the sum of three images on one grid."""
    return fused_image(images)
