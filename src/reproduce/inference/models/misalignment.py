"""Misalignment of a camera from laser spots in pixels: constant, or with a linear drift.

The spots of the calibration group are data too. The zero attitude is a parameter, so its error
contributes to the posterior of the misalignment. A group is a series of images of the same lasers.
Times u within a group have the mean 0 and the range 2. Spots have shape (groups, lasers, 2), in px.
Angles are in radians, right-handed about the axes of the camera. Frames and signs are those of
`physics.attitude`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from reproduce.inference import (
    Estimate,
    Likelihood,
    LogUniform,
    Model,
    Normal,
    Parameter,
    Prior,
)
from reproduce.physics.attitude import Platform
from reproduce.physics.validate import FloatArray
from reproduce.units import ARCSEC_PER_RADIAN

# Standard deviation of the prior of the zero attitude, in radians.
_MOUNT_SIGMA = 5e-3
# Steps of the central differences, as fractions of the scale of each parameter.
_STEP_RATIO = 1e-3


@dataclass(frozen=True, eq=False)
class SpotLikelihood(Likelihood):
    """Spots of two groups: the zero point, and a misalignment that may drift linearly.

    Moments, weights and squares are sufficient statistics of the images. With a drift, the
    misalignment is the value at the mean time of the second group.

    - `platform`: instrument.
    - `moments`, (2, groups, lasers, 2): mean of each coordinate over the images, and its slope
      against u; in px.
    - `times`, (images,) for each group: u; zero for a camera at rest.
    - `squares`: sum of all squared deviations from means (and slopes), in px^2.

    Notes
    -----
    The parameters are the mount angles, the misalignment, the drift if any, the laser scale and the
    noise.
    """

    observables = ("spots",)
    platform: Platform
    moments: FloatArray
    times: tuple[FloatArray, ...]
    squares: float

    @classmethod
    def of(
        cls,
        platform: Platform,
        images: Sequence[FloatArray],
        times: Sequence[ArrayLike] = (0.0, 0.0),
    ) -> Self:
        """Reduce images (frames, lasers, 2) of both groups at some times u, in px."""
        moments = []
        squares = 0.0
        series = tuple(map(np.full, map(len, images), times))
        for spots, u in zip(images, series, strict=True):
            mean = spots.mean(axis=0)
            slope = np.tensordot(u, spots - mean, axes=1) / (u @ u or 1.0)
            residuals = spots - mean - u[:, None, None] * slope
            squares += np.square(residuals).sum()
            moments.append((mean, slope))
        return cls(platform, np.stack(moments, axis=1), series, squares)

    @cached_property
    def weights(self) -> FloatArray:
        """Images in each group, and sum of their squared u, shape (2, groups)."""
        return np.transpose([(len(u), u @ u) for u in self.times])

    @property
    def spots(self) -> FloatArray:
        """Mean spots, shape (groups, lasers, 2), in px."""
        return self.moments[0]

    @property
    def counts(self) -> FloatArray:
        """Images in each group, shape (groups,)."""
        return self.weights[0]

    @property
    def drifts(self) -> bool:
        """Whether the camera may drift in the second group."""
        return bool(self.weights[1].any())

    @property
    def size(self) -> float:
        """Number of measured coordinates."""
        return self.counts.sum() * self.spots[0].size

    @property
    def freedom(self) -> float:
        """Degrees of freedom of `squares`."""
        return self.size - np.count_nonzero(self.weights) * self.spots[0].size

    def predicted(self, parameters: FloatArray) -> FloatArray:
        """Return predicted means and slopes of the spots, (n, 2, groups, lasers, 2), in px."""
        mount, angle = parameters[:, None, :3], parameters[:, 3:6]
        lasers = parameters[:, -2, None, None, None] * self.platform.lasers
        half = 0.5 * parameters[:, 6:9] if self.drifts else 0 * angle
        turns = np.stack([0 * angle, angle - half, angle + half], axis=1)
        spots = self.platform.predicted(turns, mount, lasers)
        zero, start, end = np.moveaxis(spots, 1, 0)
        parts = [zero, 0.5 * (start + end), 0 * zero, 0.5 * (end - start)]
        return np.stack(parts, axis=1).reshape(-1, *self.moments.shape)

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of white Gaussian noise, shape (n,).

        It is exact for straight paths. A path that bends by b px changes it by less than size times
        b times the misfit over noise^2, which is negligible for rotations of arc seconds.
        """
        squares = self.squares + np.square(self.residuals(parameters)).sum(axis=1)
        return self.white_noise(squares, self.size, parameters[:, -1])

    def residuals(self, parameters: FloatArray) -> FloatArray:
        """Return measured minus predicted moments, (n, m), each with the noise of one image."""
        off = self.moments - self.predicted(parameters)
        scaled = off * np.sqrt(self.weights)[..., None, None]
        return scaled.reshape(len(parameters), -1)

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of the mean of each spot, shape (n, groups, lasers)."""
        means = self.predicted(parameters)[:, 0]
        off = np.square(self.spots - means).sum(axis=-1)
        noise = parameters[:, -1, None, None] / np.sqrt(self.counts[:, None])
        return self.white_noise(off, 2, noise)

    def simulate(self, parameters: FloatArray, generator: Generator) -> Self:
        """Return the likelihood of simulated images for one parameter vector."""
        images = []
        for mean, slope, u in zip(
            *self.predicted(parameters[None])[0], self.times, strict=True
        ):
            path = mean + u[:, None, None] * slope
            noise = generator.standard_normal(path.shape)
            images.append(path + parameters[-1] * noise)
        return self.of(self.platform, images, self.times)

    def start(self) -> Estimate:
        """Return three Gauss-Newton steps from rough values, and standard errors."""
        freedom = self.freedom
        noise = np.sqrt(self.squares / freedom)
        # Rough values and scales of all parameters except the noise: arc minutes, and a tenth.
        rough = np.append(np.zeros(9 if self.drifts else 6), 1.0)
        scale = np.where(rough > 0, 0.3, 1e-2)
        centre = rough
        for _ in range(3):
            response, residuals = self.linearised(np.append(centre, noise), scale)
            normal = response.T @ response / noise**2 + np.diag(1 / scale**2)
            pull = response.T @ residuals / noise**2 - (centre - rough) / scale**2
            centre = centre + np.linalg.solve(normal, pull)
        errors = np.sqrt(np.diagonal(np.linalg.inv(normal)))
        return np.append(centre, noise), np.append(errors, noise / np.sqrt(2 * freedom))

    def linearised(
        self, centre: FloatArray, scale: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return derivatives and residuals of the scaled statistics, (m, d - 1) and (m,).

        The derivatives are by all parameters except the noise. Each residual, measured minus
        predicted, has the standard deviation of the noise.
        """
        reach = _STEP_RATIO * scale[:, None]
        steps = reach * np.eye(len(scale), len(centre))
        behind, ahead = map(self.residuals, (centre - steps, centre + steps))
        [residuals] = self.residuals(centre[None])
        return ((behind - ahead) / (2 * reach)).T, residuals

    def checks(self, other: Self) -> dict[str, float]:
        """Return scatter, shape of the pattern and motion of its centre, in px."""
        width, height = np.ptp(other.spots.mean(axis=0), axis=0)
        x, y = (other.spots[-1] - other.spots[0]).mean(axis=0)
        return {
            "scatter of one image (px)": np.sqrt(other.squares / other.freedom),
            "pattern, wider than high (px)": width - height,
            "centre, last less first group, x (px)": x,
            "centre, last less first group, y (px)": y,
        }


