"""Misalignment of a camera from laser spots in pixels: constant, or with a linear drift.

The calibration group is data like any other: the zero attitude is a parameter, so its error is in
the posterior of the misalignment. A group is a run of images of the same lasers. For a camera at
rest, the mean of each spot and the pooled scatter are sufficient; with a linear drift, the slope
of each spot is needed too. Times within a group run as u from -1 to 1. Spots have shape
(groups, lasers, 2), in px; angles are in radians, right-handed about the axes of the camera;
frames and signs are those of `physics.attitude`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.random import Generator
from scipy.special import logsumexp

from reproduce.inference import Derived, LogUniform, Model, Normal, Parameter, Prior
from reproduce.physics.attitude import Platform
from reproduce.physics.validate import FloatArray
from reproduce.units import ARCSEC_PER_RADIAN

AXES = "xyz"
# Standard deviation of the prior of the zero attitude, in radians.
MOUNT = 5e-3
# Steps of the central differences, as fractions of the scale of each parameter.
_STEP = 1e-3
# Points over the noise of the small-angle posterior, and their range in its standard errors.
POINTS, REACH = 401, 9.0


@dataclass(frozen=True, eq=False)
class SpotStatistics:
    """Sufficient statistics of groups of images.

    - `means`, `slopes`, (groups, lasers, 2): mean of each coordinate over the images, and its slope
      against u; in px.
    - `counts`, (groups,): images in each group.
    - `levers`, (groups,): sum of the squared u of each group; zero for a camera at rest.
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
        return self.size - self.means.size - self.slopes[self.levers > 0].size

    @property
    def size(self) -> int:
        """Number of measured coordinates."""
        return int(self.counts.sum() * self.means[0].size)

    @classmethod
    def of(cls, images: list[FloatArray], drifts: tuple[bool, ...]) -> SpotStatistics:
        """Reduce images (frames, lasers, 2) of each group, evenly spaced in time, in px.

        `drifts` contains for each group whether the camera may drift in it.
        """
        rows, squares = [], 0.0
        for spots, drift in zip(images, drifts, strict=True):
            times = drift * np.linspace(-1, 1, len(spots))
            lever, mean = float(times @ times), spots.mean(axis=0)
            slope = np.tensordot(times, spots - mean, axes=1) / (lever or 1.0)
            left = spots - mean - times[:, None, None] * slope
            squares += float(np.square(left).sum())
            rows.append((mean, slope, float(len(spots)), lever))
        means, slopes, counts, levers = (
            np.array(column) for column in zip(*rows, strict=True)
        )
        return cls(means, slopes, counts, levers, squares)

    def weighted(self, means: FloatArray, slopes: FloatArray) -> FloatArray:
        """Return (n, groups, lasers, 2) as (n, m), each with the variance of one image."""
        roots = (np.sqrt(self.counts), np.sqrt(self.levers))
        parts = (
            (part * root[:, None, None]).reshape(len(part), -1)
            for part, root in zip((means, slopes), roots, strict=True)
        )
        return np.concatenate([*parts], axis=1)


