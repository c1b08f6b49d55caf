"""Lights of a camera, the star tracker that images them, and the directions of their light.

Both instruments use the same frame: the origin is the intersection of boresight and focal plane,
Z is along the boresight out of the instrument, X and Y are along the axes of the focal plane. An
image through one lens is inverted, hence the minus signs of (2) and (3): the light of a source at
positive X goes towards negative X. A direction in the tracker points to the source of the light, as
for a star.

Points on the focal plane of the camera are in metres, spots on the detector of the tracker in px,
x before y. Directions are unit vectors of shape (..., n, 3): v_i,cam of the paper in the camera,
w_i^k in the tracker. Leading axes are a batch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.attitude.angles import (
    laser_transform,
    misalignment,
    misalignment_angles,
)
from reproduce.physics.attitude.rotations import attitude, rotation_from_vector, unit
from reproduce.physics.optics import ideal_positions
from reproduce.physics.validate import (
    Directions,
    FloatArray,
    IntArray,
    Point,
    Points,
    Size,
    checked,
    checked_fields,
    valid,
    weights_for,
)


@checked
def emitted_directions(
    points: Points, focal_length: Size, principal_point: Point = (0.0, 0.0)
) -> FloatArray:
    """Return the directions of the light of lasers on the focal plane of the camera.

    Implements: chen2023 (2).

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Laser positions (X_i, Y_i) on the focal plane, in metres.
    focal_length : float
        Focal length of the camera, in metres.
    principal_point : array_like, shape (..., 2)
        Principal point (X_0, Y_0), in metres.

    Returns
    -------
    ndarray, shape (..., n, 3)
        Unit vectors v_i,cam in the camera frame, out of the camera.

    Examples
    --------
    A laser at three quarters of the focal length from the centre.

    >>> emitted_directions([[3.0, 0.0]], focal_length=4.0)
    array([[-0.6,  0. ,  0.8]])
    """
    # (2) is (3) for positions in metres.
    return received_directions(points, principal_point, 1.0, focal_length)


@checked
def received_directions(
    spots: Points, principal_point: Point, pixel_pitch: Size, focal_length: Size
) -> FloatArray:
    """Return the directions of the sources of laser spots in the tracker.

    Implements: chen2023 (3).

    Parameters
    ----------
    spots : array_like, shape (..., n, 2)
        Centroids (x_i, y_i) of the spots, in px.
    principal_point : array_like, shape (..., 2)
        Principal point (x_0, y_0) of the tracker, in px.
    pixel_pitch : float
        Distance between the centres of neighbouring pixels, in metres.
    focal_length : float
        Focal length of the tracker, in metres.

    Returns
    -------
    ndarray, shape (..., n, 3)
        Unit vectors w_i in the tracker frame, towards the source of the light.

    Examples
    --------
    >>> received_directions([[13.0, 10.0]], (10.0, 10.0), pixel_pitch=1.0, focal_length=4.0)
    array([[-0.6,  0. ,  0.8]])
    """
    slopes = (principal_point[..., None, :] - spots) * (pixel_pitch / focal_length)
    return unit("spots", np.insert(slopes, 2, 1.0, axis=-1))


@checked
def received_spots(
    directions: Directions,
    principal_point: Point,
    pixel_pitch: Size,
    focal_length: Size,
) -> FloatArray:
    """Return the spots of light from given directions, the inverse of `received_directions`.

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Tracker directions, of any length, towards the source of the light, in front of the tracker
        (z > 0).
    principal_point, pixel_pitch, focal_length
        As in `received_directions`.

    Returns
    -------
    ndarray, shape (..., n, 2)
        Centroids of the spots, in px.

    Examples
    --------
    >>> received_spots([[-0.6, 0.0, 0.8]], (10.0, 10.0), pixel_pitch=1.0, focal_length=4.0)
    array([[13., 10.]])
    """
    offsets = ideal_positions(directions, focal_length / pixel_pitch)
    return principal_point[..., None, :] - offsets


def _check_distinct(
    name: str, points: FloatArray, numbers: Sequence[int] | IntArray
) -> None:
    """Raise `ValueError` if two lights, called by their numbers, have the same position."""
    for i, j in combinations(range(len(points)), 2):
        if (points[i] == points[j]).all():
            raise ValueError(
                f"{name}: expected different positions, got lights {numbers[i]} and {numbers[j]} "
                "at one place. Correct or remove one of them"
            )


# Largest pixel pitch, in metres. Larger numbers are in micrometres or millimetres.
_LARGEST_PITCH = 1e-3


@checked_fields
@dataclass(frozen=True, eq=False)
class Platform:
    """Two or more lights that move with a camera, and the tracker that images them, as designed.

    Parameters
    ----------
    lasers : array_like, shape (n, 2)
        Positions on the focal plane of the camera, in metres. If other quantities are known, see
        `of_directions` and `of_spots`.
    camera_focal_length, tracker_focal_length : float
        Focal lengths, in metres.
    pixel_pitch : float
        Distance between neighbouring pixels of the tracker, in metres.
    principal_point : array_like, shape (2,)
        Principal point of the tracker, in px.
    spots : array_like, shape (n, 2), optional
        Rough positions of the spots, in px. They determine the attitude about which angles are
        small. Default: positions for parallel boresights.

    Raises
    ------
    ValueError
        If there are fewer than two lights, or a length is not in metres.

    Examples
    --------
    >>> Platform([[1, 0], [0, 1]], 2.0, 0.05, 5e-6, (0, 0)).spots / 5e3
    array([[1., 0.],
           [0., 1.]])
    """

    lasers: Points
    camera_focal_length: Size
    tracker_focal_length: Size
    pixel_pitch: Size
    principal_point: Point
    spots: Points = None

    def __post_init__(self) -> None:
        if self.lasers.ndim != 2 or len(self.lasers) < 2:
            raise ValueError(
                f"lasers: expected two lights or more, (n, 2), got {self.lasers.shape}"
            )
        _check_distinct("lights", self.lasers, range(1, len(self.lasers) + 1))
        valid(
            "pixel_pitch",
            self.pixel_pitch,
            self.pixel_pitch < _LARGEST_PITCH,
            f"metres, below {_LARGEST_PITCH:g}",
        )
        if self.spots is None:
            spots = self.lasers / self.camera_focal_length * self.pixels
            object.__setattr__(self, "spots", self.principal_point + spots)

    @classmethod
    @checked
    def of_directions(
        cls,
        directions: Directions,
        tracker_focal_length: Size,
        pixel_pitch: Size,
        principal_point: Point,
    ) -> Platform:
        """Return the platform of lights with known directions.

        Parameters
        ----------
        directions : array_like, shape (n, 3)
            Directions of the light in the camera frame, of any length, with Z, along the boresight,
            above zero. The angles are about the axes of this frame.
        tracker_focal_length, pixel_pitch, principal_point
            As in `Platform`.

        Returns
        -------
        Platform
            Platform with a camera of focal length 1 m.

        Examples
        --------
        >>> Platform.of_directions([[0, 0, 1], [-0.6, 0, 0.8]], 0.05, 5e-6, (0, 0)).lasers + 0.0
        array([[0.  , 0.  ],
               [0.75, 0.  ]])
        """
        return cls(
            lasers=-ideal_positions(directions, 1.0),
            camera_focal_length=1.0,
            tracker_focal_length=tracker_focal_length,
            pixel_pitch=pixel_pitch,
            principal_point=principal_point,
        )

    @classmethod
    @checked
    def of_spots(
        cls,
        spots: Points,
        tracker_focal_length: Size,
        pixel_pitch: Size,
        principal_point: Point,
    ) -> Platform:
        """Return the platform of lights of which only the spots are known.

        The frame of the camera is then the frame of the tracker.

        Parameters
        ----------
        spots : array_like, shape (n, 2)
            Expected spots on the detector of the tracker, in px.
        tracker_focal_length, pixel_pitch, principal_point
            As in `Platform`.

        Returns
        -------
        Platform
            Platform whose camera has the focal length of the tracker.

        Examples
        --------
        >>> Platform.of_spots([[10, 0], [0, 10]], 0.05, 5e-6, (0, 0)).lasers * 1e6
        array([[50.,  0.],
               [ 0., 50.]])
        """
        lasers, length = (spots - principal_point) * pixel_pitch, tracker_focal_length
        return cls(lasers, length, length, pixel_pitch, principal_point)

    @property
    def pixels(self) -> float:
        """Focal length of the tracker in px."""
        return self.tracker_focal_length / self.pixel_pitch

    @property
    def tracker(self) -> tuple[FloatArray, float, float]:
        """Principal point (px), pixel pitch and focal length of the tracker (m)."""
        return self.principal_point, self.pixel_pitch, self.tracker_focal_length

    @cached_property
    def directions(self) -> FloatArray:
        """Directions of the lights, unit vectors in the camera frame, (n, 3)."""
        return emitted_directions(self.lasers, self.camera_focal_length)

    @cached_property
    def reference(self) -> FloatArray:
        """Rotation tracker_from_camera, (3, 3), fitted to the rough spots of the lasers."""
        return self.transform(self.spots)

    def seen(self, spots: ArrayLike) -> FloatArray:
        """Return the directions of the sources of spots (..., n, 2), in px, in the tracker."""
        return received_directions(spots, *self.tracker)

    def transform(
        self, spots: ArrayLike, weights: ArrayLike | None = None
    ) -> FloatArray:
        """Return the laser transform of spots (..., n, 2), tracker_from_camera."""
        return laser_transform(self.directions, self.seen(spots), weights)

    def misalignment(
        self, spots: ArrayLike, zero: FloatArray, weights: ArrayLike | None = None
    ) -> FloatArray:
        """Return the misalignment angles, (..., 3), of spots against a laser transform."""
        seen = self.seen(spots)
        return misalignment_angles(misalignment(self.directions, seen, zero, weights))

    def response(
        self, spots: ArrayLike, weights: ArrayLike | None = None
    ) -> FloatArray:
        """Return the derivative of the misalignment angles by spots, (..., 3, n, 2), per px.

        At the optimum, sum w b × v is zero, with v the emitted direction, and b the received
        direction in the frame of the camera. Its derivative gives theta = H^-1 sum w v × db, with
        the stiffness H = trace(P) I - P and P = sum w v b^T.
        """
        seen = self.seen(spots)
        camera_from_tracker = attitude(self.directions, seen, weights)
        relative = weights_for(weights, len(self.lasers))
        emitted = relative[..., None] * self.directions
        product = emitted.mT @ (seen @ camera_from_tracker.mT)
        trace = np.trace(product, axis1=-2, axis2=-1)[..., None, None]
        stiffness = trace * np.eye(3) - 0.5 * (product + product.mT)
        # Only the motion across the ray changes the direction. The ray ends at unit depth.
        rays = seen[..., None]
        across = np.eye(3, 2) - rays * rays[..., :2, :].mT
        moved = camera_from_tracker[..., None, :, :] @ (rays[..., 2:, :] * across)
        torque = np.cross(emitted[..., None, :], moved.mT) / -self.pixels
        # The stiffness is symmetric, so rows times its inverse are the rotations.
        return np.moveaxis(torque @ np.linalg.inv(stiffness)[..., None, :, :], -1, -3)

    def predicted(
        self,
        turn: ArrayLike,
        mount: ArrayLike = (0.0, 0.0, 0.0),
        lasers: FloatArray | None = None,
    ) -> FloatArray:
        """Return the expected spots, shape (..., lasers, 2), in px.

        The turn, (..., 3), contains the misalignment angles since the zero point. The mount,
        (..., 3), is the rotation vector of the zero attitude against `reference`, in the camera
        frame. Lasers, (..., lasers, 2), are in metres. Default: as designed.
        """
        points = self.lasers if lasers is None else lasers
        rays = np.insert(-points, 2, self.camera_focal_length, axis=-1)
        zero = self.reference @ rotation_from_vector(mount)
        # (6): light passes through the inverse rotation of the camera.
        arriving = rays @ (zero @ rotation_from_vector(turn)).mT
        slopes = arriving[..., :2] / arriving[..., 2:]
        return self.principal_point - slopes * self.pixels
