"""The experiment with the real camera and its twin in a simulation (niu2024, section 4.3).

The measured centroids are not published. The twin is the same camera, simulated from the printed
settings. What it takes from the paper:

* green spots follow (21) with the focal length and distortion of Table 4; red and blue ones are
  those that the registration of the paper, (17) and (18) with the four parameters of Table 4, lays
  over them;
* the test positions are directions at random, uniform over the printed field of view;
* what is left after registration, per axis and channel, measures the centroid errors: the printed
  residuals are inputs here, and split evenly between green and the other channel, so that both
  channels share the errors of green. The rotary table's own error moves all channels alike;
* the RMSE is printed per axis, so the literal reading computes it per axis; (26) counts both.

So the RMSE before registration is predicted, with the RMSE after it as an input. The RMSE after it
is little more than the centroid errors of the laboratory, which no other printed number states; it
stays blocked. As a stand-in it is computed with the noise of the simulation, which the paper calls
close to the real conditions.

The scale factors of Table 4 are not the ratios of the focal lengths beside them. The twin first had
the ratios; the printed factors came in when that result was known, because the paper registers
with them. Both are readings, and so are both ways to count the axes: all are judged.

The paper also fits a focal length and a distortion to every channel alone, whose closeness it takes
as support for its approximations. The twin does both fits many times, to show how well they can do;
nothing is judged with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.declare import (
    Blocked,
    Prediction,
    Results,
    draws,
    read,
    reproduces,
    seed_of,
    split_seed,
)
from reproduce.papers.niu2024 import registration, simulation
from reproduce.papers.niu2024.index import LOOKS, Place
from reproduce.papers.niu2024.simulation import CHANNELS, OPTICS, REGISTERED, SETTINGS, cameras_of
from reproduce.papers.sketch import arrow, box, diagram, joined, label, slim
from reproduce.papers.study import Fact, studied
from reproduce.papers.words import words
from reproduce.physics.optics import (
    Camera,
    angle_from_pixels,
    channel_centroids,
    fit_camera,
    noisy_centroids,
    spawned_angles,
    spawned_normals,
    starlight,
)
from reproduce.physics.registration import (
    Registration,
    RegistrationFit,
    fit_registration,
    rmse_per_axis,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

if TYPE_CHECKING:
    from matplotlib.axes import Axes


CALIBRATION = "niu2024/table-4"
OUTCOME = "niu2024/text-experiment"
_WORDS = words(OUTCOME)
_REPLICATES = 10_000
_ARRANGEMENT = (
    f"{CALIBRATION}#rotation.*",
    f"{CALIBRATION}#translation-*",
    f"{OPTICS}#pixel-pitch-x",
)
# The cameras of all channels, each by its own focal length and distortion.
CAMERAS = (
    f"{CALIBRATION}#focal-length.*",
    f"{CALIBRATION}#radial-distortion.*",
    *_ARRANGEMENT,
)
# The same, and how far the positions reach.
INSTRUMENT = (*CAMERAS, f"{OPTICS}#field-of-view-*")


@reproduces(
    CALIBRATION,
    cells=["scale.*"],
    given=[f"{CALIBRATION}#focal-length.*"],
    equations=["6"],
)
def scale_factors(given: Given) -> Results:
    """Scale factors: fitted to unpublished centroids; the ratios of focal lengths stand in."""
    centroids = (
        "the star centroids measured on the three detectors, to which scale factors and focal "
        "lengths are fitted apart; our stand-in is the ratio of the focal lengths"
    )
    ratios = registration.scale_factors(given, CALIBRATION)
    return {f"scale.{channel}": Blocked(centroids, ratio) for channel, ratio in ratios.items()}


@reproduces(CALIBRATION, cells=["rotation.*", "translation-*", "radial-distortion.*"])
def fitted_parameters(given: Given) -> Results:
    """Rotation, translation and distortion: fitted to centroids that are not published."""
    centroids = Blocked("the star centroids measured on the three detectors")
    rows = ("rotation", "translation-x", "translation-y", "radial-distortion")
    fitted = [f"{row}.{channel}" for row in rows for channel in REGISTERED]
    return dict.fromkeys([*fitted, "radial-distortion.green"], centroids)


def cameras(given: Given, channels: Sequence[str] = CHANNELS) -> list[Camera]:
    """Return the cameras of Table 4, image points counted from the green principal point."""
    return cameras_of(given, CALIBRATION, {c: _shift(given, c) for c in channels})


def _shift(given: Given, channel: str) -> list[float]:
    if channel == "green":
        return [0.0, 0.0]
    return [given[f"{CALIBRATION}#translation-{axis}.{channel}"] for axis in "xy"]


def rotations(given: Given) -> list[float]:
    """Return the detectors' calibrated angles against green: green, red, blue, in radians."""
    return [0.0, *(given[f"{CALIBRATION}#rotation.{channel}"] for channel in REGISTERED)]


