"""The satellite's camera and the monitoring system as designed, its light traced (chen2023, I-II).

The light goes through `physics.raytrace` from the focal plane of the ground platform's telescope
to the tracker's detector, and the spots are solved as the paper solves them. Every error is
therefore the turn or roll of the camera that the system would report. A third reflection mirrors
the image, and the designed pattern is then mirrored too, because no rotation would fit otherwise.
The paper does not print the beam: it is 0.2 m wide here, and returns 1 m next to the camera.

II-B describes the effects of heat in words. Its numbers limit the motion of the lasers and the turn
of the dichroic mirror whose effect equals the error of the monitoring: the three-sigma accuracy of
the averaged misalignment.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from reproduce.papers.charts import Look, sized
from reproduce.papers.chen2023 import platform
from reproduce.papers.declare import Fact, Results, draws, reproduces, studied
from reproduce.physics import attitude, ground
from reproduce.physics.optics import field_of_view
from reproduce.physics.raytrace import (
    RETROREFLECTORS,
    LightPath,
    fold_mirror_tilt,
    reflection,
    turn_response,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.figure import Figure

SATELLITE = "chen2023/table-1"
_TEXT = "chen2023/text-satellite"
# Panchromatic camera: focal length, pixel size, ground resolution.
CAMERA = tuple(
    f"{SATELLITE}#panchromatic-{name}.value"
    for name in ("focal-length", "pixel-size", "ground-resolution")
)
BORESIGHT = f"{_TEXT}#boresight-angle"
_RATIO = f"{_TEXT}#focal-ratio"
_EXPANSION = "chen2023/text-hardware#expansion-coefficient"
_ACCURACY = "chen2023/table-4#100.misalignment-?"
_LASERS = (platform.SPOTS, platform.DIAGONAL, platform.TELESCOPE)
_LIGHT_PATH = (*_LASERS, platform.FOCAL_LENGTH, BORESIGHT)
# Roll of the tracker about the camera's boresight on the bench: assumed, the paper prints none.
_TRACKER_ROLL = np.pi / 4
_TEST_TURN = 10 * RADIANS_PER_ARCSEC
# Points around the edge of the beam in the camera's lens, in metres.
_AROUND = 2.0 * np.pi * (np.arange(36) + 0.5) / 36
_APERTURE = 0.1 * np.stack([np.cos(_AROUND), np.sin(_AROUND)], axis=-1)
# A smaller fraction of a turn is rounding noise.
_ROUNDING_FACTOR = 1e-9
_PIXELS = f"{platform.PLATFORM}#tracker-pixels-x.value"
_FIELD = f"{SATELLITE}#tracker-field-of-view-x.value"
_FILTER = "chen2023/text-hardware#filter-wavelength"
_BANDS = tuple(
    f"{_TEXT}#{light}-{end}"
    for light in ("transmission", "reflection")
    for end in ("low", "high")
)


LASER = Look("laser", "#D55E00", "--", "s")
STAR = Look("starlight", "#009E73", "-.", "o")


def altitude(inputs: Inputs) -> float:
    """Return the altitude that the panchromatic line of Table I implies, in metres."""
    return float(
        ground.altitude_for_resolution(*(inputs[address] for address in CAMERA))
    )


@reproduces(
    SATELLITE,
    cells=["multispectral-ground-resolution.value"],
    inputs=[
        f"{SATELLITE}#*focal-length.value",
        f"{SATELLITE}#*pixel-size.value",
        CAMERA[2],
    ],
)
def ground_resolution(inputs: Inputs) -> Results:
    """Multispectral ground resolution at the altitude that the panchromatic one implies."""
    focal, pixel = (
        inputs[f"{SATELLITE}#multispectral-{name}.value"]
        for name in ("focal-length", "pixel-size")
    )
    resolution = ground.ground_resolution(focal, pixel, altitude(inputs))
    return {"multispectral-ground-resolution.value": float(resolution)}


@reproduces(
    _TEXT,
    cells=["focal-ratio"],
    inputs=[CAMERA[0], platform.FOCAL_LENGTH, platform.PIXEL, _PIXELS, _FIELD],
)
def focal_ratio(inputs: Inputs, *, tracker: str) -> Results:
    """Focal length of the camera over that of the tracker, whose own is not printed."""
    focal = inputs[platform.FOCAL_LENGTH]
    if tracker == "table-1-field":
        focal = (
            inputs[_PIXELS] * inputs[platform.PIXEL] / 2 / np.tan(inputs[_FIELD] / 2)
        )
    return {"focal-ratio": float(inputs[CAMERA[0]] / focal)}


@reproduces(_TEXT, cells=["dihedral-angle"], inputs=[BORESIGHT])
def dichroic_tilt(inputs: Inputs) -> Results:
    """Tilt of the dichroic mirror that folds the retro-reflected laser into the tracker."""
    return {"dihedral-angle": float(fold_mirror_tilt(inputs[BORESIGHT]))}


@reproduces(_TEXT, cells=["table-angle"], inputs=[BORESIGHT])
def table_angle(inputs: Inputs) -> Results:
    """Angle of the tracker's boresight above the optical table, rolled by an assumed 45 degrees.

    The camera is assumed level. The tracker's boresight makes the supplement of the printed
    boresight angle with the camera's axis. It is rolled about that axis out of the table, which
    multiplies the sine of its elevation by the sine of the roll. The paper prints neither the
    roll nor the level of the camera.
    """
    sine = np.sin(np.pi - inputs[BORESIGHT]) * np.sin(_TRACKER_ROLL)
    return {"table-angle": float(np.arcsin(sine))}


def _believed(
    rest: LightPath, is_mirrored: bool, points: FloatArray, **changes: Any
) -> FloatArray:
    """Return the turn of the camera that the system reports when the light path changes.

    Shape (3,). Angles about X, Y and Z of the camera, in radians.
    """
    designed = points * [1.0, -1.0 if is_mirrored else 1.0]
    camera = attitude.emitted_directions(designed, rest.camera_focal_length)
    zero, now = (
        attitude.received_directions(
            light.spots(points, _APERTURE).mean(axis=1),
            (0.0, 0.0),
            1.0,
            light.tracker_focal_length,
        )
        for light in (rest, replace(rest, **changes))
    )
    transform = attitude.laser_transform(camera, zero)
    return attitude.misalignment_angles(attitude.misalignment(camera, now, transform))


@studied(
    "chen2023/retro-reflectors",
    inputs=(*_LIGHT_PATH, platform.PIXEL),
)
def _retro_reflectors(inputs: Inputs) -> Iterator[tuple[str | float, ...]]:
    """Turns of the camera that a turn of the retro-reflector mimics, for three kinds of it."""
    points = platform.lasers(inputs)
    lengths = inputs[platform.TELESCOPE], inputs[platform.FOCAL_LENGTH]
    for kind, train in RETROREFLECTORS.items():
        # An odd number of reflections mirrors the image.
        is_mirrored = train is None or np.linalg.det(train) < 0
        rest = LightPath(*lengths, inputs[BORESIGHT], train)
        shares: list[float] = []
        for turn in _TEST_TURN * np.eye(3):
            x, y, z = _believed(rest, is_mirrored, points, turn=turn) / _TEST_TURN
            shares += [np.hypot(x, y), abs(z)]
        tilted = _believed(
            rest, is_mirrored, points, camera_turn=[_TEST_TURN, 0.0, 0.0]
        )
        spots = rest.spots(points, _APERTURE)
        blur = np.linalg.norm(spots - spots.mean(axis=1, keepdims=True), axis=-1).max()
        image = "mirrored" if is_mirrored else "upright"
        yield (
            kind,
            *shares,
            abs(tilted[2]) / _TEST_TURN,
            blur / inputs[platform.PIXEL],
            image,
        )


def _bench_facts(inputs: Inputs) -> dict[str, Fact]:
    """Return the assumed roll of the bench."""
    return {"assumed-roll": Fact(f"{np.degrees(_TRACKER_ROLL):.0f}°")}


@studied(
    "chen2023/dichroic",
    inputs=(BORESIGHT, _ACCURACY, _EXPANSION),
    named=_bench_facts,
)
def _dichroic(inputs: Inputs) -> Iterator[tuple[str, float, float, float]]:
    """Turn of the camera that a tilt of the dichroic mirror mimics, and the tolerance."""
    accuracy = float(inputs.array(_ACCURACY).max())
    factors = np.linalg.norm(_dichroic_response(inputs[BORESIGHT]), axis=0)
    axes = ("in the plane of the light", "across it", "its normal")
    for axis, factor in zip(axes, factors, strict=True):
        turn = accuracy / factor if factor > _ROUNDING_FACTOR else np.inf
        yield (axis, factor, turn / RADIANS_PER_ARCSEC, turn / inputs[_EXPANSION])


def _dichroic_response(boresight_angle: float) -> FloatArray:
    """Return the derivative of the folded light by turns of the mirror about its own axes, (3, 3).

    Columns: about the axis in the mirror and in the plane of the light, about the axis in the
    mirror across that plane, about the mirror's normal.
    """
    normal = LightPath(1.0, 1.0, boresight_angle, None).fold
    # The plane of the light is that of both boresights, across X.
    across = np.array([1.0, 0.0, 0.0])
    axes = np.stack([np.cross(across, normal), across, normal], axis=-1)
    return np.asarray(turn_response(reflection(normal), [0.0, 0.0, -1.0]) @ axes)


@studied(
    "chen2023/heat",
    inputs=(
        *(CAMERA[0], *platform.TRACKER, platform.TELESCOPE, platform.DIAGONAL),
        *(_RATIO, _PIXELS, _ACCURACY, _EXPANSION),
    ),
)
def _heat(inputs: Inputs) -> Iterator[tuple[str | float, ...]]:
    """Effects of thermal motion of the lasers, in flight and on the bench."""
    flight, short = inputs[CAMERA[0]], inputs[platform.FOCAL_LENGTH]
    accuracy = float(inputs.array(_ACCURACY).max())
    for name, camera, tracker in (
        ("flight, as printed", flight, flight / inputs[_RATIO]),
        ("flight camera with the tracker of Table II", flight, short),
        ("ground platform", inputs[platform.TELESCOPE], short),
    ):
        view = field_of_view(inputs[_PIXELS], inputs[platform.PIXEL], tracker)
        angle = 1e-6 / camera / RADIANS_PER_ARCSEC
        motion = accuracy * camera
        kelvin = motion / (inputs[_EXPANSION] * inputs[platform.DIAGONAL])
        lengths = (camera / tracker, tracker * 1e3, np.degrees(float(view)))
        yield (name, *lengths, angle, motion * 1e6, kelvin)


@draws("chen2023/fig-3c", marks=[*_BANDS, _FILTER])
def _draw_filters(figure: Figure, printed: Mapping[str, float]) -> None:
    """Bands of the dichroic mirror and of the band-pass filter."""
    *bands, passed = (printed[address] * 1e9 for address in (*_BANDS, _FILTER))
    sized(figure, 6.4, 2.2)
    axes = figure.add_subplot()
    # The width of the filter is not printed: a mark stands for its band.
    axes.plot(passed, 0, LASER.marker, color=LASER.colour)
    for row, ends, look in ((1, bands[2:], LASER), (2, bands[:2], STAR)):
        axes.plot(ends, [row, row], look.line, color=look.colour, linewidth=4)
    axes.set_yticks([0, 1, 2], ["filter passes", "mirror reflects", "mirror transmits"])
    axes.set(xlabel="wavelength (nm)", ylim=(-0.5, 2.5))
