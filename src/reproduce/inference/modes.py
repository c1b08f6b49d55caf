"""Two modes of a marginal posterior, by Hartigan's dip of its draws.

The dip is the distance between the distribution of the draws and the nearest distribution with one
mode (Hartigan and Hartigan, 1985). Of all of these the uniform has the largest dips. So skewed or
heavy-tailed draws with one mode give a finding no more often than uniform ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import isotonic_regression
from scipy.signal import find_peaks
from scipy.stats import gaussian_kde

from reproduce.physics.validate import FloatArray

# The dip times the root of the number of draws exceeds this in 0.1 % of uniform samples.
LARGEST_DIP = 0.56
# Draws that are used, and points of the density whose peaks are the modes.
_DRAWS, _POINTS = 20_000, 512


class Modes(NamedTuple):
    """Two modes, the lower one first, and the fraction of draws on the side of each."""

    low: float
    high: float
    below: float
    above: float


def dip(values: FloatArray) -> float:
    """Return the dip of draws of one quantity, shape (n,), without the connection at the mode.

    Examples
    --------
    >>> one = np.linspace(0, 1, 100)
    >>> round(dip(one), 3), round(dip(np.concatenate([one, one + 9])), 3)
    (0.0, 0.22)
    """
    places, counts = np.unique(values, return_counts=True)
    widths = np.diff(places)
    slopes = counts[1:] / (counts.sum() * widths)
    first, last = 0, len(widths)
    # The convex part's error grows with its length, and the concave part's error falls.
    while last - first > 1:
        middle = (first + last) // 2
        rising = _error(slopes[:middle], widths[:middle], increasing=True)
        if rising > _error(slopes[middle:], widths[middle:], increasing=False):
            last = middle
        else:
            first = middle
    sides = [
        max(
            _error(slopes[:mode], widths[:mode], increasing=True),
            _error(slopes[mode:], widths[mode:], increasing=False),
        )
        for mode in (first, last)
    ]
    return 0.5 * min(sides)


def _error(slopes: FloatArray, widths: FloatArray, *, increasing: bool) -> float:
    """Return the largest error of the distribution whose density is monotonic."""
    if not len(slopes):
        return 0.0
    density = isotonic_regression(slopes, weights=widths, increasing=increasing).x
    return float(np.abs(np.cumsum((slopes - density) * widths)).max())


def two_modes(values: FloatArray) -> Modes | None:
    """Return the two modes of nearly independent draws, shape (n,); None for a single mode."""
    values = values[:: -(-len(values) // _DRAWS)]
    if not np.ptp(values) or dip(values) * np.sqrt(len(values)) < LARGEST_DIP:
        return None
    places = np.linspace(values.min(), values.max(), _POINTS)
    density = np.pad(gaussian_kde(values)(places), 1)
    peaks, found = find_peaks(density, prominence=0.0)
    if len(peaks) < 2:
        return None
    first, last = np.sort(peaks[np.argsort(found["prominences"])[-2:]] - 1)
    valley = places[first + density[first + 1 : last + 2].argmin()]
    below = float((values < valley).mean())
    return Modes(float(places[first]), float(places[last]), below, 1 - below)
