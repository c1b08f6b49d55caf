"""Registration of one channel or two: scale, rotation, shift and noise, from sufficient statistics.

Points have shape (n, 2), in px, x before y; inside, a point is the complex number x + iy. About
the pivot the model of niu2024 (17), (18) is linear, target = w source - shift with
w = k exp(i theta), so the squared residuals of any parameters follow from a QR decomposition of
the columns (source, one, target): the cost of a likelihood does not grow with n.

The measured source points are the design: they are held, and the target (and the second channel)
is random given them. With a flat prior on the true position of a star its noise then enters the
residual as k times the source noise, exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from reproduce.inference import Derived, LogUniform, Model, Parameter, Prior, Uniform
from reproduce.inference.models.least_squares import fit_checks, least_squares
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
