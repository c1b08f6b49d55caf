"""Registration of one channel or two: scale, rotation, shift and noise, from sufficient statistics.

Points have shape (n, 2), in px, x before y; inside, a point is the complex number x + iy. About
the pivot the model of niu2024 (17), (18) is linear, target = w source - shift with
w = k exp(i theta), so the squared residuals of any parameters follow from a QR decomposition of
the columns (source, one, target): the cost of a likelihood does not grow with n.

The measured source points are the design: they are held, and the target (and the second channel)
is random given them. With a flat prior on the true position of a star its noise then enters the
residual as k times the source noise, exactly.

The posterior of the registration in closed form: it needs no sampler.

About the pivot the model is linear in beta = (k cos theta, k sin theta, shift x, shift y). With a
flat prior in beta and one over the noise the posterior of beta is a Student-t about the
least-squares solution, with 2n - 4 degrees of freedom; with known noise it is Gaussian. A prior
flat in (k, theta) instead is flat in beta divided by k, since d(a) d(b) = k dk d(theta).

What niu2024 itself makes of a registration: the least-squares similarity, and what it leaves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from reproduce.inference import Derived, LogUniform, Model, Parameter, Prior, Uniform
from reproduce.physics.registration import (
    RegistrationFit,
    as_complex,
    as_points,
    fit_registration,
    fits_exactly,
    paired_points,
    robust_similarity,
)
from reproduce.physics.validate import FloatArray, finite_array
from reproduce.units import DEGREES_PER_RADIAN


def least_squares(
    source: FloatArray, target: FloatArray, pivot: FloatArray, source_noise: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return the least-squares (k, theta, shift x, shift y, noise) and their standard errors, (5,).

    Those of the similarity take the residuals' own variance, whatever is in it; the noise is the
    share of one coordinate in it.
    """
    fit = fit_registration(source, target, pivot)
    freedom = float(fit.degrees_of_freedom)
    residual = np.sqrt(fit.chi_square / freedom)
    noise = residual / np.sqrt(1 + fit.parameters[0] ** 2 * source_noise)
    errors = residual * np.sqrt(np.diagonal(fit.cofactor))
    return np.append(fit.parameters, noise), np.append(errors, noise / np.sqrt(2 * freedom))


def fit_checks(source: FloatArray, target: FloatArray, pivot: FloatArray) -> dict[str, float]:
    """What predictive checks compare: the least-squares fit and what it leaves over, in px.

    The mean residuals outwards and around in the outer half of the field are zero only if a
    similarity is the right model.
    """
    fit = fit_registration(source, target, pivot)
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
        "star furthest off, over rms": float(lengths.max() / np.sqrt(np.square(lengths).mean())),
        "outer residual, outwards (px)": float((left * unit).sum(axis=1).mean()),
        "outer residual, around (px)": float(
            (unit[:, 0] * left[:, 1] - unit[:, 1] * left[:, 0]).mean()
        ),
    }


def noise_growth(source: FloatArray, target: FloatArray, pivot: FloatArray) -> tuple[float, float]:
    """Return how the logarithm of the noise grows from centre to edge, and its standard error.

    The likeliest growth h of a noise sigma exp(h rho^2), rho being the distance from the pivot over
    the largest one, in the residuals of the least-squares similarity.
    """
    squares = np.square(fit_registration(source, target, pivot).residuals).sum(axis=1)
    rho = np.square(source - pivot).sum(axis=1)
    rho = rho / rho.max()
    off = rho - rho.mean()

    def surprise(growth: float) -> float:
        # Less the log likelihood over the count, sigma at its likeliest.
        return float(np.log((squares * np.exp(-2 * growth * off)).mean()))

    return float(minimize_scalar(surprise).x), float(0.5 / np.sqrt(off @ off))


