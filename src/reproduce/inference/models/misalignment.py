"""The camera's misalignment from laser centroids in pixels: still, or drifting.

The calibration group is data like any other: the zero attitude is a parameter, so its error is
in the posterior of the misalignment. Angles in radians, right-handed about the camera's axes
(`physics.attitude.angles` states the sign); spots in px.

The posterior of a misalignment in the small-angle limit: exact, without a sampler.

About its best fit the prediction of the spots is linear in the angles, in the scale and in the
directions, all their priors are Gaussian, and only the noise is left: given it the posterior is
Gaussian, and the noise itself has a density of one dimension. With a flat prior this would be the
Student-t of the registration; here the priors are kept.

What the likelihood needs of many images.

A group is a run of images of the same lasers. While the camera stands still, the mean of every
spot and the pooled scatter are sufficient; while it drifts evenly, the slope of every spot joins
them. Times within a group run as u from -1 to 1. Spots have shape (groups, lasers, 2), in px;
angles in radians; frames and signs are those of `physics.attitude`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.random import Generator
from scipy.special import logsumexp

from reproduce.inference import Derived, LogUniform, Model, Normal, Parameter, Prior
from reproduce.physics.attitude import Platform
from reproduce.physics.validate import FloatArray, finite_array
from reproduce.units import ARCSEC_PER_RADIAN


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
            spots = finite_array(
                f"images of group {group + 1}", spots, shape=(None, None, 2)
            )
            times = np.linspace(-1, 1, len(spots))
            lever = float(times @ times) if drift else 0.0
            mean = spots.mean(axis=0)
            slope = (
                np.tensordot(times, spots - mean, axes=1) / lever if drift else 0 * mean
            )
            left = spots - mean - times[:, None, None] * slope
            squares += float(np.square(left).sum())
            means.append(mean)
            slopes.append(slope)
            levers.append(lever)
        counts = np.array([float(len(spots)) for spots in images])
        return cls(np.stack(means), np.stack(slopes), counts, np.array(levers), squares)

    def log_likelihood(
        self, start: FloatArray, end: FloatArray, noise: FloatArray
    ) -> FloatArray:
        """Log likelihood of white Gaussian noise about paths that are straight in time.

        The spots predicted at u = -1 and u = 1 have shape (n, groups, lasers, 2). Exact for
        straight paths. A path that bends by b px changes it by less than size times b times the
        misfit over noise^2: nothing near the posterior of a camera that turns by arc seconds.
        """
        off_mean = (
            np.square(self.means - 0.5 * (start + end)).sum(axis=(-2, -1)) @ self.counts
        )
        off_slope = (
            np.square(self.slopes - 0.5 * (end - start)).sum(axis=(-2, -1))
            @ self.levers
        )
        squares = self.squares + off_mean + off_slope
        return np.asarray(
            -self.size * np.log(noise)
            - squares / (2 * noise**2)
            - 0.5 * self.size * np.log(2 * np.pi)
        )


AXES = "xyz"
# Width of the prior of the zero attitude, in radians.
MOUNT = 5e-3
# Steps of the central differences, as shares of each parameter's own scale.
_STEP = 1e-3


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
        half = 0.5 * parameters[:, 6:9] if self.drifts else zero
        return np.stack([zero, angle - half], axis=1), np.stack(
            [zero, angle + half], axis=1
        )

    def landed(self, parameters: FloatArray, turn: FloatArray) -> FloatArray:
        """Spots after turns of shape (n, groups, 3), in px."""
        mount, scale = parameters[:, :3], parameters[:, -2]
        return self.platform.predicted(
            mount, turn, scale[:, None, None] * self.platform.lasers
        )

    def paths(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Predicted spots at the start and at the end of each group, in px."""
        first, last = self.turns(parameters)
        start = self.landed(parameters, first)
        return start, self.landed(parameters, last) if self.drifts else start

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        return self.statistics.log_likelihood(
            *self.paths(parameters), parameters[:, -1]
        )

    @property
    def observed(self) -> dict[str, FloatArray]:
        """The mean spots of each group."""
        return {"spots": self.statistics.means}

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood of the mean of each spot, shape (n, groups, lasers)."""
        start, end = self.paths(parameters)
        off = np.square(self.statistics.means - 0.5 * (start + end)).sum(axis=-1)
        variance = (
            np.square(parameters[:, -1])[:, None, None]
            / self.statistics.counts[:, None]
        )
        return np.asarray(-np.log(2 * np.pi * variance) - off / (2 * variance))

    def simulate(self, parameters: FloatArray, generator: Generator) -> SpotStatistics:
        """Statistics of as many images for one parameter vector."""
        (start,), (end,) = self.paths(parameters[None])
        images, counts = [], self.statistics.counts.astype(int)
        for first, last, count in zip(start, end, counts, strict=True):
            path = first + np.linspace(0, 1, count)[:, None, None] * (last - first)
            images.append(
                path + float(parameters[-1]) * generator.standard_normal(path.shape)
            )
        return SpotStatistics.of(images, tuple(self.statistics.levers > 0))

    def given(self, data: SpotStatistics) -> Self:
        """The same instrument with other spots."""
        return replace(self, statistics=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Three Gauss-Newton steps from rough values, ridged by their scales; and errors."""
        noise = np.sqrt(self.statistics.squares / self.statistics.freedom)
        # Rough values and scales of all but the noise: some arc minutes, a tenth.
        angles = 9 if self.drifts else 6
        rough, scale = (
            np.append(np.zeros(angles), 1.0),
            np.append(np.full(angles, 1e-2), 0.3),
        )
        centre = rough
        for _ in range(3):
            response, left = self.linearised(np.append(centre, noise), scale)
            normal = response.T @ response / noise**2 + np.diag(1 / scale**2)
            pull = response.T @ left / noise**2 - (centre - rough) / scale**2
            centre = centre + np.linalg.solve(normal, pull)
        errors = np.sqrt(np.diagonal(np.linalg.inv(normal)))
        noise_error = noise / np.sqrt(2 * self.statistics.freedom)
        return np.append(centre, noise), np.append(errors, noise_error)

    def linearised(
        self, centre: FloatArray, scale: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Response of the weighted statistics to all parameters but the noise, and what is left.

        Derivatives, (m, d - 1), of mean times root count, then of slope times root lever; measured
        less predicted, (m,), weighted alike: each has the standard deviation of the noise.
        """
        steps = np.zeros((2 * len(scale), len(centre)))
        steps[::2, :-1], steps[1::2, :-1] = (
            np.diag(_STEP * scale),
            -np.diag(_STEP * scale),
        )
        start, end = self.paths(np.concatenate([centre[None], centre + steps]))
        found = self._weigh(0.5 * (start + end), 0.5 * (end - start))
        response = (found[1::2] - found[2::2]) / (2 * _STEP * scale)[:, None]
        measured = self._weigh(
            self.statistics.means[None], self.statistics.slopes[None]
        )[0]
        return response.T, measured - found[0]

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
        squares = -2 * float(self(centre[None])[0]) - self.statistics.size * np.log(
            2 * np.pi
        )
        return float(np.sqrt(squares / self.statistics.size))

    def checks(self, data: SpotStatistics | None = None) -> dict[str, float]:
        """Scatter, shape of the pattern and motion of its centre, in px."""
        data = data or self.statistics
        pattern = np.ptp(data.means.mean(axis=0), axis=0)
        centres = data.means.mean(axis=1)
        return {
            "scatter of one image (px)": float(np.sqrt(data.squares / data.freedom)),
            "pattern, wider than high (px)": float(pattern[0] - pattern[1]),
            "centre, last less first group, x (px)": float(
                centres[-1, 0] - centres[0, 0]
            ),
            "centre, last less first group, y (px)": float(
                centres[-1, 1] - centres[0, 1]
            ),
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
    derived: Derived | None = None,
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


# Points over the noise, and how many of its own errors they reach.
POINTS, REACH = 401, 9.0


def small_angle_posterior(model: Model) -> tuple[FloatArray, FloatArray]:
    """Return the posterior of a misalignment whose prediction is replaced by its tangent.

    Mean, (d,), and covariance, (d, d), of all parameters, the noise last. Exact in the limit of
    small angles; every prior but that of the noise has to be a `Normal`.
    """
    noise, weight, means, roots = _given_noise(model)
    mean = np.append(weight @ means, weight @ noise)
    rows = np.column_stack([means, noise]) - mean
    covariance = np.einsum("m,mi,mj->ij", weight, rows, rows)
    covariance[:-1, :-1] += np.einsum("m,mik,mjk->ij", weight, roots, roots)
    return mean, np.asarray(covariance)


def _given_noise(model: Model) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the same posterior as a mixture of Gaussians over the noise.

    Values of the noise, in px, and their probabilities, (m,); means of all other parameters given
    the noise, (m, d - 1), in SI; and roots of their covariances, (m, d - 1, d - 1): any matrix
    whose product with its transpose is the covariance.
    """
    likelihood = model.likelihood_of(SpotLikelihood)
    priors = [parameter.prior for parameter in model.parameters[:-1]]
    if not all(isinstance(prior, Normal) for prior in priors):
        raise TypeError(
            "model: expected Gaussian priors of all parameters but the noise"
        )
    sigma = np.array([prior.sigma for prior in priors if isinstance(prior, Normal)])
    middle = np.array([prior.mean for prior in priors if isinstance(prior, Normal)])
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
    statistics = likelihood.statistics
    logs = -statistics.size * np.log(noise) + model.parameters[-1].prior.log_density(
        noise
    )
    logs -= 0.5 * (statistics.squares + left @ left) / noise**2
    logs += 0.5 * np.einsum("mi,mi->m", means, pull)
    logs += np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    weight = np.exp(logs - logsumexp(logs))
    return noise, weight, centre[:-1] + means * scale, roots * scale[:, None]
