"""A correction that predicts a thermal misalignment.

Angles are about X and Y of the camera, and rows are samples: series have shape (samples, 2).
"""

from __future__ import annotations

import numpy as np

from reproduce.physics.validate import FloatArray


def trend_and_fourier(
    times: FloatArray,
    phase: FloatArray,
    measured: FloatArray,
    known: int,
    degree: int = 2,
) -> FloatArray:
    """Return the misalignment that a linear trend plus a Fourier series predicts.

    Parameters
    ----------
    times : ndarray, shape (samples,)
        Times, in days.
    phase : ndarray, shape (samples,)
        Times, in orbits.
    measured : ndarray, shape (samples, 2)
        Calibrated misalignment.
    known : int
        Number of samples, from the first, that are fitted.
    degree : int
        Degree of the Fourier series.

    Returns
    -------
    ndarray, shape (samples, 2)
        Fitted function at all times.

    Raises
    ------
    ValueError
        If fewer samples are known than the function has terms.

    Examples
    --------
    >>> t = np.arange(100.0)
    >>> line = np.stack([t, -t], axis=-1)
    >>> np.allclose(trend_and_fourier(t, t / 7, line, 50), line)
    True
    """
    columns = np.hstack([times[:, None], _fourier_columns(phase, degree)])
    if not columns.shape[1] <= known <= len(times):
        raise ValueError(
            f"known: expected from {columns.shape[1]} samples, one for each term of the fit, to "
            f"{len(times)}, got {known}. Calibrate longer or lower the degree"
        )
    fitted = np.linalg.lstsq(columns[:known], measured[:known], rcond=None)[0]
    return columns @ fitted


def _fourier_columns(phase: FloatArray, degree: int) -> FloatArray:
    """Return one, cosines and sines of an orbit's harmonics, shape (n, 2 degree + 1)."""
    order = np.arange(1, degree + 1)
    angle = 2.0 * np.pi * phase[:, None] * order
    return np.hstack([np.ones((len(phase), 1)), np.cos(angle), np.sin(angle)])
