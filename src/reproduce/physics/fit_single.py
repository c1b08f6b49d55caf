"""One similarity of one set of points, as fast as NumPy lets it be.

The general functions take batches, weights and models, and check as they go; for one set of a
hundred points that costs more than the fit. Here the arithmetic is done on plain complex numbers,
and whatever is unusual is left to the general functions, which also raise the errors.
"""

from __future__ import annotations

import cmath

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.fit_problem import Solution
from reproduce.physics.registration import ROUNDING
from reproduce.physics.validate import FloatArray, number_array


def single_similarity(source: ArrayLike, target: ArrayLike, pivot: FloatArray) -> Solution | None:
    """Return the least-squares similarity of one set of points, or None where a check is due.

    Parameters
    ----------
    source, target : array_like, shape (n, 2)
        The same spots in both images, in px.
    pivot : ndarray, shape (2,)
        In px.

    Returns
    -------
    fit_problem.Solution or None
        Parameters (k, theta, shift x, shift y), residuals, chi-square, cofactor.

    Examples
    --------
    >>> found = single_similarity([[0, 0], [1, 0]], [[3, 0], [5, 0]], np.zeros(2))
    >>> found.parameters + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    rows, landed = _complex("source", source), _complex("target", target)
    if rows is None or landed is None or rows.size != landed.size or pivot.shape != (2,):
        return None
    count = rows.size
    centre = complex(np.add.reduce(rows)) / count
    target_centre = complex(np.add.reduce(landed)) / count
    offsets, targets = rows - centre, landed - target_centre
    spread = float(np.vdot(offsets, offsets).real)
    if not spread > count * ROUNDING**2 * abs(centre) ** 2:
        return None
    factor = complex(np.vdot(offsets, targets)) / spread
    if abs(complex(np.dot(offsets, targets))) > abs(factor) * spread:
        return None  # perhaps a mirror image
    # Products overflow to infinity, where the power of a float would raise an error.
    size = abs(factor) * abs(factor) * spread
    if not count * ROUNDING**2 * abs(target_centre) * abs(target_centre) < size < np.inf:
        return None
    origin = complex(pivot[0], pivot[1])
    shift = factor * (centre - origin) + (origin - target_centre)
    if not cmath.isfinite(shift):
        return None
    left = targets - factor * offsets
    scale, turn = abs(factor), cmath.phase(factor)
    return Solution(
        np.array([scale, turn, shift.real, shift.imag]),
        left[:, None].view(np.float64),
        np.asarray(np.vdot(left, left).real),
        _cofactor(factor / scale * (centre - origin), spread, scale, count),
        rows[:, None].view(np.float64),
    )


def _complex(
    name: str, points: ArrayLike
) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]] | None:
    array = points if isinstance(points, np.ndarray) else number_array(name, points)
    if array.dtype != np.float64 or array.ndim != 2 or array.shape[1] != 2 or len(array) < 2:
        return None
    if not array.flags.c_contiguous:
        return None
    return array.view(np.complex128)[:, 0]


def _cofactor(lever: complex, spread: float, scale: float, count: int) -> FloatArray:
    """Return the inverse normal matrix; `registration.SimilarityFit.cofactor` says why."""
    across, along = lever.real / spread, lever.imag / spread
    variance = 1 / count + abs(lever) ** 2 / spread
    by_scale, by_turn = 1 / spread, 1 / (spread * scale**2)
    return np.array(
        [
            [by_scale, 0.0, across, along],
            [0.0, by_turn, -along / scale, across / scale],
            [across, -along / scale, variance, 0.0],
            [along, across / scale, 0.0, variance],
        ]
    )
