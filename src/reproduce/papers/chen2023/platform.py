"""The ground platform: four lasers, their spots and the scatter of these (chen2023, IV-A, V-A).

Two assumptions replace numbers that the paper does not print:

* the principal point of the tracker is the centre of the detector. The centre of the first pixel is
  at zero;
* each laser is at the corner of the designed square that is nearest to its spot. The image of the
  square is 5 % smaller than designed, which changes the errors of angles by far less than a
  printed digit.
"""

from __future__ import annotations

import numpy as np

from reproduce.papers.declare import Results, reproduces
from reproduce.physics.attitude import Platform
from reproduce.physics.optics import angle_from_pixels, detector_centre
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs

PLATFORM = "chen2023/table-2"
SCATTER = "chen2023/table-3"
TEXT = "chen2023/text-platform"
SPOTS = f"{TEXT}#spot-*"
DIAGONAL = "chen2023/text-hardware#laser-diagonal"
TELESCOPE = f"{PLATFORM}#telescope-focal-length.value"
FOCAL_LENGTH = f"{PLATFORM}#tracker-focal-length.value"
PIXEL = f"{PLATFORM}#tracker-pixel-size.value"
PIXELS = f"{PLATFORM}#tracker-pixels-*.value"
TRACKER = (FOCAL_LENGTH, PIXEL)
# What the directions of lasers and spots are made of.
INSTRUMENT = (SPOTS, DIAGONAL, TELESCOPE, FOCAL_LENGTH, PIXEL, PIXELS)
# Table III prints three standard deviations.
SIGMAS = 3.0


def angle_of_one_pixel(inputs: Inputs) -> float:
    """Return the angle that one pixel of the ground tracker sees, in radians."""
    focal_length, pixel_pitch = (inputs[address] for address in TRACKER)
    return float(angle_from_pixels(1, pixel_pitch, focal_length))


@reproduces(PLATFORM, cells=["tracker-angular-resolution.value"], inputs=TRACKER)
def pixel_angle(inputs: Inputs) -> Results:
    """Angle of one pixel from the tracker's pixel size and focal length."""
    return {"tracker-angular-resolution.value": angle_of_one_pixel(inputs)}


@reproduces(TEXT, cells=["sd-*"], inputs=[SCATTER])
def scatter_range(inputs: Inputs) -> Results:
    """Smallest and largest scatter in Table III."""
    printed = inputs.array(SCATTER)
    return {"sd-low": float(printed.min()), "sd-high": float(printed.max())}


def angle_response(inputs: Inputs) -> FloatArray:
    """Return how the camera's misalignment angles respond to errors of the four centroids.

    Shape (3, 4, 2). Derivative of the angles about X, Y and Z of the camera by x and y of each
    spot, in rad/px.
    """
    design = as_designed(inputs)
    return design.response(design.spots)


def angle_sigma(inputs: Inputs, group: int, frames: int) -> FloatArray:
    """Return the standard deviation of the angles about X, Y and Z from some frames of a group."""
    squares = angle_response(inputs) ** 2 * scatter(inputs, group) ** 2
    return np.asarray(np.sqrt(squares.sum(axis=(1, 2)) / frames))


def printed_spots(inputs: Inputs) -> FloatArray:
    """Return the printed centroids, in px, of shape (4, 2)."""
    return inputs.array(SPOTS).reshape(-1, 2)


def lasers(inputs: Inputs) -> FloatArray:
    """Return the designed lasers, in metres, of shape (4, 2)."""
    return designed_positions(printed_spots(inputs), inputs[DIAGONAL])


def designed_positions(spots: FloatArray, diagonal: float) -> FloatArray:
    """Return where the lasers sit by design, each at the corner that lies towards its spot.

    Shape (4, 2). Positions on the camera's focal plane, in metres.
    """
    offsets = spots - spots.mean(axis=0)
    corners: FloatArray = np.round(
        offsets / np.abs(offsets).max()
    )  # it stands on a corner
    return corners * diagonal / 2


def as_designed(inputs: Inputs) -> Platform:
    """The platform as designed, with the centre of the detector for the principal point."""
    lengths = inputs[TELESCOPE], inputs[FOCAL_LENGTH], inputs[PIXEL]
    centre = detector_centre(inputs.array(PIXELS))
    return Platform(lasers(inputs), *lengths, centre, printed_spots(inputs))


def scatter(inputs: Inputs, group: int) -> FloatArray:
    """Return the centroid scatter of one group of images.

    Shape (4, 2). One standard deviation of x and y of each spot, in px.
    """
    return inputs.array(f"{SCATTER}#{group}-*").reshape(-1, 2) / SIGMAS
