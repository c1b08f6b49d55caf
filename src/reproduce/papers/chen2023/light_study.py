"""The light path, traced: what retro-reflector, dichroic mirror and laser may do (chen2023, II-B).

The camera looks along Z and the laser leaves along it. Errors are those of the direction in which
the tracker sees the light; half of a mirror's turn is all that a plane mirror needs to fake a
misalignment.
"""

from __future__ import annotations

import numpy as np

from reproduce.papers.chen2023 import design, lasers, twin, twin_study
from reproduce.papers.study import Study
from reproduce.physics import mirrors
from reproduce.physics.raytrace import (
    CORNER,
    ROOF,
    cone_return,
    mirror_train,
    reflection,
    turn_response,
)
from reproduce.physics.rotations import rotation_from_vector
from reproduce.physics.validate import FloatArray
from reproduce.physics.wahba import attitude_covariance
from reproduce.printed.given import given

ARCSEC = np.pi / 180 / 3600
BORESIGHT = f"{design.DESIGN}#boresight-angle"
RATIO = f"{design.DESIGN}#focal-ratio"
EXPANSION = "chen2023/text-hardware#expansion-coefficient"
ACCURACY = "chen2023/table-4#100.misalignment-?"
OUT = np.array([0.0, 0.0, 1.0])
TURN = 10 * ARCSEC
# Rays around a beam that meets a conical mirror, away from its tip.
RING = 36
PATTERNS = ((2, 1.0), (3, 1.0), (4, 1.0), (8, 1.0), (4, 2.0), (4, 5.0), (4, 20.0))


def retroreflectors() -> Study:
    """What a turn of the retro-reflector does to the light, for three kinds of it.

    Returns
    -------
    Study
        Factor between turn and error, about the three axes.
    """
    kinds = {
        "corner cube": mirror_train(CORNER),
        "two mirrors at a right angle": mirror_train(ROOF),
    }
    rows = []
    for name, train in kinds.items():
        shift = np.linalg.norm(turn_response(train, OUT), axis=0)
        rows.append((name, *(f"{value:.2f}" for value in shift), f"{_image_roll(train):.2f}"))
    for name, offset in (("beam along its axis", 0.0), ("beam half a degree off it", 0.5)):
        cone = [
            np.linalg.norm(cone_errors(axis, TURN, np.radians(offset)), axis=1).max() / TURN
            for axis in range(3)
        ]
        rows.append((f"conical mirror, {name}", *(f"{value:.2f}" for value in cone), "–"))
    head = (
        "Retro-reflector",
        "turned about X (across the edge)",
        "about Y (along the edge)",
        "about Z (the beam)",
        "roll of the pattern from Z",
    )
    caption = (
        "Error of the returned direction for one unit of turn. Zero means that a turn does not "
        "matter; the edge of the two mirrors lies along Y."
    )
    return Study(caption, head, tuple(rows))


def _image_roll(train: FloatArray) -> float:
    """Return how far a pattern about the beam rolls for one unit of turn about the beam."""
    edge = np.array([1.0, 0.0, 0.0])
    # The change of a direction a little off the beam, less that of the beam, per unit of offset.
    tilted = OUT + 1e-4 * edge
    change = turn_response(train, tilted)[:, 2] - turn_response(train, OUT)[:, 2]
    return float(np.linalg.norm(change) / 1e-4)


def cone_errors(axis: int, turn: float, offset: float = 0.0) -> FloatArray:
    """Return the errors of light returned by a conical mirror that has turned about one axis.

    Parameters
    ----------
    axis : int
        0, 1 or 2.
    turn : float
        In radians.
    offset : float
        Angle of the beam against the cone's axis at rest, in radians.

    Returns
    -------
    ndarray, shape (RING, 3)
        Returned directions less those of the cone at rest, around a full ring.
    """
    around = 2.0 * np.pi * (np.arange(RING) + 0.5) / RING
    origins = np.stack([0.3 * np.cos(around), 0.3 * np.sin(around), np.full(RING, 2.0)], axis=-1)
    beam = -np.array([np.sin(offset), 0.0, np.cos(offset)])
    coming = np.broadcast_to(beam, origins.shape)
    still = cone_return(origins, coming)
    return np.asarray(cone_return(origins, coming, turn * np.eye(3)[axis]) - still)


