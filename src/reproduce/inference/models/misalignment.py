"""The camera's misalignment from laser centroids in pixels: still, or drifting.

The calibration group is data like any other: the zero attitude is a parameter, so its error is
in the posterior of the misalignment. Angles in radians, right-handed about the camera's axes
(`physics.misalignment` states the sign); spots in px.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator

from reproduce.inference import Derived, LogUniform, Model, Normal, Parameter, Prior
from reproduce.inference.models.lasers import Quest, SpotStatistics, none
from reproduce.inference.models.registration import with_priors
from reproduce.physics.attitude import Platform
from reproduce.physics.validate import FloatArray
from reproduce.units import ARCSEC_PER_RADIAN

AXES = "xyz"
# Width of the prior of the zero attitude, in radians.
MOUNT = 5e-3
# Steps of the central differences, as shares of each parameter's own scale.
STEP = 1e-3


@dataclass(frozen=True, eq=False)
class SpotLikelihood:
    """Spots of two groups: the zero point, and a misalignment that may drift evenly.

    - `platform`: the instrument.
    - `statistics`: the data.
    - `drifts`: whether there is a drift over the second group, in the middle of which the
      misalignment then holds.

    Notes
    -----
    The parameters are the mount angles, the misalignment, the drift if any, the laser scale and the
    noise.
    """

    platform: Platform
    statistics: SpotStatistics
    drifts: bool = False

    def turns(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Misalignment at the start and at the end of each group, (n, groups, 3)."""
        angle = parameters[:, 3:6]
        zero = np.zeros_like(angle)
        if not self.drifts:
            turn = np.stack([zero, angle], axis=1)
            return turn, turn
        half = 0.5 * parameters[:, 6:9]
        return np.stack([zero, angle - half], axis=1), np.stack([zero, angle + half], axis=1)

    def landed(self, parameters: FloatArray, turn: FloatArray) -> FloatArray:
        """Spots after turns of shape (n, groups, 3), in px."""
        mount, scale = parameters[:, :3], parameters[:, -2]
        return self.platform.predicted(mount, turn, scale, self.platform.camera_focal_length)

    def paths(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Predicted spots at the start and at the end of each group, in px."""
        first, last = self.turns(parameters)
        if first is last:
            start = self.landed(parameters, first)
            return start, start
        both = self.landed(parameters, np.concatenate([first, last], axis=1))
        count = first.shape[1]
        return both[:, :count], both[:, count:]

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        return self.statistics.log_likelihood(*self.paths(parameters), parameters[:, -1])

    def simulate(self, parameters: FloatArray, generator: Generator) -> SpotStatistics:
        """Statistics of as many images for one parameter vector."""
        start, end = self.paths(parameters[None])
        return self.statistics.simulate(start[0], end[0], float(parameters[-1]), generator)

    def given(self, data: SpotStatistics) -> Self:
        """The same instrument with other spots."""
        return replace(self, statistics=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Least squares about the rough values, with its standard errors."""
        return self.fitted

    def estimate(self) -> tuple[FloatArray, FloatArray]:
        """QUEST of both groups, and its standard errors; it knows no drift and no laser scale."""
        found = Quest(self.platform, self.statistics)
        nothing = none(4 if self.drifts else 1)
        pieces = [found.mount, found.turned(1), nothing, found.noise]
        values, errors = np.concatenate(pieces, axis=1)
        return values, errors

    def rough(self) -> tuple[FloatArray, FloatArray]:
        """Rough values and scales of all parameters but the noise: some arc minutes, a tenth."""
        angles = 9 if self.drifts else 6
        return np.append(np.zeros(angles), 1.0), np.append(np.full(angles, 1e-2), 0.3)

    @cached_property
    def fitted(self) -> tuple[FloatArray, FloatArray]:
        """Three Gauss-Newton steps from the rough values, ridged by their scales; and errors."""
        noise = np.sqrt(self.statistics.squares / self.statistics.freedom)
        rough, scale = self.rough()
        centre = rough.copy()
        for _ in range(3):
            response, left = self.linearised(np.append(centre, noise), scale)
            normal = response.T @ response / noise**2 + np.diag(1 / scale**2)
            pull = response.T @ left / noise**2 - (centre - rough) / scale**2
            centre = centre + np.linalg.solve(normal, pull)
        errors = np.sqrt(np.diagonal(np.linalg.inv(normal)))
        noise_error = noise / np.sqrt(2 * self.statistics.freedom)
        return np.append(centre, noise), np.append(errors, noise_error)

    def linearised(self, centre: FloatArray, scale: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Response of the weighted statistics to all parameters but the noise, and what is left.

        Derivatives, (m, d - 1), of mean times root count, then of slope times root lever; measured
        less predicted, (m,), weighted alike: each has the standard deviation of the noise.
        """
        steps = np.zeros((2 * len(scale), len(centre)))
        steps[::2, :-1], steps[1::2, :-1] = np.diag(STEP * scale), -np.diag(STEP * scale)
        found = self._weighted(np.concatenate([centre[None], centre + steps]))
        response = (found[1::2] - found[2::2]) / (2 * STEP * scale)[:, None]
        measured = self._weigh(self.statistics.means[None], self.statistics.slopes[None])[0]
        return response.T, measured - found[0]

    def _weighted(self, parameters: FloatArray) -> FloatArray:
        start, end = self.paths(parameters)
        return self._weigh(0.5 * (start + end), 0.5 * (end - start))

    def _weigh(self, means: FloatArray, slopes: FloatArray) -> FloatArray:
        roots = (np.sqrt(self.statistics.counts), np.sqrt(self.statistics.levers))
        parts = [
            (part * root[:, None, None]).reshape(len(part), -1)
            for part, root in zip((means, slopes), roots, strict=True)
        ]
        return np.concatenate(parts, axis=1)

    def residual(self) -> float:
        """Standard deviation of a coordinate about least squares, the misfit in it, in px."""
        centre = np.append(self.start()[0][:-1], 1.0)
        # At a noise of one pixel the log likelihood is minus half the squares, and a constant.
        squares = -2 * float(self(centre[None])[0]) - self.statistics.size * np.log(2 * np.pi)
        return float(np.sqrt(squares / self.statistics.size))

    def checks(self, data: SpotStatistics | None = None) -> dict[str, float]:
        """Scatter, shape of the pattern and motion of its centre, in px."""
        data = data or self.statistics
        pattern = np.ptp(data.means.mean(axis=0), axis=0)
        centres = data.means.mean(axis=1)
        return {
            "scatter of one image (px)": float(np.sqrt(data.squares / data.freedom)),
            "pattern, wider than high (px)": float(pattern[0] - pattern[1]),
            "centre, last less first group, x (px)": float(centres[-1, 0] - centres[0, 0]),
            "centre, last less first group, y (px)": float(centres[-1, 1] - centres[0, 1]),
        }


def _angles(name: str, label: str, prior: Prior) -> tuple[Parameter, ...]:
    return tuple(
        Parameter(f"{name}-{a}", f"{label}_{a}", "arcsec", prior, ARCSEC_PER_RADIAN) for a in AXES
    )


MISALIGNED = Normal(
    0.0, 100 / ARCSEC_PER_RADIAN, "on orbit the misalignment may reach dozens of arc seconds"
)


def misalignment_model(
    platform: Platform,
    statistics: SpotStatistics,
    *,
    drifts: bool = False,
    priors: Mapping[str, Prior] | None = None,
    derived: Derived | None = None,
) -> Model:
    """A misalignment from two groups of images, the first at the zero point.

    Parameters mount-x..z, angle-x..z (rad; in the middle of the group), drift-x..z (over the whole
    group, if it drifts: the statistics then have slopes), laser-scale, noise (px).
    """
    angles = _angles("angle", r"\theta", MISALIGNED)
    if drifts:
        angles += _angles("drift", r"\dot\theta", MISALIGNED)
    mount = Normal(0.0, MOUNT, "the zero attitude is laid over the spots to begin with, so only "
                   "the misfit of the design is left: a quarter of a degree is "
                   "generous")  # fmt: skip
    scale = Parameter("laser-scale", "s", "1", Normal(1.0, 0.1, "a pattern within a tenth or so of "
                      "its design; the printed spots lie a twentieth off"))  # fmt: skip
    noise = Parameter("noise", r"\sigma", "px", LogUniform(1e-4, 1.0, "from far finer than any "
                      "centroid to a whole pixel, no scale preferred"))  # fmt: skip
    parameters = (*_angles("mount", r"\alpha", mount), *angles, scale, noise)
    likelihood = SpotLikelihood(platform, statistics, drifts)
    name = "misalignment-drift" if drifts else "misalignment"
    return Model(name, with_priors(parameters, dict(priors or {})), likelihood, {}, derived)
