"""What the twin of the ground platform says beyond the printed tables (chen2023, V)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import default_rng
from scipy.stats import chi2, kstest

from reproduce.papers.chen2023 import accuracy, design, lasers, stage, twin
from reproduce.papers.declare import seed_of
from reproduce.papers.study import Study
from reproduce.physics.attitude.averaging import moving_average
from reproduce.physics.attitude.lasers import emitted_directions
from reproduce.physics.attitude.wahba import solve, taste
from reproduce.physics.ground.errors import altitude_for_resolution
from reproduce.physics.images.detector import Detector
from reproduce.physics.images.spots import spot_windows, window_corners
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.units import ARCSEC_PER_RADIAN, RADIANS_PER_ARCSEC

SMOOTHED = "chen2023/text-accuracy#smoothing-frames"
SATELLITE = (
    *(f"{design.SATELLITE}#panchromatic-{name}.value" for name in ("focal-length", "pixel-size")),
    f"{design.SATELLITE}#panchromatic-ground-resolution.value",
)
# Distances from the middle of the image, on the ground, for which the roll is told.
OFF_CENTRE = (0.0, 1e3, 5e3, 10e3)


def misfit() -> Study:
    """How far the printed spots lie from the designed lasers, within what the print leaves open."""
    door = given((*twin.READS, *stage.MEASURED))
    platform, printed = twin.bench(door), door.array(lasers.SPOTS).reshape(-1, 2)
    pixel = platform.tracker[1] / platform.tracker[2]
    nominal, common = door[stage.TELESCOPE], stage.common_length(door, "y")
    diagonal = door[lasers.DIAGONAL]
    least = diagonal - door.half_unit(lasers.DIAGONAL)
    rows = []
    for length, across in ((nominal, diagonal), (common, diagonal), (common, least)):
        lasers_there = lasers.designed_positions(printed, across)
        found = twin.misfit(
            replace(platform, camera_directions=emitted_directions(lasers_there, length))
        )
        rows.append(
            (
                f"{length * 1e3:.0f} mm, {across * 1e3:.1f} mm",
                f"{found['scale']:.3f}",
                f"{found['residual']:.2f}",
                f"{found['residual'] * pixel * length * 1e3:.2f}",
            )
        )
    head = ("Telescope, diagonal of the lasers", "spots' size over theirs", "distance (px, rms)",
            "the same on the stage (mm)")  # fmt: skip
    caption = (
        "Printed spots against designed lasers after the best rotation: with the nominal numbers "
        "as they stand, with the focal length that Table V asks for, and with the smallest "
        f"diagonal that prints as {diagonal * 1e3:.0f} mm."
    )
    return Study(caption, head, tuple(rows))


# The TASTE test's level, and how far a laser is displaced to see whether the test notices, in px.
REFUSED, NUDGE = 0.01, 0.1


def believable() -> Study:
    """Whether the frames of the second group pass the TASTE test, for several laser directions."""
    door = given(twin.READS)
    platform = twin.bench(door)
    frames = door.count(accuracy.FRAMES)
    series = twin.two_groups(platform, frames, default_rng(seed_of("chen2023/believable")))
    zero = series.spots[0].mean(axis=0)
    nudged = zero + NUDGE * np.eye(len(zero), 2)
    shrunk = platform.camera_directions * np.array([*[twin.misfit(platform)["scale"]] * 2, 1.0])
    rows = tuple(
        (name, *_tasted(platform, series.spots[1], directions, door))
        for name, directions in (
            ("as designed, nominal numbers as they stand", platform.camera_directions),
            ("as designed, its size within what the print leaves open", shrunk),
            ("as the first group saw them", platform.directions(zero)),
            (f"the same, one laser {NUDGE:g} px aside", platform.directions(nudged)),
        )
    )
    head = ("Laser directions", "median of the statistic", "expected", f"refused at {REFUSED:.0%}",
            "agrees with the law")  # fmt: skip
    caption = (
        f"The TASTE test of {frames} single frames of the twin, with {len(zero)} spots and "
        f"{2 * len(zero) - 3} degrees of freedom. The last column is the probability of a "
        "Kolmogorov–Smirnov test against the chi-square law."
    )
    return Study(caption, head, rows)


def _tasted(
    platform: twin.Bench, spots: FloatArray, directions: FloatArray, door: Given
) -> tuple[str, ...]:
    """Return the columns of one row: what the TASTE test says of all frames."""
    pixel = platform.tracker[1] / platform.tracker[2]
    scatter = np.sqrt((lasers.scatter(door, 2) ** 2).mean(axis=-1)) * pixel
    found = taste(solve(platform.directions(spots), directions, scatter**-2.0), scatter)
    law = chi2(found.freedom.flat[0])
    return (
        f"{np.median(found.statistic):.3g}",
        f"{law.median():.3g}",
        f"{(found.probability < REFUSED).mean():.1%}",
        f"{kstest(found.statistic, law.cdf).pvalue:.2g}",
    )


# Sensors for the twin: read noise of some electrons, dark charge whose variance is as large, twelve
# bits at two electrons a step; and a full well of half the brightest pixel.
READ_NOISE, BITS, GAIN = 5.0, 12, 0.5
SENSORS = {
    "photon noise alone": twin.PHOTONS,
    "read noise": Detector(read_noise=READ_NOISE),
    "read noise, dark charge, twelve bits": Detector(
        read_noise=READ_NOISE, dark_signal=READ_NOISE**2, gain=GAIN, offset=100.0, bits=BITS
    ),
}
FULL = 0.5


def sensors() -> Study:
    """What the twin predicts with other sensors, the light fitted to Table III beside each."""
    door = given((*twin.READS, SMOOTHED))
    many, frames = door.count(SMOOTHED), 5 * door.count(accuracy.FRAMES)
    plain = twin.bench(door)
    corners = window_corners(plain.spots, plain.window)
    windows = spot_windows(plain.spots, plain.light[1], plain.radius, corners, plain.window)
    filled = replace(plain, sensor=Detector(full_well=FULL * float(windows.max())))
    benches = {name: twin.bench(door, sensor) for name, sensor in SENSORS.items()}
    rows = []
    for name, platform in (benches | {"pixels full at half the brightest": filled}).items():
        series = twin.two_groups(platform, frames, default_rng(seed_of(f"sensor {name}")))
        spread = lasers.SIGMAS * np.sqrt(series.spots.var(axis=1).mean())
        angles = [
            lasers.SIGMAS * moving_average(series.misalignment, count, axis=0).std(axis=0)[:2]
            for count in (1, many)
        ]
        said = [f"{np.hypot(*pair) / np.sqrt(2) * ARCSEC_PER_RADIAN:.3f}" for pair in angles]
        rows.append((name, f"{platform.light.mean():.0f}", f"{spread:.4f}", *said))
    printed = lasers.SIGMAS * np.sqrt(
        np.mean([(lasers.scatter(door, group) ** 2).mean() for group in (1, 2)])
    )
    head = ("Sensor", "light of a spot (electrons)", "scatter of a spot (px, 3σ)",
            "about X or Y (arcsec, 3σ)", f"mean of {many} frames (arcsec, 3σ)")  # fmt: skip
    caption = (
        f"The twin with other sensors, {frames} frames each. Table III has a scatter of "
        f"{printed:.4f} px in the mean square; the light is fitted to it in all rows but the last."
    )
    return Study(caption, head, tuple(rows))


def roll() -> Study:
    """Roll error of the ground platform, and what it does on the ground away from the centre."""
    door = given((*twin.READS, SMOOTHED, *SATELLITE))
    many = door.count(SMOOTHED)
    series = twin.two_groups(
        twin.bench(door), 40 * many, default_rng(seed_of("chen2023/roll"))
    ).misalignment
    height = altitude(door)
    rows = []
    for count in (1, many):
        spread = lasers.SIGMAS * moving_average(series, count, axis=0).std(axis=0)
        across = float(np.hypot(*spread[:2])) * height
        moved = [f"{np.hypot(across, spread[2] * off):.2f}" for off in OFF_CENTRE]
        arcsec = spread * ARCSEC_PER_RADIAN
        angles = (f"{np.hypot(*arcsec[:2]) / np.sqrt(2):.2f}", f"{arcsec[2]:.1f}")
        rows.append((f"{count}", *angles, *moved))
    head = (
        "Frames",
        "about X or Y (arcsec, 3σ)",
        "about Z (arcsec, 3σ)",
        *(f"{off / 1e3:g} km off centre (m)" for off in OFF_CENTRE),
    )
    caption = (
        "Errors of the monitored misalignment with the spots of the ground platform, and the "
        f"three-sigma shift on the ground from {height / 1e3:.0f} km altitude."
    )
    return Study(caption, head, tuple(rows))


def altitude(door: Given) -> float:
    """Return the altitude that the panchromatic line of Table I implies, in metres."""
    focal, pixel, resolution = (door[address] for address in SATELLITE)
    return float(altitude_for_resolution(focal, pixel, resolution))


@dataclass(frozen=True, eq=False)
class CommonLength:
    """One focal length fitted to monitored angles that share their zero point.

    Attributes
    ----------
    length : float
        In metres.
    error : float
        Its standard deviation, in metres.
    chi_square : float
        Of the rows about it.
    freedom : int
        Rows less one.
    """

    length: float
    error: float
    chi_square: float
    freedom: int


def common_length(motions: FloatArray, angles: FloatArray, sigma: float) -> CommonLength:
    """Fit one focal length to angles that each carry the noise of the same zero state."""
    covariance = sigma**2 * (np.eye(len(angles)) + 1.0)
    inverse = np.linalg.inv(covariance)
    information = float(motions @ inverse @ motions)
    slope = -float(motions @ inverse @ angles) / information
    away = angles + slope * motions
    error = float(np.sqrt(1.0 / information))
    return CommonLength(
        length=1.0 / slope,
        error=error / slope**2,
        chi_square=float(away @ inverse @ away),
        freedom=len(angles) - 1,
    )


def focal_lengths() -> Study:
    """Focal lengths that the rows of Table V imply, as printed and with the columns exchanged."""
    door = given((f"{stage.TABLE}#*", *lasers.READS, lasers.SCATTER, stage.FRAMES))
    rows = []
    for axis, turn in stage.TURNS.items():
        motions = {name: _motions(door, name) for name in stage.TURNS}
        other = motions[turn]
        for index, state in enumerate(stage.MOVED):
            angle = door[f"{stage.TABLE}#{state}.reference-{turn}"]
            found = [-m[index] / np.tan(angle) for m in (motions[axis], other)]
            rounding = _rounding(found[0], motions[axis][index], angle)
            said = [f"{value * 1e3:.1f} ± {rounding * 1e3:.1f}" for value in found]
            rows.append((f"reference about {turn.upper()}, state {state}", *said))
        sigma = stage.state_noise(door, turn)
        angles = np.array([door[f"{stage.TABLE}#{s}.monitoring-{turn}"] for s in stage.MOVED])
        fits = [common_length(m, angles, sigma) for m in (motions[axis], other)]
        said = [f"{f.length * 1e3:.1f} ± {f.error * 1e3:.1f} ({f.chi_square:.1f})" for f in fits]
        rows.append((f"all monitored about {turn.upper()} (χ² of {fits[0].freedom})", *said))
    caption = (
        "Focal length implied by Table V, in mm: by reference angles (± rounding of the print) and "
        "by all monitored angles of an axis together (± noise, the shared zero point included). "
        "Motions are differences of the printed positions, which mends the one digit."
    )
    head = ("Angle", "with the motion of its own axis", "with that of the other")
    return Study(caption, head, tuple(rows))


def _motions(door: Given, axis: str) -> FloatArray:
    """Return the motions as differences of the printed positions, which mends the one digit."""
    places = np.array([door[f"{stage.TABLE}#{s}.position-{axis}"] for s in stage.STATES])
    return np.asarray(places[1:] - places[0])


def _rounding(length: float, motion: float, angle: float) -> float:
    """Return half the width of focal lengths that the rounding of both numbers allows."""
    # A motion is the difference of two positions, each printed to a hundredth of a micrometre.
    half_motion, half_angle = 1e-8, 0.0005 * RADIANS_PER_ARCSEC
    return abs(length) * (half_motion / abs(motion) + half_angle / abs(angle))
