"""The satellite's camera and the monitoring system as designed, its light traced (chen2023, I-II).

The light goes through `physics.light_path` from the focal plane of the ground platform's telescope
to the tracker's detector, and the spots are solved as the paper solves them. So every error is the
turn of the camera, or its roll, that the system would believe. Where a third reflection mirrors the
image, the designed pattern is mirrored too; nothing could be solved otherwise. What the paper does
not print: the beam is a fifth of a metre wide, and returns a metre beside the camera.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from reproduce.papers.chen2023 import platform
from reproduce.papers.declare import Blocked, Results, reproduces
from reproduce.papers.study import Column, studied
from reproduce.physics.attitude.lasers import emitted_directions, received_directions
from reproduce.physics.attitude.misalignment import (
    laser_transform,
    misalignment,
    misalignment_angles,
)
from reproduce.physics.attitude.rotations import rotation_from_vector
from reproduce.physics.ground import errors
from reproduce.physics.light import raytrace
from reproduce.physics.light.light_path import LightPath, light_path
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import RADIANS_PER_ARCSEC

__all__ = [
    "ACCURACY",
    "BORESIGHT",
    "CAMERA",
    "EXPANSION",
    "LIGHT_PATH",
    "SATELLITE",
    "TEXT",
    "TURN",
    "altitude",
    "believed",
    "bench_path",
    "dichroic_response",
]

SATELLITE = "chen2023/table-1"
TEXT = "chen2023/text-satellite"
# Of the panchromatic camera: focal length, pixel size, ground resolution.
CAMERA = tuple(
    f"{SATELLITE}#panchromatic-{name}.value"
    for name in ("focal-length", "pixel-size", "ground-resolution")
)
BORESIGHT = f"{TEXT}#boresight-angle"
EXPANSION = "chen2023/text-hardware#expansion-coefficient"
ACCURACY = "chen2023/table-4#100.misalignment-?"
LIGHT_PATH = (
    platform.SPOTS,
    platform.DIAGONAL,
    platform.TELESCOPE,
    platform.FOCAL_LENGTH,
    BORESIGHT,
)
OUT = np.array([0.0, 0.0, 1.0])
TURN = 10 * RADIANS_PER_ARCSEC
# Rays around the edge of the beam, and its radius in metres.
RAYS, BEAM = 36, 0.1
# What each retro-reflector makes of the image: an odd number of reflections mirrors it.
IMAGE = {
    "corner cube": "mirrored",
    "two mirrors at a right angle": "upright",
    "conical mirror": "mirrored",
}
# Shares of a turn below this are rounding noise.
NOISE = 1e-9


def altitude(given: Given) -> float:
    """Return the altitude that the panchromatic line of Table I implies, in metres."""
    return float(errors.altitude_for_resolution(*(given[address] for address in CAMERA)))


@reproduces(
    SATELLITE,
    cells=["multispectral-ground-resolution.value"],
    given=[
        f"{SATELLITE}#*focal-length.value",
        f"{SATELLITE}#*pixel-size.value",
        f"{SATELLITE}#panchromatic-ground-resolution.value",
    ],
)
def ground_resolution(given: Given) -> Results:
    """Multispectral ground resolution at the altitude that the panchromatic one implies."""
    resolution = errors.ground_resolution(
        given[f"{SATELLITE}#multispectral-focal-length.value"],
        given[f"{SATELLITE}#multispectral-pixel-size.value"],
        altitude(given),
    )
    return {"multispectral-ground-resolution.value": float(resolution)}


@reproduces(TEXT, cells=["focal-ratio"], given=[CAMERA[0], platform.FOCAL_LENGTH])
def focal_ratio(given: Given) -> Results:
    """Camera's focal length over the tracker's, with the ground tracker standing in."""
    missing = "the focal length of the flight tracker; the ground tracker's stands in"
    return {"focal-ratio": Blocked(missing, given[CAMERA[0]] / given[platform.FOCAL_LENGTH])}


@reproduces(TEXT, cells=["dihedral-angle"], given=[BORESIGHT])
def dichroic_tilt(given: Given) -> Results:
    """Tilt of the dichroic mirror that folds the retro-reflected laser into the tracker."""
    return {"dihedral-angle": float(raytrace.fold_mirror_tilt(given[BORESIGHT]))}


def aperture() -> FloatArray:
    """Return points around the edge of the beam in the camera's lens, in metres."""
    around = 2.0 * np.pi * (np.arange(RAYS) + 0.5) / RAYS
    return BEAM * np.stack([np.cos(around), np.sin(around)], axis=-1)


