"""Registrations whose likelihood needs every point: free distortion, and wrong matches.

With wrong matches each star is rightly or wrongly matched (Hogg, Bovy and Lang, 2010). A right
match scatters about its position as in the plain registration. A wrong one lies anywhere in the
field, with the same density everywhere: it is another star. Which star is which is summed out, so
the draws give each star's probability of being false. Conventions and units are those of
`registration`; arrays have shape (n, points).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.random import PCG64, Generator
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from reproduce.inference import (
    Coordinates,
    Model,
    Normal,
    Parameter,
    PosteriorSamples,
    Uniform,
)
from reproduce.inference.models.registration import (
    GaussianRegistration,
    StarLikelihood,
    fit_checks,
)
from reproduce.physics.registration import (
    RegistrationFit,
    as_complex,
    as_points,
    fit_registration,
)
from reproduce.physics.validate import FloatArray

# Steps of Newton's method for the inverse distortion; each doubles the digits.
_NEWTON_STEPS = 4
# Draws that give the probabilities of the stars, and draws that are evaluated together.
DRAWS, CHUNK = 4000, 500
# Pairs of stars that are tried for a start: a quarter of them are right if half the stars are.
_MAX_PAIRS = 300
# Sides of the square in which false stars lie: no star of the data lies on an edge.
_WIDER = 1.01
# Fraction of the stars that have to agree, and the limit for the others in standard deviations.
AGREEING, FAR = 1 / 3, 5.0
_MAX_FITS = 30
# Residuals below this fraction of the coordinates are rounding.
_ROUNDING = 1e-12


class _DistortedRegistration(GaussianRegistration):
    """Radial distortion free in both channels; two more parameters.

    The distortion is its displacement at the edge of the field, in px, so that the parameter does
    not depend on the unit of the coefficient.
    """

    __call__ = StarLikelihood.__call__

    def places(
        self, parameters: FloatArray, source: FloatArray | None = None
    ) -> FloatArray:
        """Undistort, scale and rotate, distort, shift: (n, points, 2), in px."""
        offsets, own = (
            as_complex(p - self.pivot)
            for p in (self.source if source is None else source, self.source)
        )
        edge = float(np.abs(own).max())
        undo, bend = (parameters[:, i : i + 1] / edge for i in (5, 6))
        radius = np.abs(offsets) / edge
        ideal = radius * np.ones((len(parameters), 1))
        for _ in range(_NEWTON_STEPS):
            term = undo * ideal**2
            ideal = ideal - (ideal + term * ideal - radius) / (1 + 3 * term)
        with np.errstate(invalid="ignore"):
            ratio = np.where(radius > 0, ideal / radius, 1.0)
        factor = parameters[:, :1] * np.exp(1j * parameters[:, 1:2])
        carried = factor * ratio * offsets
        carried = carried * (1 + bend * np.abs(carried / edge) ** 2)
        shift = parameters[:, 2:3] + 1j * parameters[:, 3:4]
        return np.asarray(as_points(carried - shift) + self.pivot)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Return the least-squares fit and its standard errors, and no distortion."""
        centre, spread = super().start()
        return np.append(centre, (0.0, 0.0)), np.append(spread, (0.1, 0.1))


