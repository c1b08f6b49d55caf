"""How far draws of several independent ensembles can be trusted.

Chains have shape (ensembles, steps, walkers) for one quantity. One ensemble counts as one chain:
its walkers steer each other and are no chains of their own. The autocorrelation time is therefore
also measured on the mean of the ensemble, where walkers that move together show.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri
from scipy.stats import beta, rankdata

from reproduce.physics.validate import FloatArray

# Sokal's window: the sum stops at this many times the autocorrelation time found so far.
WINDOW = 5.0
TAILS = (0.05, 0.95)


def autocorrelation(series: FloatArray) -> FloatArray:
    """Normalised autocorrelation along the first axis, averaged over all others.

    Parameters
    ----------
    series : ndarray, shape (steps, ...)
        Values in time order.

    Returns
    -------
    ndarray, shape (steps,)
        One at lag zero. Averaged before it is normalised, so a series that never moves counts.
    """
    steps = len(series)
    centred = series - series.mean(axis=0)
    padded = np.fft.rfft(centred, n=2 * steps, axis=0)
    power = (padded * padded.conj()).real.reshape(len(padded), -1).mean(axis=1)
    function = np.fft.irfft(power)[:steps]
    return function / function[0] if function[0] > 0 else np.ones(steps)


def integrated_time(function: FloatArray) -> float:
    """Integrated autocorrelation time of an autocorrelation function, by Sokal's window.

    Parameters
    ----------
    function : ndarray, shape (steps,)
        From `autocorrelation`.

    Returns
    -------
    float
        In steps, never below one half (draws that alternate about their mean).

    Examples
    --------
    >>> integrated_time(np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    1.0
    """
    times = 2.0 * np.cumsum(function) - 1.0
    outside = np.arange(len(times)) >= WINDOW * times
    window = int(np.argmax(outside)) if outside.any() else len(times) - 1
    return max(float(times[window]), 0.5)


def autocorrelation_time(chains: FloatArray) -> float:
    """Steps of an ensemble that are worth one independent draw per walker.

    The larger of emcee's estimate (autocorrelation of the walkers, averaged) and that of Goodman
    and Weare (autocorrelation and variance of the ensemble's mean), both pooled over ensembles.
    The effective sample size is steps times walkers over this time, summed over ensembles.

    Parameters
    ----------
    chains : ndarray, shape (ensembles, steps, walkers)
        One quantity.

    Returns
    -------
    float
        In steps.

    Examples
    --------
    >>> chains = np.random.default_rng(1).normal(size=(4, 500, 32))
    >>> 0.8 < autocorrelation_time(chains) < 1.4
    True
    """
    walkers = integrated_time(autocorrelation(np.moveaxis(chains, 0, 1)))
    variance = chains.var()
    if variance == 0:
        return float(chains.shape[1])
    means = chains.mean(axis=2).T
    # About the common mean: ensembles that disagree count as slow.
    inflation = chains.shape[2] * means.var() / variance
    together = integrated_time(autocorrelation(means)) * inflation
    return max(walkers, float(together))


def effective_size(chains: FloatArray) -> float:
    """Number of independent draws that would give the mean as well.

    Parameters
    ----------
    chains : ndarray, shape (ensembles, steps, walkers)
        One quantity.

    Returns
    -------
    float
        Summed over the ensembles.
    """
    return chains.size / autocorrelation_time(chains)


def rank_normalised(values: FloatArray) -> FloatArray:
    """Normal scores of the ranks of all values together, same shape.

    Examples
    --------
    >>> rank_normalised(np.array([3.0, 1.0, 2.0])).round(2)
    array([ 0.87, -0.87,  0.  ])
    """
    ranks = rankdata(values, method="average").reshape(values.shape)
    return np.asarray(ndtri((ranks - 0.375) / (values.size + 0.25)))


def bulk_size(chains: FloatArray) -> float:
    """Effective sample size of the rank-normalised draws."""
    return effective_size(rank_normalised(chains))


def tail_size(chains: FloatArray) -> float:
    """Smaller effective sample size of the two tail indicators, at 5 % and 95 %."""
    low, high = np.quantile(chains, TAILS)
    return min(effective_size((chains <= end).astype(float)) for end in (low, high))


def split_rhat(draws: FloatArray) -> float:
    """Rank-normalised split R-hat, the larger of its bulk and its folded form.

    Parameters
    ----------
    draws : ndarray, shape (chains, n)
        One row per independent ensemble, in time order.

    Returns
    -------
    float
        One where all halves agree.

    Examples
    --------
    >>> draws = np.random.default_rng(1).normal(size=(4, 1000))
    >>> split_rhat(draws) < 1.01 < split_rhat(draws + np.arange(4)[:, None])
    True
    """
    half = draws.shape[1] // 2
    halves = np.concatenate([draws[:, :half], draws[:, -half:]])
    folded = np.abs(halves - np.median(halves))
    return max(_rhat(rank_normalised(halves)), _rhat(rank_normalised(folded)))


def _rhat(scores: FloatArray) -> float:
    count = scores.shape[1]
    within = scores.var(axis=1, ddof=1).mean()
    between = count * scores.mean(axis=1).var(ddof=1)
    return float(np.sqrt((count - 1) / count + between / (count * within)))


def mcse_mean(chains: FloatArray) -> float:
    """Monte Carlo standard error of the mean, in the unit of the draws."""
    return float(chains.std() / np.sqrt(effective_size(chains)))


def mcse_deviation(chains: FloatArray) -> float:
    """Monte Carlo standard error of the standard deviation, in the unit of the draws."""
    squares = np.square(chains - chains.mean())
    error = squares.std() / np.sqrt(effective_size(squares))
    return float(error / (2 * chains.std()))


def mcse_quantile(chains: FloatArray, probability: float) -> float:
    """Monte Carlo standard error of a quantile, in the unit of the draws.

    Parameters
    ----------
    chains : ndarray, shape (ensembles, steps, walkers)
        One quantity.
    probability : float
        Of the quantile.

    Returns
    -------
    float
        Half the distance between the quantiles that bound it with one standard error.
    """
    size = effective_size((chains <= np.quantile(chains, probability)).astype(float))
    law = beta(size * probability + 1, size * (1 - probability) + 1)
    low, high = (np.quantile(chains, law.ppf(end)) for end in (0.1586553, 0.8413447))
    return float((high - low) / 2)
