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

import textwrap
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from reproduce.papers.chen2023 import platform, resolution
from reproduce.papers.chen2023.looks import LASER, SCENE, STAR, lens, mirror, reflected
from reproduce.papers.declare import Blocked, Results, draws, reproduces
from reproduce.papers.sketch import (
    INK,
    Look,
    arc,
    arrow,
    beside,
    box,
    canvas,
    diagram,
    key,
    label,
    line,
    path,
    slim,
    turned,
)
from reproduce.papers.space import seen_from, sense, triad
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
from reproduce.physics.ground import (
    WGS84,
    earth_fixed,
    earth_from_inertial,
    image_vectors,
    imaged_position,
)
from reproduce.physics.images import centre_of_gravity, centre_of_gravity_error, spot_windows
from reproduce.physics.light import (
    RETROREFLECTORS,
    LightPath,
    Mirrors,
    fold_mirror_tilt,
    reflection,
    turn_response,
)
from reproduce.physics.optics import field_of_view
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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


def _bench_path(given: Given, kind: str) -> LightPath:
    """Return the light path of the ground platform with one kind of retro-reflector."""
    lengths = given[platform.TELESCOPE], given[platform.FOCAL_LENGTH]
    return LightPath(*lengths, given[BORESIGHT], RETROREFLECTORS[kind])