def distortion_model(base: Model) -> Model:
    """Return the registration with the radial distortion of both channels free.

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
    plain = base.likelihood_of(GaussianRegistration)
    return replace(
        base,
        name="registration-distortion",
        parameters=base.parameters + extra,
        likelihood=_DistortedRegistration(plain.source, plain.target, plain.pivot),
    )


class _NoiseAndShare(Coordinates):
    """The logarithm of the noise and the normal score of the share, the rest as declared.

    Without false stars the share would pile up at zero; its score has no bound.
    """

    def straight(self, parameters: FloatArray) -> FloatArray:
        """Return coordinates of parameter vectors, shape (..., 6)."""
        found = parameters.copy()
        found[..., 4], found[..., 5] = np.log(found[..., 4]), ndtri(found[..., 5])
        return found

    def parameters(self, straight: FloatArray) -> FloatArray:
        """Return parameter vectors at coordinates, shape (..., 6)."""
        found = straight.copy()
        found[..., 4], found[..., 5] = np.exp(found[..., 4]), ndtr(found[..., 5])
        return found

    def log_volume(self, parameters: FloatArray) -> FloatArray:
        """Return the log determinant of the derivatives by the coordinates, shape (...)."""
        slope = -0.5 * (ndtri(parameters[..., 5]) ** 2 + np.log(2 * np.pi))
        return np.asarray(np.log(parameters[..., 4]) + slope)


@dataclass(frozen=True, eq=False)
class MixtureRegistration(GaussianRegistration):
    """One more parameter, the fraction of false stars.

    - `corner`, (2,), and `side`: the square in which a false star lies, in px; it is part of the
      design and stays when the data change.
    """

    corner: tuple[float, float] = (0.0, 0.0)
    side: float = 1.0

    __call__ = StarLikelihood.__call__

    def _densities(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the log density of each target, (n, points), as a right and as a false match."""
        share = parameters[:, 5:]
        away = (self.target - self.corner) / self.side
        within = ((away >= 0) & (away <= 1)).all(axis=1)
        with np.errstate(
            divide="ignore"
        ):  # a fraction of zero, a star beyond the field
            false = np.log(share) + np.log(within / self.side**2)
        return np.log1p(-share) + super().pointwise(parameters), np.asarray(false)

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of each star, shape (n, points)."""
        return np.asarray(np.logaddexp(*self._densities(parameters)))

    def false(self, parameters: FloatArray) -> FloatArray:
        """Return the probability of each star to be false, shape (n, points)."""
        right, false = self._densities(parameters)
        return np.asarray(np.exp(false - np.logaddexp(right, false)))

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Return target points for one parameter vector, shape (points, 2), in px."""
        return self._drawn(parameters, parameters[5], generator)

    def repeat(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Return those of a repeat, in which stars that the data show to be false are false."""
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

        The similarity of the best of many pairs of stars brings a third of all stars nearest to
        their places (least quantile of squares: Rousseeuw and Leroy, 1987). Least squares then
        takes in all stars that fit.
        """
        count, generator = len(self.source), Generator(PCG64(0))
        first, second = generator.integers(0, count, (2, _MAX_PAIRS))
        source, target = as_complex(self.source), as_complex(self.target)
        with np.errstate(divide="ignore", invalid="ignore"):  # two stars in one place
            factor = (target[second] - target[first]) / (source[second] - source[first])
            moved = factor[:, None] * (source - source[first, None])
            off = np.abs(target - target[first, None] - moved)
        third = max(4, int(np.ceil(AGREEING * count))) - 1
        off = np.sort(np.nan_to_num(off, nan=np.inf), axis=1)[:, third]
        best = off.argmin()
        fits = np.abs(target - target[first[best]] - moved[best]) <= off[best]
        rounding = _ROUNDING * float(np.abs([self.source, self.target]).max())
        for _ in range(_MAX_FITS):
            fit = self._fit_of(fits)
            noise = np.sqrt(fit.chi_square / fit.degrees_of_freedom)
            off = np.hypot(*(self.target - fit.transform.apply(self.source)).T)
            before, fits = fits, off <= FAR * max(float(noise), rounding)
            if (fits == before).all():
                break
        return np.asarray(fits)

    def _fit_of(self, stars: NDArray[np.bool_]) -> RegistrationFit:
        return fit_registration(self.source[stars], self.target[stars], self.pivot)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Return least squares of the stars that agree, and the fraction of the others."""
        fits, count = self.agreeing, len(self.source)
        right = GaussianRegistration(self.source[fits], self.target[fits], self.pivot)
        centre, spread = right.start()
        share = float((~fits).sum() + 1) / (count + 2)
        error = np.sqrt(share * (1 - share) / count)
        return np.append(centre, share), np.append(spread, error)

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """Return those of the plain registration for the stars that agree in the present data."""
        target, fits = self.target if data is None else data, self.agreeing
        return fit_checks(self.source[fits], target[fits], self.pivot)


def mixture_model(base: Model) -> Model:
    """Return the registration in which some stars are wrongly matched.

    With one more parameter, the fraction of false stars. The square in which they lie contains all
    stars of the reference channel.
    """
    plain = base.likelihood_of(GaussianRegistration)
    low, high = plain.target.min(axis=0), plain.target.max(axis=0)
    side = _WIDER * float((high - low).max())
    x, y = (0.5 * (low + high - side)).tolist()
    share = Uniform(
        0.0,
        0.5,
        "from none to half of them: were more of them false, no majority would tell which are "
        "right",
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


def probability_false(posterior: PosteriorSamples) -> FloatArray:
    """Return each star's posterior probability of being false, (points,): the mean over draws."""
    likelihood = posterior.model.likelihood_of(MixtureRegistration)
    draws = posterior.draws[:: -(-len(posterior.draws) // DRAWS)]
    parts = np.array_split(draws, -(-len(draws) // CHUNK))
    total = sum(likelihood.false(part).sum(axis=0) for part in parts)
    return np.asarray(total / len(draws))
