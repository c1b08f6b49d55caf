"""Laser spots as data: what the likelihoods of the misalignment need of many images.

A group is a run of images of the same lasers. While the camera stands still, the mean of every
spot and the pooled scatter are sufficient; while it drifts evenly, the slope of every spot joins
them. Times within a group run as u from -1 to 1. Spots have shape (groups, lasers, 2), in px;
angles in radians; frames and signs are those of `physics.misalignment` and `physics.lasers`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.random import Generator

from reproduce.physics.attitude.lasers import emitted_directions, received_directions
from reproduce.physics.attitude.misalignment import laser_transform
from reproduce.physics.attitude.rotations import rotation_from_vector
from reproduce.physics.validate import FloatArray, finite_array


@dataclass(frozen=True, eq=False)
class Platform:
    """The instrument, as designed; lengths in metres.

    - `lasers`, (lasers, 2): positions on the camera's focal plane.
    - `camera_focal_length`, `tracker_focal_length`, `pixel_pitch`: as designed.
    - `principal_point`, (2,): of the tracker, in px.
    - `spots`, (lasers, 2): rough positions of the spots, in px: they fix the attitude about which
      angles are small.
    """

    lasers: FloatArray
    camera_focal_length: float
    tracker_focal_length: float
    pixel_pitch: float
    principal_point: FloatArray
    spots: FloatArray

    @cached_property
    def reference(self) -> FloatArray:
        """tracker_from_camera that lays the designed lasers over the rough spots best, (3, 3)."""
        received = received_directions(
            self.spots, self.principal_point, self.pixel_pitch, self.tracker_focal_length
        )
        return laser_transform(emitted_directions(self.lasers, self.camera_focal_length), received)

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
        zero = self.reference @ rotation_from_vector(mount)
        now = zero[:, None] @ rotation_from_vector(turn)  # (6): the turn of the camera, undone
        arriving = rays[:, None] @ np.swapaxes(now, -1, -2)
        slopes = arriving[..., :2] / arriving[..., 2:]
        return np.asarray(
            self.principal_point - slopes * (self.tracker_focal_length / self.pixel_pitch)
        )


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
        """Draw the statistics of as many images about other paths, (groups, lasers, 2)."""
        normal = generator.normal(size=(2, *start.shape)) * noise
        means = 0.5 * (start + end) + normal[0] / np.sqrt(self.counts)[:, None, None]
        moving = self.levers > 0
        root = np.where(moving, np.sqrt(np.where(moving, self.levers, 1)), np.inf)
        slopes = 0.5 * (end - start) * moving[:, None, None] + normal[1] / root[:, None, None]
        squares = noise**2 * generator.chisquare(self.freedom)
        return SpotStatistics(means, slopes, self.counts, self.levers, float(squares))