def bench_path(given: Given, kind: str) -> LightPath:
    """Return the light path of the ground platform with one kind of retro-reflector."""
    lengths = given[platform.TELESCOPE], given[platform.FOCAL_LENGTH]
    return light_path(kind, *lengths, given[BORESIGHT])


def believed(
    rest: LightPath, kind: str, points: FloatArray, shifts: FloatArray | float = 0.0, **changes: Any
) -> FloatArray:
    """Return the turn of the camera that the system believes when lasers or light path change.

    Shape (3,). Angles about X, Y and Z of the camera, in radians.
    """
    mirror = [1.0, -1.0 if IMAGE[kind] == "mirrored" else 1.0]
    camera = emitted_directions(points * mirror, rest.camera_focal_length)
    zero, now = (
        received_directions(
            light.spots(where, aperture()).mean(axis=1), (0.0, 0.0), 1.0, light.tracker_focal_length
        )
        for light, where in ((rest, points), (replace(rest, **changes), points + shifts))
    )
    return misalignment_angles(misalignment(camera, now, laser_transform(camera, zero)))


AXES = ("X (across the edge)", "Y (along the edge)", "Z (the beam)")


@studied(
    "chen2023/retro-reflectors",
    given=(*LIGHT_PATH, platform.PIXEL),
    columns=(
        Column("Retro-reflector"),
        *(
            Column(f"{what} from a turn about {axis}", ".2f")
            for axis in AXES
            for what in ("tilt", "roll")
        ),
        Column("roll from a tilt of the camera", ".2f"),
        Column("blur (px)", ".2f"),
        Column("image"),
    ),
    caption="Tilt and roll of the camera that the system believes, for one unit of turn of the "
    "retro-reflector, from traced spots. The edge of the two mirrors lies along Y; the beam goes "
    "to and fro along X, to both sides of the axis of the cone.",
)
def retro_reflectors(given: Given) -> list[tuple[str | float, ...]]:
    """What turns of the retro-reflector make the system believe, for three kinds of it."""
    points = platform.lasers(given)
    rows: list[tuple[str | float, ...]] = []
    for kind, image in IMAGE.items():
        rest = bench_path(given, kind)
        shares: list[float] = []
        for turn in TURN * np.eye(3):
            turned = replace(rest.retroreflector, turn=turn)
            x, y, z = believed(rest, kind, points, retroreflector=turned) / TURN
            shares += [np.hypot(x, y), abs(z)]
        roll = abs(believed(rest, kind, points, camera_turn=[TURN, 0.0, 0.0])[2]) / TURN
        spots = rest.spots(points, aperture())
        blur = np.linalg.norm(spots - spots.mean(axis=1, keepdims=True), axis=-1).max()
        rows.append((kind, *shares, roll, blur / given[platform.PIXEL], image))
    return rows


@studied(
    "chen2023/dichroic",
    given=(BORESIGHT, ACCURACY, EXPANSION),
    columns=(
        Column("Turn of the mirror about"),
        Column("error per unit of turn", ".3f", zero=NOISE),
        Column("turn as large as the accuracy (arcsec)", ".3f"),
        Column("difference of temperature that makes it (K)", ".2f"),
    ),
    caption="Tolerance of the dichroic mirror, for the three-sigma accuracy of a hundred frames. "
    "The temperature is that between two sides of a support as high as it is wide.",
)
def dichroic(given: Given) -> list[tuple[str, float, float, float]]:
    """How much a tilt of the dichroic mirror mimics, and the tolerance that follows."""
    accuracy = float(given.array(ACCURACY).max())
    axes = ("in the plane of the light", "across it", "its normal")
    rows = []
    factors = np.linalg.norm(dichroic_response(given[BORESIGHT]), axis=0)
    for axis, factor in zip(axes, factors, strict=True):
        turn = accuracy / factor if factor > NOISE else np.inf
        rows.append((axis, factor, turn / RADIANS_PER_ARCSEC, turn / given[EXPANSION]))
    return rows


def dichroic_response(boresight_angle: float) -> FloatArray:
    """Return how the folded light answers to turns of the dichroic mirror about its own axes.

    Shape (3, 3). Columns: about the axis in the mirror and in the plane of the light, about the one
    in the mirror across that plane, about the mirror's normal.
    """
    tilt = float(raytrace.fold_mirror_tilt(boresight_angle))
    # The plane of the light is that of both boresights, across X.
    normal = rotation_from_vector([boresight_angle - np.pi + tilt, 0.0, 0.0]) @ OUT
    across = np.array([1.0, 0.0, 0.0])
    axes = np.stack([np.cross(across, normal), across, normal], axis=-1)
    result: FloatArray = raytrace.turn_response(raytrace.reflection(normal), -OUT) @ axes
    return result
