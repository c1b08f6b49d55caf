"""Thermal misalignment over a year of orbits, and corrections that predict it.

Time is in days, angles are about X and Y of the camera, and rows are samples: series have shape
(samples, 2). The phase of an orbit runs from 0 to 1.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from reproduce.physics import validate
from reproduce.physics.validate import FloatArray

DAY_SECONDS = 86400.0
_YEAR_DAYS = 365.25
# Thermal bending of the camera against the tracker, relative to the first harmonic of the orbit:
# its harmonics; the relative change of their size and the change of their phase with the seasons.
_HARMONICS, _SEASON, _SEASON_PHASE = (1.0, 0.5, 0.25, 0.12, 0.06), 0.3, 0.5
# Standard deviation of a part that no orbit repeats, and its correlation time in days.
_WANDER, _WANDER_DAYS = 0.1, 0.2
# Standard deviation of the drift over a year; jumps per year, and their standard deviation.
_TREND, _JUMPS, _JUMP_SIZE = 0.5, 4.0, 0.5


def thermal_series(
    period: float, per_orbit: int, orbits: int, generator: Generator
) -> tuple[FloatArray, FloatArray]:
    """Return times and misalignment over many orbits, for a first harmonic of amplitude one.

    The harmonics of the orbit change with the seasons. A part that no orbit repeats, a trend and
    a few jumps are added. All scale with the amplitude.

    Parameters
    ----------
    period : float
        Period of the orbit, in seconds.
    per_orbit : int
        Number of evenly spaced samples in an orbit.
    orbits : int
        Number of orbits.
    generator : numpy.random.Generator
        Source of phases, noise and jumps.

    Returns
    -------
    times : ndarray, shape (samples,)
        Times, in days.
    angles : ndarray, shape (samples, 2)
        Misalignment, as fractions of the amplitude.

    Examples
    --------
    >>> times, angles = thermal_series(5676.0, 8, 3, np.random.default_rng(1))
    >>> times.shape, angles.shape
    ((24,), (24, 2))
    """
    steps = validate.whole_number("per_orbit", per_orbit) * validate.whole_number(
        "orbits", orbits
    )
    phase = np.arange(steps) / per_orbit
    times = phase * validate.size("period", period) / DAY_SECONDS
    axes = [_thermal_angle(times, phase, generator) for _ in range(2)]
    return times, np.stack(axes, axis=-1)


def _thermal_angle(
    times: FloatArray, phase: FloatArray, generator: Generator
) -> FloatArray:
    """Return the misalignment about one axis."""
    from scipy.signal import lfilter  # its import takes a second

    year = 2.0 * np.pi * times / _YEAR_DAYS
    *starts, season = generator.uniform(0.0, 2.0 * np.pi, len(_HARMONICS) + 1)
    # The hot part of the orbit changes with the season.
    shift = _SEASON_PHASE * np.sin(year)
    swing = sum(
        size * np.cos(2.0 * np.pi * order * phase + start + shift)
        for order, (size, start) in enumerate(
            zip(_HARMONICS, starts, strict=False), start=1
        )
    )
    angle = (1.0 + _SEASON * np.sin(year + season)) * swing
    angle += generator.normal(0.0, _TREND) * times / _YEAR_DAYS
    # Stationary noise of variance one with an exponential correlation.
    keep = np.exp(-(times[1] - times[0]) / _WANDER_DAYS)
    noise = generator.standard_normal(len(times))
    noise[1:] *= np.sqrt(1.0 - keep**2)
    angle += _WANDER * lfilter([1.0], [1.0, -keep], noise)
    count = generator.poisson(_JUMPS * times[-1] / _YEAR_DAYS)
    moments = generator.uniform(0.0, times[-1], count)
    sizes = generator.normal(0.0, _JUMP_SIZE, count)
    return angle + (times[:, None] >= moments) @ sizes


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


def last_orbits(measured: FloatArray, per_orbit: int, degree: int = 3) -> FloatArray:
    """Return the misalignment that the three orbits before each orbit predict.

    Each orbit is fitted by a Fourier series. The coefficients of the three orbits before are
    extrapolated by a straight line, by least squares.

    Parameters
    ----------
    measured : ndarray, shape (orbits * per_orbit, 2)
        Calibrated misalignment of all orbits.
    per_orbit : int
        Number of samples in an orbit.
    degree : int
        Degree of the Fourier series.

    Returns
    -------
    ndarray, shape (orbits * per_orbit, 2)
        Prediction; NaN for the first three orbits.

    Raises
    ------
    ValueError
        If the last orbit is incomplete.

    Examples
    --------
    The prediction of a periodic misalignment is exact.

    >>> swing = np.tile(np.cos(2 * np.pi * np.arange(16) / 16), 5)
    >>> np.allclose(last_orbits(np.stack([swing, swing], axis=-1), 16)[48:, 0], swing[48:])
    True
    """
    orbits = measured.reshape(-1, per_orbit, 2)
    columns = _fourier_columns(np.arange(per_orbit) / per_orbit, degree)
    fits = np.linalg.pinv(columns) @ orbits
    # The line through values at -3, -2, -1, taken at 0.
    ahead = (-2.0 * fits[:-3] + fits[1:-2] + 4.0 * fits[2:-1]) / 3.0
    predicted = np.full_like(orbits, np.nan)
    predicted[3:] = columns @ ahead
    return predicted.reshape(-1, 2)


def _fourier_columns(phase: FloatArray, degree: int) -> FloatArray:
    """Return one, cosines and sines of an orbit's harmonics, shape (n, 2 degree + 1)."""
    order = np.arange(1, degree + 1)
    angle = 2.0 * np.pi * phase[:, None] * order
    return np.hstack([np.ones((len(phase), 1)), np.cos(angle), np.sin(angle)])
