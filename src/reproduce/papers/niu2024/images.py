"""From starlight to a fused image and to colours, with the camera of niu2024 (section 2).

Bands, detector size, pixel pitch, exposure and the calibrated camera of Table 4 are the paper's.
What it does not print is ours, in the constants below, and typical of a small camera with a
modern CMOS sensor: the aperture, what the optics let through, the sensor's parameters, the spot's
size. The results on these images are therefore examples and carry no verdict.

Images are arrays [y, x] in electrons, dark signal and offset taken away; channels are always in the
order green, red, blue; positions are in px, x before y, the centre of the first pixel at (0, 0).

A frame of stars at random is rendered, registered and fused; the stars are found in the fused
image, and the light of each is summed in every channel about its own spot, where the registration
says that it stands. Colours are red / green and blue / green.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.random import Generator, SeedSequence
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from reproduce.papers.niu2024 import experiment
from reproduce.papers.niu2024.simulation import CHANNELS, OPTICS
from reproduce.papers.study import studied
from reproduce.papers.words import Column
from reproduce.physics.images.centroids import cut_windows, detect_spots
from reproduce.physics.images.detector import Detector, electrons, expose
from reproduce.physics.images.spectra import blackbody_band, channel_ratio, tabulated_star
from reproduce.physics.images.spot_fit import fitted_centre
from reproduce.physics.images.spots import render_frame, window_corners
from reproduce.physics.optics.camera import Camera, detector_centre
from reproduce.physics.optics.simulate import channel_centroids
from reproduce.physics.registration.resample import fused_image, registered_image
from reproduce.physics.registration.transforms import Registration, similarity_between
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.store.stars import spectra

__all__ = [
    "RADIUS", "READS", "SENSOR", "TEMPERATURES", "WINDOW", "Colours", "cameras",
    "colours_of_a_frame", "exposed", "extract", "frames", "isolated", "matched_errors",
    "ratios", "register", "similarities", "star_photons",
]  # fmt: skip

OUTCOME = experiment.OUTCOME
READS = (
    *experiment.INSTRUMENT,
    f"{OPTICS}#pixels-*",
    f"{OPTICS}#band-*",
    f"{OUTCOME}#exposure",
)
APERTURE = 12.5e-3  # diameter in metres: half the focal length, f/2
TRANSMISSION = 0.8
RADIUS = 0.8  # of a spot, in px
WINDOW = 9
# The stars of a random frame: ranges of V, and of the temperature in kelvin, whose logarithm is
# uniform.
STARS, SEED = 200, 1
MAGNITUDES, TEMPERATURES = (2.0, 6.0), (3000.0, 20000.0)
MARGIN = 1.5  # windows: nearer stars share their light
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
    """Return the cameras of Table 4 with green's principal point in the detector's middle."""
    middle = detector_centre(shape(door))
    return [
        replace(camera, principal_point=camera.principal_point + middle)
        for camera in experiment.cameras(door)
    ]


def similarities(door: Given) -> list[Registration]:
    """Return the transforms of red and blue onto green that a perfect calibration would find."""
    used, turns = cameras(door), experiment.rotations(door)
    return [similarity_between(used[i], turns[i], used[0]) for i in (1, 2)]


def star_photons(door: Given, magnitude: ArrayLike, star: ArrayLike | str) -> FloatArray:
    """Return the photons that stars send to each detector in one exposure, shape (3, ...).

    Blackbodies by their temperature in kelvin, a tabulated spectrum by its name.
    """
    bands = []
    for channel in CHANNELS:
        low, high = (door[f"{OPTICS}#band-{channel}-{edge}"] for edge in ("low", "high"))
        if isinstance(star, str):
            bands.append(tabulated_star(magnitude, *spectra()[star], low, high))
        else:
            bands.append(blackbody_band(magnitude, star, low, high))
    # Square metres and seconds that an exposure collects.
    collected = float(np.pi / 4 * APERTURE**2 * TRANSMISSION * door[f"{OUTCOME}#exposure"])
    return collected * np.stack(bands)


@dataclass(frozen=True, eq=False)
class Frames:
    """Three exposures of the same stars, with the truth."""

    images: list[FloatArray]
    positions: FloatArray  # of the spots, shape (3, n, 2)
    photons: FloatArray  # shape (3, n)


def exposed(image: FloatArray, generator: Generator) -> FloatArray:
    """Return one exposure of a noiseless image, brought back to electrons."""
    return electrons(expose(image, SENSOR, generator), SENSOR)


def frames(
    door: Given, angles: ArrayLike, magnitude: ArrayLike, temperature: ArrayLike, seed: int
) -> Frames:
    """Render and expose a full frame in all three channels."""
    positions = channel_centroids(cameras(door), experiment.rotations(door), angles)
    photons = star_photons(door, magnitude, temperature)
    streams = SeedSequence(seed).spawn(len(photons))
    images = [
        exposed(render_frame(spots, light, RADIUS, shape(door)), np.random.default_rng(stream))
        for spots, light, stream in zip(positions, photons, streams, strict=True)
    ]
    return Frames(images, positions, photons)


def register(images: Sequence[FloatArray], transforms: Sequence[Registration]) -> list[FloatArray]:
    """Return green as it is, and the other images on the pixels of green."""
    return [images[0], *map(registered_image, images[1:], transforms)]


def extract(image: FloatArray, layers: int, significance: float = 6.0) -> FloatArray:
    """Return maximum-likelihood centres of the spots of an image, shape (n, 2), brightest first.

    Spots at the edge are left out, and those whose fit does not converge.
    """
    noise = SENSOR.noise_electrons() * np.sqrt(layers)
    found = detect_spots(image, significance * noise)
    half = WINDOW // 2
    inside = (found >= half) & (found < np.flip(image.shape) - half)
    kept = found[inside.all(axis=-1)]
    if not len(kept):
        return np.empty((0, 2))
    corners = window_corners(kept, WINDOW)
    windows = cut_windows(image, corners, WINDOW)
    fit = fitted_centre(windows, corners, RADIUS, read_noise=noise)
    return fit.centre[fit.converged]


def matched_errors(found: FloatArray, truth: FloatArray, within: float = 3.0) -> FloatArray:
    """Return found minus true position of every star, shape (n, 2), nan where it is not found."""
    if not len(found):
        return np.full(truth.shape, np.nan)
    distance = cdist(truth, found)
    nearest = found[distance.argmin(axis=1)]
    return np.where(distance.min(axis=1, keepdims=True) <= within, nearest - truth, np.nan)


@dataclass(frozen=True, eq=False)
class Colours:
    """Colours of stars as measured, and as they are, shape (2, n)."""

    measured: FloatArray
    sigma: FloatArray  # predicted standard deviations
    truth: FloatArray  # ratios of the light that was sent
    magnitude: FloatArray  # V of the stars, shape (n,)
    sent: int  # how many stars there were

    @property
    def pulls(self) -> FloatArray:
        """Measured minus true colours, in predicted standard deviations, shape (2, n)."""
        return (self.measured - self.truth) / self.sigma


@cache
def colours_of_a_frame() -> Colours:
    """Measure the colours of all stars of a frame that were found and stand alone.

    It takes seconds, so it is kept.
    """
    door, generator = given(READS), np.random.default_rng(SEED)
    half = 0.98 * np.array(experiment.half_field(door))
    angles = generator.uniform(-half, half, (STARS, 2))
    magnitude = generator.uniform(*MAGNITUDES, STARS)
    low, high = np.log(TEMPERATURES)
    temperature = np.exp(generator.uniform(low, high, STARS))
    sky, transforms = frames(door, angles, magnitude, temperature, SEED), similarities(door)
    layers = register(sky.images, transforms)
    errors = matched_errors(extract(fused_image(layers), len(layers)), sky.positions[0])
    kept = np.isfinite(errors[:, 0]) & isolated(sky.positions[0])
    green = (sky.positions[0] + errors)[kept]
    places = [green, *(transform.inverse().apply(green) for transform in transforms)]
    windows = (
        cut_windows(image, window_corners(at, WINDOW), WINDOW)
        for image, at in zip(sky.images, places, strict=True)
    )
    truth = (sky.photons[1:] / sky.photons[0])[:, kept]
    return Colours(*ratios(windows), truth, magnitude[kept], STARS)


def isolated(positions: FloatArray) -> FloatArray:
    """Return which spots, shape (n, 2) in px, have no neighbour within reach of their window."""
    to_next = np.sort(cdist(positions, positions))[:, 1]  # the first is the spot itself
    return np.asarray(to_next > MARGIN * WINDOW)


def ratios(windows: Iterable[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return red and blue over green by windows of each channel, and the predicted deviations."""
    light = np.array([window.sum(axis=(-2, -1)) for window in windows])
    variance = np.maximum(light, 0) + (WINDOW * SENSOR.noise_electrons()) ** 2
    return channel_ratio(light[1:], np.maximum(light[0], 1.0), variance[1:], variance[0])


@studied(
    "niu2024/image-stand-ins",
    columns=(Column("What"), Column("Ours", ",g"), Column("Unit")),
    caption="Stand-ins for what the paper does not print.",
)
def stand_ins() -> Iterator[tuple[object, ...]]:
    """What the paper does not print of the images and we had to choose."""
    yield "aperture", APERTURE * 1e3, "mm"
    yield "transmission of the optics", TRANSMISSION, ""
    yield "radius of a spot (one standard deviation)", RADIUS, "px"
    yield "quantum efficiency", SENSOR.quantum_efficiency, ""
    yield "read noise", SENSOR.read_noise, "electrons"
    yield "dark signal in one exposure", SENSOR.dark_signal, "electrons"
    yield "full well", SENSOR.full_well, "electrons"
    yield "digital output", SENSOR.bits, "bits"
