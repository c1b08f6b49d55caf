"""What chen2023 itself makes of laser spots: QUEST on mean spots, with first-order errors.

The method takes the camera for still within a group, the lasers for set as designed and the focal
length for the nominal one. Its standard errors come from the scatter of single images. Pieces of
an estimate have shape (2, m): estimates, then standard errors. Units, frames and signs are those
of `misalignment`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reproduce.inference.models.lasers import Platform, SpotStatistics
from reproduce.physics.attitude.lasers import (
    emitted_directions,
    received_directions,
    received_jacobian,
)
from reproduce.physics.attitude.misalignment import (
    angle_jacobian,
    laser_transform,
    misalignment,
    misalignment_angles,
)
from reproduce.physics.attitude.rotations import cross_matrix, transpose, vector_from_rotation
from reproduce.physics.validate import FloatArray


def none(count: int) -> FloatArray:
    """Return the piece for parameters of which the method gives no estimate, shape (2, count)."""
    return np.full((2, count), np.nan)


@dataclass(frozen=True, eq=False)
class Quest:
    """Angles of every group against the first one, and their errors.

    - `platform`: the instrument, as designed.
    - `statistics`: the data; the first group is the zero point.
    """

    platform: Platform
    statistics: SpotStatistics

    @cached_property
    def camera(self) -> FloatArray:
        """Emitted directions in the camera frame, shape (lasers, 3)."""
        return emitted_directions(self.platform.lasers, self.platform.camera_focal_length)

    @cached_property
    def optics(self) -> tuple[FloatArray, float, float]:
        """Principal point (px), pixel pitch and focal length of the tracker (m)."""
        platform = self.platform
        return platform.principal_point, platform.pixel_pitch, platform.tracker_focal_length

    @cached_property
    def received(self) -> FloatArray:
        """Received directions of the mean spots in the tracker frame, shape (groups, lasers, 3)."""
        return received_directions(self.statistics.means, *self.optics)

    @cached_property
    def zero(self) -> FloatArray:
        """tracker_from_camera at the zero point, shape (3, 3)."""
        return laser_transform(self.camera, self.received[0])

    @cached_property
    def angles(self) -> FloatArray:
        """Misalignment of every group, shape (groups, 3), in radians; that of the first is zero."""
        return misalignment_angles(misalignment(self.camera, self.received, self.zero))

    @cached_property
    def scatter(self) -> tuple[float, int]:
        """Standard deviation of a coordinate within a group, in px, and degrees of freedom.

        The scatter is about the mean of the group: whatever drifts counts as noise.
        """
        data = self.statistics
        squares = data.squares + float(np.square(data.slopes).sum(axis=(-2, -1)) @ data.levers)
        freedom = int((data.counts - 1).sum()) * data.means[0].size
        return float(np.sqrt(squares / freedom)), freedom

    @cached_property
    def covariances(self) -> FloatArray:
        """Covariance of the attitude of every group about the camera's axes, (groups, 3, 3)."""
        moves = received_jacobian(self.statistics.means, *self.optics)
        camera = np.broadcast_to(self.camera, self.received.shape)
        response = angle_jacobian(camera, self.received, moves).reshape(len(moves), 3, -1)
        variance = self.scatter[0] ** 2 / self.statistics.counts
        return np.asarray(variance[:, None, None] * (response @ transpose(response)))

    @property
    def mount(self) -> FloatArray:
        """Rotation vector of the zero attitude against the reference, in radians."""
        vector = vector_from_rotation(self.platform.reference.T @ self.zero)
        turn = _after(vector)
        covariance = turn @ self.covariances[0] @ turn.T
        return np.stack([vector, np.sqrt(np.diagonal(covariance))])

    def turned(self, group: int) -> FloatArray:
        """Misalignment angles of a group, in radians; the first group's error adds to its own."""
        turn = _after(self.angles[group])
        covariance = turn @ self.covariances[group] @ turn.T
        covariance += turn.T @ self.covariances[0] @ turn  # (I - [v ×]) goes before the turn
        return np.stack([self.angles[group], np.sqrt(np.diagonal(covariance))])

    @property
    def noise(self) -> FloatArray:
        """Noise of a coordinate in one image, in px."""
        scatter, freedom = self.scatter
        return np.array([[scatter], [scatter / np.sqrt(2 * freedom)]])


def _after(vector: FloatArray) -> FloatArray:
    """Response of a rotation vector to a small turn after it, I + [v ×] / 2, shape (3, 3).

    The pattern holds its roll hundreds of times worse than its tilts, so a vector of some arc
    minutes already carries roll into the errors of the tilts.
    """
    return np.eye(3) + 0.5 * cross_matrix(vector)