def triangular(columns: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Triangular factor of complex columns, shape (m, m) for columns of shape (n, m)."""
    factor = np.linalg.qr(columns.astype(np.complex128), mode="r")
    return np.asarray(factor)


def _squared_residuals(root: NDArray[np.complex128], weights: NDArray[np.complex128]) -> FloatArray:
    """Squared length of root @ weights for every row of weights, shape (n,)."""
    residual = weights @ root.T
    return np.asarray((residual.real**2 + residual.imag**2).sum(axis=-1))


@dataclass(frozen=True, eq=False)
class GaussianRegistration:
    """Gaussian noise of one size; parameters (k, theta, shift x, shift y, noise).

    - `source`, `target`, (n, 2): the same stars in the channel and in the reference channel, in px.
    - `pivot`, (2,): the channel's principal point, in px.
    - `source_noise`: false: `noise` is that of a residual coordinate, the source noise neglected or
      included in it. True: it is that of a coordinate in either channel, and a residual has 1 + k^2
      times its variance.
    """

    source: FloatArray
    target: FloatArray
    pivot: FloatArray
    source_noise: bool = False

    @property
    def pivots(self) -> tuple[FloatArray, ...]:
        """The pivot of every channel: of one."""
        return (self.pivot,)

    @cached_property
    def root(self) -> NDArray[np.complex128]:
        """Triangular factor of the columns (source, one, target) about the pivot, shape (3, 3)."""
        origin = as_complex(self.pivot)
        columns = [as_complex(self.source) - origin, np.ones(len(self.source)),
                   as_complex(self.target) - origin]  # fmt: skip
        return triangular(np.stack(columns, axis=-1))

    def variance(self, parameters: FloatArray) -> FloatArray:
        """Variance of a residual coordinate, shape (n,), in px^2."""
        factor = 1 + parameters[:, 0] ** 2 if self.source_noise else 1.0
        return np.asarray(parameters[:, 4] ** 2 * factor)

    def weights(self, parameters: FloatArray) -> NDArray[np.complex128]:
        """Coefficients of (source, one, target) in the residual, shape (n, 3)."""
        factor = parameters[:, 0] * np.exp(1j * parameters[:, 1])
        shift = parameters[:, 2] + 1j * parameters[:, 3]
        return np.stack([-factor, shift, np.ones_like(factor)], axis=-1)

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        variance, count = self.variance(parameters), len(self.source)
        squares = _squared_residuals(self.root, self.weights(parameters))
        return np.asarray(-count * np.log(2 * np.pi * variance) - squares / (2 * variance))

    def residuals(self, parameters: FloatArray) -> NDArray[np.complex128]:
        """Target minus transformed source, shape (n, points)."""
        origin = as_complex(self.pivot)
        weights = self.weights(parameters)
        source, target = as_complex(self.source) - origin, as_complex(self.target) - origin
        return weights[:, :1] * source + weights[:, 1:2] + target

    def scatter(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Noise of residuals, shape (n, points, 2), in px."""
        normal = generator.normal(size=(len(parameters), *self.source.shape))
        return np.asarray(np.sqrt(self.variance(parameters))[:, None, None] * normal)

    def elsewhere(self, source: FloatArray) -> Self:
        """The same model of other stars, whose targets are not known yet."""
        return replace(self, source=source, target=np.zeros_like(source))

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Target points for one parameter vector, shape (points, 2), in px."""
        rows = parameters[None]
        noise = self.scatter(rows, generator)[0]
        residual = self.residuals(rows)[0]
        return np.asarray(as_points(as_complex(self.target) - residual) + noise)

    def given(self, data: FloatArray) -> Self:
        """The same sources with other target points."""
        return replace(self, target=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """The least-squares fit and its standard errors."""
        fit = fit_registration(self.source, self.target, self.pivot)
        freedom = 2 * len(self.source) - 4
        variance = fit.chi_square / freedom / (1 + fit.parameters[0] ** 2 * self.source_noise)
        noise = max(float(np.sqrt(variance)), 1e-12)
        errors = np.sqrt(np.diagonal(fit.cofactor) * noise**2 * (1 + self.source_noise))
        return np.append(fit.parameters, noise), np.append(errors, noise / np.sqrt(2 * freedom))

    def estimate(self) -> tuple[FloatArray, FloatArray]:
        """The least-squares similarity about the pivot, and its standard errors."""
        return least_squares(self.source, self.target, self.pivot, self.source_noise)

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """Root mean square and largest residual of the least-squares fit, and its scale."""
        target = self.target if data is None else data
        return fit_checks(self.source, target, self.pivot)


def registration_parameters(source: FloatArray, target: FloatArray) -> tuple[Parameter, ...]:
    """Parameters (k, theta, shift x, shift y, noise), priors on the scale of the data alone."""
    source, target = paired_points(source, target)
    extent = float(np.ptp(np.concatenate([source, target]), axis=0).max())
    field = "the field itself: with a larger shift the channels would share no star"
    return (
        Parameter("scale", "k", "1", Uniform(0.5, 2.0, "between half and double: any pair of "
            "channels of one telescope; flat, as the closed form needs")),
        Parameter("rotation", r"\theta", "deg", Uniform(-0.5, 0.5, "half a radian: detectors "
            "behind one prism are mounted the same way round"), DEGREES_PER_RADIAN),
        Parameter("shift-x", r"\Delta x", "px", Uniform(-extent, extent, field)),
        Parameter("shift-y", r"\Delta y", "px", Uniform(-extent, extent, field)),
        Parameter("noise", r"\sigma", "px", LogUniform(extent * 1e-7, extent * 1e-2,
            "no scale preferred between a ten-millionth and a hundredth of the field")),
    )  # fmt: skip


def registration_model(
    source: FloatArray,
    target: FloatArray,
    pivot: FloatArray,
    *,
    priors: dict[str, Prior] | None = None,
    derived: Derived | None = None,
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
    fit = fit_registration(source, target, pivot)
    parameters = with_priors(registration_parameters(source, target), priors)
    return Model(
        "registration",
        parameters,
        GaussianRegistration(source, target, pivot),
        dict(
            zip(("scale", "rotation", "shift-x", "shift-y"), fit.parameters.tolist(), strict=True)
        ),
        derived,
    )


def with_priors(
    parameters: tuple[Parameter, ...], priors: dict[str, Prior] | None
) -> tuple[Parameter, ...]:
    """Return parameters with some priors replaced, by name; an unknown name is a ValueError."""
    unknown = set(priors or ()) - {p.name for p in parameters}
    if unknown:
        raise ValueError(
            f"priors: expected names among {', '.join(p.name for p in parameters)}, got "
            f"{', '.join(sorted(unknown))}; check the spelling"
        )
    return tuple(replace(p, prior=(priors or {}).get(p.name, p.prior)) for p in parameters)


# Of the residual of least squares: ends of the noise, as good as none.
NOISE = (1e-9, 1e3)
# The shift may lie so many fields or standard errors, the scale so many times, from the fit.
FIELDS, ERRORS, SCALES = 10.0, 1e3, 10.0


def free_priors(source: FloatArray, target: FloatArray, pivot: FloatArray) -> dict[str, Prior]:
    """Return flat priors whose ends are as far from the fit as the data's own scale allows.

    By parameter. Few or mirrored points, or points that fit without any error, are refused.

    Examples
    --------
    >>> points = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> moved = points + [[1, 0], [0, 1], [1, 1], [0, 0]]
    >>> print(free_priors(points, moved, np.zeros(2))["rotation"])
    uniform from -3.14159 to 3.14159
    """
    if len(source) < 4:
        raise ValueError(f"expected four or more stars, got {len(source)}; add some")
    robust = robust_similarity(source, target, pivot)
    fit = fit_registration(source, target, pivot)
    residual = _residual(fit)
    k, theta, x, y = fit.parameters.tolist()
    if fits_exactly(fit, source, target):
        raise ValueError(
            "the points fit without any error, so there is no noise to sample; exactly: scale "
            f"{k:.10g}, rotation {np.degrees(theta):.10g} deg, shift {x:.10g} and {y:.10g} px"
        )
    # No least-squares scale exceeds the ratio of both patterns' sizes.
    size = float(np.sqrt(np.square(target - target.mean(axis=0)).sum() * fit.cofactor[0, 0]))
    size = max(size, float(robust.parameters[0]))
    error = residual * float(np.sqrt(fit.cofactor[2, 2]))
    reach = max(FIELDS * float(np.ptp(target, axis=0).max()), ERRORS * error)
    place = "ten fields, or a thousand standard errors, on both sides of least squares"
    return {
        "scale": Uniform(0.0, SCALES * size, "up to ten times the ratio of the sizes of both "
                         "patterns; flat"),
        "rotation": Uniform(theta - np.pi, theta + np.pi, "any: the full turn, cut opposite to "
                            "least squares"),
        "shift-x": Uniform(x - reach, x + reach, place),
        "shift-y": Uniform(y - reach, y + reach, place),
        "noise": LogUniform(NOISE[0] * residual, NOISE[1] * residual, "no scale preferred: from a "
                            "billionth of the residuals of least squares to a thousand times them"),
    }  # fmt: skip


def _residual(fit: RegistrationFit) -> float:
    """Standard deviation of a residual coordinate, in px."""
    return float(np.sqrt(fit.chi_square / max(float(fit.degrees_of_freedom), 1.0)))


@dataclass(frozen=True, eq=False)
class RegistrationPosterior:
    """The exact posterior of one channel's registration.

    - `mean`, (4,): of (k cos theta, k sin theta, shift x, shift y): the least-squares solution.
    - `scale`, (4, 4): scale matrix of the Student-t, or covariance of the Gaussian.
    - `freedom`: degrees of freedom; infinite where the noise is known.
    - `squares`: sum of squared residuals of the least-squares solution, in px^2.
    - `count`: number of points.
    """

    mean: FloatArray
    scale: FloatArray
    freedom: float
    squares: float
    count: int

    @property
    def covariance(self) -> FloatArray:
        """Covariance of (k cos theta, k sin theta, shift x, shift y), shape (4, 4)."""
        if np.isinf(self.freedom):
            return self.scale
        return self.scale * self.freedom / (self.freedom - 2)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws of (k, theta, shift x, shift y, noise), shape (count, 5).

        The prior is flat in (k cos theta, k sin theta) and one over the noise.
        """
        if np.isinf(self.freedom):
            raise ValueError("draw: expected an unknown noise, got a known one; draw the Gaussian")
        noise = np.sqrt(self.squares / generator.chisquare(self.freedom, count))
        root = np.linalg.cholesky(self.scale * self.freedom / self.squares)
        beta = self.mean + noise[:, None] * (generator.normal(size=(count, 4)) @ root.T)
        return np.column_stack([polar(beta), noise])


def registration_posterior(
    source: FloatArray, target: FloatArray, pivot: FloatArray, noise: float | None = None
) -> RegistrationPosterior:
    """Return the exact posterior of a registration, flat in (k cos theta, k sin theta, shift).

    Student-t, or Gaussian where the noise of a residual coordinate is known, in px.

    Examples
    --------
    >>> points = np.array([[-1.0, -1], [1, -1], [-1, 1], [1, 1]])
    >>> exact = registration_posterior(points, points, (0, 0), noise=2.0)
    >>> np.sqrt(np.diagonal(exact.covariance)).round(3)
    array([0.707, 0.707, 1.   , 1.   ])
    """
    fit = fit_registration(source, target, pivot)
    k, theta = fit.parameters[:2]
    mean = np.array([k * np.cos(theta), k * np.sin(theta), *fit.parameters[2:]])
    # Jacobian of (a, b) by (k, theta): carries the fit's cofactor over.
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(theta), -k * np.sin(theta)], [np.sin(theta), k * np.cos(theta)]]
    cofactor = turn @ fit.cofactor @ turn.T
    count = fit.residuals.shape[-2]
    freedom, squares = 2.0 * count - 4, float(fit.chi_square)
    if noise is not None:
        return RegistrationPosterior(mean, noise**2 * cofactor, np.inf, squares, count)
    return RegistrationPosterior(mean, squares / freedom * cofactor, freedom, squares, count)


def polar(beta: FloatArray) -> FloatArray:
    """Return (k, theta, shift) of (k cos theta, k sin theta, shift), shape (n, 4)."""
    return np.column_stack(
        [np.hypot(beta[:, 0], beta[:, 1]), np.arctan2(beta[:, 1], beta[:, 0]), beta[:, 2:]]
    )