def _angles(name: str, prior: Prior) -> tuple[Parameter, ...]:
    return tuple(
        Parameter(f"{name}-{a}", "arcsec", prior, ARCSEC_PER_RADIAN) for a in "xyz"
    )


_MISALIGNMENT_PRIOR = Normal(
    0.0,
    100 / ARCSEC_PER_RADIAN,
    "on orbit the misalignment may reach dozens of arc seconds",
)


def misalignment_model(likelihood: SpotLikelihood) -> Model:
    """Return a misalignment from two groups of images, the first one at the zero point.

    Parameters
    ----------
    likelihood : SpotLikelihood
        Instrument and spots of both groups, with slopes of the second group if it drifts.

    Returns
    -------
    Model
        Parameters mount-x..z, angle-x..z (rad, at the mean time of the group), drift-x..z (over the
        whole group, if it drifts), laser-scale and noise (px).
    """
    angles = _angles("angle", _MISALIGNMENT_PRIOR)
    if likelihood.drifts:
        angles += _angles("drift", _MISALIGNMENT_PRIOR)
    mount = Normal(
        0.0,
        _MOUNT_SIGMA,
        "the zero attitude is fitted to the spots first, so only the misfit of the design "
        "remains: five milliradians are generous",
    )
    scale = Normal(
        1.0,
        0.1,
        "a pattern within 10 % of its design; the printed spots differ from it by 5 %",
    )
    noise = LogUniform(
        1e-4,
        1.0,
        "from far finer than any centroid to a whole pixel, no scale preferred",
    )
    parameters = (
        *_angles("mount", mount),
        *angles,
        Parameter("laser-scale", "1", scale),
        Parameter("noise", "px", noise),
    )
    name = "misalignment-drift" if likelihood.drifts else "misalignment"
    return Model(name, parameters, likelihood)
