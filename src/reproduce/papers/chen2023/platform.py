"""The ground platform: four lasers, their spots and the scatter of the spots (chen2023, IV-A, V-A).

Two assumptions replace numbers that the paper does not print:

* the principal point of the tracker is the centre of the detector. The centre of the first pixel is
  at zero;
* each laser is at the corner of the designed square that is nearest to its spot. The image of the
  square is a few per cent smaller than designed, which changes the errors of angles by far less
  than a printed digit.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from reproduce.papers.declare import Results, reproduces
from reproduce.physics.attitude import Platform
from reproduce.physics.optics import angle_from_pixels, detector_centre
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs, load_inputs
from reproduce.store.files import FilePath

SPOTS = "chen2023/text-platform#spot-*"
DIAGONAL = "chen2023/text-hardware#laser-diagonal"
TELESCOPE = "chen2023/table-2#telescope-focal-length.value"
TRACKER_FOCAL_LENGTH = "chen2023/table-2#tracker-focal-length.value"
PIXEL = "chen2023/table-2#tracker-pixel-size.value"
PIXELS = "chen2023/table-2#tracker-pixels-*.value"
TRACKER = (TRACKER_FOCAL_LENGTH, PIXEL)
# Inputs of the directions of lasers and spots.
INSTRUMENT = (SPOTS, DIAGONAL, TELESCOPE, TRACKER_FOCAL_LENGTH, PIXEL, PIXELS)
# Table III prints three standard deviations.
SIGMAS = 3.0


@reproduces(
    "chen2023/table-2", cells=["tracker-angular-resolution.value"], inputs=TRACKER
)
def pixel_angle(inputs: Inputs) -> Results:
    """Compute the angle of one pixel from the pixel size and focal length of the tracker."""
    angle = angle_from_pixels(1, inputs[PIXEL], inputs[TRACKER_FOCAL_LENGTH])
    return {"tracker-angular-resolution.value": angle}


@reproduces("chen2023/text-platform", cells=["sd-*"], inputs=["chen2023/table-3"])
def scatter_range(inputs: Inputs) -> Results:
    """Return the smallest and largest scatter in Table III."""
    printed = inputs.array("chen2023/table-3")
    return {"sd-low": printed.min(), "sd-high": printed.max()}


def as_designed(inputs: Inputs) -> Platform:
    """Return the platform as designed, with the detector's centre as principal point.

    Each laser is at the corner of the designed square that is nearest to its spot.
    """
    spots = inputs.pairs(SPOTS)
    offsets = spots - spots.mean(axis=0)
    return Platform(
        # The square stands on a corner.
        lasers=np.round(offsets / np.abs(offsets).max()) * inputs[DIAGONAL] / 2,
        camera_focal_length=inputs[TELESCOPE],
        tracker_focal_length=inputs[TRACKER_FOCAL_LENGTH],
        pixel_pitch=inputs[PIXEL],
        principal_point=detector_centre(inputs.array(PIXELS)),
        spots=spots,
    )


def platform_of(source: Platform | FilePath | None) -> Platform:
    """Return a platform, as given or from a TOML file of its arguments; by default as designed.

    The file contains ``lasers`` and ``camera_focal_length``, or ``directions``, or only ``spots``.
    """
    if source is None:
        return as_designed(load_inputs(INSTRUMENT))
    if isinstance(source, Platform):
        return source
    make: Callable[..., Platform] = Platform
    try:
        table = tomllib.loads(Path(source).read_text(encoding="utf-8-sig"))
        if "directions" in table:
            make = Platform.of_directions
        elif "lasers" not in table:
            make = Platform.of_spots
        return make(**table)
    except (TypeError, ValueError, RecursionError) as error:
        raise ValueError(
            "platform: expected a Platform, or a TOML file of lasers and camera_focal_length, or "
            "of directions, or of spots, with tracker_focal_length, pixel_pitch and "
            f"principal_point ({error})"
        ) from error


def square_ratio(design: Platform) -> float:
    """Return the size of the square of the spots over its size by design."""
    printed, designed = (
        np.ptp(points, axis=0).mean() for points in (design.spots, design.lasers)
    )
    return printed / (designed * design.pixels / design.camera_focal_length)


def unit_rotations(inputs: Inputs, group: int) -> FloatArray:
    """Return the rotations about X, Y and Z by one standard deviation of each coordinate, (3, 8).

    They are the rotations by the noise of one frame of a group, in radians.
    """
    design = as_designed(inputs)
    return (design.response(design.spots) * scatter(inputs, group)).reshape(3, -1)


def angle_sigma(inputs: Inputs, group: int, frames: int) -> FloatArray:
    """Return the standard deviation of the angles about X, Y and Z from some frames of a group."""
    return np.linalg.norm(unit_rotations(inputs, group), axis=1) / np.sqrt(frames)


def scatter(inputs: Inputs, group: int) -> FloatArray:
    """Return one standard deviation of x and y of each spot of a group, shape (4, 2), in px."""
    return inputs.pairs(f"chen2023/table-3#{group}-*") / SIGMAS
