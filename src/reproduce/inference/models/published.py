"""Posterior of printed parameters: estimates with Gaussian errors, rounded to the printed digits.

For Gaussian noise the least-squares estimate, the residual and the design of a fit are sufficient
statistics, so the posterior of its parameters does not need the measured points. A design is known
by the standard deviation of each estimate per unit of noise. If several designs are possible, each
has the same prior probability.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.random import Generator
from scipy.special import logsumexp, ndtr

from reproduce.inference import Estimate, Likelihood
from reproduce.physics.validate import FloatArray


@dataclass(frozen=True, eq=False)
class PrintedFit(Likelihood):
    """Printed estimates and residuals of a fit, as the likelihood of its parameters and noise.

    Parameter vectors are those of the fit, then the noise of one coordinate. The errors of the
    estimates are taken as independent, which is exact if the design is symmetric about the pivot.
    Their effect on the residuals is neglected: for 137 stars it is 0.7 % of the noise. The rounding
    of a residual is neglected too.

    - `estimates`, (p,): printed estimates, in SI units or px.
    - `half_units`, (p,): half a unit of their last digits.
    - `errors`, (designs, p): standard deviation of each estimate per unit of noise.
    - `residuals`, (r,): printed root mean squares of the residuals of the points, in px: of each
      coordinate, or one of both coordinates together.
    - `points`: number of points.
    """

    observables = ("estimates", "residuals")
    estimates: FloatArray
    half_units: FloatArray
    errors: FloatArray
    residuals: FloatArray
    points: int

    @property
    def count(self) -> float:
        """Number of residuals of one coordinate in each root mean square."""
        return 2 * self.points / len(self.residuals)

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood, shape (n,)."""
        return self.pointwise(parameters).sum(axis=1)

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of the estimates together and of each residual, (n, 1 + r)."""
        values, noise = parameters[:, :-1], parameters[:, -1:]
        distance = np.abs(self.estimates - values)[:, None]
        spread = noise[:, None] * self.errors
        # Far from the estimate, where the density of a parameter is zero in double precision.
        with np.errstate(divide="ignore"):
            boxes = np.log(
                ndtr((self.half_units - distance) / spread)
                - ndtr((-self.half_units - distance) / spread)
            )
        estimates = logsumexp(boxes.sum(axis=2), axis=1) - np.log(len(self.errors))
        # The density of the root mean square of Gaussian residuals.
        scaled = self.points * (self.residuals / noise) ** 2
        return np.column_stack([estimates, -self.count * np.log(noise) - scaled / 2])

    def simulate(self, parameters: FloatArray, generator: Generator) -> Self:
        """Return the likelihood of estimates and residuals drawn for one parameter vector."""
        *values, noise = parameters
        errors = generator.choice(self.errors)
        unit = 2 * self.half_units
        estimates = generator.normal(values, noise * errors)
        squares = generator.chisquare(self.count, self.residuals.shape) / self.points
        estimates = np.round(estimates / unit) * unit
        return replace(self, estimates=estimates, residuals=noise * np.sqrt(squares))

    @property
    def _noise(self) -> float:
        """The noise that all residuals imply."""
        return np.sqrt(np.square(self.residuals).sum() / 2)

    def start(self) -> Estimate:
        """Return the printed estimates with the noise, and their errors, shape (p + 1,) each."""
        noise = self._noise
        errors = np.hypot(noise * self.errors.max(axis=0), self.half_units)
        last = noise / np.sqrt(4 * self.points)
        return np.append(self.estimates, noise), np.append(errors, last)

    def exact(self, count: int, generator: Generator) -> FloatArray:
        """Return independent draws, shape (count, p + 1).

        The priors are flat, and flat in the logarithm of the noise. The unrounded estimate is
        uniform in its interval, and a parameter is normal about it. The noise follows from the
        residuals.
        """
        freedom = 2 * self.points
        scaled = freedom / generator.chisquare(freedom, (count, 1))
        noise = self._noise * np.sqrt(scaled)
        errors = generator.choice(self.errors, count)
        rounding = self.half_units * generator.uniform(-1, 1, errors.shape)
        values = generator.normal(self.estimates + rounding, noise * errors)
        return np.column_stack([values, noise])