def dichroic() -> Study:
    """How much a tilt of the dichroic mirror feigns, and the tolerance that follows.

    Returns
    -------
    Study
        One row per axis of the mirror.
    """
    door = given((BORESIGHT, ACCURACY, EXPANSION))
    response = dichroic_response(door[BORESIGHT])
    accuracy = float(door.array(ACCURACY).max())
    heat = door[EXPANSION]
    rows = []
    for name, column in zip(
        ("in the plane of the light", "across it", "its normal"), response.T, strict=True
    ):
        factor = float(np.linalg.norm(column))
        tolerance = "any" if factor < 1e-9 else f"{accuracy / factor / ARCSEC:.3f}"
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

    Parameters
    ----------
    boresight_angle : float
        Between camera and tracker, in radians.

    Returns
    -------
    ndarray, shape (3, 3)
        Columns: about the axis in the mirror and in the plane of the light, about the one in the
        mirror across that plane, about the mirror's normal.
    """
    tilt = float(mirrors.fold_mirror_tilt(boresight_angle))
    tracker = rotation_from_vector([boresight_angle, 0.0, 0.0]) @ OUT
    coming = -OUT
    # The plane of the light is that of both boresights, across X.
    normal = rotation_from_vector([boresight_angle + tilt, 0.0, 0.0]) @ OUT
    going = reflection(normal) @ coming
    if not np.allclose(going, -tracker, atol=1e-9):
        normal = rotation_from_vector([boresight_angle - tilt, 0.0, 0.0]) @ OUT
    across = np.array([1.0, 0.0, 0.0])
    axes = np.stack([np.cross(across, normal), across, normal], axis=-1)
    result: FloatArray = turn_response(reflection(normal), coming) @ axes
    return result


def heat() -> Study:
    """What a micrometre of thermal motion of one laser does, in flight and on the bench.

    Returns
    -------
    Study
        One row per instrument.
    """
    focal = f"{design.SATELLITE}#panchromatic-focal-length.value"
    bench = f"{lasers.PLATFORM}#telescope-focal-length.value"
    short = f"{lasers.PLATFORM}#tracker-focal-length.value"
    door = given((focal, bench, short, RATIO))
    rows = (
        ("flight, as printed", f"{door[RATIO]:.0f}", f"{1e-6 / door[focal] / ARCSEC:.4f}"),
        (
            "flight camera with the tracker of Table II",
            f"{door[focal] / door[short]:.1f}",
            f"{1e-6 / door[focal] / ARCSEC:.4f}",
        ),
        (
            "ground platform",
            f"{door[bench] / door[short]:.1f}",
            f"{1e-6 / door[bench] / ARCSEC:.4f}",
        ),
    )
    head = ("Instrument", "spot moves less by the factor", "angle of one laser for 1 µm (arcsec)")
    caption = (
        "The reduction belongs to lengths on the detector. The angle depends on the camera alone, "
        "and all lasers moving together are a misalignment."
    )
    return Study(caption, head, rows)


def patterns() -> Study:
    """Number and spread of lasers against the error on the ground, roll included.

    Returns
    -------
    Study
        One row per pattern.
    """
    door = given((*twin.READS, twin_study.SMOOTHED, *twin_study.SATELLITE))
    platform = twin.bench(door)
    spread = float(np.linalg.norm(platform.spots - platform.spots.mean(axis=0), axis=1).mean())
    pixel = platform.tracker[1] / platform.tracker[2]
    scatter = np.sqrt((lasers.scatter(door, 2) ** 2).mean() / door.count(twin_study.SMOOTHED))
    height = twin_study.altitude(door)
    rows = []
    for count, size in PATTERNS:
        sigma = pattern_sigma(count, size * spread * pixel, float(scatter) * pixel)
        tilt, roll = np.hypot(*sigma[:2]) * height, sigma[2]
        errors = [f"{3 * np.hypot(tilt, roll * off):.2f}" for off in twin_study.OFF_CENTRE]
        rows.append((f"{count} lasers, {size:g} times as wide", *errors))
    head = ("Pattern", *(f"{off / 1e3:g} km off centre (m)" for off in twin_study.OFF_CENTRE))
    caption = (
        "Three-sigma error on the ground of the averaged misalignment, for lasers on a ring. "
        "Width counts in that of the ground platform's pattern in the tracker."
    )
    return Study(caption, head, tuple(rows))


def pattern_sigma(count: int, radius: float, sigma: float) -> FloatArray:
    """Return the errors about X, Y and Z for lasers on a ring about the boresight.

    Parameters
    ----------
    count : int
        How many.
    radius : float
        Of the ring, in radians.
    sigma : float
        Error of one direction along one axis, in radians.

    Returns
    -------
    ndarray, shape (3,)
        Standard deviations, in radians.
    """
    around = 2.0 * np.pi * np.arange(count) / count
    flat = np.sin(radius) * np.stack([np.cos(around), np.sin(around)], axis=-1)
    directions = np.column_stack([flat, np.full(count, np.cos(radius))])
    return np.asarray(np.sqrt(attitude_covariance(directions, sigma).diagonal()))
