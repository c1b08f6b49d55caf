"""The ground platform: its tracker and the scatter of its laser spots (chen2023, IV-A, V-A)."""

from __future__ import annotations

from reproduce.papers.declare import Results, reproduces
from reproduce.physics.optics.camera import angle_from_pixels
from reproduce.printed.given import Given

PLATFORM = "chen2023/table-2"
SCATTER = "chen2023/table-3"
TRACKER = [f"{PLATFORM}#tracker-focal-length.value", f"{PLATFORM}#tracker-pixel-size.value"]


def angle_of_one_pixel(given: Given) -> float:
    """Angle that one pixel of the ground tracker sees, in radians."""
    focal_length, pixel_pitch = (given[address] for address in TRACKER)
    return float(angle_from_pixels(1, pixel_pitch, focal_length))


@reproduces(PLATFORM, cells=["tracker-angular-resolution.value"], given=TRACKER)
def pixel_angle(given: Given) -> Results:
    """Angle of one pixel from the tracker's pixel size and focal length."""
    return {"tracker-angular-resolution.value": angle_of_one_pixel(given)}


@reproduces("chen2023/text-platform", cells=["sd-*"], given=[SCATTER])
def scatter_range(given: Given) -> Results:
    """Smallest and largest scatter in Table III."""
    scatter = given.array(SCATTER)
    return {"sd-low": float(scatter.min()), "sd-high": float(scatter.max())}
