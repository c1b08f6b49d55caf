"""Registration with Gaussian noise of one channel or two, and its consequences at new stars.

Points have shape (n, 2), in px, x before y. The target points are random, and the source points are
fixed. Models, parameters and their order are those of `physics.registration.MODELS`, followed by
the noise of a star of weight one. Given covariances replace the noise. A source point with errors
has the Jeffreys prior of its true position, because a flat prior would make the estimate of the
scale inconsistent (Neyman and Scott, 1948).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import PCG64, Generator

from reproduce.inference import (
    Consequence,
    Likelihood,
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
    as_complex,
    fit_problem,
    fits_exactly,
    paired_points,
    prepare,
    residuals_at,
)
from reproduce.physics.validate import FloatArray
from reproduce.units import DEGREES_PER_RADIAN

TRANSFORM = MODELS["similarity"]
_CHANNELS = ("red", "blue")
# Values of parameter vectors and stars that are evaluated together, which limits the memory.
_MAX_VALUES = 1_000_000
# Parameter vectors that are evaluated together at new stars, and the seed of their noise.
CHUNK_SIZE, NOISE_SEED = 10_000, 52
# Half-widths of flat priors: of a shift in fields, of a scale in ratios of the sizes of both
# patterns, of any parameter in standard errors.
SHIFT_FIELDS, SCALE_RATIOS, STANDARD_ERRORS = 10.0, 10.0, 1e3
# Draws in closed form per requested draw, since the bounds of priors reject some.
_DRAWS_PER_EXACT = 10
# Symbol, displayed unit and its number per SI unit.
_DISPLAY: dict[str, tuple[str, str, float]] = {
    "scale": ("k", "1", 1.0),
    "rotation": (r"\theta", "deg", DEGREES_PER_RADIAN),
    "shift-x": (r"\Delta x", "px", 1.0),
    "shift-y": (r"\Delta y", "px", 1.0),
    "noise": (r"\sigma", "px", 1.0),
}


def fit_checks(fit: RegistrationFit) -> dict[str, float]:
    """Return the numbers of a fit for predictive checks, in px.

    The mean radial and tangential residuals in the outer half of the field are zero only if the
    model is right.
    """
    offsets, residuals = (
        as_complex(points)
        for points in (fit.problem.source - fit.problem.pivot, fit.residuals)
    )
    radius, lengths = np.abs(offsets), np.abs(residuals)
    outer = radius >= np.median(radius)
    turned = (residuals[outer] * offsets[outer].conj() / radius[outer]).mean()
    rms = np.sqrt(np.square(fit.residuals).mean())
    return {
        "residual, rms (px)": float(rms),
        "residual, largest (px)": float(np.abs(fit.residuals).max()),
        # A ratio, since one wrong match also increases the noise.
        "star furthest off, over rms": float(
            lengths.max() / np.sqrt(np.square(lengths).mean())
        ),
        "outer residual, outwards (px)": float(turned.real),
        "outer residual, around (px)": float(turned.imag),
    }


class StarLikelihood(Likelihood):
    """A likelihood that is a product over the stars of one or more channels."""

    channels: tuple[GaussianRegistration, ...]

    @property
    def target(self) -> FloatArray:
        """Points in the reference channel, shape (points, 2), in px."""
        return self.channels[0].problem.target

    @property
    def pivots(self) -> tuple[FloatArray, ...]:
        """Pivot of every channel, shape (2,), in px."""
        return tuple(channel.problem.pivot for channel in self.channels)

    @property
    def observed(self) -> dict[str, FloatArray]:
        """The target points."""
        return {"target": self.target}

    def parts(self, parameters: FloatArray) -> list[FloatArray]:
        """Return the parameter vectors in parts that fit into the memory."""
        count = -(-len(parameters) * len(self.target) // _MAX_VALUES)
        return np.array_split(parameters, max(count, 1))

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood, shape (n,)."""
        parts = self.parts(parameters)
        return np.concatenate([self.pointwise(part).sum(axis=-1) for part in parts])


