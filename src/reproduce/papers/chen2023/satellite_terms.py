"""What heat and stray light may do, term by term as the paper lists them (chen2023, II-B).

The paper gives most of these terms in words. What its numbers allow is how large each may grow
until it mimics as much as the monitoring errs by: the three-sigma accuracy of the averaged
misalignment.

Stray light of the Sun and the Earth is kept out with a baffle, light of the landscape with the
narrow filter, and laser light out of the camera by matching the beam to its aperture. The paper
prints the bands and mean transmissions of the mirror, and no power, width or attenuation. So what
can be said is how much of each light the mirror may send on, and how much a spot tolerates.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.chen2023 import platform, resolution, satellite
from reproduce.papers.study import Column, studied
from reproduce.physics.attitude.rotations import unit
from reproduce.physics.images.centroid_theory import centre_of_gravity_error
from reproduce.physics.images.centroids import centre_of_gravity
from reproduce.physics.images.spots import spot_windows
from reproduce.physics.light.light_path import Mirrors
from reproduce.physics.optics.camera import field_of_view
from reproduce.printed.given import Given
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["heat", "stray", "thermal", "tolerances"]

RATIO = f"{satellite.TEXT}#focal-ratio"
FLIGHT = satellite.CAMERA[0]
PIXELS = f"{platform.PLATFORM}#tracker-pixels-x.value"
PAIR = "two mirrors at a right angle"
# A motion that is small enough to be a derivative: a micrometre.
STEP = 1e-6
# Tilts below this share of the accuracy are rounding noise.
NOISE = 1e-6
MIRROR = f"{platform.PLATFORM}#dichroic-"
SEEN = f"{platform.PLATFORM}#tracker-band-high.value"
# No width of the narrow filter is printed; this one stands in, in metres.
FILTER_WIDTH = 10e-9
# How much an even background may add to the noise of a centroid.
ADDED = 0.1


@studied(
    "chen2023/heat",
    given=(FLIGHT, *platform.TRACKER, platform.TELESCOPE, RATIO, PIXELS, satellite.ACCURACY),
    columns=(
        Column("Instrument"),
        Column("spot moves less by the factor", ".1f"),
        Column("tracker's focal length (mm)", ".0f"),
        Column("field of Table II's detector behind it (°)", ".1f"),
        Column("angle for 1 µm of all lasers (arcsec)", ".4f"),
        Column("motion as large as the accuracy (µm)", ".1f"),
    ),
    caption="The reduction belongs to lengths on the detector. The angle depends on the camera "
    "alone, and all lasers moving together are a misalignment.",
)
def heat(given: Given) -> list[tuple[str, float, float, float, float, float]]:
    """What thermal motion of the lasers does, in flight and on the bench."""
    accuracy = float(given.array(satellite.ACCURACY).max())
    bench, short = given[platform.TELESCOPE], given[platform.FOCAL_LENGTH]
    rows = []
    for name, camera, tracker in (
        ("flight, as printed", given[FLIGHT], given[FLIGHT] / given[RATIO]),
        ("flight camera with the tracker of Table II", given[FLIGHT], short),
        ("ground platform", bench, short),
    ):
        view = np.degrees(float(field_of_view(given[PIXELS], given[platform.PIXEL], tracker)))
        angle = STEP / camera / RADIANS_PER_ARCSEC
        rows.append((name, camera / tracker, tracker * 1e3, view, angle, accuracy * camera * 1e6))
    return rows


@studied(
    "chen2023/thermal",
    given=(*satellite.LIGHT_PATH, satellite.EXPANSION, satellite.ACCURACY, FLIGHT),
    columns=(
        Column("Term"),
        Column("unit of its motion"),
        Column("tilt that one unit mimics (arcsec)", "#.3g", zero=NOISE),
        Column("as large as the accuracy at (units)", ".3g"),
        Column("which takes (K)", ".3g"),
    ),
    caption="Thermal terms of the flight camera, against the three-sigma accuracy of a hundred "
    "frames. The last column takes the expansion coefficient that the paper prints, for a support "
    "as long as the lasers' square, or the difference between two sides of a mirror's support.",
)
def thermal(given: Given) -> list[tuple[str, str, float, float, float]]:
    """Thermal terms: what each mimics, and how large it may be."""
    accuracy = float(given.array(satellite.ACCURACY).max())
    kind, points, expansion = PAIR, platform.lasers(given), given[satellite.EXPANSION]
    # In angle only the camera's own focal length counts, so the flight camera is set in.
    rest = replace(satellite.bench_path(given, kind), camera_focal_length=given[FLIGHT])
    outward = points / np.linalg.norm(points, axis=1, keepdims=True)
    rows = []
    for name, moves in {
        "all lasers move together": [1.0, 0.0],
        "one laser of four moves": np.eye(len(points), 2) * [1.0, 0.0],
        "the pattern grows evenly": outward,
    }.items():
        angles = satellite.believed(rest, kind, points, STEP * np.asarray(moves))
        tilt = np.hypot(*angles[:2])
        length = accuracy / tilt * STEP if tilt > NOISE * accuracy else np.inf
        kelvin = length / (expansion * given[platform.DIAGONAL])
        rows.append((name, "µm", tilt / RADIANS_PER_ARCSEC, length * 1e6, kelvin))
    response = satellite.dichroic_response(given[satellite.BORESIGHT])
    for name, factor in {
        "the dichroic mirror tilts": np.linalg.norm(response, axis=0).max(),
        "the angle of the two mirrors opens": opened_angle(given, kind),
        "one angle of a corner cube opens": opened_angle(given, "corner cube"),
    }.items():
        turn = accuracy / factor
        rows.append((name, "arcsec", factor, turn / RADIANS_PER_ARCSEC, turn / expansion))
    return rows


def opened_angle(given: Given, kind: str) -> float:
    """Return the tilt that is believed when one right angle of a retro-reflector opens.

    In radians per radian.
    """
    points, rest = platform.lasers(given), satellite.bench_path(given, kind)
    if not isinstance(rest.retroreflector, Mirrors):
        raise TypeError(f"kind: expected a retro-reflector of plane mirrors, got {kind!r}")
    normals = unit("normals", rest.retroreflector.normals)
    # One mirror turns about its edge with the next one, away from it.
    normals[0] += satellite.TURN * normals[1]
    opened = replace(rest.retroreflector, normals=normals)
    angles = satellite.believed(rest, kind, points, retroreflector=opened)
    return float(np.hypot(*angles[:2])) / satellite.TURN


@studied(
    "chen2023/stray",
    given=(*resolution.SPOT_READS, f"{MIRROR}*.value", SEEN, satellite.ACCURACY),
    columns=(
        Column("Term"),
        Column("at most (%)", ".1f"),
        Column("at most (electrons per px)", ".2f"),
    ),
    caption="Stray light. Shares follow from the mean transmission and reflection of Table II, "
    "which are limits; the width of the filter is ours. The last two take the light that Table III "
    "implies by photon noise alone, {signal:.0f} electrons in a spot; the slope is from one px to "
    "the next.",
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
    tilted = window + np.arange(size) + corner[0]
    moved = float(centre_of_gravity(tilted, corner)[0])
    pixel = float(given[platform.PIXEL] / given[platform.FOCAL_LENGTH])
    accuracy = float(given.array(satellite.ACCURACY).max())
    return light.signal, float(background), accuracy / pixel / moved
