"""Convergence criteria of draws of several independent ensembles.

Chains have shape (ensembles, steps, walkers) for one quantity. One ensemble counts as one chain,
because its walkers depend on each other. The autocorrelation time is therefore also measured on the
mean of the ensemble, which shows walkers that move together.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
from scipy.special import betaincinv, ndtr, ndtri
from scipy.stats import rankdata

from reproduce.physics.validate import FloatArray

# Window of Sokal: the sum stops at this multiple of the autocorrelation time of the sum.
_WINDOW_TIMES = 5.0
_TAIL_PROBABILITIES = (0.05, 0.95)
# Probabilities of the bounds of the central 95 %.
ENDS = (0.025, 0.975)
# Factors on the advised steps: a margin, since short chains underestimate the autocorrelation time,
# and the factor for ensembles that differ.
_STEPS_MARGIN, _MIXING_FACTOR = 1.5, 2.0


def _integrated_time(series: FloatArray) -> float:
    """Return the autocorrelation time of series along the first axis, in steps, pooled.

    The autocorrelation is averaged before it is normalised, so that a series that never moves
    counts. The result is at least one half, for draws that alternate about their mean.

    Examples
    --------
    >>> _integrated_time(np.tile([1.0, -1.0], 100)[:, None])
    0.5
    """
    steps = len(series)
    centred = series - series.mean(axis=0)
    padded = np.fft.rfft(centred, n=2 * steps, axis=0)
    power = (padded * padded.conj()).real.reshape(len(padded), -1).mean(axis=1)
    function = np.fft.irfft(power)[:steps]
    if function[0] <= 0:
        return 2 * steps - 1
    times = 2.0 * np.cumsum(function / function[0]) - 1.0
    outside = np.arange(steps) >= _WINDOW_TIMES * times
    outside[-1] = True
    return max(float(times[np.argmax(outside)]), 0.5)


def autocorrelation_time(chains: FloatArray) -> float:
    """Return the number of steps per independent draw of a walker.

    It is the larger one of emcee's estimate (autocorrelation of the walkers, averaged) and the
    estimate of Goodman and Weare (autocorrelation and variance of the ensemble's mean), both pooled
    over ensembles. The effective sample size is steps times walkers over this time, summed over
    ensembles.

    Parameters
    ----------
    chains : ndarray, shape (ensembles, steps, walkers)
        Draws of one quantity.

    Returns
    -------
    float
        Autocorrelation time, in steps.

    Examples
    --------
    >>> chains = np.random.default_rng(1).normal(size=(4, 500, 32))
    >>> 0.8 < autocorrelation_time(chains) < 1.4
    True
    """
    variance, means = chains.var(), chains.mean(axis=2).T
    if variance == 0:
        return chains.shape[1]
    # About the common mean, so that ensembles that differ count as slow.
    inflation = chains.shape[2] * means.var() / variance
    walkers = _integrated_time(np.moveaxis(chains, 0, 1))
    return max(walkers, _integrated_time(means) * inflation)


def _effective_size(chains: FloatArray) -> float:
    """Return the number of independent draws with the same error of the mean."""
    return chains.size / autocorrelation_time(chains)


def _rank_normalised(values: FloatArray) -> FloatArray:
    """Return normal scores of the ranks of all values together, with the shape of `values`."""
    ranks = rankdata(values, axis=None).reshape(values.shape)
    return ndtri((ranks - 0.375) / (values.size + 0.25))


def _split_rhat(draws: FloatArray) -> float:
    """Return the rank-normalised split R-hat, the larger one of its bulk and folded form.

    The draws have shape (chains, n), one row per independent ensemble, in the order of time.

    Examples
    --------
    >>> draws = np.random.default_rng(1).normal(size=(4, 1000))
    >>> _split_rhat(draws) < 1.01 < _split_rhat(draws + np.arange(4)[:, None])
    True
    """
    half = draws.shape[1] // 2
    halves = np.concatenate([draws[:, :half], draws[:, -half:]])
    folded = np.abs(halves - np.median(halves))
    scores = np.stack([_rank_normalised(halves), _rank_normalised(folded)])
    within = scores.var(axis=-1, ddof=1).mean(axis=-1)
    squares = scores.mean(axis=-1).var(axis=-1, ddof=1) / within
    return float(np.sqrt((half - 1) / half + squares.max()))


def _mcse_quantile(chains: FloatArray, probability: float) -> float:
    """Return the Monte Carlo standard error of a quantile, in the unit of the draws.

    Half the distance between the quantiles that bound it with one standard error.
    """
    size = _effective_size((chains <= np.quantile(chains, probability)).astype(float))
    first, second = size * probability + 1, size * (1 - probability) + 1
    low, high = np.quantile(chains, betaincinv(first, second, ndtr([-1.0, 1.0])))
    return (high - low) / 2


class ConvergenceCriteria:
    """Limits for a set of ensembles.

    - `rhat`: largest rank-normalised split R-hat over ensembles (Vehtari et al., 2021).
    - `times`: smallest number of autocorrelation times in the kept steps, as emcee recommends.
    - `size`: smallest bulk and tail effective sample size: 100 per chain of four.
    - `acceptance`: smallest fraction of accepted moves: below it an ensemble may be stuck.
    """

    rhat = 1.01
    times = 50.0
    size = 400.0
    acceptance = 0.05


@dataclass(frozen=True)
class Summary:
    """Summary of one parameter or consequence, in the displayed unit.

    - `name`, `unit`: its name and unit.
    - `mean`, `deviation`, `low`, `median`, `high`: mean, standard deviation, and the median between
      the bounds of the central 95 %.
    - `mcse`, `mcse_end`: Monte Carlo standard error of the mean, and the larger one of both bounds.
    - `rhat`, `bulk`, `tail`, `time`: split R-hat, effective sample sizes, and autocorrelation time
      in steps.
    """

    name: str
    unit: str
    mean: float
    deviation: float
    low: float
    median: float
    high: float
    mcse: float
    mcse_end: float
    rhat: float
    bulk: float
    tail: float
    time: float


class UnconvergedError(ArithmeticError):
    """Raised for chains that fail a convergence criterion.

    Parameters
    ----------
    factors : dict
        Failure to the factor on the steps that lifts it; infinite if more steps do not help.
    taken : int
        Number of kept steps.

    Attributes
    ----------
    missed : list of str
        Failures, the worst one first.
    taken : int
        Number of kept steps.
    steps : int or None
        Sufficient number of steps by the measured autocorrelation, if more steps help.
    """

    def __init__(self, factors: dict[str, float], taken: int) -> None:
        super().__init__(factors, taken)
        self.taken = taken
        self.missed = sorted(factors, key=factors.__getitem__, reverse=True)
        hundreds = np.ceil(_STEPS_MARGIN * factors[self.missed[0]] * taken / 100)
        self.steps = int(hundreds) * 100 if np.isfinite(hundreds) else None

    def __str__(self) -> str:
        steps = self.steps
        mixing = "find out what keeps the ensembles from mixing"
        advice = f"take about {steps} steps, not {self.taken}" if steps else mixing
        rest = len(self.missed) - 1
        more = f" (and {rest} more)" * (rest > 0)
        return f"the chains are rejected: {self.missed[0]}{more}; {advice}"


def thinned(chains: FloatArray, time: float) -> FloatArray:
    """Return draws of each ensemble in the order of time, thinned by the autocorrelation time.

    Shape (ensembles, draws, ...): step by step, all walkers of a step in sequence. The time is
    rounded up.
    """
    kept = chains[:, :: ceil(time)]
    return kept.reshape(len(kept), -1, *kept.shape[3:])


def summarised(name: str, unit: str, draws: FloatArray, stride: int = 1) -> Summary:
    """Return the summary of draws of one quantity.

    Parameters
    ----------
    name, unit : str
        Name and displayed unit of the quantity.
    draws : ndarray, shape (ensembles, steps, walkers)
        Draws of the quantity, in this unit.
    stride : int
        Steps of the sampler per step of the draws.

    Returns
    -------
    Summary
        Mean, deviation, quantiles and convergence statistics, in the displayed unit.
    """
    time = autocorrelation_time(draws)
    low, median, high = np.quantile(draws, (ENDS[0], 0.5, ENDS[1])).tolist()
    tails = np.quantile(draws, _TAIL_PROBABILITIES)
    return Summary(
        name,
        unit,
        draws.mean(),
        draws.std(),
        low,
        median,
        high,
        mcse=draws.std() / np.sqrt(draws.size / time),
        mcse_end=max(_mcse_quantile(draws, end) for end in ENDS),
        rhat=_split_rhat(thinned(draws, time)),
        bulk=_effective_size(_rank_normalised(draws)),
        tail=min(_effective_size((draws <= end).astype(float)) for end in tails),
        time=stride * time,
    )


def require(
    rows: Sequence[Summary],
    steps: int,
    acceptance: Iterable[float],
    times: float = ConvergenceCriteria.times,
) -> None:
    """Raise `UnconvergedError` if a criterion is not met, or a number is not finite.

    Parameters
    ----------
    rows : sequence of Summary
        Summaries of all parameters.
    steps : int
        Kept steps of each ensemble.
    acceptance : iterable of float
        Fraction of accepted moves of each ensemble.
    times : float
        Smallest number of autocorrelation times in the kept steps.

    Raises
    ------
    UnconvergedError
        With the failures and the sufficient number of steps.
    """
    limits = ConvergenceCriteria
    lowest = min(acceptance)
    # Failure to the factor on the steps that lifts it. NaN fails.
    factors: dict[str, float] = {}
    if not lowest >= limits.acceptance:
        text = f"acceptance {lowest:.3g}, at least {limits.acceptance:g} required"
        factors[text] = np.inf
    for row in rows:
        if not row.rhat <= limits.rhat:
            text = f"{row.name}: R-hat {row.rhat:.4f}, at most {limits.rhat:g} allowed"
            factors[text] = _MIXING_FACTOR if np.isfinite(row.rhat) else np.inf
        for name, size, least in (
            (
                f"autocorrelation times ({row.time:.1f} steps each)",
                steps / row.time,
                times,
            ),
            ("bulk effective sample size", row.bulk, limits.size),
            ("tail effective sample size", row.tail, limits.size),
        ):
            if not size >= least:
                text = f"{row.name}: {name} {size:.3g}, at least {least:g} required"
                factors[text] = least / size if size > 0 else np.inf
    if factors:
        raise UnconvergedError(factors, steps)