@dataclass(frozen=True, eq=False)
class GaussianRegistration(StarLikelihood):
    """Registration of one channel with Gaussian noise.

    - `problem`: the same stars in the channel and in the reference channel, with weights or
      covariances, the pivot and the model, from `physics.registration.prepare`.
    """

    problem: Problem

    @property
    def channels(  # type: ignore[override]  # never assigned
        self,
    ) -> tuple[GaussianRegistration, ...]:
        """The channel."""
        return (self,)

    @property
    def source(self) -> FloatArray:
        """Points in the channel, shape (points, 2), in px."""
        return self.problem.source

    @property
    def pivot(self) -> FloatArray:
        """Pivot of rotation and scale, shape (2,), in px."""
        return self.problem.pivot

    @cached_property
    def fit(self) -> RegistrationFit:
        """The fit of the points."""
        return fit_problem(self.problem)

    @property
    def is_linear(self) -> bool:
        """Whether the chi-square is quadratic in the coordinates of `linear`."""
        problem = self.problem
        return problem.model == "similarity" and problem.source_covariance is None

    @property
    def _size(self) -> int:
        """Number of parameters of the transform."""
        return len(MODELS[self.problem.model])

    def noise(self, parameters: FloatArray) -> FloatArray:
        """Return the noise, shape (n,), in px; one if the errors are known."""
        if self.problem.errors_known:
            return np.ones(len(parameters))
        return parameters[:, self._size]

    def linear(self, parameters: FloatArray) -> FloatArray:
        """Return k cos(theta), k sin(theta) and shift of similarities, shape (n, 4)."""
        factor = parameters[:, 0] * np.exp(1j * parameters[:, 1])
        return np.column_stack([factor.real, factor.imag, parameters[:, 2:4]])

    @cached_property
    def linear_cofactor(self) -> FloatArray:
        """Inverse normal matrix of a similarity in these coordinates, shape (4, 4)."""
        (scale, angle), slopes = self.fit.parameters[:2], np.eye(4)
        sine, cosine = np.sin(angle), np.cos(angle)
        slopes[:2, :2] = [[cosine, -scale * sine], [sine, scale * cosine]]
        return np.asarray(slopes @ self.fit.cofactor @ slopes.T)

    @cached_property
    def precision(self) -> FloatArray:
        """Inverse covariance of each star at the fit, without the noise, shape (points, 2, 2)."""
        return self._precision(self.fit.parameters[None]).reshape(-1, 2, 2)

    def _precision(self, transforms: FloatArray) -> FloatArray:
        inverse = residuals_at(self.problem, transforms)[1]
        return np.asarray(self.problem.counts[:, None, None] * inverse)

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
        residuals, inverse = self.target - self.places(parameters), self.precision
        if self.problem.source_covariance is not None:
            inverse = self._precision(parameters[:, : self._size])
        squares = np.vecdot(residuals, (inverse @ residuals[..., None])[..., 0])
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
        return self.problem.transformed(parameters[:, : self._size], points)

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Return target points for one parameter vector, shape (points, 2), in px."""
        normal = generator.normal(size=(*self.source.shape, 1))
        # Any matrix whose product with its transpose is the covariance.
        root = np.linalg.inv(np.linalg.cholesky(self.precision)).mT
        noise = self.noise(parameters[None]) * (root @ normal)[..., 0]
        return np.asarray(self.places(parameters[None])[0] + noise)

    def with_data(self, data: FloatArray) -> Self:
        """Return the likelihood of the same sources with other target points."""
        return replace(self, problem=replace(self.problem, target=data))

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
        return fit_checks((self if data is None else self.with_data(data)).fit)


def _parameter(name: str, prior: Prior, channel: str = "") -> Parameter:
    """Return a parameter of a registration, of a named channel if there are two."""
    own = (f"a_{{{name}}}", UNITS.get(name, "1"), 1.0)
    label, unit, shown = _DISPLAY.get(name, own)
    if channel:
        name, label = f"{channel}-{name}", f"{label}_\\mathrm{{{channel[0]}}}"
    return Parameter(name, label, unit, prior, shown)


def _book_priors(source: FloatArray, target: FloatArray) -> dict[str, Prior]:
    """Return the priors of a channel of the telescope, on the scale of the data."""
    extent = float(np.ptp(np.concatenate([source, target]), axis=0).max())
    shift = Uniform(
        -extent,
        extent,
        "the field itself: with a larger shift the channels would share no star",
    )
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
            "no scale preferred between 1e-7 and 1 % of the field",
        ),
    }


def registration_model(
    source: FloatArray, target: FloatArray, pivot: FloatArray
) -> Model:
    """Return the registration of one channel of the telescope to another channel.

    Parameters
    ----------
    source, target : ndarray, shape (n, 2)
        The same stars in both channels, in px.
    pivot : ndarray, shape (2,)
        Pivot of rotation and scale, in px.

    Returns
    -------
    Model
        Parameters scale, rotation (rad), shift-x, shift-y and noise (px).

    Raises
    ------
    ValueError
        As in `fitted_model`.

    Examples
    --------
    >>> points = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> model = registration_model(points, points + [[1, 0], [0, 1], [1, 1], [0, 0]], (0, 0))
    >>> model.names
    ('scale', 'rotation', 'shift-x', 'shift-y', 'noise')
    """
    source, target = paired_points(source, target)
    model = fitted_model(GaussianRegistration(prepare(source, target, pivot)))
    return model.with_priors(_book_priors(source, target))


def fitted_model(likelihood: GaussianRegistration) -> Model:
    """Return the registration of your stars, with priors on the scale of the data.

    The bounds of a uniform prior are as far from the fit as the data allow.

    Parameters
    ----------
    likelihood : GaussianRegistration
        Stars of both images, with their errors.

    Returns
    -------
    Model
        Model with its priors and the stars as data.

    Raises
    ------
    ValueError
        If the points are too few, or if they fit without any error and the noise is unknown.

    Examples
    --------
    >>> points = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> moved = points + [[1, 0], [0, 1], [1, 1], [0, 0]]
    >>> model = fitted_model(GaussianRegistration(prepare(points, moved, (0, 0))))
    >>> print(model.parameters[1].prior)
    uniform from -3.14159 to 3.14159
    """
    problem, names = likelihood.problem, MODELS[likelihood.problem.model]
    least = (len(names) + 1) // 2 + (0 if problem.errors_known else 2)
    if len(problem.source) < least:
        raise ValueError(
            f"source: expected at least {least} points, got {len(problem.source)}. Add stars, or "
            "give their errors"
        )
    priors = _wide_priors(likelihood.fit)
    if not problem.errors_known:
        if fits_exactly(likelihood.fit, problem.source, problem.target):
            raise ValueError(
                "target: expected points with noise, got points that fit without any error. Use "
                "`reproduce.register`"
            )
        residual = float(likelihood.start()[0][-1])
        priors["noise"] = LogUniform(
            1e-9 * residual,
            1e3 * residual,
            "no scale preferred: a billionth to a thousand times the residuals of least squares",
        )
    parameters = tuple(_parameter(*item) for item in priors.items())
    return Model("registration", parameters, likelihood)


def _wide_priors(fit: RegistrationFit) -> dict[str, Prior]:
    """Return uniform priors about the parameters of a fit."""
    problem, priors = fit.problem, dict[str, Prior]()
    # No least-squares scale exceeds the ratio of the sizes of both patterns.
    target_size, source_size = (
        float(np.linalg.norm(points - points.mean(axis=0)))
        for points in (problem.target, problem.source)
    )
    half_widths = {
        "1": SCALE_RATIOS * target_size / source_size,
        "px": SHIFT_FIELDS * float(np.ptp(problem.target, axis=0).max()),
        "px^-2": float(np.hypot(*(problem.source - problem.pivot).T).max()) ** -2,
    }
    errors = np.nan_to_num(fit.standard_errors)
    for name, value, error in zip(fit.names, fit.parameters, errors, strict=True):
        half, reason = np.pi, "any: the full circle, cut opposite to least squares"
        if name != "rotation":
            half = max(half_widths[UNITS.get(name, "1")], STANDARD_ERRORS * error)
            reason = (
                "ten times the largest plausible value, or a thousand standard errors"
            )
        low = 0.0 if name == "scale" else float(value - half)
        priors[name] = Uniform(low, float(value + half), reason)
    return priors


def exact_draws(model: Model, count: int, generator: Generator) -> FloatArray:
    """Return independent draws of a similarity in closed form, without a sampler.

    With flat priors the posterior is normal in the coordinates of `GaussianRegistration.linear`
    given the noise, and the noise has an inverse gamma distribution. Rejection converts the draws
    to priors that are flat in scale and rotation, with their bounds.

    Parameters
    ----------
    model : Model
        Similarity with uniform priors, without errors of the source.
    count : int
        Number of draws.
    generator : numpy.random.Generator
        Random number generator.

    Returns
    -------
    ndarray, shape (count, d)
        Draws in the order of the parameters of the model.

    Raises
    ------
    ValueError
        If the model is another one, or the priors exclude most of the posterior.
    """
    likelihood = model.likelihood
    if (
        type(likelihood) is not GaussianRegistration
        or not likelihood.is_linear
        or any(isinstance(one.prior, Normal) for one in model.parameters)
    ):
        raise ValueError(
            "exact: expected a similarity with uniform priors and no errors of the source, got "
            f"{model.name}. Use the draws of emcee"
        )
    fit, many = likelihood.fit, _DRAWS_PER_EXACT * count
    noise = np.ones(many)
    if not fit.errors_known:
        freedom = float(fit.degrees_of_freedom)
        noise = np.sqrt(fit.chi_square / generator.chisquare(freedom, many))
    normal = generator.normal(size=(many, 4))
    root = np.linalg.cholesky(likelihood.linear_cofactor)
    rows = likelihood.linear(fit.parameters[None]) + noise[:, None] * (normal @ root.T)
    factors, angle = rows[:, 0] + 1j * rows[:, 1], fit.parameters[1]
    scales = np.abs(factors)
    angles = angle + np.angle(factors * np.exp(-1j * angle))
    rows = np.column_stack([scales, angles, rows[:, 2:], noise])[:, : model.dimension]
    # The prior of the noise is that of the closed form within its bounds.
    inside = np.isfinite(model.log_prior(rows))
    # Flat in scale and rotation is flat in the two parts divided by the scale.
    inside &= generator.uniform(size=many) < scales.min() / scales
    if inside.sum() < count:
        raise ValueError(
            f"exact: expected priors that contain most of the posterior, got {inside.mean():.2g} "
            "of it. Use the draws of emcee"
        )
    return rows[inside][:count]


@dataclass(frozen=True, eq=False)
class NewStars:
    """Consequences of a registration at new stars.

    - `likelihood`: registration of their channel.
    - `source`, (points, 2): new stars, in px.
    - `registered`, (points, 2): positions by the least-squares transform, in px.
    - `arcsec_per_px`: of the reference channel.
    - `channel`: name and columns of a channel of `JointRegistration`, if the model is joint.
    """

    likelihood: GaussianRegistration
    source: FloatArray
    registered: FloatArray
    arcsec_per_px: float
    channel: tuple[str, tuple[int, ...]] | None = None

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Return the RMSE in px and as an angle, and the error at the outermost star."""
        generator, prefix = Generator(PCG64(NOISE_SEED)), ""
        if self.channel:
            prefix, parameters = f"{self.channel[0]} ", parameters[:, self.channel[1]]
        offsets = self.source - self.source.mean(axis=0)
        outermost = np.hypot(*offsets.T).argmax()
        errors, displacements = [], []
        for first in range(0, len(parameters), CHUNK_SIZE):
            rows = parameters[first : first + CHUNK_SIZE]
            off = self.likelihood.places(rows, self.source) - self.registered
            displacements.append(np.hypot(*off[:, outermost].T))
            # The noise of the joint model is that of one image, a residual has that of both.
            noise = rows[:, 4] * (np.hypot(1, rows[:, 0]) if self.channel else 1.0)
            off += noise[:, None, None] * generator.normal(size=off.shape)
            # As in niu2024 (26), both axes together.
            errors.append(np.sqrt(np.square(off).sum(axis=-1).mean(axis=-1)))
        rmse, displacement = map(np.concatenate, (errors, displacements))
        return {
            f"{prefix}test points, RMSE": Consequence(rmse, "px"),
            f"{prefix}test points, pointing error": Consequence(
                rmse * self.arcsec_per_px, "arcsec"
            ),
            f"{prefix}outermost star, misregistration": Consequence(displacement, "px"),
        }


