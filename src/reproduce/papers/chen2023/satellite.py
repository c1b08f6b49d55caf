"""The satellite's camera and the monitoring system as designed, with traced light (chen2023, I-II).

`physics.raytrace` traces the light from the focal plane of the ground platform's telescope to the
detector of the tracker. The spots are solved as in the paper. Every error is therefore the rotation
of the camera that the system would report. A third reflection mirrors the image. The designed
pattern is then mirrored too, because no rotation would fit otherwise. The paper does not print the
beam: it is 0.2 m wide here, and returns 1 m next to the camera.

II-B describes the effects of heat in words. Its numbers limit the motion of the lasers and the
rotation of the dichroic mirror. The limit is the error of the monitoring: the three-sigma accuracy
of the averaged misalignment.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from reproduce.papers.chen2023.platform import (
    DIAGONAL,
    INSTRUMENT,
    PIXEL,
    TELESCOPE,
    TRACKER,
    TRACKER_FOCAL_LENGTH,
    as_designed,
)
from reproduce.papers.declare import Results, Rows, reproduces, studied
from reproduce.physics import ground
from reproduce.physics.optics import field_of_view
from reproduce.physics.raytrace import (
    RETROREFLECTORS,
    fold_mirror,
    fold_mirror_tilt,
    traced_spots,
)
from reproduce.printed.inputs import Inputs
from reproduce.units import RADIANS_PER_ARCSEC

CAMERA_FOCAL_LENGTH = "chen2023/table-1#panchromatic-focal-length.value"
# Panchromatic camera: focal length, pixel size, ground resolution.
CAMERA = (
    CAMERA_FOCAL_LENGTH,
    "chen2023/table-1#panchromatic-pixel-size.value",
    "chen2023/table-1#panchromatic-ground-resolution.value",
)
BORESIGHT = "chen2023/text-satellite#boresight-angle"
_RATIO = "chen2023/text-satellite#focal-ratio"
_EXPANSION = "chen2023/text-hardware#expansion-coefficient"
_ACCURACY = "chen2023/table-4#100.misalignment-?"
_PIXELS = "chen2023/table-2#tracker-pixels-x.value"
_FIELD = "chen2023/table-1#tracker-field-of-view-x.value"
# Assumed roll of the tracker about the camera's boresight on the bench. The paper prints no roll.
_TRACKER_ROLL = np.pi / 4
_TEST_ROTATION = 10 * RADIANS_PER_ARCSEC
# Points around the edge of the beam in the camera's lens, in metres.
_AROUND = 2.0 * np.pi * (np.arange(36) + 0.5) / 36
_APERTURE = 0.1 * np.stack([np.cos(_AROUND), np.sin(_AROUND)], axis=-1)


def altitude(inputs: Inputs) -> float:
    """Return the altitude that the panchromatic line of Table I implies, in metres."""
    focal, pixel, resolution = map(inputs.__getitem__, CAMERA)
    return resolution * focal / pixel


@reproduces(
    "chen2023/table-1",
    cells=["multispectral-ground-resolution.value"],
    inputs=[
        "chen2023/table-1#*focal-length.value",
        "chen2023/table-1#*pixel-size.value",
        CAMERA[2],
    ],
)
def ground_resolution(inputs: Inputs) -> Results:
    """Compute the multispectral resolution at the altitude that the panchromatic one implies."""
    resolution = ground.ground_resolution(
        inputs["chen2023/table-1#multispectral-focal-length.value"],
        inputs["chen2023/table-1#multispectral-pixel-size.value"],
        altitude(inputs),
    )
    return {"multispectral-ground-resolution.value": resolution}


@reproduces(
    "chen2023/text-satellite",
    cells=["focal-ratio"],
    inputs=[
        CAMERA_FOCAL_LENGTH,
        TRACKER_FOCAL_LENGTH,
        PIXEL,
        _PIXELS,
        _FIELD,
    ],
)
def focal_ratio(inputs: Inputs, *, tracker: str) -> Results:
    """Compute the focal length of the camera over the one of the tracker, which is not printed."""
    focal = inputs[TRACKER_FOCAL_LENGTH]
    if tracker == "table-1-field":
        width = inputs[_PIXELS] * inputs[PIXEL]
        focal = width / 2 / np.tan(inputs[_FIELD] / 2)
    return {"focal-ratio": inputs[CAMERA_FOCAL_LENGTH] / focal}


@reproduces("chen2023/text-satellite", cells=["dihedral-angle"], inputs=[BORESIGHT])
def dichroic_tilt(inputs: Inputs) -> Results:
    """Compute the tilt of the dichroic mirror that reflects the laser light into the tracker."""
    return {"dihedral-angle": fold_mirror_tilt(inputs[BORESIGHT])}


@reproduces("chen2023/text-satellite", cells=["table-angle"], inputs=[BORESIGHT])
def table_angle(inputs: Inputs) -> Results:
    """Compute the angle of the tracker's boresight above the optical table.

    The camera is assumed level. The tracker's boresight makes the supplement of the printed
    boresight angle with the axis of the camera. It is rolled about that axis by an assumed angle of
    45 degrees, which multiplies the sine of its elevation by the sine of the roll. The paper prints
    neither the roll nor the level of the camera.
    """
    sine = np.sin(np.pi - inputs[BORESIGHT]) * np.sin(_TRACKER_ROLL)
    return {"table-angle": np.arcsin(sine)}


@studied("chen2023/retro-reflectors", inputs=(*INSTRUMENT, BORESIGHT))
def _retro_reflectors(inputs: Inputs) -> Rows:
    """Compute the reported rotation of the camera for rotations of three retro-reflectors."""
    platform = replace(as_designed(inputs), principal_point=(0.0, 0.0), spots=None)
    turns = _TEST_ROTATION * np.eye(3)
    for kind, train in RETROREFLECTORS.items():
        # An odd number of reflections mirrors the image.
        is_mirrored = train is None or np.linalg.det(train) < 0
        traced = partial(traced_spots, platform, inputs[BORESIGHT], train, _APERTURE)
        design = replace(
            platform, lasers=platform.lasers * [1, -1 if is_mirrored else 1]
        )
        rest = traced()
        centres = rest.mean(axis=1)
        # The last rotation is a rotation of the camera.
        moved = [*(traced(turn=turn) for turn in turns), traced(camera_turn=turns[0])]
        reported = design.misalignment(
            np.mean(moved, axis=2), design.transform(centres)
        )
        x, y, roll = np.abs(reported).T / _TEST_ROTATION
        responses = np.stack([np.hypot(x, y), roll], axis=-1)[:3]
        blur = np.linalg.norm(rest - centres[:, None], axis=-1).max()
        image = "mirrored" if is_mirrored else "upright"
        yield (kind, *responses.ravel(), roll[3], blur, image)


@studied(
    "chen2023/dichroic",
    inputs=(BORESIGHT, _ACCURACY, _EXPANSION),
    named=lambda _: {"assumed-roll": np.degrees(_TRACKER_ROLL)},
)
def _dichroic(inputs: Inputs) -> Rows:
    """Compute the reported rotation for a tilt of the dichroic mirror, and its tolerance."""
    accuracy, normal = inputs.array(_ACCURACY).max(), fold_mirror(inputs[BORESIGHT])
    # The plane of the light contains both boresights and is across X.
    across = np.array([1.0, 0.0, 0.0])
    moves = np.cross([np.cross(across, normal), across, normal], normal)
    # The mirror takes light d along Z to d - 2 (d·n) n.
    changes = np.outer(moves[:, 2], normal) + normal[2] * moves
    factors = 2.0 * np.linalg.norm(changes, axis=1)
    axes = ("in the plane of the light", "across it", "its normal")
    for axis, factor in zip(axes, factors, strict=True):
        tilt = accuracy / factor if factor else np.inf
        yield axis, factor, tilt / RADIANS_PER_ARCSEC, tilt / inputs[_EXPANSION]


@studied(
    "chen2023/heat",
    inputs=(
        CAMERA_FOCAL_LENGTH,
        *TRACKER,
        TELESCOPE,
        DIAGONAL,
        _RATIO,
        _PIXELS,
        _ACCURACY,
        _EXPANSION,
    ),
)
def _heat(inputs: Inputs) -> Rows:
    """Compute the effects of thermal motion of the lasers, in flight and on the bench."""
    flight, short = inputs[CAMERA_FOCAL_LENGTH], inputs[TRACKER_FOCAL_LENGTH]
    accuracy = inputs.array(_ACCURACY).max()
    for name, camera, tracker in (
        ("flight, as printed", flight, flight / inputs[_RATIO]),
        ("flight camera with the tracker of Table II", flight, short),
        ("ground platform", inputs[TELESCOPE], short),
    ):
        view = field_of_view(inputs[_PIXELS], inputs[PIXEL], tracker)
        angle = 1e-6 / camera / RADIANS_PER_ARCSEC
        motion = accuracy * camera
        kelvin = motion / (inputs[_EXPANSION] * inputs[DIAGONAL])
        yield (
            name,
            camera / tracker,
            tracker * 1e3,
            np.degrees(view),
            angle,
            motion * 1e6,
            kelvin,
        )
