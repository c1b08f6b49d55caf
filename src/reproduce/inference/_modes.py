"""Two modes of a marginal posterior: two peaks of the density of its draws, and a valley."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import find_peaks
from scipy.stats import gaussian_kde

from reproduce.physics.validate import FloatArray

# Largest density in the valley, as a fraction of the lower peak, and smallest fraction of the draws
# on each side of it.
_MAX_VALLEY, _MIN_FRACTION = 0.6, 0.03
# Draws that are used, and points of the density.
_MAX_DRAWS, _DENSITY_POINTS = 5_000, 512


class Modes(NamedTuple):
    """Two modes, the lower one first, and the fraction of draws on the side of each."""

    low: float
    high: float
    below: float
    above: float


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

    Examples
    --------
    >>> near = np.linspace(0, 1, 100)
    >>> two_modes(near), two_modes(np.concatenate([near, near + 9])).below
    (None, 0.5)
    """
    values = values[:: -(-len(values) // _MAX_DRAWS)]
    if not np.ptp(values):
        return None
    positions = np.linspace(values.min(), values.max(), _DENSITY_POINTS)
    density = np.pad(gaussian_kde(values)(positions), 1)
    peaks, properties = find_peaks(density, prominence=0.0)
    peaks = np.sort(peaks[np.argsort(properties["prominences"])[-2:]])
    first, last = peaks[0], peaks[-1]
    valley = first + density[first : last + 1].argmin()
    below = float((values < positions[valley - 1]).mean())
    is_deep = density[valley] < _MAX_VALLEY * min(density[first], density[last])
    if not is_deep or min(below, 1 - below) < _MIN_FRACTION:
        return None
    low, high = positions[[first - 1, last - 1]].tolist()
    return Modes(low, high, below, 1 - below)
