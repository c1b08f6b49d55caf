"""The colour of every star in a frame: the channel ratios of niu2024, section 2, with their errors.

A frame of stars at random is rendered, registered and fused; the stars are found in the fused
image, and the light of each is summed in every channel about its own spot, where the registration
says that it stands. Channels are in the order green, red, blue; colours are red / green and
blue / green.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reproduce.papers.niu2024 import images, laboratory
from reproduce.physics.images.centroids import cut_windows
from reproduce.physics.images.spectra import channel_ratio
from reproduce.physics.images.spots import window_corners
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

STARS, SEED = 200, 1
# Ranges of V and of the temperature in kelvin, whose logarithm is uniform.
MAGNITUDES, TEMPERATURES = (2.0, 6.0), (3000.0, 20000.0)
MARGIN = 1.5  # windows: nearer stars share their light


@dataclass(frozen=True, eq=False)
class Colours:
    """Colours of stars as measured, and as they are.

    Attributes
    ----------
    measured, sigma : ndarray, shape (2, n)
        Ratios red / green and blue / green, and their predicted standard deviations.
    truth : ndarray, shape (2, n)
        Ratios of the light that was sent.
    magnitude : ndarray, shape (n,)
        V of the stars.
    sent : int
        How many stars there were.
    """

    measured: FloatArray
    sigma: FloatArray
    truth: FloatArray
    magnitude: FloatArray
    sent: int

    @property
    def pulls(self) -> FloatArray:
        """Measured minus true colours, in predicted standard deviations, shape (2, n)."""
        return (self.measured - self.truth) / self.sigma


def of_a_frame(door: Given, stars: int = STARS, seed: int = SEED) -> Colours:
    """Measure the colours of all stars of a frame that were found and stand alone."""
    generator = np.random.default_rng(seed)
    half = np.array(laboratory.half_field(door))
    angles = generator.uniform(-0.98 * half, 0.98 * half, (stars, 2))
    magnitude = generator.uniform(*MAGNITUDES, stars)
    low, high = np.log(TEMPERATURES)
    temperature = np.exp(generator.uniform(low, high, stars))
    sky = images.frames(door, angles, magnitude, temperature, seed)
    layers = images.register(sky.images, images.similarities(door))
    centres = images.extract(images.fused(layers), len(layers))
    errors = images.matched_errors(centres, sky.positions[0])
    kept = np.isfinite(errors[:, 0]) & alone(sky.positions[0])
    ratio, sigma = measured_colours(door, sky.images, (sky.positions[0] + errors)[kept])
    truth = (sky.photons[1:] / sky.photons[0])[:, kept]
    return Colours(ratio, sigma, truth, magnitude[kept], stars)


def alone(positions: FloatArray) -> FloatArray:
    """Return which spots, shape (n, 2) in px, have no neighbour within reach of their window."""
    apart = np.hypot(*np.moveaxis(positions[:, None] - positions[None], -1, 0))
    np.fill_diagonal(apart, np.inf)
    return np.asarray(apart.min(axis=1) > MARGIN * images.WINDOW)


def measured_colours(
    door: Given, frames: list[FloatArray], centres: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the colours of stars from the three images of a frame.

    Shape (2, n). Ratios red / green and blue / green, and their predicted standard deviations.
    """
    back = [transform.inverse() for transform in images.similarities(door)]
    places = [centres, *(transform.apply(centres) for transform in back)]
    light = [
        cut_windows(image, window_corners(at, images.WINDOW), images.WINDOW).sum(axis=(-2, -1))
        for image, at in zip(frames, places, strict=True)
    ]
    dark = (images.WINDOW * images.SENSOR.noise_electrons()) ** 2
    variance = [np.maximum(one, 0) + dark for one in light]
    green = np.maximum(light[0], 1.0)
    found = [channel_ratio(light[i], green, variance[i], variance[0]) for i in (1, 2)]
    ratio, sigma = (np.stack(part) for part in zip(*found, strict=True))
    return ratio, sigma
