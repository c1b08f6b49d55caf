"""What heat may do, term by term as the paper lists them (chen2023, II-B).

The paper gives most of these terms in words. What its numbers allow is how large each may grow
until it mimics as much as the monitoring errs by: the three-sigma accuracy of the averaged
misalignment.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reproduce.papers.chen2023 import design, lasers, light_study
from reproduce.papers.study import Study
from reproduce.physics.light.light_path import Mirrors
from reproduce.physics.optics.camera import field_of_view
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.units import RADIANS_PER_ARCSEC

RATIO = f"{design.DESIGN}#focal-ratio"
FLIGHT = f"{design.SATELLITE}#panchromatic-focal-length.value"
BENCH = f"{lasers.PLATFORM}#telescope-focal-length.value"
SHORT = f"{lasers.PLATFORM}#tracker-focal-length.value"
PIXEL = f"{lasers.PLATFORM}#tracker-pixel-size.value"
PIXELS = f"{lasers.PLATFORM}#tracker-pixels-x.value"
# A motion that is small enough to be a derivative.
STEP = 1e-6


def heat() -> Study:
    """What thermal motion of the lasers does, in flight and on the bench."""
    door = given((FLIGHT, BENCH, SHORT, RATIO, PIXEL, PIXELS, light_study.ACCURACY))
    accuracy = float(door.array(light_study.ACCURACY).max())
    rows = []
    for name, camera, tracker in (
        ("flight, as printed", door[FLIGHT], door[FLIGHT] / door[RATIO]),
        ("flight camera with the tracker of Table II", door[FLIGHT], door[SHORT]),
        ("ground platform", door[BENCH], door[SHORT]),
    ):
        view = np.degrees(float(field_of_view(door[PIXELS], door[PIXEL], tracker)))
        rows.append(
            (
                name,
                f"{camera / tracker:.1f}",
                f"{tracker * 1e3:.0f}",
                f"{view:.1f}",
                f"{STEP / camera / RADIANS_PER_ARCSEC:.4f}",
                f"{accuracy * camera * 1e6:.1f}",
            )
        )
    head = (
        "Instrument",
        "spot moves less by the factor",
        "tracker's focal length (mm)",
        "field of Table II's detector behind it (°)",
        "angle for 1 µm of all lasers (arcsec)",
        "motion as large as the accuracy (µm)",
    )
    caption = (
        "The reduction belongs to lengths on the detector. The angle depends on the camera alone, "
        "and all lasers moving together are a misalignment."
    )
    return Study(caption, head, tuple(rows))


def thermal() -> Study:
    """Thermal terms: what each mimics, and how large it may be."""
    door = given((*light_study.READS, FLIGHT))
    accuracy = float(door.array(light_study.ACCURACY).max())
    rows = (*_laser_rows(door, accuracy), *_mirror_rows(door, accuracy))
    head = ("Term", "tilt that it mimics", "as large as the accuracy at", "which takes")
    caption = (
        "Thermal terms of the flight camera, against the three-sigma accuracy of a hundred frames. "
        "The last column takes the expansion coefficient that the paper prints, for a support as "
        "long as the lasers' square, or the difference between two sides of a mirror's support."
    )
    return Study(caption, head, rows)


def _laser_rows(door: Given, accuracy: float) -> list[tuple[str, ...]]:
    points = light_study.pattern(door)
    rest = light_study.bench_path(door, "two mirrors at a right angle")
    # In angle only the camera's own focal length counts, so the flight camera is set in.
    rest = replace(rest, camera_focal_length=door[FLIGHT])
    rows: list[tuple[str, ...]] = []
    for name, shifts in _laser_moves(points).items():
        angles = light_study.believed(rest, rest, points, points + shifts, False)
        factor = float(np.linalg.norm(angles[:2])) / STEP
        length = accuracy / factor if factor * STEP > 1e-6 * accuracy else np.inf
        kelvin = length / (door[light_study.EXPANSION] * door[lasers.DIAGONAL])
        entries = (_number(length * 1e6, "µm"), _number(kelvin, "K"))
        rows.append((name, f"{factor * 1e-6 / RADIANS_PER_ARCSEC:.4f} arcsec/µm", *entries))
    return rows


def _mirror_rows(door: Given, accuracy: float) -> list[tuple[str, ...]]:
    tilts = np.linalg.norm(light_study.dichroic_response(door[light_study.BORESIGHT]), axis=0)
    rows: list[tuple[str, ...]] = []
    for name, factor in (
        ("the dichroic mirror tilts", float(tilts.max())),
        ("the angle of the two mirrors opens", opened_angle(door, "two mirrors at a right angle")),
        ("one angle of a corner cube opens", opened_angle(door, "corner cube")),
    ):
        turn = accuracy / factor
        kelvin = turn / door[light_study.EXPANSION]
        entries = (_number(turn / RADIANS_PER_ARCSEC, "arcsec"), _number(kelvin, "K"))
        rows.append((name, f"{factor:.2f} of its turn", *entries))
    return rows


def _laser_moves(points: FloatArray) -> dict[str, FloatArray]:
    """Return motions of the lasers by a micrometre, each of shape (4, 2)."""
    one = np.zeros_like(points)
    one[0, 0] = STEP
    outward = STEP * points / np.linalg.norm(points, axis=1, keepdims=True)
    return {
        "all lasers move together": np.broadcast_to([STEP, 0.0], points.shape),
        "one laser of four moves": one,
        "the pattern grows evenly": outward,
    }


def opened_angle(door: Given, kind: str) -> float:
    """Return the tilt that is believed when one right angle of a retro-reflector opens.

    In radians per radian.
    """
    points, rest = light_study.pattern(door), light_study.bench_path(door, kind)
    if not isinstance(rest.retroreflector, Mirrors):
        raise TypeError(f"kind: expected a retro-reflector of plane mirrors, got {kind!r}")
    normals = rest.retroreflector.normals / np.linalg.norm(
        rest.retroreflector.normals, axis=1, keepdims=True
    )
    # One mirror turns about its edge with the next one, away from it.
    changed = normals.copy()
    changed[0] = normals[0] + light_study.TURN * normals[1]
    now = replace(rest, retroreflector=replace(rest.retroreflector, normals=changed))
    angles = light_study.believed(now, rest, points, points, light_study.KINDS[kind])
    return float(np.linalg.norm(angles[:2])) / light_study.TURN


def _number(value: float, unit: str) -> str:
    """Return a number with three digits and its unit; any, where it is without limit."""
    return "any" if not np.isfinite(value) else f"{value:.3g} {unit}"
