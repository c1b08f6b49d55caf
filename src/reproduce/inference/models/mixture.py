"""Registrations whose likelihood is evaluated star by star: free distortion, and wrong matches.

In the mixture each star is rightly or wrongly matched (Hogg, Bovy and Lang, 2010). A right match
scatters about its predicted position, as in the plain registration. The position of a wrong match
is uniform over the field. The likelihood is the sum over both cases, so the draws give the
probability that a star is wrongly matched. Conventions and units are those of `registration`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator
from scipy.special import expit

from reproduce.inference import (
    Estimate,
    Normal,
    Parameter,
    Uniform,
)
from reproduce.inference.models.registration import (
    GaussianRegistration,
)
from reproduce.physics.registration import (
    Problem,
    as_complex,
    as_points,
    fit_problem,
)
from reproduce.physics.validate import BoolArray, FloatArray

# Steps of Newton's method for the inverse distortion. Each doubles the number of correct digits.
_NEWTON_STEPS = 4
# Draws that give the probabilities of the stars.
_MAX_DRAWS = 4000
# Side of the square of the wrong matches over the extent of the stars: no star is on an edge.
_SQUARE_RATIO = 1.01
DISTORTION_PRIOR = Normal(
    0.0,
    2.0,
    "a corrected star camera moves its outermost stars by a few px at most",
)


class DistortedRegistration(GaussianRegistration):
    """Registration with a free radial distortion in both channels: two more parameters.

    Each is the displacement at the edge of the field, in px, so that it does not depend on the
    unit of the coefficient. The noise is unknown.
    """

    name = "registration-distortion"
    extra = (
        Parameter("source-distortion", "px", DISTORTION_PRIOR),
        Parameter("target-distortion", "px", DISTORTION_PRIOR),
    )

    def places(self, parameters: FloatArray, source: FloatArray) -> FloatArray:
        """Undistort, scale and rotate, distort, shift: (n, points, 2), in px."""
        scale, rotation, x, y, _, undo, bend = parameters.T[..., None]
        edge = np.abs(as_complex(self.source - self.pivot)).max()
        offsets = as_complex(source - self.pivot) / edge
        # The ratio of ideal and measured radius is the root of a cubic polynomial.
        term = undo / edge * np.abs(offsets) ** 2
        ratio = 1.0
        for _ in range(_NEWTON_STEPS):
            ratio = (1 + 2 * term * ratio**3) / (1 + 3 * term * ratio**2)
        carried = scale * np.exp(1j * rotation) * ratio * offsets
        carried = carried * (edge + bend * np.abs(carried) ** 2)
        return as_points(carried - (x + 1j * y)) + self.pivot

    def start(self) -> Estimate:
        """Return the least-squares fit and its standard errors, and no distortion."""
        centre, spread = super().start()
        return np.append(centre, (0.0, 0.0)), np.append(spread, (0.1, 0.1))


@dataclass(frozen=True, eq=False)
class MixtureRegistration(GaussianRegistration):
    """Registration with wrong matches: one more parameter, the fraction of wrong matches.

    - `corner`, (2,), and `side`: square of the wrong matches, in px. It is part of the design and
      does not depend on the data.
    """

    name = "registration-mixture"
    noise_scale = "log"
    # Without wrong matches the fraction would pile up at zero, but its score has no bound.
    extra = (
        Parameter(
            "false-share",
            "1",
            Uniform(
                0.0,
                0.5,
                "from none to half of them: were more of them false, no majority would tell which "
                "are right",
            ),
            natural=0.0,
            scale="normal score",
        ),
    )
    corner: FloatArray
    side: float

    @classmethod
    def of(cls, problem: Problem) -> Self:
        """Return the registration whose wrong matches are in a square that contains all targets."""
        low, high = problem.target.min(axis=0), problem.target.max(axis=0)
        side = _SQUARE_RATIO * (high - low).max()
        return cls(problem, 0.5 * (low + high - side), side)

    def _densities(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the log density of each target, (n, points), as a right and a wrong match."""
        fraction = parameters[:, -1:]
        away = (self.target - self.corner) / self.side
        within = ((away >= 0) & (away <= 1)).all(axis=1)
        # The logarithm of zero: no wrong match, or a star outside of the square.
        with np.errstate(divide="ignore"):
            wrong = np.log(fraction) + np.log(within / self.side**2)
        right = np.log1p(-fraction) + super().pointwise(parameters)
        return right, wrong

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of each star, shape (n, points)."""
        return np.logaddexp(*self._densities(parameters))

    def false(self, parameters: FloatArray) -> FloatArray:
        """Return the probability that each star is wrongly matched, shape (n, points)."""
        right, wrong = self._densities(parameters)
        return expit(wrong - right)

    def simulate(self, parameters: FloatArray, generator: Generator) -> Self:
        """Return the registration of target points drawn for one parameter vector."""
        return self._drawn(parameters, parameters[-1], generator)

    def repeat(self, parameters: FloatArray, generator: Generator) -> Self:
        """Return the registration of a repeat, in which the same stars are wrongly matched."""
        return self._drawn(parameters, self.false(parameters[None])[0], generator)

    def _drawn(
        self, parameters: FloatArray, fraction: FloatArray, generator: Generator
    ) -> Self:
        wrong = generator.uniform(size=len(self.source)) < fraction
        right = super().simulate(parameters, generator).target
        anywhere = self.corner + self.side * generator.uniform(size=right.shape)
        return self.with_target(np.where(wrong[:, None], anywhere, right))

    @cached_property
    def agreeing(self) -> BoolArray:
        """The stars that the robust fit does not reject, (points,)."""
        return fit_problem(self.problem, robust=True).weights > 0

    def start(self) -> Estimate:
        """Return the fit of the stars that agree, and the fraction of the others."""
        count = len(self.source)
        centre, spread = super().start()
        fraction = ((~self.agreeing).sum() + 1) / (count + 2)
        error = np.sqrt(fraction * (1 - fraction) / count)
        return np.append(centre, fraction), np.append(spread, error)

    def checks(self, other: Self) -> dict[str, float]:
        """Return the checks of the plain registration for the stars that agree in these data."""
        right = GaussianRegistration(other.problem.rows(self.agreeing))
        return right.checks(right)

    def probability_false(self, draws: FloatArray) -> FloatArray:
        """Return the posterior probability that each star is wrongly matched, (points,)."""
        draws = draws[:: -(-len(draws) // _MAX_DRAWS)]
        parts = map(self.false, self.parts(draws))
        return sum(part.sum(axis=0) for part in parts) / len(draws)
