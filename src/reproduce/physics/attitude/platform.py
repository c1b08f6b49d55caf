"""Lights of a camera, and the star tracker that sees them: what a misalignment is measured with.

Frames are those of `physics.attitude.lasers`. Lengths are in metres, spots in px, x before y.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.attitude.angles import laser_transform
from reproduce.physics.attitude.lasers import emitted_directions, received_directions
from reproduce.physics.attitude.rotations import rotation_from_vector
from reproduce.physics.validate import FloatArray, finite_array, kernel, positive

_rotation_from_vector = kernel(rotation_from_vector)
# In metres: no pixel is that large, but one in micrometres or millimetres seems so.
LARGEST_PITCH = 1e-3


@dataclass(frozen=True, eq=False)
class Platform:
    """Two or more lights that turn with a camera, and the tracker that sees them, as designed.

    Parameters
    ----------
    lasers : array_like, shape (n, 2)
        Positions on the camera's focal plane, in metres. Where lights are known otherwise, see
        `of_directions` and `of_spots`.
    camera_focal_length, tracker_focal_length : float, in metres
    pixel_pitch : float
        Distance between the tracker's neighbouring pixels, in metres.
    principal_point : array_like, shape (2,)
        Of the tracker, in px.
    spots : array_like, shape (n, 2), optional
        Rough positions of the spots, in px: they fix the attitude about which angles are small.
        Without them the two boresights are taken for parallel.

    Raises
    ------
    ValueError
        If there are fewer than two lights, or a length cannot be one in metres.

    Examples
    --------
    >>> Platform([[1, 0], [0, 1]], 2.0, 0.05, 5e-6, (0, 0)).spots / 5e3
    array([[1., 0.],
           [0., 1.]])
    """

    lasers: FloatArray
    camera_focal_length: float
    tracker_focal_length: float
    pixel_pitch: float
    principal_point: FloatArray
    spots: FloatArray = field(default_factory=lambda: np.empty((0, 2)))

    def __post_init__(self) -> None:
        lasers = finite_array("lasers", self.lasers, shape=(None, 2))
        if lasers.ndim != 2 or len(lasers) < 2:
            raise ValueError(f"lasers: expected two lights or more, (n, 2), got {lasers.shape}")
        for name in ("camera_focal_length", "tracker_focal_length", "pixel_pitch"):
            object.__setattr__(self, name, float(positive(name, getattr(self, name))))
        if self.pixel_pitch > LARGEST_PITCH:
            raise ValueError(
                f"pixel_pitch: expected metres, below {LARGEST_PITCH:g}, got {self.pixel_pitch:g}; "
                "give 5.5e-6 for 5.5 micrometres"
            )
        object.__setattr__(self, "lasers", lasers)
        centre = finite_array("principal_point", self.principal_point, shape=(2,))
        object.__setattr__(self, "principal_point", centre)
        spots = finite_array("spots", self.spots, shape=(None, 2)) if len(self.spots) else (
            self.principal_point + lasers / self.camera_focal_length * self.pixels
        )  # fmt: skip
        if len(spots) != len(lasers):
            raise ValueError(f"spots: expected {len(lasers)}, one for each light, got {len(spots)}")
        object.__setattr__(self, "spots", spots)

    @classmethod
    def of_directions(
        cls,
        directions: ArrayLike,
        tracker_focal_length: float,
        pixel_pitch: float,
        principal_point: ArrayLike,
    ) -> Platform:
        """Return the platform of lights of which the directions are known.

        Other arguments are those of the class.

        Parameters
        ----------
        directions : array_like, shape (n, 3)
            In which the lights leave, in the camera frame, of any length; Z, along the boresight,
            above zero. The angles are about the axes of this frame.

        Examples
        --------
        >>> Platform.of_directions([[0, 0, 1], [-0.6, 0, 0.8]], 0.05, 5e-6, (0, 0)).lasers + 0.0
        array([[0.  , 0.  ],
               [0.75, 0.  ]])
        """
        rays = finite_array("directions", directions, shape=(None, 3))
        if (rays[:, 2] <= 0).any():
            raise ValueError(
                f"directions: expected a third component above zero, got {rays[:, 2].min():g}; the "
                "lights leave along Z of the camera"
            )
        lasers = -rays[:, :2] / rays[:, 2:]
        return cls(lasers, 1.0, tracker_focal_length, pixel_pitch, np.asarray(principal_point))

    @classmethod
    def of_spots(
        cls,
        spots: ArrayLike,
        tracker_focal_length: float,
        pixel_pitch: float,
        principal_point: ArrayLike,
    ) -> Platform:
        """Return the platform of lights of which only the spots are known.

        The camera's frame is then that of the tracker. Other arguments are those of the class.

        Parameters
        ----------
        spots : array_like, shape (n, 2)
            Where the lights should fall on the tracker's detector, in px.

        Examples
        --------
        >>> Platform.of_spots([[10, 0], [0, 10]], 0.05, 5e-6, (0, 0)).lasers * 1e6
        array([[50.,  0.],
               [ 0., 50.]])
        """
        places = finite_array("spots", spots, shape=(None, 2))
        centre = finite_array("principal_point", principal_point, shape=(2,))
        length = tracker_focal_length
        return cls((places - centre) * pixel_pitch, length, length, pixel_pitch, centre)

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
        """In which the lights leave, unit vectors in the camera frame, (n, 3)."""
        return emitted_directions(self.lasers, self.camera_focal_length)

    @cached_property
    def reference(self) -> FloatArray:
        """tracker_from_camera that lays the designed lasers over the rough spots best, (3, 3)."""
        return laser_transform(self.directions, received_directions(self.spots, *self.tracker))

    def predicted(
        self, mount: FloatArray, turn: FloatArray, scale: FloatArray, focal: FloatArray | float
    ) -> FloatArray:
        """Where the spots should lie, shape (n, groups, lasers, 2), in px.

        The mount, (n, 3), is the rotation vector of the zero attitude against `reference`, in the
        camera frame; the turn, (n, groups, 3), holds the misalignment angles since the zero point;
        the scale, (n,), is the size of the laser pattern over the designed one.
        """
        return self.landed(mount, turn, scale[:, None, None] * self.lasers, focal)

    def landed(
        self, mount: FloatArray, turn: FloatArray, lasers: FloatArray, focal: FloatArray | float
    ) -> FloatArray:
        """Where the spots of lasers at given positions, (n, lasers, 2), in metres, lie.

        The rest is as for `predicted`.
        """
        count = len(mount)
        rays = np.empty((count, lasers.shape[-2], 3))
        rays[..., :2] = -lasers
        rays[..., 2] = np.broadcast_to(focal, count)[:, None]
        zero = self.reference @ _rotation_from_vector(mount)
        now = zero[:, None] @ _rotation_from_vector(turn)  # (6): the turn of the camera, undone
        arriving = rays[:, None] @ np.swapaxes(now, -1, -2)
        slopes = arriving[..., :2] / arriving[..., 2:]
        return np.asarray(self.principal_point - slopes * self.pixels)
