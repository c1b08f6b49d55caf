"""Two modes of a marginal posterior, by Hartigan's dip of its draws.

The dip is the distance between the distribution of the draws and the nearest distribution with one
mode (Hartigan and Hartigan, 1985). The uniform distribution has the largest dips of all
distributions with one mode, so its dips give the limit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import isotonic_regression
from scipy.signal import find_peaks
from scipy.stats import gaussian_kde

from reproduce.physics.validate import FloatArray

# Limit of the dip times the root of the number of draws, which 0.1 % of uniform samples exceed.
MAX_DIP = 0.56
# Draws that are used, and points of the density whose peaks are the modes.
_MAX_DRAWS, _DENSITY_POINTS = 20_000, 512


class Modes(NamedTuple):
    """Two modes, the lower one first, and the fraction of draws on the side of each."""

    low: float
    high: float
    below: float
    above: float


def dip(values: FloatArray) -> float:
    """Return the dip of draws of one quantity.

    The distribution with one mode is convex below the mode and concave above it.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Draws.

    Returns
    -------
    float
        Distance of the distributions, a probability.

    Examples
    --------
    >>> flat = np.linspace(0, 1, 100)
    >>> round(dip(flat), 3), round(dip(np.concatenate([flat, flat + 9])), 3)
    (0.0, 0.22)
    """
    positions, counts = np.unique(values, return_counts=True)
    widths = np.diff(positions)
    slopes = counts[1:] / (counts.sum() * widths)

    def errors(mode: int) -> tuple[float, float]:
        """Return the errors of the convex and of the concave part for a mode."""
        return (
            _monotonic_error(slopes[:mode], widths[:mode]),
            _monotonic_error(slopes[mode:][::-1], widths[mode:][::-1]),
        )

    first, last = 0, len(widths)
    # The error of the convex part grows with its length, and that of the concave part falls.
    while last - first > 1:
        middle = (first + last) // 2
        convex, concave = errors(middle)
        first, last = (first, middle) if convex > concave else (middle, last)
    return 0.5 * min(max(errors(first)), max(errors(last)))


def _monotonic_error(slopes: FloatArray, widths: FloatArray) -> float:
    """Return the largest error of the distribution with the nearest increasing density."""
    if not len(slopes):
        return 0.0
    density = isotonic_regression(slopes, weights=widths).x
    return float(np.abs(np.cumsum((slopes - density) * widths)).max())


def two_modes(values: FloatArray) -> Modes | None:
    """Return the two modes of draws; None for a single mode.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Nearly independent draws.

    Returns
    -------
    Modes or None
        Position and weight of both modes.
    """
    values = values[:: -(-len(values) // _MAX_DRAWS)]
    if not np.ptp(values) or dip(values) * np.sqrt(len(values)) < MAX_DIP:
        return None
    positions = np.linspace(values.min(), values.max(), _DENSITY_POINTS)
    density = np.pad(gaussian_kde(values)(positions), 1)
    peaks, properties = find_peaks(density, prominence=0.0)
    if len(peaks) < 2:
        return None
    first, last = np.sort(peaks[np.argsort(properties["prominences"])[-2:]] - 1)
    valley = positions[first + density[first + 1 : last + 2].argmin()]
    below = float((values < valley).mean())
    return Modes(float(positions[first]), float(positions[last]), below, 1 - below)
