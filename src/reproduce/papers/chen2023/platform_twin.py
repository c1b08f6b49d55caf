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
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator, default_rng
from numpy.typing import ArrayLike
from scipy.special import chdtr, chdtri

from reproduce.papers.chen2023 import (
    accuracy,
    effectiveness,
    platform,
    resolution,
    satellite,
)
from reproduce.papers.chen2023.attitude import towards
from reproduce.papers.chen2023.looks import LASER, STAR, lens, mirror, reflected
from reproduce.papers.declare import draws, seed_of
from reproduce.papers.sketch import (
    INK,
    arc,
    arrow,
    beside,
    box,
    canvas,
    key,
    label,
    line,
    path,
    sized,
    slim,
    turned,
)
from reproduce.papers.study import studied
from reproduce.papers.words import Column
from reproduce.physics.attitude import (
    attitude,
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
    stage_angle,
    stage_angles,
    taste,
)
from reproduce.physics.images import (
    Detector,
    centre_of_gravity,
    electrons,
    expose,
    render_frame,
    spot_windows,
    window_corners,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.store.stars import bright_stars
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
        moved = self.directions(self.spots) @ zero @ now.mT
        return received_spots(moved, *self.tracker)

    def misfit(self) -> tuple[float, float]:
        """Return how far the spots lie from the designed lasers, and their size over that of these.

        Root-mean-square distance after the best rotation, in radians; size of the pattern of
        directions.
        """
        patterns = received, emitted = self.directions(self.spots), self.camera_directions
        sizes = [np.linalg.norm(rows - rows.mean(axis=0)) for rows in patterns]
        misses = received - emitted @ attitude(received, emitted).T
        distance = np.linalg.norm(misses) / np.sqrt(len(self.spots))
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
    errors = misalignment_angles(single.mT @ zero)
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
    from scipy.stats import kstest  # only now: its import takes longer than all of this

    twin, frames = bench(given), given.count(accuracy.FRAMES)
    series = two_groups(twin, frames, default_rng(seed_of("chen2023/believable", given.root)))
    zero = series.spots[0].mean(axis=0)
    nudged, freedom = zero + NUDGE * np.eye(len(zero), 2), 2 * len(zero) - 3
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
        statistic, probability = taste(twin.directions(series.spots[1]), directions, noise)
        refused = 100 * (probability < REFUSED).mean()
        agrees = kstest(statistic, partial(chdtr, freedom)).pvalue
        rows.append((name, np.median(statistic), chdtri(freedom, 0.5), refused, agrees))
    return believable.frame(rows, frames=frames, spots=len(zero), freedom=freedom)


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
def _roll(given: Given) -> pd.DataFrame:
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
    return _roll.frame(rows, altitude=height / 1e3)


DESIGN = "chen2023/text-satellite"
ANGLES = tuple(f"{DESIGN}#{name}-angle" for name in ("boresight", "table", "dihedral"))
# Towards Orion, for no better reason than that everybody knows it: right ascension, declination,
# turn about the boresight, in degrees.
POINTING = (84.6, -0.4, 20.0)
FAINTEST = 6.0
# With the side on which there is room for the name.
NAMED = {1852: ("Mintaka", 1), 1903: ("Alnilam", -1), 1948: ("Alnitak", -1), 1899: ("Hatysa", -1)}
SERIES_READS = (*READS, accuracy.SMOOTHED, accuracy.DURATION)
STAGE_READS = (*SERIES_READS, f"{effectiveness.TABLE}#*.position-?", effectiveness.FRAMES)
MARGIN = 12


@draws("chen2023/fig-1c", given=platform.INSTRUMENT, marks=[platform.SPOTS])
def _draw_frame(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """A frame of the star and laser tracker: stars of the catalogue and the four laser spots."""
    from scipy.spatial.transform import Rotation  # only now: no judged number needs it

    alpha, delta, turn = POINTING
    turns = [alpha + 90.0, 90.0 - delta, turn]
    stars, inertial_from_tracker = bright_stars(), Rotation.from_euler("ZXZ", turns, degrees=True)
    rays = stars.directions @ inertial_from_tracker.as_matrix()
    ahead = (rays[:, 2] > 0.9) & (stars.magnitude <= FAINTEST)
    spots = received_spots(rays[ahead], *platform.tracker(door))
    inside = ((spots > 0) & (spots < door.array(platform.PIXELS) - 1)).all(axis=1)
    spots, seen = spots[inside], np.flatnonzero(ahead)[inside]
    gap = 28 if sized(figure, 6.0, 6.0, 4.2) else 16
    axes = figure.add_subplot()
    size = 5 * 1.7 ** (FAINTEST - stars.magnitude[seen])
    x, y = spots.T
    axes.scatter(x, y, s=size, color=STAR.colour, marker=STAR.marker, label="stars")
    for number, (name, side) in NAMED.items():
        for x, y in spots[stars.number[seen] == number]:
            ends = "left" if side > 0 else "right"
            axes.annotate(name, (x + gap * side, y), ha=ends, va="center", fontsize=9)
    _lasers(axes, _pairs(printed), 5, "laser spots, printed")
    axes.set(xlim=(-0.5, 1023.5), ylim=(1023.5, -0.5), aspect="equal")
    axes.set(xlabel="x (px)", ylabel="y (px)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.09), ncols=2)


def _pairs(printed: Mapping[str, float]) -> FloatArray:
    return np.array(list(printed.values())).reshape(-1, 2)


def _lasers(axes: Axes, places: FloatArray, size: float, name: str = "") -> None:
    axes.plot(*places.T, LASER.marker, markersize=size, color=LASER.colour, label=name)


@draws("chen2023/fig-6a", marks=[platform.DIAGONAL])
def draw_stage(figure: Figure, printed: Mapping[str, float]) -> None:
    """The stage that moves the lasers, and how the four lasers sit on it."""
    (diagonal,) = printed.values()
    axes = canvas(figure, 12.6, 7.6, narrow=(10.8, 9.4))
    narrow = slim(axes)
    centre = np.array([3.8, 5.7 if narrow else 3.8])
    box(axes, centre, (7.0, 7.0))
    label(axes, centre - 3.1, "stage", ha="left")
    corners = np.array([[0, 1], [1, 0], [0, -1], [-1, 0]]) * 2.4 + centre
    line(axes, np.vstack([corners, corners[:1]]), 0.7, ":")
    _lasers(axes, corners, 11)
    arrow(axes, beside(corners[3], 0.3, 0), corners[1] - [0.3, 0], style="<|-|>")
    label(axes, beside(centre, 0.0, 0.35), f"{diagonal * 1e3:g} mm")
    label(axes, beside(corners[0], 0.0, 0.55), "laser")
    corner = beside(centre, 4.3, -1.2)
    for index, (axis, gap, y) in enumerate((("X", 2.3, 1.5), ("Y", 2.35, 0.8))):
        along = np.eye(2)[index]
        arrow(axes, corner, corner + 2.0 * along)
        label(axes, corner + gap * along, axis)
        sense = towards(np.zeros(3), stage_angles(along, 1.0))
        text = f"towards {axis}: as if the camera turned about {sense}"
        label(axes, (0.3 if narrow else 7.5, y), text, ha="left", size=8)


@draws("chen2023/fig-6b", marks=ANGLES)
def draw_bench(figure: Figure, printed: Mapping[str, float]) -> None:
    """The ground platform: lasers, telescope, two mirrors at a right angle, tracker."""
    between, table, tilt = (float(np.degrees(printed[address])) for address in ANGLES)
    axes = canvas(figure, 16.0, 9.0, 6.8, (16.0, 11.2))
    below = 2.2 if slim(axes) else 0.0
    axes.set_ylim(-below, 9.0)
    box(axes, (0.8, 5.4), (0.7, 2.2))
    label(axes, (0.2, 3.8), "stage and lasers", ha="left")
    lens(axes, (4.6, 5.4), 2.6)
    label(axes, (4.6, 7.2), "telescope")
    label(axes, (10.3, 5.85), "camera's boresight")
    out, hit, back = turned([1.0, 0.0], between), np.array([8.6, 3.4]), np.array([-1.0, 0.0])
    path(axes, [(1.2, 5.4), (4.6, 5.4), (13.4, 5.4), (13.4, 3.4), hit], LASER)
    mirror(axes, (13.4, 5.4), 1.6, -45)
    mirror(axes, (13.4, 3.4), 1.6, 45)
    label(axes, (14.1, 4.4), "two mirrors\nat a right\nangle", ha="left")
    # The mirror stands at its tilt to the plane across the tracker's boresight.
    stands = between - 90 + tilt
    detector = hit + 3.0 * reflected(back, stands)
    mirror(axes, hit, 1.9, stands)
    path(axes, [hit, detector], LASER)
    lens(axes, hit - 1.6 * out, 1.6, between)
    box(axes, detector, (0.3, 1.4), turn=between)
    label(axes, beside(detector, 0.9, 0.9), "tracker", ha="left")
    path(axes, [hit + 4.4 * out, hit], STAR)
    label(axes, beside(hit + 4.4 * out, 0.2, 1.0), "tracker's boresight")
    arc(axes, hit, 1.2, (0, between), head=False)
    label(axes, beside(hit, 1.35, 1.4), f"{between:g}°")
    label(axes, (0.2, 1.1 - below), f"tracker against the table: {table:g}°", ha="left")
    label(axes, (0.2, 0.4 - below), f"mirror against the plane across it: {tilt:g}°", ha="left")
    key(axes, (LASER, STAR), (0.8, 1.0))


@cache
def groups(door: Given) -> Series:
    """Return the two groups of frames that Figures 8 and 9 show."""
    twin, frames = bench(door), door.count(accuracy.FRAMES)
    return two_groups(twin, frames, default_rng(seed_of("chen2023/fig-8", door.root)))


@cache
def ride(door: Given) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Run the test of Figure 10: the printed positions, one state after the other.

    Shape (frames,). Times, in seconds. Shape (frames, 2), twice. Angles about X and Y, in radians:
    reference, and as monitored by the mean of up to 100 frames before.
    """
    twin, frames = bench(door), door.count(effectiveness.FRAMES)
    places = door.array(f"{effectiveness.TABLE}#*.position-?").reshape(-1, 2)
    # A motion along one axis turns the camera about the other; the printed signs are kept.
    angles = np.zeros((len(places), 3))
    angles[:, :2] = stage_angle((places - places[0])[:, ::-1], door[platform.TELESCOPE])
    generator, spots = default_rng(seed_of("chen2023/fig-10b", door.root)), twin.turned(angles)
    found = centroids(twin, spots, twin.light[1], frames, generator)
    zero = mean_rotation(twin.transform(found[0]))
    single = twin.misalignment(found, zero).reshape(-1, 3)[:, :2]
    count, pace = door.count(accuracy.SMOOTHED), door[accuracy.DURATION] / door[accuracy.FRAMES]
    start = np.cumsum(single[: count - 1], axis=0) / np.arange(1, count)[:, np.newaxis]
    monitored = np.concatenate([start, moving_average(single, count, axis=0)])
    times = np.asarray(np.arange(len(single)) * pace, dtype=np.float64)
    return times, np.repeat(angles[:, :2], frames, axis=0), monitored


@draws("chen2023/fig-7", given=SERIES_READS, marks=["chen2023/text-platform#spot-*"], random=True)
def _draw_spots(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Image of the four laser spots in the tracker, rendered at the printed places."""
    twin = bench(door)
    corner = np.floor(twin.spots.min(axis=0)).astype(int) - MARGIN
    width, height = (np.ceil(twin.spots.max(axis=0)).astype(int) + MARGIN - corner).tolist()
    spots = twin.spots - corner
    mean = render_frame(spots, twin.light[0], twin.radius, (width, height))
    seen = expose(mean, Detector(), default_rng(seed_of("chen2023/fig-7", door.root)))
    left, top = corner - 0.5
    sized(figure, 6.4, 5.2, 3.2)
    figure.set_layout_engine("compressed")
    axes = figure.add_subplot()
    extent = (left, left + width, top + height, top)
    picture = axes.imshow(seen, extent=extent, cmap="gray", vmin=0.0)
    centres = _pairs(printed)
    axes.plot(*centres.T, "o", markersize=16, fillstyle="none", color="#D55E00", label="printed")
    for number, (x, y) in enumerate(centres, start=1):
        axes.annotate(f"{number}", (x + 2.5, y - 1.5), color="#E69F00")
    axes.grid(visible=False)
    axes.set(xlabel="x (px)", ylabel="y (px)")
    axes.legend(loc="upper right", labelcolor="#E69F00")
    figure.colorbar(picture, ax=axes, label="electrons per frame")


@draws(
    "chen2023/fig-8",
    given=SERIES_READS,
    marks=["chen2023/text-accuracy#transform-single-?"],
    random=True,
)
def _draw_transform(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Error of the laser transform over the first group, single frames and smoothed."""
    _series(figure, door, groups(door).transform, printed, "error (arcsec)")


@draws(
    "chen2023/fig-9",
    given=SERIES_READS,
    marks=["chen2023/text-accuracy#misalignment-single-?"],
    random=True,
)
def _draw_misalignment(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Monitored misalignment over the second group, single frames and smoothed.

    The bench stood differently in the second group, and the paper prints no number for it. A
    constant misalignment moves the whole series and leaves its scatter as it is; the twin has
    none, and the axis says that it counts from there.
    """
    _series(figure, door, groups(door).misalignment, printed, "angle, less offset (arcsec)")


def _series(
    figure: Figure, door: Given, angles: FloatArray, printed: Mapping[str, float], quantity: str
) -> None:
    count, frames = door.count(accuracy.SMOOTHED), np.arange(1, len(angles) + 1)
    narrow = sized(figure, 6.4, 3.4, 5.4)
    panels: list[Axes] = list(figure.subplots(*((2, 1) if narrow else (1, 2)), sharey=True))
    columns = zip(panels, "XY", angles.T[:2] * ARCSEC_PER_RADIAN, printed.values(), strict=True)
    for panel, axis, series, limit in columns:
        panel.plot(frames, series, ".", markersize=2.5, label="single frame")
        smoothed, name = moving_average(series, count), f"mean of {count}"
        panel.plot(frames[count - 1 :], smoothed, color=INK, linewidth=2.5, label=name)
        for side, limits in ((-1, "_"), (1, "printed, 3σ")):
            edge = series.mean() + side * limit * ARCSEC_PER_RADIAN
            panel.axhline(edge, color=INK, linestyle="--", linewidth=1, label=limits)
        panel.set(xlabel="frame", title=f"about {axis}")
    for panel in panels if narrow else panels[:1]:
        panel.set_ylabel(quantity)
    handles, across = panels[0].get_legend_handles_labels(), 2 if narrow else 3
    figure.legend(*handles, loc="outside lower center", ncols=across)


@draws("chen2023/fig-10a", marks=["chen2023/table-5#*.position-?"])
def _draw_pattern(figure: Figure, printed: Mapping[str, float]) -> None:
    """Motion pattern of the stage, its five states marked."""
    places = _pairs(printed) * 1e6
    axes = figure.add_subplot()
    axes.plot(*places.T, "--", linewidth=1)
    axes.plot(*places.T, "^", markersize=8, color="#D55E00")
    for state, (x, y) in enumerate(places, start=1):
        axes.annotate(f"state {state}", (x + 3.5, y - 4.0), fontsize=9)
    axes.set(xlabel="stage along X (µm)", ylabel="stage along Y (µm)", xlim=(0, 112), ylim=(0, 95))


@draws(
    "chen2023/fig-10b",
    given=STAGE_READS,
    marks=["chen2023/table-5#[2-5].monitoring-y"],
    random=True,
)
def _draw_about_y(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Monitored and reference angle about Y while the stage moves along X."""
    _ridden(figure, door, "Y", printed)


@draws(
    "chen2023/fig-10c",
    given=STAGE_READS,
    marks=["chen2023/table-5#[2-5].monitoring-x"],
    random=True,
)
def _draw_about_x(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Monitored and reference angle about X while the stage moves along Y."""
    _ridden(figure, door, "X", printed)


@draws("chen2023/fig-1d", given=STAGE_READS, random=True)
def _draw_example(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """One move of the stage, close up: the average follows the reference after its own length."""
    sized(figure, 6.4, 3.2, 2.8)
    _ridden(figure, door, "Y", {})


def _ridden(figure: Figure, door: Given, axis: str, marked: Mapping[str, float]) -> None:
    """Draw the whole test with the printed angles, or one move without any."""
    times, *angles = ride(door)
    each, axes = len(times) // len(effectiveness.STATES), figure.add_subplot()
    shown = slice(None) if marked else slice(each // 2, 2 * each)
    reference, monitored = (a[shown, "XY".index(axis)] * ARCSEC_PER_RADIAN for a in angles)
    axes.plot(times[shown], monitored, label="monitored" + " by the twin" * bool(marked))
    axes.plot(times[shown], reference, "--", label="reference" + ", (10)" * bool(marked))
    if marked:
        values = np.array(list(marked.values())) * ARCSEC_PER_RADIAN
        middles = times[each + each // 2 :: each]
        axes.plot(middles, values, "s", color=INK, label="monitored, printed")
    axes.set(xlabel="time (s)", ylabel=f"angle about {axis} (arcsec)")
    axes.legend()
