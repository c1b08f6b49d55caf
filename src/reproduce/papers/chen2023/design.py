"""The satellite's camera and the monitoring system as designed (chen2023, sections I and II)."""

from __future__ import annotations

from reproduce.papers.declare import Blocked, Results, reproduces
from reproduce.physics.ground import errors
from reproduce.physics.light import raytrace
from reproduce.printed.given import Given

SATELLITE = "chen2023/table-1"
DESIGN = "chen2023/text-satellite"
TRACKER = "chen2023/table-2#tracker-focal-length.value"


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
    altitude = errors.altitude_for_resolution(
        given[f"{SATELLITE}#panchromatic-focal-length.value"],
        given[f"{SATELLITE}#panchromatic-pixel-size.value"],
        given[f"{SATELLITE}#panchromatic-ground-resolution.value"],
    )
    resolution = errors.ground_resolution(
        given[f"{SATELLITE}#multispectral-focal-length.value"],
        given[f"{SATELLITE}#multispectral-pixel-size.value"],
        altitude,
    )
    return {"multispectral-ground-resolution.value": float(resolution)}


@reproduces(
    "chen2023/text-positioning",
    cells=["*-resolution"],
    given=[f"{SATELLITE}#*ground-resolution.value"],
)
def quoted_resolution(given: Given) -> Results:
    """Ground resolutions of Table I, quoted again in the introduction."""
    return {
        f"{sensor}-resolution": given[f"{SATELLITE}#{sensor}-ground-resolution.value"]
        for sensor in ("panchromatic", "multispectral")
    }


@reproduces(
    DESIGN,
    cells=["focal-ratio"],
    given=[f"{SATELLITE}#panchromatic-focal-length.value", TRACKER],
)
def focal_ratio(given: Given) -> Results:
    """Camera's focal length over the tracker's, with the ground tracker standing in."""
    ratio = given[f"{SATELLITE}#panchromatic-focal-length.value"] / given[TRACKER]
    missing = "the focal length of the flight tracker; the ground tracker's stands in"
    return {"focal-ratio": Blocked(missing, ratio)}


@reproduces(DESIGN, cells=["dihedral-angle"], given=[f"{DESIGN}#boresight-angle"])
def dichroic_tilt(given: Given) -> Results:
    """Tilt of the dichroic mirror that folds the retro-reflected laser into the tracker."""
    return {"dihedral-angle": float(raytrace.fold_mirror_tilt(given[f"{DESIGN}#boresight-angle"]))}
