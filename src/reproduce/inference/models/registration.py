"""Registration with Gaussian noise, and its consequences at new stars.

Points have shape (n, 2), in px, x before y. The target points are random, and the source points are
fixed. Models, parameters and their order are those of `physics.registration.MODELS`, followed by
the noise of a star of weight one. Given covariances replace the noise. A source point with errors
has the Jeffreys prior of its true position, because a flat prior would make the estimate of the
scale inconsistent (Neyman and Scott, 1948).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from numpy.random import Generator, default_rng

from reproduce.inference import (
    Estimate,
    Likelihood,
    LogUniform,
    Model,
    Parameter,
    Prior,
    Quantity,
    Uniform,
)
from reproduce.physics.registration import (
    MODELS,
    UNITS,
    Problem,
    RegistrationFit,
    as_complex,
    fit_problem,
    rmse,
)
from reproduce.physics.validate import BoolArray, FloatArray
from reproduce.units import DEGREES_PER_RADIAN

TRANSFORM = MODELS["similarity"]
# Values of parameter vectors and stars that are evaluated together, which limits the memory.
_MAX_VALUES = 1_000_000
# Seed of the noise of new stars.
_NOISE_SEED = 52
# Half-width of flat priors, in standard errors.
_STANDARD_ERRORS = 1e6
_UNITS = UNITS | {"rotation": "deg", "noise": "px"}


@dataclass(frozen=True, eq=False)
class GaussianRegistration(Likelihood):
    """Registration of one channel with Gaussian noise.

    - `problem`: the same stars in the channel and in the reference channel, with weights or
      covariances, the pivot and the model, from `physics.registration.prepare`.
    """

    observables = ("target",)
    name = "registration"
    # Parameters after those of the transform and the noise, and `Parameter.scale` of the noise.
    extra: ClassVar[tuple[Parameter, ...]] = ()
    noise_scale = ""
    problem: Problem

    @property
    def source(self) -> FloatArray:
        """Points in the channel, shape (points, 2), in px."""
        return self.problem.source

    @property
    def target(self) -> FloatArray:
        """Points in the reference channel, shape (points, 2), in px."""
        return self.problem.target

    @property
    def pivot(self) -> FloatArray:
        """Pivot of rotation and scale, shape (2,), in px."""
        return self.problem.pivot

    @cached_property
    def agreeing(self) -> BoolArray:
        """The stars that are rightly matched, (points,): all stars."""
        return np.ones(len(self.source), dtype=bool)

    @cached_property
    def fit(self) -> RegistrationFit:
        """The fit of the stars that are rightly matched."""
        return fit_problem(self.problem.rows(self.agreeing))

    @property
    def is_linear(self) -> bool:
        """Whether the chi-square is quadratic in the coordinates of `linear`."""
        return (
            type(self) is GaussianRegistration
            and self.problem.model in ("similarity", "shift", "affine")
            and not self.problem.source_covariance.any()
        )

    @property
    def size(self) -> int:
        """Number of parameters of the transform."""
        return len(MODELS[self.problem.model])

    def noise(self, parameters: FloatArray) -> FloatArray:
        """Return the noise, shape (n,), in px; one if the errors are known."""
        if self.problem.errors_known:
            return np.ones(len(parameters))
        return parameters[:, self.size]

    def linear(self, parameters: FloatArray) -> FloatArray:
        """Return k cos(theta), k sin(theta) and shift of similarities, shape (n, 4).

        The parameters of a shift and of an affine transform are linear themselves.
        """
        if self.problem.model != "similarity":
            return parameters[:, : self.size]
        factor = parameters[:, 0] * np.exp(1j * parameters[:, 1])
        return np.column_stack([factor.real, factor.imag, parameters[:, 2:4]])

    @cached_property
    def linear_normal(self) -> FloatArray:
        """Normal matrix in these coordinates, shape (p, p)."""
        # At a scale of one without rotation, they have the derivatives of the parameters.
        unrotated = self.problem.transform(np.eye(self.size)[0])
        rows = unrotated.jacobian(self.source)
        return (rows.mT @ self.precision @ rows).sum(axis=0)

    @cached_property
    def precision(self) -> FloatArray:
        """Inverse covariance of each star at the fit, without the noise, shape (points, 2, 2)."""
        return self._precision(self.fit.parameters[None]).reshape(-1, 2, 2)

    def _precision(self, transforms: FloatArray) -> FloatArray:
        _, inverse, _ = self.problem.linearized(transforms, self.source)
        return self.problem.counts[:, None, None] * inverse

    @cached_property
    def _constant(self) -> FloatArray:
        """Logarithm of the root of the determinant of `precision`, (points,)."""
        return 0.5 * np.linalg.slogdet(self.precision)[1]

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood, shape (n,)."""
        if not self.is_linear:
            parts = map(self.pointwise, self.parts(parameters))
            return np.concatenate([part.sum(axis=-1) for part in parts])
        off = self.linear(parameters) - self.linear(self.fit.parameters[None])
        squares = self.fit.chi_square + np.vecdot(off @ self.linear_normal, off)
        white = self.white_noise(squares, self.target.size, self.noise(parameters))
        return self._constant.sum() + white

    def parts(self, parameters: FloatArray) -> list[FloatArray]:
        """Return the parameter vectors in parts that fit into the memory."""
        count = -(-len(parameters) * len(self.target) // _MAX_VALUES)
        return np.array_split(parameters, max(count, 1))

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of each star, shape (n, points)."""
        residuals = self.target - self.places(parameters, self.source)
        inverse = self.precision
        if self.problem.source_covariance.any():
            inverse = self._precision(parameters[:, : self.size])
        squares = np.einsum("...i,...ij,...j", residuals, inverse, residuals)
        return self._constant + self.white_noise(
            squares, 2, self.noise(parameters)[:, None]
        )

    def places(self, parameters: FloatArray, source: FloatArray) -> FloatArray:
        """Return noise-free positions of source points, (points, 2), in the reference channel.

        They have shape (n, points, 2), in px.
        """
        points = np.broadcast_to(source, (len(parameters), *source.shape))
        return self.problem.transform(parameters[:, : self.size]).apply(points)

    def simulate(self, parameters: FloatArray, generator: Generator) -> Self:
        """Return the registration of target points drawn for one parameter vector."""
        normal = generator.normal(size=(*self.source.shape, 1))
        unit = np.linalg.solve(np.linalg.cholesky(self.precision).mT, normal)[..., 0]
        target = self.places(parameters[None], self.source)[0]
        return self.with_target(target + self.noise(parameters[None]) * unit)

    def with_target(self, target: FloatArray) -> Self:
        """Return the registration of the same sources to other target points, (points, 2)."""
        return replace(self, problem=replace(self.problem, target=target))

    def start(self) -> Estimate:
        """Return the fit and its standard errors."""
        fit = self.fit
        if fit.errors_known:
            return fit.parameters, fit.standard_errors
        freedom = fit.degrees_of_freedom
        noise = np.sqrt(fit.chi_square / freedom)
        last = noise / np.sqrt(2 * freedom)
        return np.append(fit.parameters, noise), np.append(fit.standard_errors, last)

    def exact(self, count: int, generator: Generator) -> FloatArray:
        """Return draws of a similarity for priors that are flat in scale and rotation, (n, 5).

        With priors that are flat in the coordinates of `linear`, the posterior is normal in them
        given the noise, and the noise has an inverse gamma distribution. Rejection converts the
        draws, so n is smaller than `count`.
        """
        if not self.is_linear or self.problem.model != "similarity":
            return super().exact(count, generator)
        fit = self.fit
        noise = np.ones(count)
        if not fit.errors_known:
            scaled = generator.chisquare(fit.degrees_of_freedom, count)
            noise = np.sqrt(fit.chi_square / scaled)
        cofactor = np.linalg.inv(self.linear_normal)
        unit = generator.multivariate_normal(
            np.zeros(4), cofactor, count, method="cholesky"
        )
        rows = self.linear(fit.parameters[None]) + noise[:, None] * unit
        factors = as_complex(rows[:, :2])
        angle = fit.parameters[1]
        angles = angle + np.angle(factors * np.exp(-1j * angle))
        scales = np.abs(factors)
        # Flat in scale and rotation is flat in the two parts divided by the scale.
        kept = generator.uniform(size=count) < scales.min() / scales
        return np.column_stack([scales, angles, rows[:, 2:], noise])[kept]

    def checks(self, other: Self) -> dict[str, float]:
        """Return numbers of the residuals of the fit of `other`, in px.

        The mean radial and tangential residuals in the outer half of the field are zero only if
        the model is right. Without a degree of freedom there are no residuals to check.
        """
        if not other.fit.degrees_of_freedom:
            return {}
        offsets = as_complex(other.source - other.pivot)
        found = other.fit.residuals
        residuals = as_complex(found)
        radius = np.abs(offsets)
        outer = radius >= np.median(radius)
        turned = (residuals[outer] * offsets[outer].conj() / radius[outer]).mean()
        rms = np.sqrt(np.square(found).mean())
        return {
            "residual, rms (px)": rms,
            "residual, largest (px)": np.abs(found).max(),
            # A ratio, since one wrong match also increases the noise.
            "star furthest off, over rms": (np.abs(residuals) / rms).max() / np.sqrt(2),
            "outer residual, outwards (px)": turned.real,
            "outer residual, around (px)": turned.imag,
        }

    def new_stars(
        self, parameters: FloatArray, source: FloatArray, arcsec_per_px: float
    ) -> dict[str, Quantity]:
        """Return consequences of a registration at new stars.

        They are the RMSE in px and as an angle, and the error at the outermost star. The new stars,
        (points, 2), in px, are registered by the least-squares transform of the rightly matched
        stars. The angle belongs to the reference channel.
        """
        generator = default_rng(_NOISE_SEED)
        registered = self.fit.transform.apply(source)
        outermost = np.hypot(*(source - source.mean(axis=0)).T).argmax()

        def errors(rows: FloatArray) -> FloatArray:
            off = self.places(rows, source) - registered
            displacement = np.hypot(*off[:, outermost].T)
            off += rows[:, 4, None, None] * generator.normal(size=off.shape)
            return np.stack([rmse(off, 0 * off), displacement])

        parts = map(errors, self.parts(parameters))
        whole, displacement = np.concatenate([*parts], axis=-1)
        return {
            "test points, RMSE": Quantity(whole, "px"),
            "test points, pointing error": Quantity(whole * arcsec_per_px, "arcsec"),
            "outermost star, misregistration": Quantity(displacement, "px"),
        }


def registration_parameter(name: str, prior: Prior, scale: str = "") -> Parameter:
    """Return a parameter of a registration, with its unit."""
    unit = _UNITS.get(name, "1")
    shown = DEGREES_PER_RADIAN if unit == "deg" else 1.0
    return Parameter(name, unit, prior, shown, scale=scale)


def registration_model(likelihood: GaussianRegistration) -> Model:
    """Return the registration of one channel of the telescope to another channel.

    Parameters
    ----------
    likelihood : GaussianRegistration
        The same stars in both channels, with unknown noise.

    Returns
    -------
    Model
        Parameters scale, rotation (rad), shift-x, shift-y, noise (px) and those of the likelihood.

    Raises
    ------
    ValueError
        As in `fitted_model`.

    Examples
    --------
    >>> from reproduce.physics.registration import prepare
    >>> points = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> moved = points + [[1, 0], [0, 1], [1, 1], [0, 0]]
    >>> registration_model(GaussianRegistration(prepare(points, moved, (0, 0)))).names
    ('scale', 'rotation', 'shift-x', 'shift-y', 'noise')
    """
    points = np.concatenate([likelihood.source, likelihood.target])
    extent = np.ptp(points, axis=0).max()
    shift = Uniform(
        -extent,
        extent,
        "the field itself: with a larger shift the channels would share no star",
    )
    return fitted_model(likelihood).with_priors(
        {
            "scale": Uniform(
                0.5,
                2.0,
                "between half and double: any pair of channels of one telescope; flat, as the "
                "closed form needs",
            ),
            "rotation": Uniform(
                -0.5 * DEGREES_PER_RADIAN,
                0.5 * DEGREES_PER_RADIAN,
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
    )


def fitted_model(likelihood: GaussianRegistration) -> Model:
    """Return the registration of your stars, with priors far wider than the errors.

    A uniform prior reaches a million standard errors from the fit, a rotation any angle.

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
    >>> from reproduce.physics.registration import prepare
    >>> points = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> moved = points + [[1, 0], [0, 1], [1, 1], [0, 0]]
    >>> model = fitted_model(GaussianRegistration(prepare(points, moved, (0, 0))))
    >>> print(model.parameters[1].prior)
    uniform from -3.14159 to 3.14159
    """
    count = np.count_nonzero(likelihood.agreeing)
    least = (likelihood.size + 1) // 2 + (0 if likelihood.problem.errors_known else 2)
    if count < least:
        raise ValueError(
            f"source: expected at least {least} points, got {count}. Add stars, or give their "
            "errors"
        )
    fit = likelihood.fit
    if not fit.errors_known and fit.is_exact:
        raise ValueError(
            "target: expected points with noise, got points that fit without any error. Use "
            "`reproduce.register`"
        )
    names = fit.names if fit.errors_known else (*fit.names, "noise")
    scales = {"noise": likelihood.noise_scale}
    parameters = []
    # The estimates of further parameters come last.
    for name, value, error in zip(names, *likelihood.start(), strict=False):
        half, reason = _STANDARD_ERRORS * error, "any: a million standard errors"
        if name == "rotation":
            half, reason = np.pi, "any: the full circle, cut opposite to least squares"
        low = 0.0 if name == "scale" else value - half
        prior: Prior = Uniform(low, value + half, reason)
        if name == "noise":
            prior = LogUniform(
                1e-9 * value,
                1e3 * value,
                "no scale preferred: a billionth to a thousand times the residuals of least "
                "squares",
            )
        parameters.append(registration_parameter(name, prior, scales.get(name, "")))
    return Model(likelihood.name, (*parameters, *likelihood.extra), likelihood)