@dataclass(frozen=True, eq=False)
class JointRegistration(StarLikelihood):
    """Both channels at once, red and blue, registered to green.

    Both share the green noise, so their residuals are correlated. The green, red and blue points
    of a star are its true position in the respective channel plus noise. Given the red points, and
    with a flat prior of the true position, the two residuals of a star are Gaussian per axis with
    covariance noise^2 [[1 + k_red^2, 1], [1, 1 + k_blue^2]]. The blue points are random too, which
    adds the Jacobian k_blue^2 per star.

    - `channels`: registration of red and of blue, with the same target.

    Parameters are scale, rotation and shift of red, then of blue, and the noise of one image.
    """

    channels: tuple[GaussianRegistration, ...]

    @property
    def observed(self) -> dict[str, FloatArray]:
        """The blue and green points, which are random given the red ones."""
        return {"blue": self.channels[1].source, "target": self.target}

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

    def simulate(
        self, parameters: FloatArray, generator: Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Return blue and green points for one parameter vector, given the red ones; in px."""
        blue = Registration.similarity(
            parameters[4], parameters[5], parameters[6:8], self.pivots[1]
        )
        noise = parameters[8] * generator.normal(size=(3, *self.target.shape))
        red, _ = self.channels
        true = red.places(parameters[None, :4], red.source + noise[0])[0]
        return blue.inverse().apply(true) + noise[1], true + noise[2]

    def with_data(self, data: tuple[FloatArray, FloatArray]) -> Self:
        """Return the likelihood of the same red points with other blue and green points."""
        red, blue = (one.with_data(data[1]) for one in self.channels)
        moved = replace(blue, problem=replace(blue.problem, source=data[0]))
        return replace(self, channels=(red, moved))

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Return the least-squares fits of both channels and their standard errors.

        The noise is that of one image.
        """
        (red, red_error), (blue, blue_error) = (one.start() for one in self.channels)
        ratios = np.hypot(1, (red[0], blue[0]))
        noise = float(np.mean((red[4], blue[4]) / ratios))
        wider = [
            np.sqrt(2) * one[:4] / ratio
            for one, ratio in zip((red_error, blue_error), ratios, strict=True)
        ]
        return (
            np.concatenate([red[:4], blue[:4], [noise]]),
            np.append(wider, red_error[4] / ratios[0]),
        )

    def checks(
        self, data: tuple[FloatArray, FloatArray] | None = None
    ) -> dict[str, float]:
        """Return the checks of each channel, and the correlation of their residuals."""
        fits = [one.fit for one in (self.with_data(data) if data else self).channels]
        residuals = [fit.residuals.ravel() for fit in fits]
        return {
            f"{name}: {key}": value
            for name, fit in zip(_CHANNELS, fits, strict=True)
            for key, value in fit_checks(fit).items()
        } | {
            "correlation of both residuals": float(
                np.asarray(np.corrcoef(residuals))[0, 1]
            )
        }


def joint_model(
    sources: tuple[FloatArray, FloatArray],
    target: FloatArray,
    pivots: tuple[FloatArray, FloatArray],
) -> Model:
    """Return the registration of red and blue to green, with one noise in all channels.

    Parameters
    ----------
    sources : tuple of ndarray, shape (n, 2)
        Red and blue points, in px.
    target : ndarray, shape (n, 2)
        Green points, in px.
    pivots : tuple of ndarray, shape (2,)
        Principal points of red and blue, in px.

    Returns
    -------
    Model
        Parameters scale, rotation (rad), shift-x, shift-y of red and of blue, and noise (px).
    """
    likelihood = JointRegistration(
        tuple(
            GaussianRegistration(prepare(source, target, pivot))
            for source, pivot in zip(sources, pivots, strict=True)
        )
    )
    priors = [_book_priors(source, target) for source in sources]
    parameters = [
        _parameter(name, own[name], channel)
        for channel, own in zip(_CHANNELS, priors, strict=True)
        for name in TRANSFORM
    ]
    parameters.append(_parameter("noise", priors[0]["noise"]))
    return Model("registration-joint", tuple(parameters), likelihood)
