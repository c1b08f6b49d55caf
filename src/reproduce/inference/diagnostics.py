"""Convergence criteria of draws of several independent ensembles.

Chains have shape (ensembles, steps, walkers) for one quantity. One ensemble counts as one chain:
its walkers depend on each other. The autocorrelation time is therefore also measured on the mean of
the ensemble, which shows walkers that move together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv, ndtr, ndtri
from scipy.stats import rankdata

from reproduce.physics.validate import FloatArray

# Sokal's window: the sum stops at this many times the autocorrelation time found so far.
_WINDOW_TIMES = 5.0
_TAILS = (0.05, 0.95)
# Probabilities of the bounds of the central 95 %.
ENDS = (0.025, 0.975)
# Advised steps: the margin over those that the criteria need, since short chains underestimate the
# time, and the factor for ensembles that differ.
_MARGIN, _MIXING = 1.5, 2.0


def _autocorrelation(series: FloatArray) -> FloatArray:
    """Normalised autocorrelation along the first axis, averaged over all others, (steps,).

    Averaged before it is normalised, so a series that never moves counts.
    """
    steps = len(series)
    centred = series - series.mean(axis=0)
    padded = np.fft.rfft(centred, n=2 * steps, axis=0)
    power = (padded * padded.conj()).real.reshape(len(padded), -1).mean(axis=1)
    function = np.fft.irfft(power)[:steps]
    return function / function[0] if function[0] > 0 else np.ones(steps)


def _integrated_time(function: FloatArray) -> float:
    """Integrated time of an autocorrelation function, in steps, by Sokal's window.

    Never below one half (draws that alternate about their mean).

    Examples
    --------
    >>> _integrated_time(np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    1.0
    """
    times = 2.0 * np.cumsum(function) - 1.0
    outside = np.arange(len(times)) >= _WINDOW_TIMES * times
    window = int(np.argmax(outside)) if outside.any() else len(times) - 1
    return max(float(times[window]), 0.5)


def autocorrelation_time(chains: FloatArray) -> float:
    """Steps of an ensemble that are worth one independent draw per walker.

    The larger of emcee's estimate (autocorrelation of the walkers, averaged) and that of Goodman
    and Weare (autocorrelation and variance of the ensemble's mean), both pooled over ensembles.
    The effective sample size is steps times walkers over this time, summed over ensembles.

    Examples
    --------
    >>> chains = np.random.default_rng(1).normal(size=(4, 500, 32))
    >>> 0.8 < autocorrelation_time(chains) < 1.4
    True
    """
    walkers = _integrated_time(_autocorrelation(np.moveaxis(chains, 0, 1)))
    variance = chains.var()
    if variance == 0:
        return float(chains.shape[1])
    means = chains.mean(axis=2).T
    # About the common mean: ensembles that disagree count as slow.
    inflation = chains.shape[2] * means.var() / variance
    together = _integrated_time(_autocorrelation(means)) * inflation
    return max(walkers, float(together))


def _effective_size(chains: FloatArray) -> float:
    """Number of independent draws that would give the mean as well, summed over ensembles."""
    return chains.size / autocorrelation_time(chains)


def _rank_normalised(values: FloatArray) -> FloatArray:
    """Return normal scores of the ranks of all values together, same shape.

    Examples
    --------
    >>> _rank_normalised(np.array([3.0, 1.0, 2.0])).round(2)
    array([ 0.87, -0.87,  0.  ])
    """
    ranks = rankdata(values, axis=None).reshape(values.shape)
    return np.asarray(ndtri((ranks - 0.375) / (values.size + 0.25)))


def _tail_size(chains: FloatArray) -> float:
    """Smaller effective sample size of the two tail indicators, at 5 % and 95 %."""
    low, high = np.quantile(chains, _TAILS)
    return min(_effective_size((chains <= end).astype(float)) for end in (low, high))


def _split_rhat(draws: FloatArray) -> float:
    """Rank-normalised split R-hat, the larger of its bulk and its folded form.

    Of draws (chains, n), one row per independent ensemble, in time order; one where all halves
    agree.

    Examples
    --------
    >>> draws = np.random.default_rng(1).normal(size=(4, 1000))
    >>> _split_rhat(draws) < 1.01 < _split_rhat(draws + np.arange(4)[:, None])
    True
    """
    half = draws.shape[1] // 2
    halves = np.concatenate([draws[:, :half], draws[:, -half:]])
    folded = np.abs(halves - np.median(halves))
    return max(_rhat(_rank_normalised(halves)), _rhat(_rank_normalised(folded)))


def _rhat(scores: FloatArray) -> float:
    count = scores.shape[1]
    within = scores.var(axis=1, ddof=1).mean()
    between = count * scores.mean(axis=1).var(ddof=1)
    return float(np.sqrt((count - 1) / count + between / (count * within)))


def mcse_quantile(chains: FloatArray, probability: float) -> float:
    """Monte Carlo standard error of a quantile, in the unit of the draws.

    Half the distance between the quantiles that bound it with one standard error.
    """
    size = _effective_size((chains <= np.quantile(chains, probability)).astype(float))
    first, second = size * probability + 1, size * (1 - probability) + 1
    low, high = np.quantile(chains, betaincinv(first, second, ndtr([-1.0, 1.0])))
    return float((high - low) / 2)


class ConvergenceCriteria:
    """Limits for a set of ensembles.

    - `rhat`: largest rank-normalised split R-hat over ensembles (Vehtari et al., 2021).
    - `times`: smallest number of autocorrelation times in the steps kept (recommended by emcee).
    - `size`: smallest bulk and tail effective sample size: 100 per chain of four.
    - `acceptance`: smallest fraction of accepted moves: below it an ensemble may be stuck.
    """

    rhat = 1.01
    times = 50.0
    size = 400.0
    acceptance = 0.05


@dataclass(frozen=True)
class Summary:
    """The summary of one parameter or consequence, in the unit shown.

    - `name`, `unit`: which, and its unit.
    - `mean`, `deviation`, `low`, `median`, `high`: mean, standard deviation, and the median between
      the bounds of the central 95 %.
    - `mcse`, `mcse_end`: Monte Carlo standard error of the mean, and the larger one of the two
      ends.
    - `rhat`, `bulk`, `tail`, `time`: split R-hat, effective sample sizes, autocorrelation time in
      steps.
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
    """Chains that fail a convergence criterion.

    `missed` lists the failures, the worst first. `taken` is the number of steps kept, and `steps`
    the number that would be enough by the autocorrelation found; None if more steps do not help.
    """

    missed: list[str]
    taken: int
    steps: int | None


def thinned(chains: FloatArray, time: float) -> FloatArray:
    """Draws of each ensemble in time order, thinned by the autocorrelation time, rounded up.

    Shape (ensembles, draws, ...): step by step, all walkers of a step in sequence.
    """
    kept = chains[:, :: max(1, int(np.ceil(time)))]
    return kept.reshape(len(kept), -1, *kept.shape[3:])


def summarised(name: str, unit: str, draws: FloatArray, shown: float = 1.0) -> Summary:
    """Summarise draws of one quantity, (ensembles, steps, walkers), times `shown` in its unit."""
    time, values = autocorrelation_time(draws), draws * shown
    low, median, high = np.quantile(values, (ENDS[0], 0.5, ENDS[1])).tolist()
    return Summary(
        name,
        unit,
        float(values.mean()),
        float(values.std()),
        low,
        median,
        high,
        mcse=float(draws.std() / np.sqrt(draws.size / time)) * shown,
        mcse_end=max(mcse_quantile(values, end) for end in ENDS),
        rhat=_split_rhat(thinned(draws, time)),
        bulk=_effective_size(_rank_normalised(draws)),
        tail=_tail_size(draws),
        time=time,
    )


def require(
    rows: Sequence[Summary],
    steps: int,
    acceptance: Sequence[float],
    times: float = ConvergenceCriteria.times,
) -> None:
    """Raise `UnconvergedError` if a criterion is not met, or a number is not finite."""
    limits = ConvergenceCriteria
    # Sizes and their limits. More steps increase the sizes, and mix ensembles that differ.
    sizes = [("acceptance", min(acceptance), limits.acceptance)]
    missed: list[tuple[float, str]] = []
    for one in rows:
        # NaN fails.
        if not one.rhat <= limits.rhat:
            factor = _MIXING if np.isfinite(one.rhat) else np.inf
            text = f"{one.name}: R-hat {one.rhat:.4f}, at most {limits.rhat:g} allowed"
            missed.append((factor, text))
        times_name = f"{one.name}: autocorrelation times ({one.time:.1f} steps each)"
        sizes += [
            (times_name, steps / one.time, times),
            (f"{one.name}: bulk effective sample size", one.bulk, limits.size),
            (f"{one.name}: tail effective sample size", one.tail, limits.size),
        ]
    for name, size, least in sizes:
        if not size >= least:
            grows = size > 0 and name != "acceptance"
            text = f"{name} {size:.3g}, at least {least:g} required"
            missed.append((least / size if grows else np.inf, text))
    if not missed:
        return
    missed.sort(key=lambda miss: -miss[0])
    factor, worst = missed[0]
    needed, advice = None, "find out what keeps the ensembles from mixing"
    if np.isfinite(factor):
        needed = int(np.ceil(_MARGIN * factor * steps / 100)) * 100
        advice = f"take about {needed} steps"
    more = f" (and {len(missed) - 1} more)" if len(missed) > 1 else ""
    error = UnconvergedError(f"the chains are rejected: {worst}{more}; {advice}")
    error.steps, error.taken = needed, steps
    error.missed = [text for _, text in missed]
    raise error
