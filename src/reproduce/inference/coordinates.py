"""Coordinates in which a posterior is nearly Gaussian: what the moves of an ensemble work in.

Parameters stay as they are declared, in chains, files and summaries. Where one of them sets the
width of others (a noise that ranges over decades, say), proposals are made in coordinates that
take this out; the ratio of volumes in the acceptance keeps the posterior what it is. They depend
on the data alone, never on the ensemble, so the moves stay those of a fixed posterior.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from scipy.special import ndtr, ndtri

from reproduce.physics.validate import FloatArray


class Coordinates(Protocol):
    """A smooth one-to-one map of the parameters; all arrays have one row per vector."""

    def straight(self, parameters: FloatArray) -> FloatArray:
        """Coordinates of parameter vectors, shape (n, d)."""

    def parameters(self, straight: FloatArray) -> FloatArray:
        """Parameter vectors at coordinates, shape (n, d)."""

    def log_volume(self, parameters: FloatArray) -> FloatArray:
        """Log of the determinant of the derivatives of parameters by coordinates, shape (n,)."""


@runtime_checkable
class Straightened(Protocol):
    """A likelihood that knows such coordinates for its data."""

    def coordinates(self) -> Coordinates:
        """Coordinates for the data at hand."""


@runtime_checkable
class Mirrored(Protocol):
    """Coordinates in which the posterior may have two modes, images of each other."""

    def mirrored(self, straight: FloatArray) -> FloatArray:
        """Where the mirror takes them, shape (n, d): once more takes back, volumes are kept."""


class Declared:
    """The parameters themselves: for posteriors that are nearly Gaussian as declared."""

    def straight(self, parameters: FloatArray) -> FloatArray:
        """The same vectors, shape (n, d)."""
        return parameters

    def parameters(self, straight: FloatArray) -> FloatArray:
        """The same vectors, shape (n, d)."""
        return straight

    def log_volume(self, parameters: FloatArray) -> FloatArray:
        """Zeros, shape (n,)."""
        return np.zeros(len(parameters))


def scores(values: FloatArray, ends: tuple[float, float]) -> FloatArray:
    """Normal scores of values between two ends: uniform values become Gaussian.

    Examples
    --------
    >>> scores(np.array([0.5]), (0.0, 1.0))
    array([0.])
    """
    low, high = ends
    return np.asarray(ndtri((values - low) / (high - low)))


def from_scores(found: FloatArray, ends: tuple[float, float]) -> FloatArray:
    """Values between two ends from their normal scores.

    Examples
    --------
    >>> from_scores(np.array([0.0]), (2.0, 4.0))
    array([3.])
    """
    low, high = ends
    return np.asarray(low + (high - low) * ndtr(found))


def log_slope(values: FloatArray, ends: tuple[float, float]) -> FloatArray:
    """Log derivative of values by their normal scores; minus infinity at the ends.

    Examples
    --------
    >>> bool(np.isclose(log_slope(np.array([0.5]), (0.0, 1.0))[0], -0.5 * np.log(2 * np.pi)))
    True
    """
    width = ends[1] - ends[0]
    return np.asarray(np.log(width / np.sqrt(2 * np.pi)) - 0.5 * scores(values, ends) ** 2)


def weighted(
    estimate: FloatArray | float,
    error: FloatArray,
    prior: FloatArray | float,
    spread: FloatArray | float,
) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation of a Gaussian estimate with a Gaussian prior.

    Examples
    --------
    >>> mean, deviation = weighted(1.0, np.array([3.0]), 0.0, 4.0)
    >>> mean.round(2), deviation.round(2)
    (array([0.64]), array([2.4]))
    """
    share = spread**2 / (spread**2 + error**2)
    return np.asarray(share * estimate + (1 - share) * prior), np.asarray(error * np.sqrt(share))