def half_field(given: Given) -> tuple[float, float]:
    """Return half the printed field of view along x and y, in radians."""
    return given[f"{OPTICS}#field-of-view-x"] / 2, given[f"{OPTICS}#field-of-view-y"] / 2


def centroid_errors(given: Given) -> FloatArray:
    """Return the centroid errors that the printed residuals imply.

    Shape (3, 1, 2). Standard deviation by channel (green, red, blue) and axis, in px: green has
    half the mean squared residual, the others have what is then missing to their own. Raises
    ValueError where that is less than nothing.
    """
    after = np.array(
        [[given[f"{OUTCOME}#rmse-after-{c}-{axis}"] for axis in "xy"] for c in REGISTERED]
    )
    squares = np.square(after)
    green = squares.mean(axis=0) / 2
    for axis in np.flatnonzero((squares < green).any(axis=0)):
        red, blue = after[:, axis]
        raise ValueError(
            f"{OUTCOME}#rmse-after-red-{'xy'[axis]} = {red:.4g} px and "
            f"{OUTCOME}#rmse-after-blue-{'xy'[axis]} = {blue:.4g} px: expected neither to be more "
            "than √3 times the other; green's part, half of their mean square, would exceed the "
            "whole of the smaller one"
        )
    return np.asarray(np.sqrt(np.stack([green, *(squares - green)]))[:, None, :])


def registered_points(given: Given, angles: FloatArray) -> FloatArray:
    """Return green points, and those that the similarities of Table 4 lay over them.

    Shape (..., 3, n, 2). In px from the green principal point; channels green, red, blue.
    """
    green = channel_centroids(cameras(given, ["green"]), [0.0], angles)[..., 0, :, :]
    points = [green]
    for position, channel in enumerate(REGISTERED, start=1):
        # The source's principal point is the shift, as green's is the origin here.
        shift = _shift(given, channel)
        scale = given[f"{CALIBRATION}#scale.{channel}"]
        laid = Registration.similarity(scale, rotations(given)[position], shift, shift)
        points.append(laid.inverse().apply(green))
    return np.stack(points, axis=-3)


def _by_focal_lengths(given: Given, angles: FloatArray) -> FloatArray:
    """Return the points of the cameras of Table 4 in the same form, without its scale factors."""
    return channel_centroids(cameras(given), rotations(given), angles)


