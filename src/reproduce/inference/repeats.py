"""The published numbers in a posterior: would a repeat of the experiment print the same digits?

Parameters are drawn from the posterior, the experiment is simulated with them, and what the paper
prints is computed from the simulated data in the paper's way and rounded as in print.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from reproduce.inference.checks import Range, Share, tail_share
from reproduce.inference.posterior import Posterior
from reproduce.physics.validate import FloatArray

REPLICATES = 4000


@dataclass(frozen=True, eq=False)
class Published:
    """What a paper prints of an experiment, and how a repeat of it is simulated.

    Parameters
    ----------
    names, units : tuple of str
        Of the m printed numbers.
    texts : tuple of str
        Their digits.
    printed, half_units : ndarray, shape (m,)
        The numbers and half their last digits, in SI units or px.
    shown : ndarray, shape (m,)
        How many units of print one SI unit is.
    repeat : callable
        Gives the numbers of a repeat before rounding, shape (n, m), of parameter vectors of shape
        (n, d) and a generator.
    parameters : tuple of str
        The parameter that each number estimates, or an empty word.
    whole : callable, optional
        Log probability that a repeat prints all the same digits at once, shape (n,), of parameter
        vectors, where the likelihood knows it; else it is counted.
    note : str
        What the comparison cannot show, where the printed numbers made the data or are the data.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    texts: tuple[str, ...]
    printed: FloatArray
    half_units: FloatArray
    shown: FloatArray
    repeat: Callable[[FloatArray, Generator], FloatArray]
    parameters: tuple[str, ...]
    whole: Callable[[FloatArray], FloatArray] | None = None
    note: str = ""


@dataclass(frozen=True)
class Repeat:
    """One printed number among those of repeats.

    Parameters
    ----------
    name, unit : str
        Which, and the unit of print.
    printed : str
        The printed digits.
    range : Range
        The central 95 % of repeats.
    tail : Share
        Two-sided tail probability of the printed number among the rounded ones of repeats.
    same : Share
        Probability that a repeat prints the same digits.
    estimated : Share, optional
        Two-sided tail probability in the posterior of the parameter that the number estimates.
    """

    name: str
    unit: str
    printed: str
    range: Range
    tail: Share
    same: Share
    estimated: Share | None


def repeats(
    posterior: Posterior, published: Published, replicates: int = REPLICATES
) -> tuple[list[Repeat], Share]:
    """Simulate repeats of the experiment under the posterior and compare their digits.

    Parameters
    ----------
    posterior : Posterior
        Draws.
    published : Published
        What is printed.
    replicates : int
        How many repeats.

    Returns
    -------
    list of Repeat
        One for each printed number.
    Share
        Probability that a repeat prints all of them alike, at once.
    """
    draws = posterior.draws
    chosen = draws[np.linspace(0, len(draws) - 1, min(replicates, len(draws))).astype(int)]
    generator = Generator(PCG64(SeedSequence(posterior.seed, spawn_key=(98,))))
    found = published.repeat(chosen, generator)
    same = same_digits(found, published)
    together = same.all(axis=1).astype(float)
    if published.whole is not None:
        together = np.exp(published.whole(chosen))
    rows = [_row(posterior, published, found[:, i], same[:, i], i) for i in range(found.shape[1])]
    return rows, Share.of(together)


def _row(
    posterior: Posterior, published: Published, found: FloatArray, same: FloatArray, i: int
) -> Repeat:
    unit, printed = 2 * published.half_units[i], float(published.printed[i])
    name, estimated = published.parameters[i], None
    if name:
        column = posterior.draws[:, posterior.model.names.index(name)]
        estimated = tail_share(column, printed)
    return Repeat(
        published.names[i],
        published.units[i],
        published.texts[i],
        Range.of(found).scaled(published.shown[i]),
        tail_share(np.round(found / unit), float(np.round(printed / unit))),
        Share.of(same.astype(float)),
        estimated,
    )


def same_digits(found: FloatArray, published: Published) -> FloatArray:
    """Tell which numbers of repeats, shape (n, m), round to the printed digits."""
    # Numbers that come rounded lie in the middle of the interval, so its ends do not matter.
    return np.asarray(np.abs(found - published.printed) <= published.half_units)
