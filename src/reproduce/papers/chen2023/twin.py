"""A twin of the ground platform: images in, the camera's misalignment out (chen2023, IV and V).

Every frame is made as the bench makes it: four spots at their places, light integrated over
pixels, photon noise and read noise drawn, centres of gravity taken, and (2) to (9) solved. What
the paper leaves open, and how the twin reads it (a choice that came into the history together with
its results):

* light: each laser of each group has the light that gives the mean variance of its two cells of
  Table III, with photon noise alone; nothing else is fitted. What photons cannot explain, such as
  a laser whose x scatters less than its y, the twin does not have. Another sensor, with read noise,
  dark charge, rounding or saturation, may be put in its place (see `twin_study.sensors`): one
  variance cannot tell them apart, so the light is fitted again beside it;
* the spot's radius is the printed one; it is the same for all lasers;
* places: the printed centroids, with the bias of their own 5 by 5 window taken off, stand still
  within a group, and are the same in both groups: the paper does not print how they differ;
* laser directions are the designed ones, as the calibration takes them, with the nominal focal
  length and the printed diagonal as they stand. Within the rounding of the diagonal and a few per
  cent of the focal length they fit the printed spots (see `misfit`); what is left is the same in
  all frames and goes into the zero point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from reproduce.papers.chen2023 import accuracy, lasers, resolution
from reproduce.physics.attitude.lasers import (
    emitted_directions,
    received_directions,
    received_spots,
)
from reproduce.physics.attitude.misalignment import (
    laser_transform,
    misalignment,
    misalignment_angles,
    moved_laser_transform,
)
from reproduce.physics.attitude.rotations import rotation_from_vector, transpose
from reproduce.physics.attitude.wahba import mean_rotation, solve
from reproduce.physics.images.centroid_theory import centre_of_gravity_error
from reproduce.physics.images.centroids import centre_of_gravity
from reproduce.physics.images.detector import Detector, electrons, expose
from reproduce.physics.images.spots import spot_windows, window_corners
from reproduce.physics.optics.camera import detector_centre
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

RADIUS = f"{resolution.STUDY}#spot-radius"
WINDOW = "chen2023/text-platform#window-x"
# The sensor that the predictions rest on.
PHOTONS = Detector()
READS = (*lasers.READS, lasers.SCATTER, accuracy.FRAMES, RADIUS, WINDOW)


@dataclass(frozen=True, eq=False)
class Bench:
    """The ground platform as the twin sees it.

    Attributes
    ----------
    spots : ndarray, shape (4, 2)
        True centres of the spots at rest, in px.
    light : ndarray, shape (2, 4)
        Electrons of each spot, for both groups of images.
    radius : float
        Of a spot, in px.
    window : int
        Width of the window around a spot, in px.
    camera_directions : ndarray, shape (4, 3)
        Designed directions of the lasers.
    tracker : tuple
        Principal point in px, pixel pitch and focal length in metres.
    sensor : Detector
        The tracker's image sensor.
    """

    spots: FloatArray
    light: FloatArray
    radius: float
    window: int
    camera_directions: FloatArray
    tracker: tuple[FloatArray, float, float]
    sensor: Detector

    def directions(self, spots: ArrayLike) -> FloatArray:
        """Return the tracker directions of spots of shape (..., 4, 2)."""
        return received_directions(spots, *self.tracker)

    def transform(self, spots: ArrayLike) -> FloatArray:
        """Return the laser transform of every frame, tracker_from_camera."""
        return laser_transform(self.camera_directions, self.directions(spots))

    def turned(self, angles: ArrayLike) -> FloatArray:
        """Return where the spots stand when the camera has turned by angles of shape (..., 3)."""
        rest = self.directions(self.spots)
        zero = self.transform(self.spots)
        now = moved_laser_transform(zero, rotation_from_vector(-np.asarray(angles)))
        # The light goes back to the camera of the zero point, then by the present transform.
        moved = rest @ zero @ transpose(now)
        return received_spots(moved, *self.tracker)


def bench(given: Given, sensor: Detector = PHOTONS) -> Bench:
    """Set the twin up from printed numbers."""
    printed = given.array(lasers.SPOTS).reshape(-1, 2)
    pitch = given[f"{lasers.PLATFORM}#tracker-pixel-size.value"]
    radius, window = given[RADIUS] / pitch, round(given[WINDOW])
    corners = window_corners(printed, window)
    law = centre_of_gravity_error(printed, 1.0, radius, corners, window)
    noisy = centre_of_gravity_error(printed, 1.0, radius, corners, window, 1.0)
    groups = np.stack([lasers.scatter(given, group) for group in (1, 2)])
    # The variance is photon / light + read noise^2 read / light^2: a quadratic in the light.
    target, photon = (groups**2).mean(axis=-1), law.variance.mean(axis=-1)
    read = sensor.noise_electrons() ** 2 * (noisy.variance.mean(axis=-1) - photon)
    light = (photon + np.sqrt(photon**2 + 4.0 * target * read)) / (2.0 * target)
    pixels = given.array(f"{lasers.PLATFORM}#tracker-pixels-*.value")
    designed = lasers.designed_positions(printed, given[lasers.DIAGONAL])
    return Bench(
        spots=printed - law.bias,
        light=np.asarray(light),
        radius=radius,
        window=window,
        camera_directions=emitted_directions(
            designed, given[f"{lasers.PLATFORM}#telescope-focal-length.value"]
        ),
        tracker=(
            detector_centre(pixels),
            pitch,
            given[f"{lasers.PLATFORM}#tracker-focal-length.value"],
        ),
        sensor=sensor,
    )


def centroids(
    platform: Bench, spots: ArrayLike, light: ArrayLike, frames: int, generator: Generator
) -> FloatArray:
    """Render frames and extract the spots, as the bench does.

    Shape (..., frames, 4, 2). Centres of gravity, in px.
    """
    places = np.asarray(spots, dtype=np.float64)[..., np.newaxis, :, :]
    corners = window_corners(places, platform.window)
    mean = spot_windows(places, light, platform.radius, corners, platform.window)
    shape = (*mean.shape[:-4], frames, *mean.shape[-3:])
    photons = np.broadcast_to(mean / platform.sensor.quantum_efficiency, shape)
    seen = electrons(expose(photons, platform.sensor, generator), platform.sensor)
    return centre_of_gravity(seen, np.broadcast_to(corners, (*shape[:-2], 2)))


@dataclass(frozen=True, eq=False)
class Series:
    """What the bench measures over two groups of frames.

    Attributes
    ----------
    spots : ndarray, shape (2, frames, 4, 2)
        Extracted centroids, in px.
    transform : ndarray, shape (frames, 3)
        Error of the laser transform of the first group, in the camera frame, in radians.
    misalignment : ndarray, shape (frames, 3)
        Misalignment of the second group against the zero point of the first, in radians.
    """

    spots: FloatArray
    transform: FloatArray
    misalignment: FloatArray


def two_groups(platform: Bench, frames: int, generator: Generator) -> Series:
    """Take two groups of frames and solve them, as the accuracy test does."""
    found = np.stack(
        [centroids(platform, platform.spots, light, frames, generator) for light in platform.light]
    )
    single = platform.transform(found[0])
    zero = mean_rotation(single)
    errors = misalignment_angles(transpose(single) @ zero)
    now = misalignment(platform.camera_directions, platform.directions(found[1]), zero)
    return Series(found, errors, misalignment_angles(now))


def misfit(platform: Bench) -> dict[str, float]:
    """Return how far the printed spots lie from where the designed lasers would put them.

    ``residual``: root-mean-square distance of a spot from its laser after the best rotation, in px;
    ``scale``: size of the printed pattern over the designed one; ``after_scale``: the distance that
    is left when the pattern may also shrink, in px.
    """
    rest, designed = platform.directions(platform.spots), platform.camera_directions
    pixel = platform.tracker[1] / platform.tracker[2]

    def miss(camera: FloatArray) -> float:
        return float(np.sqrt(solve(rest, camera).loss / len(rest))) / pixel

    sizes = [np.linalg.norm(rows - rows.mean(axis=0)) for rows in (rest, designed)]
    scale = float(sizes[0] / sizes[1])
    shrunk = designed * np.array([scale, scale, 1.0])
    return {"residual": miss(designed), "scale": scale, "after_scale": miss(shrunk)}
