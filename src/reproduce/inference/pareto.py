"""Importance weights and how far to trust them: Pareto-smoothed importance sampling."""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from reproduce.physics.validate import FloatArray

# Below this shape the weighted mean is reliable (Vehtari et al., 2024).
RELIABLE = 0.7


def smoothed(log_weights: FloatArray) -> tuple[FloatArray, float]:
    """Normalised log weights with the largest smoothed, and the Pareto shape k.

    Parameters
    ----------
    log_weights : ndarray, shape (n,)
        Unnormalised.

    Returns
    -------
    ndarray, shape (n,)
        Log weights that sum to one.
    float
        Shape of the upper tail: above 0.7 the weights are not to be trusted.

    Examples
    --------
    >>> weights, shape = smoothed(np.random.default_rng(1).normal(size=2000))
    >>> round(float(np.exp(weights).sum()), 9), shape < 0.7
    (1.0, True)
    """
    weights = log_weights - log_weights.max()
    count = len(weights)
    tail = int(np.ceil(min(0.2 * count, 3 * np.sqrt(count))))
    order = np.argsort(weights)
    cut = weights[order[-tail - 1]]
    excess = np.exp(weights[order[-tail:]]) - np.exp(cut)
    shape = -np.inf
    if tail >= 5 and excess[0] >= 0 and excess[-1] > 0:
        shape, scale = fitted_pareto(excess)
        quantiles = (np.arange(tail) + 0.5) / tail
        grown = (
            -np.log1p(-quantiles) if shape == 0 else np.expm1(-shape * np.log1p(-quantiles)) / shape
        )
        weights[order[-tail:]] = np.minimum(np.log(np.exp(cut) + scale * grown), 0.0)
    return weights - np.log(np.exp(weights).sum()), float(shape)


def fitted_pareto(values: FloatArray) -> tuple[float, float]:
    """Shape and scale of a generalised Pareto distribution (Zhang and Stephens, 2009).

    Parameters
    ----------
    values : ndarray, shape (n,)
        Excesses over a threshold, sorted, the largest above zero.

    Returns
    -------
    tuple of float
        Shape, pulled a little towards one half as usual for small tails, and scale.
    """
    count = len(values)
    grid = 30 + int(np.sqrt(count))
    steps = 1 - np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))
    quarter = values[int(count / 4 + 0.5) - 1]
    slopes = steps / (3 * max(quarter, np.finfo(float).tiny)) + 1 / values[-1]
    shapes = np.log1p(-slopes[:, None] * values).mean(axis=1)
    likelihoods = count * (np.log(-slopes / shapes) - shapes - 1)
    weights = np.exp(likelihoods - logsumexp(likelihoods))
    slope = float((slopes * weights).sum())
    shape = float(np.log1p(-slope * values).mean())
    scale = -shape / slope
    return (shape * count + 5.0) / (count + 10), scale
