"""The papers' own estimators of what the posteriors determine, with standard errors.

They are those of the published methods, which may know less than the models do: niu2024's
least-squares similarity, and QUEST of chen2023, which takes the camera for still within a group,
the lasers for set as designed and the focal length for the nominal one; the standard errors of its
method come from the scatter of single images. Pieces of its estimate have shape (2, m): estimates,
then standard errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from reproduce.inference.models import (
    GaussianRegistration,
    JointRegistration,
    MixtureRegistration,
    SpotLikelihood,
    SpotStatistics,
)
from reproduce.physics.attitude import (
    Platform,
    angle_jacobian,
    cross_matrix,
    laser_transform,
    misalignment,
    misalignment_angles,
    received_directions,
    received_jacobian,
    vector_from_rotation,
)
from reproduce.physics.registration import fit_registration
from reproduce.physics.validate import FloatArray

Estimate = tuple[FloatArray, FloatArray]


def estimate(likelihood: Any) -> Estimate:
    """Return estimates and standard errors of a model's parameters, both of shape (d,).

    Both are NaN, whatever the data, where the method gives none for a parameter.
    """
    if isinstance(likelihood, JointRegistration):
        return _both_channels(likelihood)
    if isinstance(likelihood, SpotLikelihood):
        return _quest(likelihood)
    if not isinstance(likelihood, GaussianRegistration):
        raise TypeError(f"no published estimator of a {type(likelihood).__name__}")
    centre, spread = least_squares(likelihood)
    # Of a mixture, plain residuals do not tell the noise; of what is added nothing is known.
    known = 4 if isinstance(likelihood, MixtureRegistration) else 5
    none = np.full(len(likelihood.start()[0]) - known, np.nan)
    return np.append(centre[:known], none), np.append(spread[:known], none)


def least_squares(likelihood: GaussianRegistration) -> Estimate:
    """Return the least-squares (k, theta, shift x, shift y, noise) and their standard errors, (5,).

    The errors are those of the variance of the residuals, and the noise is its root.
    """
    fit = fit_registration(likelihood.source, likelihood.target, likelihood.pivot)
    freedom = float(fit.degrees_of_freedom)
    noise = np.sqrt(fit.chi_square / freedom)
    errors = noise * np.sqrt(np.diagonal(fit.cofactor))
    return np.append(fit.parameters, noise), np.append(
        errors, noise / np.sqrt(2 * freedom)
    )


def _both_channels(likelihood: JointRegistration) -> Estimate:
    """The least-squares fit of each channel by itself, and the mean of their noises.

    The residuals of the channels share the green noise: their correlation is
    1 / sqrt((1 + k_red^2) (1 + k_blue^2)), and that of the noises its square.
    """
    (red, red_errors), (blue, blue_errors) = map(least_squares, likelihood.channels)
    for centre, errors in ((red, red_errors), (blue, blue_errors)):
        share = np.sqrt(1 + centre[0] ** 2)  # of both images in the residual
        centre[4], errors[4] = centre[4] / share, errors[4] / share
    shared = 1 / ((1 + red[0] ** 2) * (1 + blue[0] ** 2))
    squares = red_errors[4] ** 2 + blue_errors[4] ** 2
    error = 0.5 * np.sqrt(squares + 2 * shared * red_errors[4] * blue_errors[4])
    centre = np.concatenate([red[:4], blue[:4], [0.5 * (red[4] + blue[4])]])
    return centre, np.concatenate([red_errors[:4], blue_errors[:4], [error]])


def _quest(likelihood: SpotLikelihood) -> Estimate:
    """QUEST of both groups, and its standard errors; it knows no drift and no laser scale."""
    found = Quest(likelihood.platform, likelihood.statistics)
    nothing = np.full((2, 4 if likelihood.drifts else 1), np.nan)
    pieces = [found.mount, found.turned(1), nothing, found.noise]
    values, errors = np.concatenate(pieces, axis=1)
    return values, errors


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
        squares = data.squares + float(
            np.square(data.slopes).sum(axis=(-2, -1)) @ data.levers
        )
        freedom = int((data.counts - 1).sum()) * data.means[0].size
        return float(np.sqrt(squares / freedom)), freedom

    @cached_property
    def covariances(self) -> FloatArray:
        """Covariance of the attitude of every group about the camera's axes, (groups, 3, 3)."""
        moves = received_jacobian(self.statistics.means, *self.platform.tracker)
        camera = np.broadcast_to(self.camera, self.received.shape)
        response = angle_jacobian(camera, self.received, moves).reshape(
            len(moves), 3, -1
        )
        variance = self.scatter[0] ** 2 / self.statistics.counts
        return np.asarray(variance[:, None, None] * (response @ response.mT))

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
        covariance += (
            turn.T @ self.covariances[0] @ turn
        )  # (I - [v ×]) goes before the turn
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
