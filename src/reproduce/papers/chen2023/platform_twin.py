"""A twin of the ground platform: images in, the camera's misalignment out (chen2023, IV and V).

Every frame is made as the bench makes it: four spots at their places, light integrated over
pixels, photon noise and read noise drawn, centres of gravity taken, and (2) to (9) solved. What
the paper leaves open, and how the twin reads it (a choice that came into the history together with
its results):

* light: each laser of each group has the light that gives the mean variance of its two cells of
  Table III, with photon noise alone; nothing else is fitted. What photons cannot explain, such as
  a laser whose x scatters less than its y, the twin does not have. Another sensor, with read noise,
  dark charge, rounding or saturation, may be put in its place (see `sensors`): one
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

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator, default_rng
from numpy.typing import ArrayLike
from scipy.stats import chi2, kstest

from reproduce.papers.chen2023 import accuracy, effectiveness, platform, resolution, satellite
from reproduce.papers.declare import seed_of
from reproduce.papers.study import studied
from reproduce.papers.words import Column
from reproduce.physics.attitude import (
    emitted_directions,
    laser_transform,
    mean_rotation,
    misalignment,
    misalignment_angles,
    moved_laser_transform,
    moving_average,
    received_directions,
    received_spots,
    rotation_from_vector,
    solve,
    taste,
    transpose,
)
from reproduce.physics.images import (
    Detector,
    centre_of_gravity,
    electrons,
    expose,
    spot_windows,
    window_corners,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["READS", "SENSORS", "Bench", "Series", "bench", "centroids", "two_groups"]

WINDOW = f"{platform.TEXT}#window-x"
# The sensor that the predictions rest on.
PHOTONS = Detector()
BENCH = (*platform.INSTRUMENT, platform.SCATTER, resolution.SPOT_RADIUS, WINDOW)
READS = (*BENCH, accuracy.FRAMES)


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

    def misalignment(self, spots: ArrayLike, zero: FloatArray) -> FloatArray:
        """Return the misalignment angles of every frame against a laser transform."""
        now = misalignment(self.camera_directions, self.directions(spots), zero)
        return misalignment_angles(now)

    def turned(self, angles: ArrayLike) -> FloatArray:
        """Return where the spots stand when the camera has turned by angles of shape (..., 3)."""
        zero = self.transform(self.spots)
        now = moved_laser_transform(zero, rotation_from_vector(-np.asarray(angles)))
        # The light goes back to the camera of the zero point, then by the present transform.
        moved = self.directions(self.spots) @ zero @ transpose(now)
        return received_spots(moved, *self.tracker)

    def misfit(self) -> tuple[float, float]:
        """Return how far the spots lie from the designed lasers, and their size over that of these.

        Root-mean-square distance after the best rotation, in radians; size of the pattern of
        directions.
        """
        patterns = self.directions(self.spots), self.camera_directions
        sizes = [np.linalg.norm(rows - rows.mean(axis=0)) for rows in patterns]
        distance = np.sqrt(solve(*patterns).loss / len(self.spots))
        return float(distance), float(sizes[0] / sizes[1])


def bench(given: Given, sensor: Detector = PHOTONS) -> Bench:
    """Set the twin up from printed numbers."""
    printed, window = platform.printed_spots(given), round(given[WINDOW])
    radius = given[resolution.SPOT_RADIUS] / given[platform.PIXEL]
    law, noisy = resolution.spot_laws(printed, radius, window)
    target = np.stack([(platform.scatter(given, g) ** 2).mean(axis=-1) for g in (1, 2)])
    # The variance is photon / light + read noise^2 read / light^2: a quadratic in the light.
    photon = law.variance.mean(axis=-1)
    read = sensor.noise_electrons() ** 2 * (noisy.variance.mean(axis=-1) - photon)
    light = (photon + np.sqrt(photon**2 + 4.0 * target * read)) / (2.0 * target)
    return Bench(
        spots=printed - law.bias,
        light=np.asarray(light),
        radius=radius,
        window=window,
        camera_directions=emitted_directions(platform.lasers(given), given[platform.TELESCOPE]),
        tracker=platform.tracker(given),
        sensor=sensor,
    )


def centroids(
    twin: Bench, spots: ArrayLike, light: ArrayLike, frames: int, generator: Generator
) -> FloatArray:
    """Render frames and extract the spots, as the bench does.

    Shape (..., frames, 4, 2). Centres of gravity, in px.
    """
    places = np.asarray(spots, dtype=np.float64)[..., np.newaxis, :, :]
    corners = window_corners(places, twin.window)
    mean = spot_windows(places, light, twin.radius, corners, twin.window)
    shape = (*mean.shape[:-4], frames, *mean.shape[-3:])
    photons = np.broadcast_to(mean / twin.sensor.quantum_efficiency, shape)
    seen = electrons(expose(photons, twin.sensor, generator), twin.sensor)
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


def two_groups(twin: Bench, frames: int, generator: Generator) -> Series:
    """Take two groups of frames and solve them, as the accuracy test does."""
    found = np.stack(
        [centroids(twin, twin.spots, light, frames, generator) for light in twin.light]
    )
    single = twin.transform(found[0])
    zero = mean_rotation(single)
    errors = misalignment_angles(transpose(single) @ zero)
    return Series(found, errors, twin.misalignment(found[1], zero))


@studied(
    "chen2023/misfit",
    given=(*BENCH, f"{effectiveness.TABLE}#[15].position-y", effectiveness.LAST),
)
def misfit(given: Given) -> pd.DataFrame:
    """How far the printed spots lie from the designed lasers, within what the print leaves open."""
    common, diagonal = effectiveness.common_length(given, "y"), given[platform.DIAGONAL]
    least = diagonal - given.half_unit(platform.DIAGONAL)
    rows = []
    sizes = ((given[platform.TELESCOPE], diagonal), (common, diagonal), (common, least))
    for length, across in sizes:
        lasers = platform.designed_positions(platform.printed_spots(given), across)
        directions = emitted_directions(lasers, length)
        distance, scale = replace(bench(given), camera_directions=directions).misfit()
        pixels = distance / (given[platform.PIXEL] / given[platform.FOCAL_LENGTH])
        rows.append((length * 1e3, across * 1e3, scale, pixels, distance * length * 1e3))
    return misfit.frame(rows, diagonal=diagonal * 1e3)


# The TASTE test's level, and how far a laser is displaced to see whether the test notices, in px.
REFUSED, NUDGE = 0.01, 0.1


@studied(
    "chen2023/believable",
    random=True,
    given=READS,
    caption="The TASTE test of {frames} single frames of the twin, with {spots} spots and "
    f"{{freedom}} degrees of freedom. A frame is refused below a probability of {REFUSED:.0%}. The "
    "last column is the probability of a Kolmogorov–Smirnov test against the chi-square law.",
)
def believable(given: Given) -> pd.DataFrame:
    """Whether the frames of the second group pass the TASTE test, for several laser directions."""
    twin, frames = bench(given), given.count(accuracy.FRAMES)
    series = two_groups(twin, frames, default_rng(seed_of("chen2023/believable", given.root)))
    zero = series.spots[0].mean(axis=0)
    nudged = zero + NUDGE * np.eye(len(zero), 2)
    designed, scale = twin.camera_directions, twin.misfit()[1]
    pixel = given[platform.PIXEL] / given[platform.FOCAL_LENGTH]
    noise = np.sqrt((platform.scatter(given, 2) ** 2).mean(axis=-1)) * pixel
    rows = []
    for name, directions in (
        ("as designed, nominal numbers as they stand", designed),
        ("as designed, its size within what the print leaves open", designed * [scale, scale, 1.0]),
        ("as the first group saw them", twin.directions(zero)),
        (f"the same, one laser {NUDGE:g} px aside", twin.directions(nudged)),
    ):
        found = taste(solve(twin.directions(series.spots[1]), directions, noise**-2.0), noise)
        law = chi2(found.freedom.flat[0])
        refused = 100 * (found.probability < REFUSED).mean()
        agrees = kstest(found.statistic, law.cdf).pvalue
        rows.append((name, np.median(found.statistic), law.median(), refused, agrees))
    return believable.frame(rows, frames=frames, spots=len(zero), freedom=2 * len(zero) - 3)


# Sensors for the twin: read noise of some electrons, dark charge whose variance is as large, twelve
# bits at two electrons a step; and a full well of half the brightest pixel.
SENSORS = {
    "photon noise alone": PHOTONS,
    "read noise": Detector(read_noise=5.0),
    "read noise, dark charge, twelve bits": Detector(
        read_noise=5.0, dark_signal=25.0, gain=0.5, offset=100.0, bits=12
    ),
}
FULL = 0.5


@studied(
    "chen2023/sensors",
    random=True,
    given=(*READS, accuracy.SMOOTHED),
)
def sensors(given: Given) -> pd.DataFrame:
    """What the twin predicts with other sensors, the light fitted to Table III beside each."""
    many, frames = given.count(accuracy.SMOOTHED), 5 * given.count(accuracy.FRAMES)
    plain = bench(given)
    corners = window_corners(plain.spots, plain.window)
    windows = spot_windows(plain.spots, plain.light[1], plain.radius, corners, plain.window)
    filled = replace(plain, sensor=Detector(full_well=FULL * float(windows.max())))
    benches = {name: bench(given, sensor) for name, sensor in SENSORS.items()}
    rows = []
    for name, twin in (benches | {"pixels full at half the brightest": filled}).items():
        series = two_groups(twin, frames, default_rng(seed_of(f"sensor {name}", given.root)))
        spread = platform.SIGMAS * np.sqrt(series.spots.var(axis=1).mean())
        angles = [_spread(series.misalignment, count)[0] for count in (1, many)]
        rows.append((name, twin.light.mean(), spread, *angles))
    groups = [(platform.scatter(given, group) ** 2).mean() for group in (1, 2)]
    printed = platform.SIGMAS * float(np.sqrt(np.mean(groups)))
    return sensors.frame(rows, frames=frames, many=many, printed=printed)


def _spread(series: FloatArray, count: int) -> FloatArray:
    """Return 3σ of averages over some frames, about X or Y and about Z, in arcsec."""
    x, y, z = platform.SIGMAS * moving_average(series, count, axis=0).std(axis=0)
    return np.array([np.hypot(x, y) / np.sqrt(2), z]) * ARCSEC_PER_RADIAN


# Distances from the middle of the image, on the ground, for which the roll is studied.
OFF_CENTRE = (0.0, 1e3, 5e3, 10e3)


@studied(
    "chen2023/roll",
    random=True,
    given=(*BENCH, accuracy.SMOOTHED, *satellite.CAMERA),
    columns=(
        Column("Frames", ".0f"),
        Column("about X or Y (arcsec, 3σ)", ".2f"),
        Column("about Z (arcsec, 3σ)", ".1f"),
        *(Column(f"{off / 1e3:g} km off centre (m)", ".2f") for off in OFF_CENTRE),
    ),
)
def roll(given: Given) -> pd.DataFrame:
    """Roll error of the ground platform, and what it does on the ground away from the centre."""
    many, height = given.count(accuracy.SMOOTHED), satellite.altitude(given)
    generator = default_rng(seed_of("chen2023/roll", given.root))
    series = two_groups(bench(given), 40 * many, generator).misalignment
    rows = []
    for count in (1, many):
        spread = _spread(series, count)
        tilt, turn = spread / ARCSEC_PER_RADIAN
        moved = (np.hypot(np.sqrt(2) * tilt * height, turn * off) for off in OFF_CENTRE)
        rows.append((count, *spread, *moved))
    return roll.frame(rows, altitude=height / 1e3)
