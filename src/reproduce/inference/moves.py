"""Moves of an emcee ensemble, with the whole half-ensemble accepted or rejected at once.

emcee decides walker by walker in Python; for likelihoods that cost next to nothing this is most
of the time. `Complement` adds a proposal for the nearly Gaussian posteriors of this book; those
that are far from it are moved in coordinates of their own (`inference.coordinates`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from emcee import moves
from emcee.state import State
from scipy.special import gammaln

from reproduce.inference.coordinates import Coordinates, Declared, Mirrored
from reproduce.physics.validate import FloatArray

# Two widths of the proposal: degrees of freedom of a Student-t, and its width over the ensemble's.
# The near one fits a nearly Gaussian posterior; the far one, with its share, is heavier and wider
# than any posterior that is met here, so that no walker is left behind in a tail.
NEAR, FAR = (30.0, 1.05), (4.0, 1.5)
FAR_SHARE = 0.2


# emcee has no types: what stands on its classes is of an unknown kind to mypy.
class _AtOnce(moves.RedBlueMove):  # type: ignore[misc]
    """A red-blue move whose acceptance is decided for a whole half at once.

    - `coordinates`, optional: in which proposals are made; the parameters themselves by default.
    """

    def __init__(self, coordinates: Coordinates | None = None) -> None:
        self.coordinates = coordinates or Declared()
        super().__init__()

    def propose(self, model: Any, state: State) -> tuple[State, Any]:
        """Move one half of the ensemble after the other, each given its complement."""
        self.setup(state.coords)
        walkers = len(state.coords)
        halves = np.arange(walkers) % 2
        model.random.shuffle(halves)
        accepted = np.zeros(walkers, dtype=bool)
        coords, log_prob = state.coords.copy(), np.array(state.log_prob)
        for half in (0, 1):
            moved, rest = halves == half, halves != half
            straight = self.coordinates.straight(coords)
            new, factors = self.get_proposal(straight[moved], [straight[rest]], model.random)
            proposed = self._back(new)
            values = model.log_prob_fn(proposed)
            # Minus infinity less minus infinity cannot occur: a walker never stands on it.
            before = log_prob[moved] + self.coordinates.log_volume(coords[moved])
            gain = factors + self._density(proposed, values) - before
            taken = np.log(model.random.rand(len(gain))) < gain
            index = np.flatnonzero(moved)[taken]
            coords[index], log_prob[index] = proposed[taken], values[taken]
            accepted[index] = True
        return State(coords, log_prob=log_prob, random_state=state.random_state), accepted

    def _back(self, straight: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):  # far outside: infinite, and rejected
            return self.coordinates.parameters(straight)

    def _density(self, proposed: FloatArray, values: FloatArray) -> FloatArray:
        inside = np.isfinite(values)
        if inside.all():
            return np.asarray(values + self.coordinates.log_volume(proposed))
        density = np.full(len(values), -np.inf)
        density[inside] = values[inside] + self.coordinates.log_volume(proposed[inside])
        return density


class Stretch(_AtOnce, moves.StretchMove):  # type: ignore[misc]
    """The affine-invariant stretch of Goodman and Weare, decided at once."""


class DifferentialEvolution(_AtOnce, moves.DEMove):  # type: ignore[misc]
    """A step along the difference of two other walkers, decided at once."""


class Complement(_AtOnce):
    """An independent draw from two Student-t with mean and covariance of the other half.

    The proposal depends on the other half alone, so the step leaves the posterior unchanged for
    any shape of it; the nearer to Gaussian, the more often it is accepted. It is affine
    invariant, as the stretch is.
    """

    def get_proposal(
        self, sample: FloatArray, complement: list[FloatArray], random: np.random.RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """Propose for every walker; the factor is the ratio of proposal densities."""
        others = complement[0]
        count, dimension = sample.shape
        mean = others.mean(axis=0)
        # Scales differ by many orders of magnitude; factorise the correlation, not the covariance.
        scale = others.std(axis=0) + np.finfo(float).tiny
        scaled = (others - mean) / scale
        correlation = scaled.T @ scaled / len(others) + 1e-10 * np.eye(dimension)
        root = np.linalg.cholesky(correlation)
        far = (random.rand(count) < FAR_SHARE).astype(int)
        degrees, width = np.array([NEAR, FAR])[far].T
        reach = width / np.sqrt(random.chisquare(degrees) / degrees)
        steps = reach[:, None] * random.standard_normal(sample.shape)
        before = ((sample - mean) / scale) @ np.linalg.inv(root).T
        squares = [np.square(points).sum(axis=1) for points in (before, steps)]
        old, new = (_log_proposal(distance, dimension) for distance in squares)
        return mean + scale * (steps @ root.T), old - new


def _log_proposal(squared: FloatArray, dimension: int) -> FloatArray:
    """Log density of the proposal at a squared distance, but for a constant of the dimension."""
    near, far = (
        gammaln((degrees + dimension) / 2) - gammaln(degrees / 2)
        - dimension * np.log(np.sqrt(degrees) * width)
        - 0.5 * (degrees + dimension) * np.log1p(squared / (degrees * width**2))
        for degrees, width in (NEAR, FAR)
    )  # fmt: skip
    return np.asarray(np.logaddexp(np.log1p(-FAR_SHARE) + near, np.log(FAR_SHARE) + far))


class Mirror(_AtOnce):
    """A reflection into the other mode of a posterior that has two."""

    def get_proposal(
        self, sample: FloatArray, complement: list[FloatArray], random: np.random.RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """Propose for every walker; a reflection neither stretches nor shrinks."""
        if not isinstance(self.coordinates, Mirrored):
            raise TypeError(
                f"coordinates: expected a mirror, got {type(self.coordinates).__name__}"
            )
        return self.coordinates.mirrored(sample), np.zeros(len(sample))


def inward(coordinates: Coordinates | None = None) -> list[tuple[moves.Move, float]]:
    """Return the moves of the warm-up for emcee, with their shares.

    The stretch and the differential evolution carry a far-off ensemble in.
    """
    return _shared(coordinates, (0.3, 0.4, 0.0))


def mixture(coordinates: Coordinates | None = None) -> list[tuple[moves.Move, float]]:
    """Return the moves of an ensemble for emcee, with their shares.

    The complement makes draws nearly independent; the stretch and the differential evolution keep
    curved or heavy-tailed posteriors moving. Where the coordinates know of a second mode, a mirror
    joins them.

    Examples
    --------
    >>> sum(weight for _, weight in mixture())
    1.0
    """
    mirrored = isinstance(coordinates, Mirrored)
    return _shared(coordinates, (0.05, 0.1, 0.15 if mirrored else 0.0))


def _shared(
    coordinates: Coordinates | None, shares: tuple[float, float, float]
) -> list[tuple[moves.Move, float]]:
    kinds = (Stretch, DifferentialEvolution, Mirror)
    chosen = [
        (kind(coordinates), share) for kind, share in zip(kinds, shares, strict=True) if share
    ]
    return [*chosen, (Complement(coordinates), 1 - sum(shares))]
