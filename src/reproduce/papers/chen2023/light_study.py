"""The light path, traced: what retro-reflector and dichroic mirror may do (chen2023, II-B).

The light goes through `physics.light_path` from the focal plane of the ground platform's telescope
to the tracker's detector, and the spots are solved as the paper solves them. So every error is the
turn of the camera, or its roll, that the system would believe. Where a third reflection mirrors the
image, the designed pattern is mirrored too; nothing could be solved otherwise. What the paper does
not print: the beam is a fifth of a metre wide, and returns a metre beside the camera.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reproduce.papers.chen2023 import design, lasers
from reproduce.papers.study import Study
from reproduce.physics.attitude.lasers import emitted_directions, received_directions
from reproduce.physics.attitude.misalignment import (
    laser_transform,
    misalignment,
    misalignment_angles,
)
from reproduce.physics.attitude.rotations import rotation_from_vector
from reproduce.physics.light import raytrace
from reproduce.physics.light.light_path import LightPath, light_path
from reproduce.physics.light.raytrace import reflection, turn_response
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.units import RADIANS_PER_ARCSEC

BORESIGHT = f"{design.DESIGN}#boresight-angle"
EXPANSION = "chen2023/text-hardware#expansion-coefficient"
ACCURACY = "chen2023/table-4#100.misalignment-?"
READS = (*lasers.READS, BORESIGHT, EXPANSION, ACCURACY)
OUT = np.array([0.0, 0.0, 1.0])
TURN = 10 * RADIANS_PER_ARCSEC
# Rays around the edge of the beam, and its radius in metres.
RAYS, BEAM = 36, 0.1
# Of each retro-reflector: whether its image is mirrored, as an odd number of reflections does.
KINDS = {"corner cube": True, "two mirrors at a right angle": False, "conical mirror": True}


def aperture() -> FloatArray:
    """Return points around the edge of the beam in the camera's lens, in metres."""
    around = 2.0 * np.pi * (np.arange(RAYS) + 0.5) / RAYS
    return BEAM * np.stack([np.cos(around), np.sin(around)], axis=-1)


def bench_path(door: Given, kind: str) -> LightPath:
    """Return the light path of the ground platform with one kind of retro-reflector."""
    camera = door[f"{lasers.PLATFORM}#telescope-focal-length.value"]
    tracker = door[f"{lasers.PLATFORM}#tracker-focal-length.value"]
    return light_path(kind, camera, tracker, door[BORESIGHT])


def pattern(door: Given) -> FloatArray:
    """Return the designed lasers, in metres, of shape (4, 2)."""
    return lasers.designed_positions(door.array(lasers.SPOTS).reshape(-1, 2), door[lasers.DIAGONAL])


def believed(
    now: LightPath, rest: LightPath, points: FloatArray, moved: FloatArray, mirrored: bool
) -> FloatArray:
    """Return the turn of the camera that the system believes when its light path changes.

    Shape (3,). Angles about X, Y and Z of the camera, in radians.
    """
    camera = emitted_directions(points * [1.0, -1.0 if mirrored else 1.0], rest.camera_focal_length)
    zero, then = (
        received_directions(
            light.spots(where, aperture()).mean(axis=1), (0.0, 0.0), 1.0, light.tracker_focal_length
        )
        for light, where in ((rest, points), (now, moved))
    )
    return misalignment_angles(misalignment(camera, then, laser_transform(camera, zero)))


def retro_reflectors() -> Study:
    """What turns of the retro-reflector make the system believe, for three kinds of it."""
    door = given(READS)
    points = pattern(door)
    pixel = door[f"{lasers.PLATFORM}#tracker-pixel-size.value"]
    rows = []
    for kind, mirrored in KINDS.items():
        rest = bench_path(door, kind)
        entries = []
        for turn in TURN * np.eye(3):
            now = replace(rest, retroreflector=replace(rest.retroreflector, turn=turn))
            entries.append(_tilt_and_roll(believed(now, rest, points, points, mirrored) / TURN))
        tilted = replace(rest, camera_turn=[TURN, 0.0, 0.0])
        roll = abs(believed(tilted, rest, points, points, mirrored)[2]) / TURN
        spots = rest.spots(points, aperture())
        blur = np.linalg.norm(spots - spots.mean(axis=1, keepdims=True), axis=-1).max() / pixel
        image = "mirrored" if mirrored else "upright"
        rows.append((kind, *entries, f"{roll:.2f}", f"{blur:.2f}", image))
    head = (
        "Retro-reflector",
        "turned about X (across the edge)",
        "about Y (along the edge)",
        "about Z (the beam)",
        "roll from a tilt of the camera",
        "blur (px)",
        "image",
    )
    caption = (
        "Tilt and roll of the camera that the system believes, for one unit of turn of the "
        "retro-reflector, from traced spots. The edge of the two mirrors lies along Y; the beam "
        "goes to and fro along X, to both sides of the axis of the cone."
    )
    return Study(caption, head, tuple(rows))


def _tilt_and_roll(angles: FloatArray) -> str:
    # Rounded first, so that no sign of a rounding error shows.
    return f"{np.hypot(*angles[:2]):.2f}, {abs(angles[2]):.2f}"


def dichroic() -> Study:
    """How much a tilt of the dichroic mirror mimics, and the tolerance that follows."""
    door = given((BORESIGHT, ACCURACY, EXPANSION))
    response = dichroic_response(door[BORESIGHT])
    accuracy = float(door.array(ACCURACY).max())
    heat = door[EXPANSION]
    rows = []
    for name, column in zip(
        ("in the plane of the light", "across it", "its normal"), response.T, strict=True
    ):
        factor = float(np.linalg.norm(column))
        tolerance = "any" if factor < 1e-9 else f"{accuracy / factor / RADIANS_PER_ARCSEC:.3f}"
        kelvin = "any" if factor < 1e-9 else f"{accuracy / factor / heat:.2f}"
        rows.append((name, f"{factor:.3f}", tolerance, kelvin))
    head = (
        "Turn of the mirror about",
        "error per unit of turn",
        "turn as large as the accuracy (arcsec)",
        "difference of temperature that makes it (K)",
    )
    caption = (
        "Tolerance of the dichroic mirror, for the three-sigma accuracy of a hundred frames. The "
        "temperature is that between two sides of a support as high as it is wide."
    )
    return Study(caption, head, tuple(rows))


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
    result: FloatArray = turn_response(reflection(normal), -OUT) @ axes
    return result
