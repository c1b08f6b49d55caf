"""Registration of one channel or two: scale, rotation, shift and noise, from sufficient statistics.

Points have shape (n, 2), in px, x before y; inside, a point is the complex number x + iy. About
the pivot the model of niu2024 (17), (18) is linear, target = w source - shift with
w = k exp(i theta), so the squared residuals of any parameters follow from a QR decomposition of
the columns (source, one, target): the cost of a likelihood does not grow with n.

The measured source points are the design: they are held, and the target (and the second channel)
is random given them. With a flat prior on the true position of a star its noise then enters the
residual as k times the source noise, exactly.

What a registration leaves at stars that it was not fitted to: the transform in use is the
least-squares one; the true one and the noise are those of the model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.random import PCG64, Generator
from numpy.typing import NDArray

from reproduce.inference import Consequence, LogUniform, Model, Parameter, Uniform
from reproduce.physics.registration import (
    Registration,
    RegistrationFit,
    as_complex,
    as_points,
    fit_registration,
    paired_points,
)
from reproduce.physics.validate import FloatArray, finite_array
from reproduce.units import DEGREES_PER_RADIAN

ComplexArray = NDArray[np.complex128]
_CHANNELS = ("red", "blue")
TRANSFORM = ("scale", "rotation", "shift-x", "shift-y")
# New stars: parameter vectors that are worked on at once, which bounds the memory, and the seed.
CHUNK, SEED = 10_000, 52


def fit_checks(
    source: FloatArray, target: FloatArray, pivot: FloatArray, **settings: Any
) -> dict[str, float]:
    """Return the numbers of a fit that predictive checks compare, in px.

    The mean radial and tangential residuals in the outer half of the field are zero only if the
    model is right.
    """
    fit = fit_registration(source, target, pivot, **settings)
    offsets = source - pivot
    radius = np.hypot(*offsets.T)
    outer = radius >= np.median(radius)
    unit = offsets[outer] / radius[outer, None]
    left = fit.residuals[outer]
    lengths = np.hypot(*fit.residuals.T)
    return {
        "residual, rms (px)": float(np.sqrt(np.square(fit.residuals).mean())),
        "residual, largest (px)": float(np.abs(fit.residuals).max()),
        # Free of the noise, which follows the size of the residuals, that of a wrong match too.
        "star furthest off, over rms": float(
            lengths.max() / np.sqrt(np.square(lengths).mean())
        ),
        "outer residual, outwards (px)": float((left * unit).sum(axis=1).mean()),
        "outer residual, around (px)": float(
            (unit[:, 0] * left[:, 1] - unit[:, 1] * left[:, 0]).mean()
        ),
    }


@dataclass(frozen=True, eq=False)
class GaussianRegistration:
    """Gaussian noise of one size; parameters (k, theta, shift x, shift y, noise).

    - `source`, `target`, (n, 2): the same stars in the channel and in the reference channel, in px.
    - `pivot`, (2,): the channel's principal point, in px.
    - `source_noise`: false: `noise` is that of a residual coordinate, the source noise neglected or
      included in it. True: it is that of a coordinate in either channel, and a residual has 1 + k^2
      times its variance.
    - `edge`, optional: radius of the field, in px; by default that of the outermost star.
    """

    source: FloatArray
    target: FloatArray
    pivot: FloatArray
    source_noise: bool = False
    edge: float | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """The arguments of `fit_registration` other than the points."""
        return {}

    @cached_property
    def fit(self) -> RegistrationFit:
        """The fit of the same points."""
        return fit_registration(self.source, self.target, self.pivot, **self.settings)

    @property
    def pivots(self) -> tuple[FloatArray, ...]:
        """The pivot of every channel: of one."""
        return (self.pivot,)

    @property
    def observed(self) -> dict[str, FloatArray]:
        """The target points."""
        return {"target": self.target}

    @cached_property
    def offsets(self) -> ComplexArray:
        """Source points about the pivot."""
        return as_complex(self.source) - as_complex(self.pivot)

    @cached_property
    def field(self) -> float:
        """Radius of the field, in px."""
        return float(np.abs(self.offsets).max()) if self.edge is None else self.edge

    @cached_property
    def precision(self) -> FloatArray:
        """Reciprocal standard deviation of each star, without the noise, (n,)."""
        return np.ones(len(self.source))

    @cached_property
    def root(self) -> ComplexArray:
        """Triangular factor of the columns (source, one, target) about the pivot, shape (3, 3)."""
        target = as_complex(self.target) - as_complex(self.pivot)
        columns = (
            self.precision * one for one in (self.offsets, np.ones(len(target)), target)
        )
        return np.asarray(np.linalg.qr(np.stack([*columns], axis=-1), mode="r"))

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        factor = parameters[:, 0] * np.exp(1j * parameters[:, 1])
        shift = parameters[:, 2] + 1j * parameters[:, 3]
        residual = (
            np.stack([-factor, shift, np.ones_like(factor)], axis=-1) @ self.root.T
        )
        squares = (residual.real**2 + residual.imag**2).sum(axis=-1)
        wider = 1 + parameters[:, 0] ** 2 if self.source_noise else 1.0
        variance = parameters[:, 4] ** 2 * wider
        constant = 2 * np.log(self.precision).sum()
        constant = constant - len(self.source) * np.log(2 * np.pi * variance)
        return np.asarray(constant - squares / (2 * variance))

    def predicted(self, parameters: FloatArray) -> ComplexArray:
        """Where the target points should lie, about the pivot, shape (n, points)."""
        factor = parameters[:, :1] * np.exp(1j * parameters[:, 1:2])
        return np.asarray(factor * self.offsets - shifts(parameters))

    def places(self, parameters: FloatArray) -> FloatArray:
        """Where the stars lie in the reference channel without noise, (n, points, 2), in px."""
        return as_points(self.predicted(parameters)) + self.pivot

    def residuals(self, parameters: FloatArray) -> ComplexArray:
        """Target minus prediction, shape (n, points), in px."""
        return (
            as_complex(self.target)
            - as_complex(self.pivot)
            - self.predicted(parameters)
        )

    def deviations(self, parameters: FloatArray) -> FloatArray:
        """Standard deviation of a residual coordinate of each star, shape (n, points), in px."""
        wider = np.hypot(1, parameters[:, 0]) if self.source_noise else 1.0
        return np.asarray((parameters[:, 4] * wider)[:, None] / self.precision)

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood of each star, shape (n, points)."""
        residual, noise = self.residuals(parameters), self.deviations(parameters)
        squares = (residual.real**2 + residual.imag**2) / noise**2
        return np.asarray(-(0.5 * squares + (2 * np.log(noise) + np.log(2 * np.pi))))

    def scatter(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Noise of residuals, shape (n, points, 2), in px."""
        normal = generator.normal(size=(len(parameters), *self.source.shape))
        return np.asarray(self.deviations(parameters)[..., None] * normal)

    def elsewhere(self, source: FloatArray) -> Self:
        """The same model of other stars, whose targets are not known yet."""
        target = np.zeros_like(source)
        return replace(self, source=source, target=target, edge=self.field)

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Target points for one parameter vector, shape (points, 2), in px."""
        rows = parameters[None]
        return np.asarray(self.places(rows)[0] + self.scatter(rows, generator)[0])

    def given(self, data: FloatArray) -> Self:
        """The same sources with other target points."""
        return replace(self, target=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """The fit and its standard errors."""
        fit, freedom = self.fit, float(self.fit.degrees_of_freedom)
        variance = (
            fit.chi_square / freedom / (1 + fit.parameters[0] ** 2 * self.source_noise)
        )
        noise = max(float(np.sqrt(variance)), 1e-12)
        errors = np.sqrt(np.diagonal(fit.cofactor) * noise**2 * (1 + self.source_noise))
        return np.append(fit.parameters, noise), np.append(
            errors, noise / np.sqrt(2 * freedom)
        )

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """Residuals of the fit."""
        target = self.target if data is None else data
        return fit_checks(self.source, target, self.pivot, **self.settings)


def shifts(parameters: FloatArray) -> ComplexArray:
    """The shifts of parameter vectors, shape (n, 1)."""
    return np.asarray(parameters[:, 2:3] + 1j * parameters[:, 3:4])


def _registration_parameters(
    source: FloatArray, target: FloatArray
) -> tuple[Parameter, ...]:
    """Parameters (k, theta, shift x, shift y, noise), priors on the scale of the data alone."""
    source, target = paired_points(source, target)
    extent = float(np.ptp(np.concatenate([source, target]), axis=0).max())
    field = "the field itself: with a larger shift the channels would share no star"
    return (
        Parameter(
            "scale",
            "k",
            "1",
            Uniform(
                0.5,
                2.0,
                "between half and double: any pair of "
                "channels of one telescope; flat, as the closed form needs",
            ),
        ),
        Parameter(
            "rotation",
            r"\theta",
            "deg",
            Uniform(
                -0.5,
                0.5,
                "half a radian: detectors "
                "behind one prism are mounted the same way round",
            ),
            DEGREES_PER_RADIAN,
        ),
        Parameter("shift-x", r"\Delta x", "px", Uniform(-extent, extent, field)),
        Parameter("shift-y", r"\Delta y", "px", Uniform(-extent, extent, field)),
        Parameter(
            "noise",
            r"\sigma",
            "px",
            LogUniform(
                extent * 1e-7,
                extent * 1e-2,
                "no scale preferred between a ten-millionth and a hundredth of the field",
            ),
        ),
    )


def registration_model(
    source: FloatArray, target: FloatArray, pivot: FloatArray
) -> Model:
    """Registration of one channel with Gaussian noise, from the same stars in both channels.

    Parameters scale, rotation (rad), shift-x, shift-y, noise (px). Errors are those of
    `physics.registration.fit_registration`, and a ValueError for fewer than four points.

    Examples
    --------
    >>> points = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> model = registration_model(points, points + [[1, 0], [0, 1], [1, 1], [0, 0]], (0, 0))
    >>> model.names
    ('scale', 'rotation', 'shift-x', 'shift-y', 'noise')
    """
    source, target = paired_points(source, target)
    if len(source) < 4:
        raise ValueError(
            f"source: expected at least four points, got {len(source)}; two more than the fit "
            "needs are the least that say anything of the noise"
        )
    pivot = finite_array("pivot", pivot, shape=(2,))
    likelihood = GaussianRegistration(source, target, pivot)
    estimate = dict(zip(TRANSFORM, likelihood.fit.parameters.tolist(), strict=True))
    parameters = _registration_parameters(source, target)
    return Model("registration", parameters, likelihood, estimate)


@dataclass(frozen=True, eq=False)
class NewStars:
    """Consequences of a registration at new stars.

    - `stars`: the model at the new stars.
    - `registered`, (points, 2): where the least-squares transform puts them, in px.
    - `arcsec_per_px`: of the reference channel.
    - `columns`: which parameters the model of the stars takes; all, as they stand, by default.
    - `prefix`: stands before the names, where there is more than one channel.
    """

    stars: GaussianRegistration
    registered: FloatArray
    arcsec_per_px: float
    columns: tuple[int, ...] = ()
    prefix: str = ""

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """RMSE, the same as an angle, and the error of the transform at the outermost star."""
        generator = Generator(PCG64(SEED))
        parameters = parameters[:, self.columns] if self.columns else parameters
        outermost = np.hypot(
            *(self.stars.source - self.stars.source.mean(axis=0)).T
        ).argmax()
        errors, moved = [], []
        for first in range(0, len(parameters), CHUNK):
            rows = parameters[first : first + CHUNK]
            off = self.stars.places(rows) - self.registered
            moved.append(np.hypot(*off[:, outermost].T))
            # As niu2024 (26), both axes together.
            squares = np.square(off + self.stars.scatter(rows, generator)).sum(axis=-1)
            errors.append(np.sqrt(squares.mean(axis=-1)))
        rmse, name = np.concatenate(errors), self.prefix
        angle, misplaced = rmse * self.arcsec_per_px, np.concatenate(moved)
        return {
            f"{name}test points, RMSE": Consequence(rmse, "px"),
            f"{name}test points, pointing error": Consequence(angle, "arcsec"),
            f"{name}outermost star, misregistration": Consequence(misplaced, "px"),
        }


@dataclass(frozen=True, eq=False)
class Together:
    """Consequences of several channels, one after the other."""

    parts: tuple[NewStars, ...]

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """The consequences of all."""
        return {
            name: found
            for part in self.parts
            for name, found in part(parameters).items()
        }


@dataclass(frozen=True, eq=False)
class JointRegistration:
    """Both channels at once; parameters (k, theta, shift x, shift y) of red, then of blue, noise.

    They share the green noise, which belongs in the covariance. A true green position z gives
    green = z + noise, red and blue = z carried back by their transforms + noise. Given the red
    points, and with a flat prior on z, the two residuals of a star are Gaussian per axis with
    covariance noise^2 [[1 + k_red^2, 1], [1, 1 + k_blue^2]]; blue itself being random adds the
    Jacobian k_blue^2 per star.

    - `sources`, (n, 2): red and blue points, in px.
    - `target`, (n, 2): green points, in px.
    - `pivots`, (2,): principal points of red and blue, in px.
    """

    sources: tuple[FloatArray, FloatArray]
    target: FloatArray
    pivots: tuple[FloatArray, FloatArray]

    @property
    def columns(self) -> ComplexArray:
        """The columns (red, blue, one, green), red and blue about their pivots, shape (n, 4)."""
        pivots = [as_complex(pivot) for pivot in self.pivots]
        offsets = [as_complex(s) - p for s, p in zip(self.sources, pivots, strict=True)]
        one = np.ones(len(self.target), dtype=np.complex128)
        return np.stack([*offsets, one, as_complex(self.target) - pivots[0]], axis=-1)

    @cached_property
    def root(self) -> ComplexArray:
        """Triangular factor of the columns, shape (4, 4)."""
        return np.asarray(np.linalg.qr(self.columns, mode="r"))

    def weights(self, parameters: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Coefficients of the columns in the two residuals, each of shape (n, 4)."""
        found = []
        for channel in (0, 1):
            k, theta, x, y = parameters[:, 4 * channel : 4 * channel + 4].T
            weights = np.zeros((len(parameters), 4), dtype=np.complex128)
            weights[:, channel] = -k * np.exp(1j * theta)
            weights[:, 2] = (
                x
                + 1j * y
                - (as_complex(self.pivots[channel]) - as_complex(self.pivots[0]))
            )
            weights[:, 3] = 1
            found.append(weights)
        return found[0], found[1]

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        left, right = (weights @ self.root.T for weights in self.weights(parameters))
        red, blue = (1 + parameters[:, i] ** 2 for i in (0, 4))
        determinant = red * blue - 1
        squares = blue * _product(left, left) + red * _product(right, right)
        squares -= 2 * _product(left, right)
        noise, count = parameters[:, 8], len(self.target)
        # Per star: two axes of a pair of residuals, and the Jacobian of the blue transform.
        constant = -np.log(determinant) - 4 * np.log(noise) - 2 * np.log(2 * np.pi)
        constant += 2 * np.log(parameters[:, 4])
        return np.asarray(count * constant - squares / (2 * noise**2 * determinant))

    @property
    def observed(self) -> dict[str, FloatArray]:
        """The blue and green points, which are random given the red ones."""
        return {"blue": self.sources[1], "target": self.target}

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood of each star, shape (n, points)."""
        stars = zip(
            *(one[:, None] for one in (*self.sources, self.target)), strict=True
        )
        each = (
            replace(self, sources=(red, blue), target=green)
            for red, blue, green in stars
        )
        return np.stack([star(parameters) for star in each], axis=-1)

    def simulate(
        self, parameters: FloatArray, generator: Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Blue and green points for one parameter vector, given the red ones; in px."""
        red, blue = (
            Registration.similarity(u[0], u[1], u[2:4], pivot)
            for u, pivot in zip(
                (parameters[:4], parameters[4:8]), self.pivots, strict=True
            )
        )
        noise = parameters[8] * generator.normal(size=(3, *self.target.shape))
        true = red.apply(self.sources[0] + noise[0])
        return blue.inverse().apply(true) + noise[1], true + noise[2]

    def given(self, data: tuple[FloatArray, FloatArray]) -> Self:
        """The same red points with other blue and green ones."""
        return replace(self, sources=(self.sources[0], data[0]), target=data[1])

    def single(self, channel: int) -> GaussianRegistration:
        """One channel alone, red (0) or blue (1), the noise of both its channels in it."""
        return GaussianRegistration(
            self.sources[channel], self.target, self.pivots[channel], True
        )

    def start(self) -> tuple[FloatArray, FloatArray]:
        """The least-squares fits of both channels and their standard errors."""
        starts = [self.single(channel).start() for channel in (0, 1)]
        centre = np.concatenate(
            [c[:4] for c, _ in starts] + [[np.mean([c[4] for c, _ in starts])]]
        )
        spread = np.concatenate([s[:4] for _, s in starts] + [[starts[0][1][4]]])
        return centre, spread

    def checks(
        self, data: tuple[FloatArray, FloatArray] | None = None
    ) -> dict[str, float]:
        """Those of each channel, and the correlation of the two channels' residuals."""
        blue, green = (self.sources[1], self.target) if data is None else data
        found = {}
        sources, left = (self.sources[0], blue), []
        for name, source, pivot in zip(_CHANNELS, sources, self.pivots, strict=True):
            checks = fit_checks(source, green, pivot)
            found.update({f"{name}: {key}": value for key, value in checks.items()})
            left.append(fit_registration(source, green, pivot).residuals.ravel())
        found["correlation of both residuals"] = float(
            np.asarray(np.corrcoef(left))[0, 1]
        )
        return found


def _product(left: ComplexArray, right: ComplexArray) -> FloatArray:
    return np.asarray((left.real * right.real + left.imag * right.imag).sum(axis=-1))


def joint_model(
    sources: tuple[FloatArray, FloatArray],
    target: FloatArray,
    pivots: tuple[FloatArray, FloatArray],
) -> Model:
    """Registration of red and blue over green, with one noise in all channels: nine parameters."""
    likelihood = JointRegistration(sources, target, pivots)
    parameters = []
    for channel, source in zip(_CHANNELS, sources, strict=True):
        for one in _registration_parameters(source, target)[:4]:
            label = f"{one.label}_\\mathrm{{{channel[0]}}}"
            parameters.append(replace(one, name=f"{channel}-{one.name}", label=label))
    names = [p.name for p in parameters]
    estimate = dict(zip(names, likelihood.start()[0].tolist(), strict=False))
    parameters.append(_registration_parameters(sources[0], target)[4])
    return Model("registration-joint", tuple(parameters), likelihood, estimate)
