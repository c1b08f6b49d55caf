"""The four laser spots of the ground platform as a small instrument (chen2023, IV-A, V-A).

What the paper leaves open, and what stands in for it:

* the principal point of the tracker is not printed: the centre of the detector stands in, where
  the centre of the first pixel is at zero;
* which laser sits at which corner is read from the spots: each at the corner of the designed
  square that lies towards its spot. The image of the square is about a twentieth smaller than
  designed, which moves the angles of a centroid error by far less than a digit of print.
"""

from __future__ import annotations

import numpy as np

from reproduce.physics.attitude.lasers import (
    emitted_directions,
    received_directions,
    received_jacobian,
)
from reproduce.physics.attitude.misalignment import angle_jacobian, laser_transform
from reproduce.physics.optics.camera import detector_centre
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

PLATFORM = "chen2023/table-2"
SCATTER = "chen2023/table-3"
SPOTS = "chen2023/text-platform#spot-*"
DIAGONAL = "chen2023/text-hardware#laser-diagonal"
READS = (
    SPOTS,
    DIAGONAL,
    f"{PLATFORM}#telescope-focal-length.value",
    f"{PLATFORM}#tracker-focal-length.value",
    f"{PLATFORM}#tracker-pixel-size.value",
    f"{PLATFORM}#tracker-pixels-*.value",
)
# Table III prints three standard deviations.
SIGMAS = 3.0


def angle_response(given: Given) -> FloatArray:
    """Return how the camera's misalignment angles respond to errors of the four centroids.

    Shape (2, 4, 2). Derivative of the angles about X and Y of the camera by x and y of each spot,
    in rad/px.
    """
    return turn_response(given)[:2]


def turn_response(given: Given) -> FloatArray:
    """Return the same response for the angles about X, Y and Z, roll included.

    Shape (3, 4, 2). In rad/px.
    """
    return responses(given, tracker_centre(given))[0]


def tracker_centre(given: Given) -> FloatArray:
    """Return the centre of the tracker's detector, in px."""
    return detector_centre(given.array(f"{PLATFORM}#tracker-pixels-*.value"))


def responses(given: Given, principal_point: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the response of the error of the laser transform, in two frames.

    Shape (3, 4, 2). About the axes of the camera, and about those of the tracker, in rad/px.
    """
    spots = given.array(SPOTS).reshape(-1, 2)
    tracker = (
        spots,
        principal_point,
        given[f"{PLATFORM}#tracker-pixel-size.value"],
        given[f"{PLATFORM}#tracker-focal-length.value"],
    )
    camera = emitted_directions(
        designed_positions(spots, given[DIAGONAL]),
        given[f"{PLATFORM}#telescope-focal-length.value"],
    )
    received = received_directions(*tracker)
    response = angle_jacobian(camera, received, received_jacobian(*tracker))
    # One small rotation, told in the other frame: its vector turns with the laser transform.
    turned = np.tensordot(laser_transform(camera, received), response, axes=1)
    return response, np.asarray(turned)


def designed_positions(spots: FloatArray, diagonal: float) -> FloatArray:
    """Return where the lasers sit by design, each at the corner that lies towards its spot.

    Shape (4, 2). Positions on the camera's focal plane, in metres.
    """
    offsets = spots - spots.mean(axis=0)
    corners: FloatArray = np.round(offsets / np.abs(offsets).max())  # it stands on a corner
    return corners * diagonal / 2


def scatter(given: Given, group: int) -> FloatArray:
    """Return the centroid scatter of one group of images.

    Shape (4, 2). One standard deviation of x and y of each spot, in px.
    """
    return given.array(f"{SCATTER}#{group}-*").reshape(-1, 2) / SIGMAS
