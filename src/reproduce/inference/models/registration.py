"""Registration with Gaussian noise of one channel or two, and its consequences at new stars.

Points have shape (n, 2), in px, x before y. The measured source points are fixed, and the target
points are random. Models, parameters and their order are those of
`physics.registration.MODELS`, then the noise of a star of weight one. If covariances are given,
they are the noise. A source point with errors has the Jeffreys prior of its true position: with a
flat prior the estimate of the scale would be inconsistent (Neyman and Scott, 1948).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.random import PCG64, Generator

from reproduce.inference import (
    Consequence,
    LogUniform,
    Model,
    Normal,
    Parameter,
    Prior,
    Uniform,
)
from reproduce.physics.registration import (
    MODELS,
    UNITS,
    Problem,
    Registration,
    RegistrationFit,
    fit_registration,
    fits_exactly,
    paired_points,
    prepare,
    residuals_at,
    robust_similarity,
)
from reproduce.physics.validate import FloatArray, finite_array
from reproduce.units import DEGREES_PER_RADIAN

TRANSFORM = MODELS["similarity"]
_CHANNELS = ("red", "blue")
# The similarity is linear in k cos(theta) and k sin(theta).
_LINEAR_MODELS = ("shift", "similarity", "affine")
# Parameter vectors times stars that are evaluated together. This bounds the memory.
_MAX_VALUES = 1_000_000
# New stars: parameter vectors that are evaluated together, and the seed of their noise.
CHUNK, SEED = 10_000, 52
# Half-widths of flat priors: of a shift in fields, of any parameter in standard errors, of a scale
# in ratios of the sizes of both patterns.
FIELDS, ERRORS, SCALES = 10.0, 1e3, 10.0
# Closed form: draws for each one that is asked for, since bounds of priors reject some.
_DRAWS_PER_EXACT = 10


def fit_checks(
    source: FloatArray, target: FloatArray, pivot: FloatArray, **settings: Any
) -> dict[str, float]:
    """Return the numbers of a fit that predictive checks compare, in px.

    The mean radial and tangential residuals in the outer half of the field are zero only if the
    model is right.
    """
    residuals = fit_registration(source, target, pivot, **settings).residuals
    offsets = source - pivot
    radius, lengths = np.hypot(*offsets.T), np.hypot(*residuals.T)
    outer = radius >= np.median(radius)
    (x, y), left = (offsets[outer] / radius[outer, None]).T, residuals[outer].T
    return {
        "residual, rms (px)": float(np.sqrt(np.square(residuals).mean())),
        "residual, largest (px)": float(np.abs(residuals).max()),
        # A ratio, since one wrong match also increases the noise.
        "star furthest off, over rms": float(
            lengths.max() / np.sqrt(np.square(lengths).mean())
        ),
        "outer residual, outwards (px)": float((x * left[0] + y * left[1]).mean()),
        "outer residual, around (px)": float((x * left[1] - y * left[0]).mean()),
    }


class StarLikelihood:
    """A likelihood that is a product over stars."""

    target: FloatArray

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood, shape (n,)."""
        parts = -(-len(parameters) * len(self.target) // _MAX_VALUES)
        split = np.array_split(parameters, max(parts, 1))
        return np.concatenate([self.pointwise(part).sum(axis=-1) for part in split])

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of each star, shape (n, points)."""
        raise NotImplementedError

    @property
    def observed(self) -> dict[str, FloatArray]:
        """The target points."""
        return {"target": self.target}


@dataclass(frozen=True, eq=False)
class GaussianRegistration(StarLikelihood):
    """Registration of one channel with Gaussian noise.

    - `source`, `target`, (n, 2): the same stars in the channel and in the reference channel, in px.
    - `pivot`, (2,): pivot of rotation and scale, in px.
    - `model`: a key of `MODELS`.
    - `weights`, optional, (n,): above zero.
    - `source_covariance`, `target_covariance`, optional, (n, 2, 2): of each star, in px^2.
    """

    source: FloatArray
    target: FloatArray
    pivot: FloatArray
    model: str = "similarity"
    weights: FloatArray | None = None
    source_covariance: FloatArray | None = None
    target_covariance: FloatArray | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """The arguments of `fit_registration` other than the points."""
        names = ("model", "weights", "source_covariance", "target_covariance")
        return {name: getattr(self, name) for name in names}

    @cached_property
    def fit(self) -> RegistrationFit:
        """The fit of the same points."""
        return fit_registration(self.source, self.target, self.pivot, **self.settings)

    @cached_property
    def problem(self) -> Problem:
        """The points with their errors."""
        return prepare(self.source, self.target, self.pivot, **self.settings)

    @property
    def pivots(self) -> tuple[FloatArray, ...]:
        """The pivot of every channel."""
        return (self.pivot,)

    @property
    def is_linear(self) -> bool:
        """Whether the chi-square is quadratic in the coordinates of `linear`."""
        return self.model in _LINEAR_MODELS and self.source_covariance is None

    def transform(self, parameters: FloatArray) -> FloatArray:
        """Return the parameters of the transform, shape (n, p)."""
        return parameters[:, : len(MODELS[self.model])]

    def noise(self, parameters: FloatArray) -> FloatArray:
        """Return the noise, shape (n,), in px; one if the errors are known."""
        if self.problem.errors_known:
            return np.ones(len(parameters))
        return parameters[:, len(MODELS[self.model])]

    def linear(self, parameters: FloatArray) -> FloatArray:
        """Return coordinates in which a linear model is linear, shape (n, p)."""
        moved = self.transform(parameters)
        if self.model != "similarity":
            return moved
        factor = moved[:, 0] * np.exp(1j * moved[:, 1])
        return np.column_stack([factor.real, factor.imag, moved[:, 2:]])

    @cached_property
    def linear_cofactor(self) -> FloatArray:
        """Inverse normal matrix of the fit in these coordinates, shape (p, p)."""
        slopes = np.eye(len(self.fit.parameters))
        if self.model == "similarity":
            scale, angle = self.fit.parameters[:2]
            across, along = np.sin(angle), np.cos(angle)
            slopes[:2, :2] = [[along, -scale * across], [across, scale * along]]
        return np.asarray(slopes @ self.fit.cofactor @ slopes.T)

    @cached_property
    def precision(self) -> FloatArray:
        """Inverse covariance of each star at the fit, without the noise, shape (points, 2, 2)."""
        inverse = residuals_at(self.problem, self.fit.parameters[None])[1]
        return self.problem.counts[:, None, None] * inverse.reshape(-1, 2, 2)

    @cached_property
    def _constant(self) -> FloatArray:
        """Log density of each star at its predicted position for a noise of one, (points,)."""
        return np.asarray(
            0.5 * np.linalg.slogdet(self.precision)[1] - np.log(2 * np.pi)
        )

    @cached_property
    def _normal_matrix(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self.linear_cofactor))

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood, shape (n,)."""
        if not self.is_linear:
            return super().__call__(parameters)
        off = self.linear(parameters) - self.linear(self.fit.parameters[None])
        squares = self.fit.chi_square + np.vecdot(off @ self._normal_matrix, off)
        noise = self.noise(parameters)
        constant = self._constant.sum() - 2 * len(self.target) * np.log(noise)
        return np.asarray(constant - squares / (2 * noise**2))

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of each star, shape (n, points)."""
        left, inverse = self.target - self.places(parameters), self.precision
        if self.source_covariance is not None:
            inverse = residuals_at(self.problem, self.transform(parameters))[1]
            inverse = self.problem.counts[:, None, None] * inverse
        squares = np.vecdot(left, (inverse @ left[..., None])[..., 0])
        noise = self.noise(parameters)[:, None]
        return np.asarray(self._constant - 2 * np.log(noise) - squares / (2 * noise**2))

    def places(
        self, parameters: FloatArray, source: FloatArray | None = None
    ) -> FloatArray:
        """Return noise-free positions in the reference channel, (n, points, 2), in px.

        Positions of the stars, or of other source points of shape (points, 2).
        """
        points = self.source if source is None else source
        points = np.broadcast_to(points, (len(parameters), *points.shape))
        return self.problem.transformed(self.transform(parameters), points)

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Return target points for one parameter vector, shape (points, 2), in px."""
        normal = generator.normal(size=(*self.source.shape, 1))
        # Any matrix whose product with its transpose is the covariance.
        root = np.linalg.inv(np.linalg.cholesky(self.precision)).mT
        noise = self.noise(parameters[None]) * (root @ normal)[..., 0]
        return np.asarray(self.places(parameters[None])[0] + noise)

    def with_data(self, data: FloatArray) -> Self:
        """Return the same sources with other target points."""
        return replace(self, target=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Return the fit and its standard errors."""
        fit = self.fit
        if fit.errors_known:
            return fit.parameters, fit.standard_errors
        freedom = float(fit.degrees_of_freedom)
        noise = max(float(np.sqrt(fit.chi_square / freedom)), 1e-12)
        errors = noise * np.sqrt(np.diagonal(fit.cofactor))
        last = noise / np.sqrt(2 * freedom)
        return np.append(fit.parameters, noise), np.append(errors, last)

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """Return numbers of the residuals of the fit."""
        target = self.target if data is None else data
        return fit_checks(self.source, target, self.pivot, **self.settings)


# Symbol, displayed unit and its number per SI unit.
_SHOWN: dict[str, tuple[str, str, float]] = {
    "scale": ("k", "1", 1.0),
    "rotation": (r"\theta", "deg", DEGREES_PER_RADIAN),
    "shift-x": (r"\Delta x", "px", 1.0),
    "shift-y": (r"\Delta y", "px", 1.0),
    "noise": (r"\sigma", "px", 1.0),
}


def _parameters(priors: Mapping[str, Prior]) -> list[Parameter]:
    found = []
    for name, prior in priors.items():
        shown = (f"a_{{{name}}}", UNITS.get(name, "1"), 1.0)
        label, unit, factor = _SHOWN.get(name, shown)
        found.append(Parameter(name, label, unit, prior, factor))
    return found


def _default_priors(source: FloatArray, target: FloatArray) -> dict[str, Prior]:
    """Return the priors of the registration of a channel, on the scale of the data."""
    extent = float(np.ptp(np.concatenate([source, target]), axis=0).max())
    field = "the field itself: with a larger shift the channels would share no star"
    shift = Uniform(-extent, extent, field)
    return {
        "scale": Uniform(
            0.5,
            2.0,
            "between half and double: any pair of channels of one telescope; flat, as the closed "
            "form needs",
        ),
        "rotation": Uniform(
            -0.5,
            0.5,
            "half a radian: detectors behind one prism are mounted the same way round",
        ),
        "shift-x": shift,
        "shift-y": shift,
        "noise": LogUniform(
            extent * 1e-7,
            extent * 1e-2,
            "no scale preferred between a ten-millionth and a hundredth of the field",
        ),
    }


def registration_model(
    source: FloatArray, target: FloatArray, pivot: FloatArray
) -> Model:
    """Return the registration of one channel, with the same stars in both channels.

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
    likelihood = GaussianRegistration(
        source, target, finite_array("pivot", pivot, shape=(2,))
    )
    return _model(likelihood, lambda _: _default_priors(source, target))


def _model(
    likelihood: GaussianRegistration,
    priors: Callable[[GaussianRegistration], dict[str, Prior]],
) -> Model:
    """Return the model, if its stars are enough."""
    names = MODELS[likelihood.model]
    least = (len(names) + 1) // 2 + (0 if likelihood.problem.errors_known else 2)
    if len(likelihood.source) < least:
        raise ValueError(
            f"source: expected at least {least} points, got {len(likelihood.source)}. Add stars, "
            "or give their errors"
        )
    estimate = dict(zip(names, likelihood.fit.parameters.tolist(), strict=True))
    parameters = _parameters(priors(likelihood))
    return Model("registration", tuple(parameters), likelihood, estimate)


def fitted_model(likelihood: GaussianRegistration) -> Model:
    """Return the registration of your stars, with priors on the scale of the data.

    A flat prior ends as far from the fit as the data allow. Points that fit without any error are
    a ValueError if the noise is unknown.

    Examples
    --------
    >>> points = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> moved = points + [[1, 0], [0, 1], [1, 1], [0, 0]]
    >>> model = fitted_model(GaussianRegistration(points, moved, np.zeros(2)))
    >>> print(model.parameters[1].prior)
    uniform from -3.14159 to 3.14159
    """
    source, target = paired_points(likelihood.source, likelihood.target)
    model = _model(likelihood, _wide_priors)
    if likelihood.problem.errors_known:
        return model
    if fits_exactly(likelihood.fit, source, target):
        raise ValueError(
            "target: expected points with noise, got points that fit without any error. Use "
            "`reproduce.register`"
        )
    residual = float(likelihood.start()[0][-1])
    reason = "no scale preferred: a billionth to a thousand times the residuals of least squares"
    noise = {"noise": LogUniform(1e-9 * residual, 1e3 * residual, reason)}
    return replace(model, parameters=(*model.parameters, *_parameters(noise)))


def _wide_priors(likelihood: GaussianRegistration) -> dict[str, Prior]:
    """Return the flat priors of the parameters of the transform."""
    source, target, fit = likelihood.source, likelihood.target, likelihood.fit
    robust = robust_similarity(source, target, likelihood.pivot)
    # No least-squares scale exceeds the ratio of the sizes of both patterns.
    wide, narrow = (np.linalg.norm(p - p.mean(axis=0)) for p in (target, source))
    size = SCALES * max(float(wide / narrow), float(robust.parameters[0]))
    field = np.hypot(*(source - likelihood.pivot).T).max()
    reach = dict.fromkeys(MODELS["affine"], size) | {"radial": field**-2.0}
    reach |= dict.fromkeys(
        ("shift-x", "shift-y"), FIELDS * np.ptp(target, axis=0).max()
    )
    reason = "ten times the largest plausible value, or a thousand standard errors"
    found: dict[str, Prior] = {}
    errors = np.nan_to_num(fit.standard_errors)
    for name, value, error in zip(fit.names, fit.parameters, errors, strict=True):
        if name == "scale":
            found[name] = Uniform(
                0.0,
                size,
                "up to ten times the ratio of the sizes of both patterns; flat",
            )
        elif name == "rotation":
            turn = "any: the full turn, cut opposite to least squares"
            found[name] = Uniform(float(value - np.pi), float(value + np.pi), turn)
        else:
            half = max(reach[name], ERRORS * error)
            found[name] = Uniform(float(value - half), float(value + half), reason)
    return found


def exact_draws(model: Model, count: int, generator: Generator) -> FloatArray:
    """Return independent draws of a registration in closed form, shape (count, d).

    The posterior of a linear model with flat priors is normal given the noise, and the noise has
    an inverse gamma distribution. Rejection carries the draws over to priors that are flat in
    scale and rotation, with their bounds. Other models and priors are a ValueError.
    """
    likelihood = model.likelihood
    if (
        type(likelihood) is not GaussianRegistration
        or not likelihood.is_linear
        or any(isinstance(one.prior, Normal) for one in model.parameters)
    ):
        raise ValueError(
            "exact: expected a shift, similarity or affine registration with uniform priors and no "
            f"errors of the source, got {model.name}. Use the draws of emcee"
        )
    fit, many = likelihood.fit, _DRAWS_PER_EXACT * count
    noise = np.ones(many)
    if not fit.errors_known:
        freedom = float(fit.degrees_of_freedom)
        noise = np.sqrt(fit.chi_square / generator.chisquare(freedom, many))
    normal = generator.normal(size=(many, len(fit.parameters)))
    root = np.linalg.cholesky(likelihood.linear_cofactor)
    rows = noise[:, None] * (normal @ root.T)
    rows += likelihood.linear(fit.parameters[None])
    kept = np.ones(many)
    if likelihood.model == "similarity":
        # Flat in scale and rotation is flat in the two parts divided by the scale.
        factors, angle = rows[:, 0] + 1j * rows[:, 1], fit.parameters[1]
        scales = np.abs(factors)
        kept = scales.min() / scales
        rows[:, 0] = scales
        rows[:, 1] = angle + np.angle(factors * np.exp(-1j * angle))
    rows = np.column_stack([rows, noise])[:, : model.dimension]
    # The prior of the noise is that of the closed form within its bounds.
    inside = np.isfinite(model.log_prior(rows)) & (generator.uniform(size=many) < kept)
    if inside.sum() < count:
        raise ValueError(
            f"exact: expected priors that hold most of the posterior, got {inside.mean():.2g} of "
            "it. Use the draws of emcee"
        )
    return rows[inside][:count]


@dataclass(frozen=True, eq=False)
class NewStars:
    """Consequences of a registration at new stars.

    - `likelihood`: the registration of their channel.
    - `source`, (points, 2): the new stars, in px.
    - `registered`, (points, 2): their positions by the least-squares transform, in px.
    - `arcsec_per_px`: of the reference channel.
    - `channel`: name and columns of a channel of `JointRegistration`, if it is one.
    """

    likelihood: GaussianRegistration
    source: FloatArray
    registered: FloatArray
    arcsec_per_px: float
    channel: tuple[str, tuple[int, ...]] | None = None

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Return the RMSE in px and as an angle, and the error at the outermost star."""
        generator, prefix = Generator(PCG64(SEED)), ""
        if self.channel:
            prefix, parameters = f"{self.channel[0]} ", parameters[:, self.channel[1]]
        offsets = self.source - self.source.mean(axis=0)
        outermost = np.hypot(*offsets.T).argmax()
        errors, moved = [], []
        for first in range(0, len(parameters), CHUNK):
            rows = parameters[first : first + CHUNK]
            off = self.likelihood.places(rows, self.source) - self.registered
            moved.append(np.hypot(*off[:, outermost].T))
            # The noise of the joint model is that of one image, and a residual has that of both.
            noise = rows[:, 4] * (np.hypot(1, rows[:, 0]) if self.channel else 1.0)
            off += noise[:, None, None] * generator.normal(size=off.shape)
            # As niu2024 (26), both axes together.
            errors.append(np.sqrt(np.square(off).sum(axis=-1).mean(axis=-1)))
        rmse = np.concatenate(errors)
        angle = Consequence(rmse * self.arcsec_per_px, "arcsec")
        misplaced = Consequence(np.concatenate(moved), "px")
        return {
            f"{prefix}test points, RMSE": Consequence(rmse, "px"),
            f"{prefix}test points, pointing error": angle,
            f"{prefix}outermost star, misregistration": misplaced,
        }


@dataclass(frozen=True, eq=False)
class JointRegistration(StarLikelihood):
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

    @cached_property
    def channels(self) -> tuple[GaussianRegistration, ...]:
        """Red and blue, each by itself."""
        return tuple(
            GaussianRegistration(source, self.target, pivot)
            for source, pivot in zip(self.sources, self.pivots, strict=True)
        )

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of each star, shape (n, points)."""
        red, blue = (
            self.target - channel.places(parameters[:, 4 * i : 4 * i + 4])
            for i, channel in enumerate(self.channels)
        )
        red_variance, blue_variance = (1 + parameters[:, i, None] ** 2 for i in (0, 4))
        determinant = red_variance * blue_variance - 1
        squares = blue_variance * np.vecdot(red, red) - 2 * np.vecdot(red, blue)
        squares += red_variance * np.vecdot(blue, blue)
        noise = parameters[:, 8, None]
        # Two axes of a pair of residuals, and the Jacobian of the blue transform.
        constant = -np.log(determinant) - 4 * np.log(noise) - 2 * np.log(2 * np.pi)
        constant += 2 * np.log(parameters[:, 4, None])
        return np.asarray(constant - squares / (2 * noise**2 * determinant))

    @property
    def observed(self) -> dict[str, FloatArray]:
        """The blue and green points, which are random given the red ones."""
        return {"blue": self.sources[1], "target": self.target}

    def simulate(
        self, parameters: FloatArray, generator: Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Return blue and green points for one parameter vector, given the red ones; in px."""
        blue = Registration.similarity(
            parameters[4], parameters[5], parameters[6:8], self.pivots[1]
        )
        noise = parameters[8] * generator.normal(size=(3, *self.target.shape))
        measured = self.sources[0] + noise[0]
        true = self.channels[0].places(parameters[None, :4], measured)[0]
        return blue.inverse().apply(true) + noise[1], true + noise[2]

    def with_data(self, data: tuple[FloatArray, FloatArray]) -> Self:
        """Return the same red points with other blue and green ones."""
        return replace(self, sources=(self.sources[0], data[0]), target=data[1])

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Return the least-squares fits of both channels and their standard errors.

        The noise is that of one image.
        """
        (red, red_error), (blue, blue_error) = (one.start() for one in self.channels)
        shares = np.hypot(1, (red[0], blue[0]))
        noise = float(np.mean((red[4], blue[4]) / shares))
        error = red_error[4] / shares[0]
        wider = [
            np.sqrt(2) * one[:4] / share
            for one, share in zip((red_error, blue_error), shares, strict=True)
        ]
        return np.concatenate([red[:4], blue[:4], [noise]]), np.append(wider, error)

    def checks(
        self, data: tuple[FloatArray, FloatArray] | None = None
    ) -> dict[str, float]:
        """Return the checks of each channel, and the correlation of their residuals."""
        found: dict[str, float] = {}
        residuals = []
        likelihood = self if data is None else self.with_data(data)
        for name, channel in zip(_CHANNELS, likelihood.channels, strict=True):
            found |= {f"{name}: {key}": one for key, one in channel.checks().items()}
            residuals.append(channel.fit.residuals.ravel())
        correlation = np.asarray(np.corrcoef(residuals))[0, 1]
        return found | {"correlation of both residuals": float(correlation)}


def joint_model(
    sources: tuple[FloatArray, FloatArray],
    target: FloatArray,
    pivots: tuple[FloatArray, FloatArray],
) -> Model:
    """Return the registration of red and blue to green, with one noise in all channels."""
    likelihood = JointRegistration(sources, target, pivots)
    parameters: list[Parameter] = []
    for channel, source in zip(_CHANNELS, sources, strict=True):
        for one in _parameters(_default_priors(source, target))[:4]:
            label = f"{one.label}_\\mathrm{{{channel[0]}}}"
            parameters.append(replace(one, name=f"{channel}-{one.name}", label=label))
    names, values = (one.name for one in parameters), likelihood.start()[0].tolist()
    estimate = dict(zip(names, values, strict=False))
    parameters.append(_parameters(_default_priors(sources[0], target))[4])
    return Model("registration-joint", tuple(parameters), likelihood, estimate)
