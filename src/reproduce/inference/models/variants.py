"""Registrations whose likelihood needs every point: free distortion.

Conventions and units are those of `registration`; arrays have shape (n, points).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from reproduce.inference import Model, Normal, Parameter
from reproduce.inference.models.registration import GaussianRegistration
from reproduce.physics.registration import as_complex, as_points
from reproduce.physics.validate import FloatArray

# Steps of Newton's method for the inverse distortion; each doubles the digits.
NEWTON_STEPS = 4


@dataclass(frozen=True, eq=False)
class PointwiseRegistration:
    """A registration evaluated point by point; a subclass adds one idea and its parameters.

    - `source`, `target`, (n, 2): in px.
    - `pivot`, (2,): the source channel's principal point, in px.
    - `edge`, optional: radius of the field, in px; by default that of the outermost star.
    """

    source: FloatArray
    target: FloatArray
    pivot: FloatArray
    edge: float | None = None

    # Centre and spread of the parameters that a subclass adds.
    extra_centre: ClassVar[tuple[float, ...]] = (0.0,)
    extra_spread: ClassVar[tuple[float, ...]] = (0.3,)
    # Whether `noise` is the standard deviation of every coordinate, which plain residuals tell.
    noise_is_even: ClassVar[bool] = True

    @property
    def pivots(self) -> tuple[FloatArray, ...]:
        """The pivot of every channel: of one."""
        return (self.pivot,)

    @cached_property
    def offsets(self) -> NDArray[np.complex128]:
        """Source points about the pivot."""
        return as_complex(self.source) - as_complex(self.pivot)

    @cached_property
    def radius(self) -> FloatArray:
        """Distance from the pivot over the radius of the field."""
        return np.asarray(np.abs(self.offsets) / self.field)

    @cached_property
    def field(self) -> float:
        """Radius of the field, in px."""
        return float(np.abs(self.offsets).max()) if self.edge is None else self.edge

    def elsewhere(self, source: FloatArray) -> Self:
        """The same model of other stars, whose targets are not known yet."""
        return replace(self, source=source, target=np.zeros_like(source), edge=self.field)

    def predicted(self, parameters: FloatArray) -> NDArray[np.complex128]:
        """Where the target points should lie, about the pivot."""
        factor = parameters[:, :1] * np.exp(1j * parameters[:, 1:2])
        predicted: NDArray[np.complex128] = factor * self.offsets - _shift(parameters)
        return predicted

    def residuals(self, parameters: FloatArray) -> NDArray[np.complex128]:
        """Target minus prediction, in px."""
        return as_complex(self.target) - as_complex(self.pivot) - self.predicted(parameters)

    def noise(self, parameters: FloatArray) -> FloatArray:
        """Standard deviation at each point, in px."""
        return parameters[:, 4:5]

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        residual, noise = self.residuals(parameters), self.noise(parameters)
        squares = (residual.real**2 + residual.imag**2) / noise**2
        constant = 2 * np.log(noise) + np.log(2 * np.pi)
        return np.asarray(-(0.5 * squares + constant).sum(axis=-1))

    def scatter(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Noise of residuals, shape (n, points, 2), in px."""
        normal = generator.normal(size=(len(parameters), *self.source.shape))
        return np.asarray(self.noise(parameters)[..., None] * normal)

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Target points for one parameter vector, shape (points, 2), in px."""
        rows = parameters[None]
        points = as_points(self.predicted(rows)[0]) + self.pivot
        return np.asarray(points + self.scatter(rows, generator)[0])

    def given(self, data: FloatArray) -> Self:
        """The same sources with other target points."""
        return replace(self, target=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """The least-squares fit and its standard errors, and what the subclass adds."""
        centre, spread = self.plain.start()
        return np.append(centre, self.extra_centre), np.append(spread, self.extra_spread)

    def estimate(self) -> tuple[FloatArray, FloatArray]:
        """Plain least squares, which knows nothing of the added idea, and its standard errors."""
        centre, spread = self.plain.estimate()
        known = 5 if self.noise_is_even else 4
        none = np.full(5 - known + len(self.extra_centre), np.nan)
        return np.append(centre[:known], none), np.append(spread[:known], none)

    @property
    def plain(self) -> GaussianRegistration:
        """The registration without the added idea."""
        return GaussianRegistration(self.source, self.target, self.pivot)

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """As for the plain registration."""
        return self.plain.checks(data)


class DistortedRegistration(PointwiseRegistration):
    """Radial distortion free in both channels; two more parameters.

    The distortion is its displacement at the edge of the field, in px, so that the parameter does
    not depend on the unit of the coefficient.
    """

    extra_centre: ClassVar[tuple[float, ...]] = (0.0, 0.0)
    extra_spread: ClassVar[tuple[float, ...]] = (0.1, 0.1)

    def predicted(self, parameters: FloatArray) -> NDArray[np.complex128]:
        """Undistort, scale and rotate, distort, shift."""
        edge = self.field
        source, target = (parameters[:, i : i + 1] / edge for i in (5, 6))
        radius = np.broadcast_to(self.radius, (len(parameters), len(self.radius)))
        ideal = radius.copy()
        for _ in range(NEWTON_STEPS):
            bend = source * ideal**2
            ideal = ideal - (ideal + bend * ideal - radius) / (1 + 3 * bend)
        with np.errstate(invalid="ignore"):
            ratio = np.where(radius > 0, ideal / radius, 1.0)
        factor = parameters[:, :1] * np.exp(1j * parameters[:, 1:2])
        carried = factor * ratio * self.offsets
        bent = carried * (1 + target * np.abs(carried / edge) ** 2)
        predicted: NDArray[np.complex128] = bent - _shift(parameters)
        return predicted


def _shift(parameters: FloatArray) -> NDArray[np.complex128]:
    shift: NDArray[np.complex128] = parameters[:, 2:3] + 1j * parameters[:, 3:4]
    return shift


def distortion_model(base: Model) -> Model:
    """The registration with the radial distortion of both channels free.

    With two more parameters, the displacement at the edge of the field in source and target.
    """
    prior = Normal(
        0.0, 2.0, "a corrected star camera moves its outermost stars by a few px at most"
    )
    extra = (
        Parameter("source-distortion", "d_s", "px", prior),
        Parameter("target-distortion", "d_t", "px", prior),
    )
    plain = base.likelihood_of(GaussianRegistration)
    return replace(
        base,
        name="registration-distortion",
        parameters=base.parameters + extra,
        likelihood=DistortedRegistration(plain.source, plain.target, plain.pivot),
    )