def _believed(
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
        rest = _bench_path(given, kind)
        shares: list[float] = []
        for turn in TURN * np.eye(3):
            turned = replace(rest.retroreflector, turn=turn)
            x, y, z = _believed(rest, kind, points, retroreflector=turned) / TURN
            shares += [np.hypot(x, y), abs(z)]
        roll = abs(_believed(rest, kind, points, camera_turn=[TURN, 0.0, 0.0])[2]) / TURN
        spots = rest.spots(points, APERTURE)
        blur = np.linalg.norm(spots - spots.mean(axis=1, keepdims=True), axis=-1).max()
        rows.append((kind, *shares, roll, blur / given[platform.PIXEL], image))
    return rows


@studied(
    "chen2023/dichroic",
    given=(BORESIGHT, ACCURACY, EXPANSION),
)
def _dichroic(given: Given) -> list[tuple[str, float, float, float]]:
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
    rest = replace(_bench_path(given, PAIR), camera_focal_length=given[CAMERA[0]])
    outward = points / np.linalg.norm(points, axis=1, keepdims=True)
    rows = []
    for name, moves in {
        "all lasers move together": [1.0, 0.0],
        "one laser of four moves": np.eye(len(points), 2) * [1.0, 0.0],
        "the pattern grows evenly": outward,
    }.items():
        angles = _believed(rest, PAIR, points, STEP * np.asarray(moves))
        tilt = np.hypot(*angles[:2])
        length = accuracy / tilt * STEP if tilt > NEGLIGIBLE * accuracy else np.inf
        kelvin = length / (expansion * given[platform.DIAGONAL])
        rows.append((name, "µm", tilt / RADIANS_PER_ARCSEC, length * 1e6, kelvin))
    response = dichroic_response(given[BORESIGHT])
    for name, factor in {
        "the dichroic mirror tilts": np.linalg.norm(response, axis=0).max(),
        "the angle of the two mirrors opens": _opened_angle(given, PAIR),
        "one angle of a corner cube opens": _opened_angle(given, "corner cube"),
    }.items():
        turn = accuracy / factor
        rows.append((name, "arcsec", factor, turn / RADIANS_PER_ARCSEC, turn / expansion))
    return rows


def _opened_angle(given: Given, kind: str) -> float:
    """Return the tilt that is believed when one right angle of a retro-reflector opens.

    In radians per radian.
    """
    rest = _bench_path(given, kind)
    if not isinstance(rest.retroreflector, Mirrors):
        raise TypeError(f"kind: expected a retro-reflector of plane mirrors, got {kind!r}")
    normals = unit("normals", rest.retroreflector.normals)
    # One mirror turns about its edge with the next one, away from it.
    normals[0] += TURN * normals[1]
    opened = replace(rest.retroreflector, normals=normals)
    angles = _believed(rest, kind, platform.lasers(given), retroreflector=opened)
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


HARDWARE = "chen2023/text-hardware"
INSTALLED = f"{TEXT}#boresight-angle"
INERTIAL = Look("J2000", INK, "--")
DATE = "2023-09-22T03:30:00"
EARTH = WGS84.equatorial_radius
ABOVE = np.array([np.radians(104.0), np.radians(24.0), 1.25 * EARTH])
TARGET = np.array([np.radians(66.0), np.radians(50.0), 0.0])
VIEW = seen_from(36.0, 20.0, (4.6, 3.2), 2.8 / EARTH)
DETECTORS = f"{HARDWARE}#detectors"
BANDS = tuple(
    f"{TEXT}#{light}-{end}" for light in ("transmission", "reflection") for end in ("low", "high")
)
FILTER = f"{HARDWARE}#filter-wavelength"
# Of the drawing of the light paths: how far the two lights come in beside the boresight.
ASIDE = 9.0
LENS, FOCUS = np.array([5.0, 2.2]), 1.5


def scene(door: Given) -> tuple[FloatArray, FloatArray, dict[str, FloatArray]]:
    """Return a satellite that looks at a target, and what the imaging model makes of it.

    Position of the satellite; where equation (1) puts the middle of the image; three frames whose
    columns are their axes. All Earth-fixed, in metres.
    """
    turning = earth_from_inertial(DATE, ut1_utc=0.0)
    satellite = earth_fixed(ABOVE)
    z = unit("boresight", earth_fixed(TARGET) - satellite)
    x = unit("level", np.cross([0.0, 0.0, 1.0], z))
    looking = np.stack([x, np.cross(z, x), z], axis=-1)
    # The tracker looks away from the Earth: the camera, turned about the X that both share.
    tracker_from_camera = rotation_from_vector([door[INSTALLED], 0.0, 0.0])
    inertial_from_tracker = turning.T @ looking @ tracker_from_camera.T
    chain = turning @ inertial_from_tracker @ tracker_from_camera
    centre = image_vectors([(0.0, 0.0)], focal_length=1.0)
    frames = {"camera": chain, "tracker": turning @ inertial_from_tracker, "stars": turning}
    return satellite, imaged_position(centre, satellite, chain)[0], frames


@draws("chen2023/fig-1a", given=[INSTALLED])
@diagram(14.0, 9.6, 6.6)
def draw_scene(axes: Axes, door: Given) -> None:
    """Frames of the imaging model, from a point of the image to a place on the Earth."""
    satellite, imaged, frames = scene(door)
    _globe(axes)
    _earth_frames(axes, frames["stars"])
    place, target = VIEW.point(satellite), VIEW.point(imaged)
    arrow(axes, VIEW.point(np.zeros(3)), place, width=0.8)
    path(axes, [target, place], SCENE)
    axes.plot(*target, SCENE.marker, color=SCENE.colour, markersize=7)
    # Beside the camera's frame on the paper, so that both can be read.
    tracker, size = satellite + EARTH * np.array([0.35, 0.75]) @ VIEW.matrix, 0.42 * EARTH
    # The line of sight runs along the camera's boresight: its name stands above.
    triad(axes, VIEW, satellite, size * frames["camera"].T, ["$X_c$", "$Y_c$", ""], width=1.8)
    tip = VIEW.point(satellite + size * frames["camera"][:, 2])
    label(axes, beside(tip, -0.1, 0.35), "$Z_c$")
    names = ["$X_s$", "$Y_s$", "$Z_s$"]
    triad(axes, VIEW, tracker, size * frames["tracker"].T, names, width=1.8)
    boresight = EARTH * frames["tracker"][:, 2]
    path(axes, [VIEW.point(tracker + s * boresight) for s in (1.25, 0.7)], STAR)
    label(axes, beside(place, 0.7, 0.2), "camera", ha="left")
    label(axes, beside(VIEW.point(tracker), -0.35, 0.1), "tracker", ha="right")
    label(axes, beside(target, 0.3, 0.4), "target")
    aside = (1.8, -0.93) if slim(axes) else (1.3, -0.35)
    label(axes, beside((place + np.asarray(VIEW.centre)) / 2, *aside), "$(X_S, Y_S, Z_S)$")
    key(axes, (SCENE, STAR, INERTIAL), (0.0, 1.0))


def _globe(axes: Axes) -> None:
    """Draw the outline, the equator, dotted where it lies behind, and the zero meridian."""
    around = np.linspace(0, 2 * np.pi, 240)
    flat = EARTH * np.stack([np.cos(around), np.sin(around), 0 * around], axis=-1)
    line(axes, np.asarray(VIEW.centre) + VIEW.scale * flat[:, :2], 1.3)
    viewer = np.cross(*VIEW.matrix)
    for circle, side, style in ((flat, 1, "-"), (flat, -1, ":"), (flat[:, [0, 2, 1]], 1, "-")):
        shown = np.copysign(1.0, circle @ viewer) == side
        line(axes, np.where(shown[:, np.newaxis], VIEW.point(circle), np.nan), 0.7, style)


def _earth_frames(axes: Axes, earth_from_inertial: FloatArray) -> None:
    """Draw the frame of the stars, the turning one, and the turn between their X axes."""
    centre, fixed = np.zeros(3), np.diag([1.6, 1.6, 1.3]) * EARTH
    names = ["$X_\\mathrm{WGS84}$", "$Y_\\mathrm{WGS84}$", "$Z$ of both"]
    triad(axes, VIEW, centre, fixed, names, width=1.8)
    names = ["$X_\\mathrm{J2000}$", "$Y_\\mathrm{J2000}$"]
    triad(axes, VIEW, centre, 1.6 * EARTH * earth_from_inertial.T[:2], names, look=INERTIAL)
    x = earth_from_inertial[:, 0]
    turn = float(-np.arctan2(x[1], x[0]))
    sense(axes, VIEW, centre, [0.0, 0.0, 1.0], 0.6 * EARTH * x, turn)


@draws("chen2023/fig-1b")
@diagram(12.0, 7.2)
def _draw_system(axes: Axes) -> None:
    """The monitoring system: what the laser light couples, and what the stars add."""
    box(axes, (2.4, 3.4), (4.4, 1.7), "camera with lasers\nin its focal plane")
    box(axes, (6.2, 0.8), (2.8, 1.1), "retro-reflector")
    box(axes, (9.9, 3.4), (3.4, 1.7), "star and laser\ntracker")
    path(axes, [(3.5, 2.55), (3.5, 0.8), (4.8, 0.8)], LASER)
    path(axes, [(7.6, 0.8), (9.8, 0.8), (9.8, 2.55)], LASER)
    path(axes, [(10.5, 6.9), (10.5, 4.25)], STAR)
    path(axes, [(1.6, 0.1), (1.6, 2.55)], SCENE)
    arrow(axes, (4.6, 3.4), (8.2, 3.4), style="<|-|>")
    label(axes, (6.4, 3.95), "installation,\nmisalignment")
    label(axes, (6.4, 3.05), "what heat bends")
    attitude = "camera's attitude =\nmisalignment × installation\n× tracker's attitude"
    label(axes, (6.3, 5.5), attitude)
    key(axes, (LASER, STAR, SCENE), (0.0, 1.0))


@draws("chen2023/fig-2a")
@diagram(12.6, 10.8)
def _draw_satellite(axes: Axes) -> None:
    """The system in the satellite: camera down, tracker up, retro-reflector between."""
    box(axes, (3.4, 5.4), (3.8, 5.2))
    label(axes, (3.4, 8.45), "camera")
    for x in (2.35, 4.45):
        mirror(axes, (x, 6.2), 1.3, 0)
    label(axes, (2.45, 6.55), "primary")
    mirror(axes, (3.4, 3.6), 1.0, 0)
    label(axes, (3.2, 3.2), "secondary")
    if slim(axes):
        box(axes, (3.4, 7.5), (3.2, 1.1), "focal plane,\nlasers")
    else:
        box(axes, (3.4, 7.3), (2.9, 0.6), "focal plane, lasers")
    path(axes, [(3.4, 7.0), (3.65, 3.65), (4.5, 6.1), (4.5, 1.2)], LASER)
    mirror(axes, (4.5, 1.2), 1.4, -45)
    mirror(axes, (9.4, 1.2), 1.4, 45)
    path(axes, [(4.5, 1.2), (9.4, 1.2), (9.4, 4.6)], LASER)
    label(axes, (6.95, 1.95), "retro-reflector,\nin section")
    path(axes, [(2.2, 0.6), (2.2, 6.1)], SCENE)
    label(axes, (2.2, 0.25), "from the Earth")
    box(axes, (9.4, 5.6), (3.4, 2.0), "star and laser\ntracker")
    for side in (-1, 1):
        line(axes, [(9.4 + side * 1.0, 6.6), (9.4 + side * 1.7, 8.2)], 1.3)
    label(axes, (11.2, 7.4), "baffle", ha="left")
    path(axes, [(9.9, 10.4), (9.9, 6.7)], STAR)
    box(axes, (6.5, 5.4), (2.4, 0.8), "platform")
    key(axes, (LASER, STAR, SCENE), (0.0, 1.0))


@draws("chen2023/fig-2b", given=[DETECTORS])
@diagram(15.8, 8.2)
def _draw_focal_plane(axes: Axes, door: Given) -> None:
    """Focal plane of the camera: detectors in two planes, joined by reflectors, and the lasers."""
    from matplotlib.patches import Polygon

    count = door.count(DETECTORS)
    # The outlines of the two planes share an edge.
    edge = [(1.2, 3.0), (11.9, 3.0)]
    for far in ([(11.9, 5.4), (1.2, 5.4)], [(10.9, 0.9), (0.2, 0.9)]):
        line(axes, [*edge, *far, edge[0]], 0.8)
    for index in range(count):
        x = 1.5 + 0.7 * index
        if index % 2 == 0:
            foot, rise, colour, hatch = (x, 3.9), (0.0, 0.9), SCENE.colour, "//"
            box(axes, (x + 0.3, 3.0), (0.45, 0.45), style=":")
        else:
            foot, rise, colour, hatch = (x - 0.75, 1.4), (0.3, 0.7), "#AA7700", ""
        corners = np.array([(0, 0), (0.6, 0), beside(rise, 0.6, 0), rise]) + foot
        axes.add_patch(Polygon(corners, facecolor=colour, edgecolor=INK, hatch=hatch))
    for place in ((0.9, 1.6), (10.8, 1.25)):
        axes.plot(*place, LASER.marker, color=LASER.colour, markersize=8)
    names = ((12.1, 4.4, "upright plane"), (12.1, 3.0, "reflectors"), (11.9, 2.1, "flat plane"))
    for x, y, name in (*names, (11.4, 1.25, "lasers: squares")):
        label(axes, (x, y), name, ha="left")
    for x in (3.0, 6.0, 9.0):
        arrow(axes, (x, 7.4), (x, 6.0), SCENE)
    label(axes, (8.0, 7.8), "light from the telescope")
    label(axes, (0.2, 7.8), f"{count} detectors", ha="left")


@draws("chen2023/fig-3a")
@diagram(12.6, 9.2)
def _draw_tracker(axes: Axes) -> None:
    """Structure of the star and laser tracker."""
    box(axes, (5.0, 1.0), (3.6, 1.2), "processor")
    box(axes, (5.0, 2.2), (1.6, 0.3))
    label(axes, (6.0, 2.25), "detector", ha="left")
    lens(axes, (5.0, 3.4), 2.2, 90)
    label(axes, (5.0, 3.4), "lens")
    mirror(axes, (5.0, 5.3), 2.6, 30)
    label(axes, (4.0, 6.4), "dichroic\nmirror")
    mirror(axes, (7.2, 4.0), 1.4, 60, ":")
    label(axes, (8.4, 3.5), "narrow band-pass\nfilter (dots)", ha="left")
    box(axes, (3.35, 4.7), (0.5, 2.2), style="--")
    label(axes, (0.1, 4.7), "invar\nsupport\n(dashed)", ha="left")
    box(axes, (5.2, 4.5), (5.8, 5.1), style=":")
    label(axes, (8.4, 5.6), "thermal control\n(dotted)", ha="left")
    for side in (-1, 1):
        line(axes, [(5 + side * 1.6, 7.2), (5 + side * 2.6, 9.0)], 1.3)
    label(axes, (7.8, 7.9), "baffle, held by the\nsatellite alone", ha="left")


@draws("chen2023/fig-3b", marks=[f"{TEXT}#dihedral-angle"])
def _draw_paths(figure: Figure, printed: Mapping[str, float]) -> None:
    """Paths of starlight and laser light into the tracker."""
    (tilt,) = np.degrees(list(printed.values())).tolist()
    axes = canvas(figure, 11.0, 8.2)
    middle = np.array([5.0, 4.8])
    mirror(axes, middle, 3.4, tilt)
    label(axes, (2.0, 4.3), "dichroic\nmirror")
    lens(axes, LENS, 2.6, 90)
    label(axes, LENS - [1.5, 0.0], "lens", ha="right")
    box(axes, LENS - [0, FOCUS + 0.15], (1.8, 0.3))
    label(axes, (6.2, 0.55), "detector", ha="left")
    star, laser = turned([0.0, -1.0], -ASIDE), turned([0.0, -1.0], ASIDE)
    came, normal = reflected(laser, tilt), turned([0.0, 1.0], tilt)
    # Each ray to its place on the lens and on to the focus of its direction.
    for way, shifts, look in ((star, (-0.5, 0.0, 0.5), STAR), (laser, (-0.35, 0.35), LASER)):
        for place in (beside(LENS, shift, 0.0) for shift in shifts):
            hit = place - (place - middle) @ normal / (way @ normal) * way
            before = [place - 5.4 * way] if look is STAR else [hit - 4.0 * came, hit]
            path(axes, [*before, place, LENS + FOCUS * way / -way[1]], look)
    across = float(np.degrees(np.arctan2(came[1], came[0]))) + 90
    filtered = middle - 2.5 * came
    mirror(axes, filtered, 1.6, across, ":")
    label(axes, beside(filtered, 0.85, 0.55), "band-pass\nfilter (dots)", ha="left")
    line(axes, [middle, beside(middle, 2.9, 0.0)], 0.7)
    arc(axes, middle, 2.5, (0, tilt), f"{tilt:g}°")
    key(axes, (STAR, LASER), (0.0, 1.0))


@draws("chen2023/fig-3c", marks=[*BANDS, FILTER])
def _draw_filters(figure: Figure, printed: Mapping[str, float]) -> None:
    """Transmission and reflection of the dichroic mirror and of the band-pass filter, idealised."""
    low, high, *reflecting, passed = (printed[a] * 1e9 for a in (*BANDS, FILTER))
    upper, lower = figure.subplots(2, 1, sharex=True)
    for name, (start, stop), colour, style in (
        ("transmission", (low, high), SCENE.colour, "-"),
        ("reflection", reflecting, LASER.colour, LASER.line),
    ):
        edges = [350, start, start, stop, stop, 1100]
        upper.plot(edges, [0, 0, 100, 100, 0, 0], style, color=colour, label=name)
    upper.set(ylabel="dichroic mirror (%)")
    # The width of the filter is not printed: a line stands for its band.
    lower.plot([350, passed, passed, passed, 1100], [0, 0, 100, 0, 0], color=INK)
    lower.set(ylabel="band-pass filter (%)", xlabel="wavelength (nm)", xlim=(350, 1100))
    for axes in (upper, lower):
        axes.axvspan(low, high, facecolor=(STAR.colour, 0.15), edgecolor=STAR.colour, linestyle=":")
        axes.text((low + high) / 2, 45, "light of the stars", ha="center")
        axes.text(passed + 8, 45, "laser")
    upper.axvline(passed, color=INK, linestyle=":", linewidth=2)
    upper.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


@draws("chen2023/fig-4")
@diagram(15.0, 9.0, 6.8, (15.0, 13.0))
def _draw_route(axes: Axes) -> None:
    """Technical route: calibration, monitoring, correction."""
    steps = {
        "calibration": (
            "control points and stars: installation",
            "laser spots at the zero point",
            "laser transform at the zero point",
        ),
        "monitoring": (
            "laser spots in every frame",
            "mean over many frames",
            "misalignment, by QUEST",
        ),
        "correction": (
            "corrected installation",
            "attitude of tracker from the stars",
            "attitude of camera among the stars",
        ),
    }
    # Height of a box, of the lowest one, from one to the next; letters in a line.
    high, low, step, letters = (2.4, 2.2, 4.0, 15) if slim(axes) else (1.4, 1.6, 2.6, 19)
    heights = [low + 2 * step, low + step, low]
    for x, (name, texts) in zip((2.5, 7.5, 12.5), steps.items(), strict=True):
        label(axes, (x, heights[0] + high / 2 + 1.0), name, size=11)
        box(axes, (x, heights[1]), (4.7, 2 * step + high + 1.0), style=":")
        for y, text in zip(heights, texts, strict=True):
            box(axes, (x, y), (4.2, high), textwrap.fill(text, letters))
        for y in heights[:2]:
            arrow(axes, (x, y - high / 2), (x, y - step + high / 2))
    arrow(axes, (4.6, low), (5.4, low))
    line(axes, [(9.6, low), (10.0, low), (10.0, heights[0])], 1.3)
    arrow(axes, (10.0, heights[0]), (10.4, heights[0]))


@draws("chen2023/fig-5")
@diagram(14.0, 8.4)
def _draw_transform(axes: Axes) -> None:
    """Laser directions in the camera and in the tracker, joined by the laser transform."""
    for x, name, focal in ((3.0, "c", r"f_\mathrm{cam}"), (11.0, "s", r"f_\mathrm{s}")):
        line(axes, [(x - 2.2, 1.2), (x + 2.2, 1.2)], 2.5)
        lens(axes, (x, 4.4), 3.0, 90)
        arrow(axes, (x, 1.2), (x, 2.8))
        label(axes, (x + 0.48, 1.8), f"$Z_{name}$")
        arrow(axes, (x + 2.2, 1.2), (x + 2.7, 1.2))
        label(axes, (x + 2.45, 1.6), f"$X_{name}$")
        arrow(axes, (x - 2.0, 1.2), (x - 2.0, 4.4), style="<|-|>", width=0.8)
        label(axes, (x - 2.55, 2.8), f"${focal}$")
        look, vector = (LASER.marker, "v") if name == "c" else ("o", "w")
        for number, offset in ((1, -1.2), (2, 1.2)):
            # The light of one laser through the lens, its direction as equation (2) gives it.
            direction = emitted_directions([(offset, 0.0)], 3.2)[0][[0, 2]]
            places = np.array([(x + offset, 1.2), (x, 4.4), (x, 4.4) + 2.9 * direction])
            path(axes, list(places if name == "c" else places[::-1]), LASER)
            axes.plot(*places[0], look, color=LASER.colour, markersize=6)
            label(axes, beside(places[2], 0.0, 0.4), rf"$\mathbf{{{vector}}}_{number}$")
    label(axes, (3.0, 0.4), "lasers in the focal plane\nof the camera")
    label(axes, (11.0, 0.4), "spots on the detector\nof the tracker")
    arrow(axes, (5.6, 5.9), (8.4, 5.9))
    label(axes, (7.0, 6.4), r"$\mathbf{w} = T\,\mathbf{v}$", size=11)
    label(axes, (7.0, 5.2), "retro-reflector,\ndichroic mirror")
