"""Registrations whose likelihood needs every point: free distortion, and wrong matches.

With wrong matches each star is rightly or wrongly matched (Hogg, Bovy and Lang, 2010). A right
match scatters about its place as in the plain registration. A wrong one lies anywhere in the field,
with the same density everywhere: it is another star. Which star is which is summed out, so the
draws give each star's probability of being false. Conventions and units are those of
`registration`; arrays have shape (n, points).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.random import PCG64, Generator
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from reproduce.inference import Coordinates, Model, Normal, Parameter, Sampled, Uniform
from reproduce.inference.models import registration
from reproduce.physics.registration import as_complex, fit_registration
from reproduce.physics.validate import FloatArray

# Steps of Newton's method for the inverse distortion; each doubles the digits.
_NEWTON_STEPS = 4
# Draws that tell of the stars, and how many are worked on at once: bounds the memory.
DRAWS, CHUNK = 4000, 500
# Pairs of stars that are tried for a start: a quarter of them are right when half the stars are.
_PAIRS = 300
# Sides of the square in which false stars lie: no star of the data lies on an end.
_WIDER = 1.01
# Stars that have to agree, and how many standard deviations off a star no longer does.
AGREEING, FAR = 1 / 3, 5.0
_ROUNDS = 30
# Residuals below this share of the coordinates are rounding.
_ROUNDING = 1e-12


class _DistortedRegistration(registration.GaussianRegistration):
    """Radial distortion free in both channels; two more parameters.

    The distortion is its displacement at the edge of the field, in px, so that the parameter does
    not depend on the unit of the coefficient.
    """

    def predicted(self, parameters: FloatArray) -> registration.ComplexArray:
        """Undistort, scale and rotate, distort, shift."""
        edge, radius = self.field, np.abs(self.offsets) / self.field
        source, target = (parameters[:, i : i + 1] / edge for i in (5, 6))
        radius = np.broadcast_to(radius, (len(parameters), len(radius)))
        ideal = radius.copy()
        for _ in range(_NEWTON_STEPS):
            bend = source * ideal**2
            ideal = ideal - (ideal + bend * ideal - radius) / (1 + 3 * bend)
        with np.errstate(invalid="ignore"):
            ratio = np.where(radius > 0, ideal / radius, 1.0)
        factor = parameters[:, :1] * np.exp(1j * parameters[:, 1:2])
        carried = factor * ratio * self.offsets
        bent = carried * (1 + target * np.abs(carried / edge) ** 2)
        return np.asarray(bent - registration.shifts(parameters))

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        return np.asarray(self.pointwise(parameters).sum(axis=-1))

    def start(self) -> tuple[FloatArray, FloatArray]:
        """The least-squares fit and its standard errors, and no distortion."""
        centre, spread = super().start()
        return np.append(centre, (0.0, 0.0)), np.append(spread, (0.1, 0.1))


def distortion_model(base: Model) -> Model:
    """The registration with the radial distortion of both channels free.

    With two more parameters, the displacement at the edge of the field in source and target.
    """
    prior = Normal(
        0.0,
        2.0,
        "a corrected star camera moves its outermost stars by a few px at most",
    )
    extra = (
        Parameter("source-distortion", "d_s", "px", prior),
        Parameter("target-distortion", "d_t", "px", prior),
    )
    plain = base.likelihood_of(registration.GaussianRegistration)
    return replace(
        base,
        name="registration-distortion",
        parameters=base.parameters + extra,
        likelihood=_DistortedRegistration(plain.source, plain.target, plain.pivot),
    )


class _NoiseAndShare(Coordinates):
    """The logarithm of the noise and the normal score of the share, the rest as declared.

    Where no star is false the share would lean on zero; its score has no end.
    """

    def straight(self, parameters: FloatArray) -> FloatArray:
        """Coordinates of parameter vectors, shape (n, d)."""
        noise, share = np.log(parameters[:, 4]), ndtri(parameters[:, 5])
        return np.column_stack([parameters[:, :4], noise, share])

    def parameters(self, straight: FloatArray) -> FloatArray:
        """Parameter vectors at coordinates, shape (n, d)."""
        noise, share = np.exp(straight[:, 4]), ndtr(straight[:, 5])
        return np.column_stack([straight[:, :4], noise, share])

    def log_volume(self, parameters: FloatArray) -> FloatArray:
        """Log of the determinant of the derivatives of parameters by coordinates, shape (n,)."""
        slope = np.log(1 / np.sqrt(2 * np.pi)) - 0.5 * ndtri(parameters[:, 5]) ** 2
        return np.asarray(np.log(parameters[:, 4]) + slope)


@dataclass(frozen=True, eq=False)
class MixtureRegistration(registration.GaussianRegistration):
    """One more parameter, the share of false stars.

    - `corner`, (2,), and `side`: the square in which a false star lies, in px; it is part of the
      design and stays when the data change.
    """

    corner: tuple[float, float] = (0.0, 0.0)
    side: float = 1.0

    def _densities(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Log density of every target, (n, points), as a right match and as a false one."""
        residual, noise, share = (
            self.residuals(parameters),
            parameters[:, 4:5],
            parameters[:, 5:],
        )
        within = (self.target >= self.corner) & (
            self.target <= np.add(self.corner, self.side)
        )
        with np.errstate(
            divide="ignore"
        ):  # a share of nothing, a star beyond the field
            right = np.log1p(-share) - np.log(2 * np.pi * noise**2)
            false = np.log(share) + np.log(within.all(axis=1) / self.side**2)
        squares = residual.real**2 + residual.imag**2
        return np.asarray(right - 0.5 * squares / noise**2), np.asarray(false)

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood of each star, shape (n, points)."""
        return np.asarray(np.logaddexp(*self._densities(parameters)))

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        return np.asarray(self.pointwise(parameters).sum(axis=-1))

    def false(self, parameters: FloatArray) -> FloatArray:
        """Probability of every star to be false, shape (n, points)."""
        right, false = self._densities(parameters)
        return np.asarray(np.exp(false - np.logaddexp(right, false)))

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Target points for one parameter vector, shape (points, 2), in px."""
        return self._drawn(parameters, parameters[5], generator)

    def repeat(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """The same of a repeat, in which the stars that the data tell to be false are so again."""
        return self._drawn(parameters, self.false(parameters[None])[0], generator)

    def _drawn(
        self, parameters: FloatArray, share: FloatArray, generator: Generator
    ) -> FloatArray:
        false = generator.uniform(size=len(self.source)) < share
        right = super().simulate(parameters, generator)
        anywhere = self.corner + self.side * generator.uniform(size=right.shape)
        return np.where(false[:, None], anywhere, right)

    @cached_property
    def agreeing(self) -> NDArray[np.bool_]:
        """The stars that agree with each other, (points,), though half of all may be false.

        Of many pairs of stars the one is taken whose similarity brings a third of all stars
        nearest to their places (least quantile of squares: Rousseeuw and Leroy, 1987); least
        squares then takes in all stars that fit.
        """
        count = len(self.source)
        first, second = (
            Generator(PCG64(0)).integers(0, (count, count - 1), (_PAIRS, 2)).T
        )
        second = (first + 1 + second) % count
        target = as_complex(self.target)
        with np.errstate(divide="ignore", invalid="ignore"):  # two stars in one place
            factor = (target[second] - target[first]) / (
                self.offsets[second] - self.offsets[first]
            )
            moved = factor[:, None] * (self.offsets - self.offsets[first, None])
            off = np.nan_to_num(
                np.abs(target - target[first, None] - moved), nan=np.inf
            )
        rounding = _ROUNDING * float(np.abs([self.source, self.target]).max())
        third = max(4, int(np.ceil(AGREEING * count))) - 1
        best = off[np.partition(off, third)[:, third].argmin()]
        fits = np.asarray(best <= np.partition(best, third)[third], dtype=np.bool_)
        for _ in range(_ROUNDS):
            fit = fit_registration(self.source[fits], self.target[fits], self.pivot)
            noise = max(
                float(np.sqrt(fit.chi_square / fit.degrees_of_freedom)), rounding
            )
            off = np.hypot(*(self.target - fit.transform.apply(self.source)).T)
            before, fits = fits, np.asarray(off <= FAR * noise)
            if (fits == before).all():
                break
        return fits

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Least squares of the stars that agree with its errors, and the share of the others."""
        fits, count = self.agreeing, len(self.source)
        fit = fit_registration(self.source[fits], self.target[fits], self.pivot)
        freedom = float(fit.degrees_of_freedom)
        noise = np.sqrt(fit.chi_square / freedom)
        share = float((~fits).sum() + 1) / (count + 2)
        rest = [noise / np.sqrt(2 * freedom), np.sqrt(share * (1 - share) / count)]
        errors = noise * np.sqrt(np.diagonal(fit.cofactor))
        return np.append(fit.parameters, [noise, share]), np.append(errors, rest)

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """As for the plain registration, of those stars alone that agree in the data at hand."""
        target, fits = self.target if data is None else data, self.agreeing
        return registration.fit_checks(self.source[fits], target[fits], self.pivot)


def mixture_model(base: Model) -> Model:
    """The registration in which some stars are wrongly matched.

    With one more parameter, the share of false stars. The square in which they lie holds all stars
    of the reference channel.
    """
    plain = base.likelihood_of(registration.GaussianRegistration)
    low, high = plain.target.min(axis=0), plain.target.max(axis=0)
    side = _WIDER * float((high - low).max())
    x, y = (0.5 * (low + high - side)).tolist()
    share = Uniform(
        0.0,
        0.5,
        "from none to half of them: were more of them false, no majority "
        "would tell which are right",
    )
    return replace(
        base,
        name="registration-mixture",
        parameters=(
            *base.parameters,
            Parameter("false-share", "f", "1", share, natural=(0.0,)),
        ),
        likelihood=MixtureRegistration(
            plain.source, plain.target, plain.pivot, corner=(x, y), side=side
        ),
        coordinates=_NoiseAndShare(),
    )


def probability_false(posterior: Sampled) -> FloatArray:
    """Return each star's posterior probability of being false, (points,): the mean over draws."""
    likelihood = posterior.model.likelihood_of(MixtureRegistration)
    draws = posterior.draws[:: -(-len(posterior.draws) // DRAWS)]
    parts = np.array_split(draws, -(-len(draws) // CHUNK))
    return np.asarray(
        sum(likelihood.false(part).sum(axis=0) for part in parts) / len(draws)
    )
