"""Laser spots: what the likelihoods of the misalignment need of many images, and QUEST of them.

A group is a run of images of the same lasers. While the camera stands still, the mean of every
spot and the pooled scatter are sufficient; while it drifts evenly, the slope of every spot joins
them. Times within a group run as u from -1 to 1. Spots have shape (groups, lasers, 2), in px;
angles in radians; frames and signs are those of `physics.misalignment` and `physics.lasers`.

chen2023 itself takes the camera for still within a group, the lasers for set as designed and the
focal length for the nominal one; the standard errors of its method come from the scatter of single
images. Pieces of its estimate have shape (2, m): estimates, then standard errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.random import Generator

from reproduce.physics.attitude import (
    Platform,
    angle_jacobian,
    cross_matrix,
    laser_transform,
    misalignment,
    misalignment_angles,
    received_directions,
    received_jacobian,
    transpose,
    vector_from_rotation,
)
from reproduce.physics.validate import FloatArray, finite_array


@dataclass(frozen=True, eq=False)
class SpotStatistics:
    """Sufficient statistics of groups of images.

    - `means`, `slopes`, (groups, lasers, 2): mean of each coordinate over the images, and its slope
      against u; in px.
    - `counts`, (groups,): images in each group.
    - `levers`, (groups,): sum of the squared u of each group; zero where no slope was taken.
    - `squares`: sum of all squared deviations from means (and slopes), in px^2.
    """

    means: FloatArray
    slopes: FloatArray
    counts: FloatArray
    levers: FloatArray
    squares: float

    @property
    def freedom(self) -> int:
        """Degrees of freedom of `squares`."""
        per_group = self.counts - 1 - (self.levers > 0)
        return int(per_group.sum() * self.means[0].size)

    @property
    def size(self) -> int:
        """Number of coordinates measured."""
        return int(self.counts.sum() * self.means[0].size)

    @classmethod
    def of(cls, images: list[FloatArray], drifts: tuple[bool, ...]) -> SpotStatistics:
        """Reduce images (frames, lasers, 2) of each group, evenly spaced in time, in px.

        `drifts` says within which groups the camera may drift.
        """
        means, slopes, levers, squares = [], [], [], 0.0
        for group, (spots, drift) in enumerate(zip(images, drifts, strict=True)):
            spots = finite_array(f"images of group {group + 1}", spots, shape=(None, None, 2))
            if len(spots) < 3:
                raise ValueError(
                    f"images of group {group + 1}: expected three or more, got {len(spots)}; the "
                    "scatter needs them"
                )
            times = np.linspace(-1, 1, len(spots))
            lever = float(times @ times) if drift else 0.0
            mean = spots.mean(axis=0)
            slope = np.tensordot(times, spots - mean, axes=1) / lever if drift else 0 * mean
            left = spots - mean - times[:, None, None] * slope
            squares += float(np.square(left).sum())
            means.append(mean)
            slopes.append(slope)
            levers.append(lever)
        counts = np.array([float(len(spots)) for spots in images])
        return cls(np.stack(means), np.stack(slopes), counts, np.array(levers), squares)

    def log_likelihood(self, start: FloatArray, end: FloatArray, noise: FloatArray) -> FloatArray:
        """Log likelihood of white Gaussian noise about paths that are straight in time.

        The spots predicted at u = -1 and u = 1 have shape (n, groups, lasers, 2). Exact for
        straight paths. A path that bends by b px changes it by less than size times b times the
        misfit over noise^2: nothing near the posterior of a camera that turns by arc seconds.
        """
        off_mean = np.square(self.means - 0.5 * (start + end)).sum(axis=(-2, -1)) @ self.counts
        off_slope = np.square(self.slopes - 0.5 * (end - start)).sum(axis=(-2, -1)) @ self.levers
        squares = self.squares + off_mean + off_slope
        return np.asarray(
            -self.size * np.log(noise)
            - squares / (2 * noise**2)
            - 0.5 * self.size * np.log(2 * np.pi)
        )

    def simulate(
        self, start: FloatArray, end: FloatArray, noise: float, generator: Generator
    ) -> SpotStatistics:
        """Draw as many images about other paths, (groups, lasers, 2), and reduce them."""
        images = []
        for first, last, count in zip(start, end, self.counts.astype(int), strict=True):
            share = np.linspace(0, 1, count)[:, None, None]
            path = first + share * (last - first)
            images.append(path + noise * generator.standard_normal(path.shape))
        return SpotStatistics.of(images, tuple(self.levers > 0))


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

    @property
    def camera(self) -> FloatArray:
        """Emitted directions in the camera frame, shape (lasers, 3)."""
        return self.platform.directions

    @cached_property
    def received(self) -> FloatArray:
        """Received directions of the mean spots in the tracker frame, shape (groups, lasers, 3)."""
        return received_directions(self.statistics.means, *self.platform.tracker)

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
        moves = received_jacobian(self.statistics.means, *self.platform.tracker)
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
