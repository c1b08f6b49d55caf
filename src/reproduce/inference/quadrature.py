"""Posteriors of one or two parameters as sums over nodes: moments and quantiles without sampling.

The nodes are Gauss-Legendre's, between ends that a coarse look at the posterior finds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import logsumexp

from reproduce.inference.model import Model, UnsuitableModelError
from reproduce.inference.priors import Prior
from reproduce.physics.validate import FloatArray

# Nodes per parameter, and those of the coarse look.
NODES = {1: 300, 2: 120}
COARSE = {1: 60, 2: 24}
# A node this much (natural logarithm) below the largest one adds nothing.
NEGLIGIBLE = 35.0
# The first look reaches so many rough standard errors, and is repeated at most so often.
REACH, LOOKS = 8.0, 30
# Places between which a quantile is sought.
FINE = 4001
# Points that are worked on at once: bounds the memory.
CHUNK = 1000


@dataclass(frozen=True, eq=False)
class Summed:
    """A posterior on its nodes.

    - `model`: which.
    - `points`, (n, d): the nodes, all combinations of those of each parameter; SI units or px.
    - `log_weights`, `log_likelihood`, (n,): logarithms of what a node stands for, in the
      parameters' own measure, and of the likelihood.
    """

    model: Model
    points: FloatArray
    log_weights: FloatArray
    log_likelihood: FloatArray

    def _logs(self, model: Model) -> FloatArray:
        return self.log_weights + self.log_likelihood + model.log_prior(self.points)

    @property
    def probabilities(self) -> FloatArray:
        """Of the nodes, shape (n,)."""
        logs = self._logs(self.model)
        return np.asarray(np.exp(logs - logsumexp(logs)))

    @property
    def means(self) -> FloatArray:
        """Of the parameters, shape (d,)."""
        return np.asarray(self.probabilities @ self.points)

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations of the parameters, shape (d,)."""
        return np.sqrt(self.probabilities @ np.square(self.points - self.means))

    def quantile(self, column: int, probability: float) -> float:
        """Quantile of one parameter, by a cubic spline through its density at the nodes."""
        places, which = np.unique(self.points[:, column], return_inverse=True)
        shares, widths = (
            np.bincount(which.ravel(), each)
            for each in (self.probabilities, np.exp(self.log_weights))
        )
        whole = CubicSpline(places, shares / widths).antiderivative()
        fine = np.linspace(places[0], places[-1], FINE)
        return float(np.interp(probability, whole(fine) / whole(places[-1]), fine))

    def quantiles(self, values: FloatArray, probabilities: Sequence[float]) -> FloatArray:
        """Quantiles of what the parameters make, from its values at the nodes, shape (n,)."""
        order = np.argsort(values)
        shares = self.probabilities[order]
        return np.asarray(np.interp(probabilities, np.cumsum(shares) - shares / 2, values[order]))


def summed(model: Model, finer: float = 1) -> Summed:
    """Sum the posterior of a model of one or two parameters.

    The sum adds an error far below a thousandth, for the posteriors are smooth. What remains is the
    error of the log likelihood itself: for boxes of printed numbers, that of `log_box`, averaged
    over the posterior. `finer` multiplies the number of nodes.
    """
    if model.dimension not in NODES:
        raise UnsuitableModelError(
            f"{model.name}: expected at most {max(NODES)} parameters, got {model.dimension}"
        )
    ends = _ends(model)
    points, log_weights = _nodes(ends, round(finer * NODES[model.dimension]))
    parts = [_log_likelihood(model, points[i : i + CHUNK]) for i in range(0, len(points), CHUNK)]
    return Summed(model, points, log_weights, np.concatenate(parts))


def _nodes(ends: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """All combinations of nodes between ends of shape (d, 2), and their log weights."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    low, width = ends[:, :1], np.diff(ends, axis=1)
    axes, logs = low + (nodes + 1) / 2 * width, np.log(weights * width / 2)
    points = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=-1)
    return points, np.sum(np.meshgrid(*logs, indexing="ij"), axis=0).ravel()


def _log_likelihood(model: Model, points: FloatArray) -> FloatArray:
    found = model.log_likelihood(points)
    return np.where(np.isnan(found), -np.inf, found)


def _ends(model: Model) -> FloatArray:
    """Ends beyond which the posterior is negligible, shape (d, 2)."""
    rough, spread = model.likelihood.start()
    priors = [parameter.prior for parameter in model.parameters]
    ends = np.array([_supported(*one) for one in zip(priors, rough, REACH * spread, strict=True)])
    count = COARSE[model.dimension]
    for _ in range(LOOKS):
        points, _ = _nodes(ends, count)
        logs = model.log_posterior(points).reshape((count,) * model.dimension)
        near = logs > logs.max() - NEGLIGIBLE
        found = np.array([
            _narrowed(prior, one, np.flatnonzero(near.any(axis=_others(i, near.ndim))), count)
            for i, (prior, one) in enumerate(zip(priors, ends, strict=True))
        ])  # fmt: skip
        still = np.abs(found - ends).max(axis=1) < 0.2 * np.diff(ends, axis=1)[:, 0]
        ends = found
        if still.all():
            return ends
    raise UnsuitableModelError(f"{model.name}: the ends of the posterior are not found")


def _others(axis: int, count: int) -> tuple[int, ...]:
    return tuple(i for i in range(count) if i != axis)


def _narrowed(prior: Prior, ends: FloatArray, kept: NDArray[np.intp], count: int) -> FloatArray:
    """Ends around the nodes that count; further out where the outermost one does."""
    nodes = ends[0] + (np.polynomial.legendre.leggauss(count)[0] + 1) / 2 * (ends[1] - ends[0])
    first, last, width = int(kept.min()), int(kept.max()), ends[1] - ends[0]
    low = nodes[first - 1] if first else ends[0] - 0.5 * width
    high = nodes[last + 1] if last + 1 < count else ends[1] + 0.5 * width
    middle = nodes[(first + last) // 2]
    return np.array([_inside(prior, middle, low), _inside(prior, middle, high)])


def _supported(prior: Prior, rough: float, reach: float) -> tuple[float, float]:
    return _inside(prior, rough, rough - reach), _inside(prior, rough, rough + reach)


def _inside(prior: Prior, inside: float, outside: float) -> float:
    """The farthest point between two, from the first on, where the prior is not zero."""
    if np.isfinite(prior.log_density(np.array(outside))):
        return outside
    for _ in range(60):
        middle = 0.5 * (inside + outside)
        supported = np.isfinite(prior.log_density(np.array(middle)))
        inside, outside = (middle, outside) if supported else (inside, middle)
    return inside