@reproduces(
    OUTCOME,
    cells=["rmse-before-*"],
    given=[
        *INSTRUMENT,
        f"{CALIBRATION}#scale.*",
        f"{OUTCOME}#test-points",
        f"{OUTCOME}#rmse-after-*",
    ],
    equations=["17", "18", "21"],
    replicates=_REPLICATES,
    options=_WORDS.options,
)
def rmse_before(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """RMSE before registration, from the calibrated registration and the printed residuals."""
    for_positions, for_errors = split_seed(seed, 2)
    count = given.count(f"{OUTCOME}#test-points")
    angles = spawned_angles(for_positions, replicates, count, half_field(given))
    errors = centroid_errors(given) * spawned_normals(for_errors, replicates, (3, count, 2))
    apart = {
        name: rmse_per_axis(measured[:, 1:], measured[:, :1])
        for name, measured in (
            ("factors", registered_points(given, angles) + errors),
            ("focal-lengths", _by_focal_lengths(given, angles) + errors),
        )
    }
    [(name, ways)] = _WORDS.readings.items()
    results = {}
    for (position, channel), (place, axis) in product(enumerate(REGISTERED), enumerate("xy")):
        readings = []
        for way in ways:
            x_and_y = apart[way.choices["scale"]][:, position]
            one = way.choices["rmse"] == "one"
            found = x_and_y[:, place] if one else np.hypot(*x_and_y.T)
            readings.append(read(way, Prediction(found)))
        results[f"{name}-{channel}-{axis}"] = Blocked(
            _WORDS.missing[name], readings=tuple(readings)
        )
    return results


@reproduces(
    OUTCOME,
    cells=["rmse-after-*"],
    given=[*INSTRUMENT, f"{SETTINGS}#noise"],
    equations=["17", "18"],
)
def rmse_after(given: Given) -> Results:
    """RMSE after registration: it needs centroid errors that are not published."""
    missing = "the centroid errors of the laboratory; our stand-in has the simulation's noise"
    half_x, half_y = half_field(given)
    grid = np.meshgrid(np.linspace(-half_x, half_x, 33), np.linspace(-half_y, half_y, 25))
    true = _by_focal_lengths(given, np.stack(grid, -1).reshape(-1, 2))
    results: dict[str, Blocked] = {}
    for position, channel in enumerate(REGISTERED, start=1):
        fit = fit_registration(true[position], true[0], _shift(given, channel))
        misfit = np.square(fit.residuals).mean(axis=0)
        expected = np.sqrt(misfit + 2 * given[f"{SETTINGS}#noise"] ** 2)
        for axis, value in zip("xy", expected, strict=True):
            results[f"rmse-after-{channel}-{axis}"] = Blocked(missing, float(value))
    return results


@reproduces(
    OUTCOME,
    cells=["pointing-error-*"],
    given=[
        f"{OUTCOME}#rmse-after-*",
        f"{OPTICS}#pixel-pitch-*",
        f"{CALIBRATION}#focal-length.green",
    ],
)
def pointing_errors(given: Given) -> Results:
    """Residuals in pixels as angles: they lie in the green image, so its focal length applies."""
    pitches = given.array(f"{OPTICS}#pixel-pitch-?")
    focal_length = given[f"{CALIBRATION}#focal-length.green"]
    results = {}
    for channel in REGISTERED:
        for axis, pitch in zip("xy", pitches, strict=True):
            residual = given[f"{OUTCOME}#rmse-after-{channel}-{axis}"]
            angle = angle_from_pixels(residual, pitch, focal_length)
            results[f"pointing-error-{channel}-{axis}"] = float(angle)
    return results


def calibrated_cameras(
    given: Given, seed: SeedSequence, replicates: int, error: float
) -> dict[str, Camera]:
    """Calibrate each channel's own camera on the twin, as the last two rows of Table 4 were.

    Channel to its calibrations, batch shape (replicates,).
    """
    table, noisy = _twin(given, seed, replicates, error)
    directions, pitch = starlight(table[:, 1], table[:, 0]), given[f"{OPTICS}#pixel-pitch-x"]
    return {
        channel: fit_camera(directions, noisy[:, position], pitch, rotations(given)[position])
        for position, channel in enumerate(CHANNELS)
    }


def registrations(
    given: Given, seed: SeedSequence, replicates: int, error: float
) -> dict[str, RegistrationFit]:
    """Register both channels with green on the twin, as the first rows of Table 4 were.

    The fit is the closed form, which is where the paper's iteration ends; its pivot is the spot at
    the zero position, as in section 3.2.

    Channel to its fits, batch shape (replicates,).
    """
    table, noisy = _twin(given, seed, replicates, error)
    [zero] = simulation.zero_places(table)
    return {
        channel: fit_registration(noisy[:, place], noisy[:, 0], noisy[:, place, zero])
        for place, channel in enumerate(REGISTERED, start=1)
    }


def _twin(
    given: Given, seed: SeedSequence, replicates: int, error: float
) -> tuple[FloatArray, FloatArray]:
    """Return the angles of the simulation, and what the twin measures there."""
    table = simulation.literal(given).angles
    return table, noisy_centroids(_by_focal_lengths(given, table), error, seed, replicates)


# Replicates of both kinds of fit, and how much of a printed residual is the error of one centroid.
_FITS = 1000
# Half the last digit of a scale factor; that of a focal length moves the ratio by far less.
_ROUNDING = 0.5e-4
_SHARES = {"half of them green's": np.sqrt(0.5), "all of them in every channel": 1.0}


def _scale_facts(given: Given) -> dict[str, Fact]:
    """What sentences say of the scale factors: how far each lies from the ratio, at both noises."""
    found = _scale_errors(given)
    far = found.groupby("Channel")["Distance (σ)"].agg(["min", "max"])
    return {
        f"{channel}-{end}": Fact(value, ".1f")
        for channel, ends in far.iterrows()
        for end, value in zip(("least", "most"), ends, strict=True)
    } | {"sd": Fact(found["Standard deviation in the twin"].max(), ".1e")}


@studied(
    "niu2024/scale-errors",
    given=(
        *CAMERAS,
        *simulation.ANGLES,
        f"{CALIBRATION}#scale.*",
        f"{OUTCOME}#rmse-after-*",
    ),
    named=_scale_facts,
    random=True,
)
def _scale_errors(given: Given) -> list[tuple[str, str, float, float, float]]:
    """How far scale factors and focal lengths fitted apart may differ."""
    seed = seed_of("niu2024/scale-errors", given.root)
    residual = float(np.sqrt(np.square(given.array(f"{OUTCOME}#rmse-after-*")).mean()))
    printed = registration.scale_factors(given, CALIBRATION)
    rows = []
    for name, share in _SHARES.items():
        cameras_found = calibrated_cameras(given, seed, _FITS, share * residual)
        found = registrations(given, seed, _FITS, share * residual)
        for channel in REGISTERED:
            lengths = (cameras_found[one].focal_length for one in ("green", channel))
            sd = float(np.std(found[channel].parameters[:, 0] - np.divide(*lengths)))
            apart = given[f"{CALIBRATION}#scale.{channel}"] - printed[channel]
            rows.append((channel, name, apart, sd, max(0.0, abs(apart) - _ROUNDING) / sd))
    return rows


@draws("niu2024/fig-5")
@diagram(17.2, 10.0, narrow=(10.0, 12.4))
def _draw_acquisition(axes: Axes) -> None:
    """Data acquisition: simulated starlight of a chosen band and magnitude, three images."""
    narrow = slim(axes)

    def placed(
        wide: Place, slender: Place, text: str = "", width: float = 1.3, style: str = "-"
    ) -> Place:
        """Draw a box where it stands on this page, and return its place."""
        place = slender if narrow else wide
        box(axes, *place, text, width=width, style=style)
        return place

    placed(((8.6, 6.45), (16.8, 6.5)), ((5.0, 7.6), (9.8, 9.4)), width=0.8)
    label(axes, (0.4, 11.9) if narrow else (0.6, 9.2), "dark room", ha="left", style="italic")
    star = placed(
        ((2.9, 6.3), (4.9, 2.2)),
        ((5.0, 10.5), (5.2, 1.8)),
        "single-star simulator:\nband and magnitude\ncan be chosen",
    )
    table = placed(((10.0, 6.3), (5.0, 4.4)), ((2.8, 6.3), (4.8, 3.6)), width=1.5)
    joined(axes, star, table)
    label(axes, (5.0, 8.8) if narrow else (6.4, 6.75), "starlight")
    label(axes, (2.8, 5.1) if narrow else (10.0, 8.95), "two-axis rotary table")
    camera = "3CMOS camera on\nthe middle frame"
    placed(((10.0, 6.3), (4.4, 2.0)), ((2.8, 6.6), (4.2, 1.6)), camera)
    images = placed(((14.9, 6.3), (3.6, 4.8)), ((8.0, 6.3), (3.2, 4.6)), style=":", width=0.8)
    (x, _), start = images[0], (5.2 if narrow else 12.5, 6.3)
    for look, y in zip(LOOKS.values(), (7.9, 6.3, 4.7), strict=True):
        box(axes, (x, y), (2.8, 1.0), f"{look.name} image", look)
        axes.plot([x + 1.25], [y], look.marker, color=look.colour, markersize=4)
        arrow(axes, start, (x - 1.4, y), look)
    course = placed(((10.0, 1.5), (3.6, 1.5)), ((2.8, 1.3), (3.4, 1.3)), "trajectory\nof the table")
    kept = placed(
        ((14.9, 1.5), (4.0, 1.5)), ((8.0, 1.3), (3.4, 1.3)), "spots and angles\nare recorded"
    )
    for one, other in ((course, table), (course, kept), (images, kept)):
        joined(axes, one, other)
