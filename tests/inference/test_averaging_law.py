"""Table IV under the exact law of its standard deviations, by plain simulation.

A series of white noise of unit size and a drift of r times that size meets the print for some
range of white noises: the prior of that range, averaged over series, is the posterior of r. No law
of the standard deviations is assumed.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from reproduce.inference.models import by_column
from reproduce.inference.quadrature import summed
from reproduce.papers.chen2023.posteriors import COLUMNS
from reproduce.papers.posteriors import posteriors
from reproduce.physics.attitude import moving_average

RATIOS = np.linspace(0, 0.25, 26)
BATCH, BATCHES = 2000, 60
# Digits are taken as this many times as coarse as they are, that more series meet them.
COARSER = 2


def models():
    """Return the model of every column, with coarser digits."""
    found = by_column(posteriors()["frame-averaging"].model())
    return [
        replace(one, likelihood=replace(like, half_unit=COARSER * like.half_unit))
        for one in found
        for like in (one.likelihood,)
    ]


def centred(series, count):
    """Return moving averages about their mean, so scaled that their squares add to a variance."""
    averages = moving_average(series, count)
    off = averages - averages.mean(axis=-1, keepdims=True)
    return off / np.sqrt(off.shape[-1] - 1)


@cache
def posteriors_of_ratio():
    """Return the posterior of the ratio, summed over series, for every column; (4, 26)."""
    columns = models()
    likelihood, generator = columns[0].likelihood, np.random.default_rng(1)
    drift = np.linspace(-1, 1, likelihood.frames)
    drifts = [centred(drift / drift.std(ddof=1), count) for count in likelihood.counts]
    total = np.zeros((len(columns), len(RATIOS)))
    for _ in range(BATCHES):
        series = generator.normal(size=(BATCH, likelihood.frames))
        whites = [centred(series, count) for count in likelihood.counts]
        squares = [(w**2).sum(axis=1) for w in whites]
        mixed = [2 * w @ d for w, d in zip(whites, drifts, strict=True)]
        evens = [d @ d for d in drifts]
        for j, ratio in enumerate(RATIOS):
            parts = zip(squares, mixed, evens, strict=True)
            scatter = np.sqrt([s + ratio * m + ratio**2 * e for s, m, e in parts])
            for i, model in enumerate(columns):
                half, printed = model.likelihood.half_unit, model.likelihood.printed[0]
                low = ((printed - half)[:, None] / scatter).max(axis=0)
                high = ((printed + half)[:, None] / scatter).min(axis=0)
                met = high > low
                single = (low + high)[met] / 2
                white, floor = (one.prior.log_density for one in model.parameters)
                density = np.exp(white(single) + floor(ratio * single))
                # The prior of the floor is that of the ratio times white noise.
                total[i, j] += ((high - low)[met] * density * single).sum()
    return total


@pytest.mark.parametrize("column", COLUMNS)
def test_error_of_the_gaussian_law_of_table_4(column):
    """Mean and upper end of the floor, as the page of the model says: within a twentieth."""
    i = COLUMNS.index(column)
    approximate = summed(models()[i])
    fine = np.linspace(0, RATIOS[-1], 2501)
    shares = np.interp(fine, RATIOS, posteriors_of_ratio()[i])
    shares /= shares.sum()
    floors = fine * approximate.means[0]
    exact = shares @ floors, np.interp(0.975, np.cumsum(shares), floors)
    found = approximate.means[1], approximate.quantile(1, 0.975)
    np.testing.assert_allclose(found, exact, rtol=0.05)