@dataclass(frozen=True, eq=False)
class SpotLikelihood:
    """Spots of two groups: the zero point, and a misalignment that may drift linearly.

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

    def paths(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return spots at the start and the end, (n, groups, lasers, 2), in px."""
        mount, angle = parameters[:, :3], parameters[:, 3:6]
        lasers = parameters[:, -2, None, None] * self.platform.lasers
        turns = [angle]
        if self.drifts:
            half = 0.5 * parameters[:, 6:9]
            turns = [angle - half, angle + half]
        found = [
            self.platform.predicted(mount, np.stack([0 * one, one], axis=1), lasers)
            for one in turns
        ]
        return found[0], found[-1]

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of white Gaussian noise, shape (n,).

        Exact for straight paths. A path that bends by b px changes it by less than size times b
        times the misfit over noise^2: nothing near the posterior of a camera that turns by arc
        seconds.
        """
        data, noise = self.statistics, parameters[:, -1]
        start, end = self.paths(parameters)
        off_mean = np.square(data.means - 0.5 * (start + end)).sum(axis=(-2, -1))
        off_slope = np.square(data.slopes - 0.5 * (end - start)).sum(axis=(-2, -1))
        squares = data.squares + off_mean @ data.counts + off_slope @ data.levers
        constant = -data.size * (np.log(noise) + 0.5 * np.log(2 * np.pi))
        return np.asarray(constant - squares / (2 * noise**2))

    @property
    def observed(self) -> dict[str, FloatArray]:
        """The mean spots of each group."""
        return {"spots": self.statistics.means}

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of the mean of each spot, shape (n, groups, lasers)."""
        start, end = self.paths(parameters)
        off = np.square(self.statistics.means - 0.5 * (start + end)).sum(axis=-1)
        variance = parameters[:, -1, None, None] ** 2 / self.statistics.counts[:, None]
        return np.asarray(-np.log(2 * np.pi * variance) - off / (2 * variance))

    def simulate(self, parameters: FloatArray, generator: Generator) -> SpotStatistics:
        """Return the statistics of as many images for one parameter vector."""
        (start,), (end,) = self.paths(parameters[None])
        images, counts = [], self.statistics.counts.astype(int)
        for first, last, count in zip(start, end, counts, strict=True):
            path = first + np.linspace(0, 1, count)[:, None, None] * (last - first)
            noise = generator.standard_normal(path.shape)
            images.append(path + float(parameters[-1]) * noise)
        return SpotStatistics.of(images, tuple(self.statistics.levers > 0))

    def with_data(self, data: SpotStatistics) -> Self:
        """Return the same instrument with other spots."""
        return replace(self, statistics=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Return three Gauss-Newton steps from rough values, and standard errors."""
        freedom = self.statistics.freedom
        noise = np.sqrt(self.statistics.squares / freedom)
        # Rough values and scales of all parameters but the noise: some arc minutes, a tenth.
        angles = 9 if self.drifts else 6
        rough, scale = np.zeros(angles + 1), np.full(angles + 1, 1e-2)
        rough[-1], scale[-1] = 1.0, 0.3
        centre = rough
        for _ in range(3):
            response, left = self.linearised(np.append(centre, noise), scale)
            normal = response.T @ response / noise**2 + np.diag(1 / scale**2)
            pull = response.T @ left / noise**2 - (centre - rough) / scale**2
            centre = centre + np.linalg.solve(normal, pull)
        errors = np.sqrt(np.diagonal(np.linalg.inv(normal)))
        return np.append(centre, noise), np.append(errors, noise / np.sqrt(2 * freedom))

    def linearised(
        self, centre: FloatArray, scale: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return derivatives and residuals of the weighted statistics, (m, d - 1) and (m,).

        Derivatives by all parameters but the noise. Each residual, measured minus predicted, has
        the standard deviation of the noise.
        """
        steps = np.zeros((2, len(scale), len(centre)))
        steps[:, :, :-1] = np.multiply.outer([1, -1], np.diag(_STEP * scale))
        start, end = self.paths(np.vstack([centre, *(centre + steps)]))
        data = self.statistics
        found = data.weighted(0.5 * (start + end), 0.5 * (end - start))
        ahead, behind = np.split(found[1:], 2)
        response = (ahead - behind) / (2 * _STEP * scale)[:, None]
        return response.T, data.weighted(data.means[None], data.slopes[None])[
            0
        ] - found[0]

    def residual(self) -> float:
        """Return the standard deviation of a coordinate about least squares, in px."""
        centre, spread = self.start()
        left = self.linearised(centre, spread[:-1])[1]
        return float(
            np.sqrt((self.statistics.squares + left @ left) / self.statistics.size)
        )

    def checks(self, data: SpotStatistics | None = None) -> dict[str, float]:
        """Return scatter, shape of the pattern and motion of its centre, in px."""
        data = data or self.statistics
        width, height = np.ptp(data.means.mean(axis=0), axis=0)
        x, y = (data.means[-1] - data.means[0]).mean(axis=0)
        return {
            "scatter of one image (px)": float(np.sqrt(data.squares / data.freedom)),
            "pattern, wider than high (px)": float(width - height),
            "centre, last less first group, x (px)": float(x),
            "centre, last less first group, y (px)": float(y),
        }


def _angles(name: str, label: str, prior: Prior) -> tuple[Parameter, ...]:
    return tuple(
        Parameter(f"{name}-{a}", f"{label}_{a}", "arcsec", prior, ARCSEC_PER_RADIAN)
        for a in AXES
    )


_MISALIGNED = Normal(
    0.0,
    100 / ARCSEC_PER_RADIAN,
    "on orbit the misalignment may reach dozens of arc seconds",
)


def misalignment_model(
    platform: Platform,
    statistics: SpotStatistics,
    *,
    drifts: bool = False,
    derived: tuple[Derived, ...] = (),
) -> Model:
    """A misalignment from two groups of images, the first at the zero point.

    Parameters mount-x..z, angle-x..z (rad; in the middle of the group), drift-x..z (over the whole
    group, if it drifts: the statistics then have slopes), laser-scale, noise (px).
    """
    angles = _angles("angle", r"\theta", _MISALIGNED)
    if drifts:
        angles += _angles("drift", r"\dot\theta", _MISALIGNED)
    mount = Normal(
        0.0,
        MOUNT,
        "the zero attitude is laid over the spots to begin with, so only "
        "the misfit of the design is left: a quarter of a degree is "
        "generous",
    )
    scale = Parameter(
        "laser-scale",
        "s",
        "1",
        Normal(
            1.0,
            0.1,
            "a pattern within a tenth or so of "
            "its design; the printed spots lie a twentieth off",
        ),
    )
    noise = Parameter(
        "noise",
        r"\sigma",
        "px",
        LogUniform(
            1e-4,
            1.0,
            "from far finer than any centroid to a whole pixel, no scale preferred",
        ),
    )
    parameters = (*_angles("mount", r"\alpha", mount), *angles, scale, noise)
    likelihood = SpotLikelihood(platform, statistics, drifts)
    name = "misalignment-drift" if drifts else "misalignment"
    return Model(name, parameters, likelihood, {}, derived)


def small_angle_posterior(model: Model) -> tuple[FloatArray, FloatArray]:
    """Return the posterior of a misalignment whose prediction is replaced by its tangent.

    Mean, (d,), and covariance, (d, d), of all parameters, the noise last. Exact in the limit of
    small angles; each prior but that of the noise has to be a `Normal`.
    """
    noise, weight, means, roots = _given_noise(model)
    rows = np.column_stack([means, noise])
    mean = weight @ rows
    covariance = ((rows - mean).T * weight) @ (rows - mean)
    covariance[:-1, :-1] += np.einsum("m,mik,mjk->ij", weight, roots, roots)
    return mean, covariance


def _given_noise(model: Model) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the same posterior as a mixture of Gaussians over the noise.

    Values of the noise, in px, and their probabilities, (m,); means of all other parameters given
    the noise, (m, d - 1), in SI; and roots of their covariances, (m, d - 1, d - 1): any matrix
    whose product with its transpose is the covariance.
    """
    likelihood = model.likelihood_of(SpotLikelihood)
    *others, last = (one.prior for one in model.parameters)
    priors = [(one.mean, one.sigma) for one in others if isinstance(one, Normal)]
    if len(priors) < len(others):
        raise TypeError(
            "model: expected Gaussian priors of all parameters but the noise"
        )
    middle, sigma = np.array(priors).T
    centre, spread = likelihood.start()
    scale = spread[:-1]
    response, left = likelihood.linearised(centre, scale)
    # In units of the errors, or the matrices cannot be inverted.
    response, off = response * scale, (middle - centre[:-1]) / scale
    held = np.square(scale / sigma)
    noise = centre[-1] + spread[-1] * np.linspace(-REACH, REACH, POINTS)
    precise = noise[:, None] ** -2
    inverse = np.linalg.inv(response.T @ response * precise[..., None] + np.diag(held))
    pull = response.T @ left * precise + held * off
    means = np.einsum("mij,mj->mi", inverse, pull)
    roots = np.linalg.cholesky(inverse)
    squares = likelihood.statistics.squares + left @ left
    logs = last.log_density(noise) - likelihood.statistics.size * np.log(noise)
    logs += 0.5 * (np.vecdot(means, pull) - squares / noise**2)
    logs += np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    weight = np.exp(logs - logsumexp(logs))
    return noise, weight, centre[:-1] + means * scale, roots * scale[:, None]
