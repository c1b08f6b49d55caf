"""The satellite's camera and the monitoring system as designed, its light traced (chen2023, I-II).

The light goes through `physics.light` from the focal plane of the ground platform's telescope
to the tracker's detector, and the spots are solved as the paper solves them. So every error is the
turn of the camera, or its roll, that the system would believe. Where a third reflection mirrors the
image, the designed pattern is mirrored too; nothing could be solved otherwise. What the paper does
not print: the beam is a fifth of a metre wide, and returns a metre beside the camera.

What heat and stray light may do is taken term by term as II-B lists them. The paper gives most of
these terms in words. What its numbers allow is how large each may grow until it mimics as much as
the monitoring errs by: the three-sigma accuracy of the averaged misalignment.

Stray light of the Sun and the Earth is kept out with a baffle, light of the landscape with the
narrow filter, and laser light out of the camera by matching the beam to its aperture. The paper
prints the bands and mean transmissions of the mirror, and no power, width or attenuation. So what
can be said is how much of each light the mirror may send on, and how much a spot tolerates.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from reproduce.papers.chen2023 import platform, resolution
from reproduce.papers.declare import Blocked, Results, reproduces
from reproduce.papers.study import studied
from reproduce.physics import ground
from reproduce.physics.attitude import (
    emitted_directions,
    laser_transform,
    misalignment,
    misalignment_angles,
    received_directions,
    rotation_from_vector,
    unit,
)
from reproduce.physics.images import centre_of_gravity, centre_of_gravity_error, spot_windows
from reproduce.physics.light import (
    LightPath,
    Mirrors,
    fold_mirror_tilt,
    light_path,
    reflection,
    turn_response,
)
from reproduce.physics.optics import field_of_view
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["ACCURACY", "CAMERA", "SATELLITE", "altitude", "dichroic_response", "tolerances"]

SATELLITE = "chen2023/table-1"
TEXT = "chen2023/text-satellite"
# Of the panchromatic camera: focal length, pixel size, ground resolution.
CAMERA = tuple(
    f"{SATELLITE}#panchromatic-{name}.value"
    for name in ("focal-length", "pixel-size", "ground-resolution")
)
BORESIGHT = f"{TEXT}#boresight-angle"
RATIO = f"{TEXT}#focal-ratio"
EXPANSION = "chen2023/text-hardware#expansion-coefficient"
ACCURACY = "chen2023/table-4#100.misalignment-?"
LASERS = (platform.SPOTS, platform.DIAGONAL, platform.TELESCOPE)
LIGHT_PATH = (*LASERS, platform.FOCAL_LENGTH, BORESIGHT)
OUT = np.array([0.0, 0.0, 1.0])
TURN = 10 * RADIANS_PER_ARCSEC
# Points around the edge of the beam in the camera's lens, in metres.
AROUND = 2.0 * np.pi * (np.arange(36) + 0.5) / 36
APERTURE = 0.1 * np.stack([np.cos(AROUND), np.sin(AROUND)], axis=-1)
PAIR = "two mirrors at a right angle"
# What each retro-reflector makes of the image: an odd number of reflections mirrors it.
IMAGE = {"corner cube": "mirrored", PAIR: "upright", "conical mirror": "mirrored"}
# Shares of a turn below this are rounding noise.
NOISE = 1e-9
# A motion of the lasers that is small enough to be a derivative: a micrometre. What it mimics, as a
# share of the accuracy, is rounding noise below the other number.
STEP, NEGLIGIBLE = 1e-6, 1e-6
MIRROR = f"{platform.PLATFORM}#dichroic-"
PIXELS = f"{platform.PLATFORM}#tracker-pixels-x.value"
SEEN = f"{platform.PLATFORM}#tracker-band-high.value"
# No width of the narrow filter is printed; this one stands in, in metres.
FILTER_WIDTH = 10e-9
# How much an even background may add to the noise of a centroid.
ADDED = 0.1


def altitude(given: Given) -> float:
    """Return the altitude that the panchromatic line of Table I implies, in metres."""
    return float(ground.altitude_for_resolution(*(given[address] for address in CAMERA)))


@reproduces(
    SATELLITE,
    cells=["multispectral-ground-resolution.value"],
    given=[f"{SATELLITE}#*focal-length.value", f"{SATELLITE}#*pixel-size.value", CAMERA[2]],
)
def ground_resolution(given: Given) -> Results:
    """Multispectral ground resolution at the altitude that the panchromatic one implies."""
    camera = f"{SATELLITE}#multispectral"
    focal, pixel = given[f"{camera}-focal-length.value"], given[f"{camera}-pixel-size.value"]
    resolution = ground.ground_resolution(focal, pixel, altitude(given))
    return {"multispectral-ground-resolution.value": float(resolution)}


@reproduces(TEXT, cells=["focal-ratio"], given=[CAMERA[0], platform.FOCAL_LENGTH])
def focal_ratio(given: Given) -> Results:
    """Camera's focal length over the tracker's, with the ground tracker standing in."""
    missing = "the focal length of the flight tracker; the ground tracker's stands in"
    return {"focal-ratio": Blocked(missing, given[CAMERA[0]] / given[platform.FOCAL_LENGTH])}


@reproduces(TEXT, cells=["dihedral-angle"], given=[BORESIGHT])
def dichroic_tilt(given: Given) -> Results:
    """Tilt of the dichroic mirror that folds the retro-reflected laser into the tracker."""
    return {"dihedral-angle": float(fold_mirror_tilt(given[BORESIGHT]))}


def _accuracy(given: Given) -> float:
    return float(given.array(ACCURACY).max())


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
            light.spots(where, APERTURE).mean(axis=1), (0.0, 0.0), 1.0, light.tracker_focal_length
        )
        for light, where in ((rest, points), (replace(rest, **changes), points + shifts))
    )
    return misalignment_angles(misalignment(camera, now, laser_transform(camera, zero)))


@studied(
    "chen2023/retro-reflectors",
    given=(*LIGHT_PATH, platform.PIXEL),
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
        spots = rest.spots(points, APERTURE)
        blur = np.linalg.norm(spots - spots.mean(axis=1, keepdims=True), axis=-1).max()
        rows.append((kind, *shares, roll, blur / given[platform.PIXEL], image))
    return rows


@studied(
    "chen2023/dichroic",
    given=(BORESIGHT, ACCURACY, EXPANSION),
)
def dichroic(given: Given) -> list[tuple[str, float, float, float]]:
    """How much a tilt of the dichroic mirror mimics, and the tolerance that follows."""
    accuracy = _accuracy(given)
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
    tilt = float(fold_mirror_tilt(boresight_angle))
    # The plane of the light is that of both boresights, across X.
    normal = rotation_from_vector([boresight_angle - np.pi + tilt, 0.0, 0.0]) @ OUT
    across = np.array([1.0, 0.0, 0.0])
    axes = np.stack([np.cross(across, normal), across, normal], axis=-1)
    result: FloatArray = turn_response(reflection(normal), -OUT) @ axes
    return result


@studied(
    "chen2023/heat",
    given=(CAMERA[0], *platform.TRACKER, platform.TELESCOPE, RATIO, PIXELS, ACCURACY),
)
def heat(given: Given) -> list[tuple[str, float, float, float, float, float]]:
    """What thermal motion of the lasers does, in flight and on the bench."""
    flight, short = given[CAMERA[0]], given[platform.FOCAL_LENGTH]
    rows = []
    for name, camera, tracker in (
        ("flight, as printed", flight, flight / given[RATIO]),
        ("flight camera with the tracker of Table II", flight, short),
        ("ground platform", given[platform.TELESCOPE], short),
    ):
        view = np.degrees(float(field_of_view(given[PIXELS], given[platform.PIXEL], tracker)))
        angle = STEP / camera / RADIANS_PER_ARCSEC
        motion = _accuracy(given) * camera * 1e6
        rows.append((name, camera / tracker, tracker * 1e3, view, angle, motion))
    return rows


@studied(
    "chen2023/thermal",
    given=(*LIGHT_PATH, EXPANSION, ACCURACY, CAMERA[0]),
)
def thermal(given: Given) -> list[tuple[str, str, float, float, float]]:
    """Thermal terms: what each mimics, and how large it may be."""
    accuracy, points, expansion = _accuracy(given), platform.lasers(given), given[EXPANSION]
    # In angle only the camera's own focal length counts, so the flight camera is set in.
    rest = replace(bench_path(given, PAIR), camera_focal_length=given[CAMERA[0]])
    outward = points / np.linalg.norm(points, axis=1, keepdims=True)
    rows = []
    for name, moves in {
        "all lasers move together": [1.0, 0.0],
        "one laser of four moves": np.eye(len(points), 2) * [1.0, 0.0],
        "the pattern grows evenly": outward,
    }.items():
        angles = believed(rest, PAIR, points, STEP * np.asarray(moves))
        tilt = np.hypot(*angles[:2])
        length = accuracy / tilt * STEP if tilt > NEGLIGIBLE * accuracy else np.inf
        kelvin = length / (expansion * given[platform.DIAGONAL])
        rows.append((name, "µm", tilt / RADIANS_PER_ARCSEC, length * 1e6, kelvin))
    response = dichroic_response(given[BORESIGHT])
    for name, factor in {
        "the dichroic mirror tilts": np.linalg.norm(response, axis=0).max(),
        "the angle of the two mirrors opens": opened_angle(given, PAIR),
        "one angle of a corner cube opens": opened_angle(given, "corner cube"),
    }.items():
        turn = accuracy / factor
        rows.append((name, "arcsec", factor, turn / RADIANS_PER_ARCSEC, turn / expansion))
    return rows


def opened_angle(given: Given, kind: str) -> float:
    """Return the tilt that is believed when one right angle of a retro-reflector opens.

    In radians per radian.
    """
    rest = bench_path(given, kind)
    if not isinstance(rest.retroreflector, Mirrors):
        raise TypeError(f"kind: expected a retro-reflector of plane mirrors, got {kind!r}")
    normals = unit("normals", rest.retroreflector.normals)
    # One mirror turns about its edge with the next one, away from it.
    normals[0] += TURN * normals[1]
    opened = replace(rest.retroreflector, normals=normals)
    angles = believed(rest, kind, platform.lasers(given), retroreflector=opened)
    return float(np.hypot(*angles[:2])) / TURN


@studied(
    "chen2023/stray",
    given=(*resolution.SPOT_READS, f"{MIRROR}*.value", SEEN, ACCURACY),
)
def stray(given: Given) -> pd.DataFrame:
    """Stray terms: what the printed bands and scatters allow to be said of each."""
    passed, reflected = (
        given[f"{MIRROR}{n}-average.value"] for n in ("transmission", "reflection")
    )
    # The mirror reflects further into the infrared than the detector sees.
    band = min(given[f"{MIRROR}reflection-high.value"], given[SEEN])
    band -= given[f"{MIRROR}reflection-low.value"]
    signal, background, slope = tolerances(given)
    shares = {
        "laser light that the mirror loses": 1 - reflected,
        "noise of a spot's centroid that this adds": reflected**-0.5 - 1,
        "starlight that the mirror loses": 1 - passed,
        "noise of a star's centroid that this adds": passed**-0.5 - 1,
        "visible light of the landscape that the mirror sends on": 1 - passed,
        "near-infrared light of the landscape that a filter of "
        f"{FILTER_WIDTH * 1e9:.0f} nm lets through": FILTER_WIDTH / band,
    }
    electrons = {
        f"even background that adds {ADDED:.0%} to the noise of a centroid": background,
        "slope of the background that mimics the averaged accuracy": slope,
    }
    rows = [(name, 100 * share, np.nan) for name, share in shares.items()]
    rows += [(name, np.nan, light) for name, light in electrons.items()]
    return stray.frame(rows, signal=signal)


def tolerances(given: Given) -> tuple[float, float, float]:
    """Return the light of a spot and how much stray light its centroid tolerates."""
    light, size = resolution.light_for_table(given), resolution.window(given)
    radius = float(given[resolution.SPOT_RADIUS] / given[platform.PIXEL])
    corner = np.full(2, -float(size // 2))
    plain, lit = (
        centre_of_gravity_error([0.0, 0.0], light.signal, radius, corner, size, noise).variance[0]
        for noise in (0.0, 1.0)
    )
    # The shot noise of an even background acts as read noise; variance goes with its light.
    background = ((1.0 + ADDED) ** 2 - 1.0) * plain / (lit - plain)
    window = spot_windows([0.0, 0.0], light.signal, radius, corner, size)
    moved = float(centre_of_gravity(window + np.arange(size) + corner[0], corner)[0])
    pixel = float(given[platform.PIXEL] / given[platform.FOCAL_LENGTH])
    return light.signal, float(background), _accuracy(given) / pixel / moved
