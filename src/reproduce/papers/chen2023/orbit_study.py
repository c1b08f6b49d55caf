"""A year of orbits: what four ways to correct a thermal misalignment leave on the ground.

The paper argues for monitoring and does not compare. Here all four correct the same simulated
year. `physics.orbits` says how heat bends the camera; a calibration errs by `CALIBRATION` at each
sample; the three methods without lasers are given more of them than any ground segment has.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.random import default_rng

from reproduce.papers.chen2023 import ground_study, twin_study
from reproduce.papers.declare import seed_of
from reproduce.papers.study import Study
from reproduce.physics.orbits import (
    DAY,
    Thermal,
    last_orbits,
    orbital_period,
    thermal_series,
    trend_and_fourier,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given

ARCSEC = ground_study.ARCSEC
RATE = "chen2023/text-accuracy#frame-rate"
CALIBRATION = 0.5 * ARCSEC
PER_ORBIT = 64
# Long enough for the trend of (b) to stand out from what wanders; a week makes it far worse.
CAMPAIGN_DAYS = 60.0
YEAR_DAYS = 365.0
AMPLITUDES = (0.5, 2.0, 10.0, 50.0)
AGES = ((0.0, 1.0, "first day"), (6.0, 7.0, "after a week"), (30.0, 31.0, "after a month"))
LAST_DAY = (364.0, 365.0, "after a year")
AGE_AMPLITUDE = 10.0
NAMES = (
    "no correction",
    "one calibration",
    "trend and Fourier series of degree 2, fitted to the campaign",
    "Fourier series of degree 3 over the three last orbits",
    "star–laser monitoring, averaged",
)


@cache
def year() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Simulate the campaign and the year after it, for a thermal amplitude of one.

    Returns
    -------
    times : ndarray, shape (samples,)
        In days, zero at the end of the campaign.
    angles : ndarray, shape (samples, 2)
        Misalignment about X and Y over the amplitude.
    noise : ndarray, shape (samples, 2)
        Standard normal numbers for the errors of calibrations and of the monitoring.
    """
    period = float(orbital_period(twin_study.altitude(given(twin_study.SATELLITE))))
    orbits = int(np.ceil((YEAR_DAYS + CAMPAIGN_DAYS) * DAY / period))
    generator = default_rng(seed_of("chen2023/year"))
    times, angles = thermal_series(Thermal(1.0), period, PER_ORBIT, orbits, generator)
    return times - CAMPAIGN_DAYS, angles, generator.standard_normal(angles.shape)


def residuals(amplitude: float) -> dict[str, FloatArray]:
    """Return what each correction leaves of the misalignment, from the end of the campaign on.

    Parameters
    ----------
    amplitude : float
        Of the first thermal harmonic, in radians.

    Returns
    -------
    dict
        Name to errors of shape (samples, 2), in radians.
    """
    times, unit, noise = year()
    true = amplitude * unit
    known = int(np.searchsorted(times, 0.0))
    phase = np.arange(len(times)) / PER_ORBIT
    measured = true + CALIBRATION * noise
    corrections = (
        np.zeros_like(true),
        np.broadcast_to(measured[known - 1], true.shape),
        trend_and_fourier(times, phase, measured, known),
        last_orbits(measured, PER_ORBIT),
        _monitored(times, true, noise),
    )
    return {name: (true - found)[known:] for name, found in zip(NAMES, corrections, strict=True)}


def _monitored(times: FloatArray, true: FloatArray, noise: FloatArray) -> FloatArray:
    """Return the misalignment as the lasers give it: half an average late, with its noise."""
    door = given((*ground_study.READS, RATE))
    count = door.count(twin_study.SMOOTHED)
    sigma = ground_study.monitoring_sigma(door, count)[:2]
    late = 0.5 * count / door[RATE] / DAY
    delayed = np.stack(
        [np.interp(times - late, times, true[:, axis]) for axis in range(2)], axis=-1
    )
    return np.asarray(delayed + sigma * noise)


def _ce90(errors: FloatArray, height: float) -> str:
    radius = np.quantile(np.linalg.norm(errors, axis=1), 0.9) * height
    return f"{radius:.2f}"


def strategies() -> Study:
    """Positioning error over a year, for four corrections and four thermal amplitudes.

    Returns
    -------
    Study
        One row per correction; radius on the ground that holds 90 %, in metres.
    """
    height = twin_study.altitude(given(twin_study.SATELLITE))
    found = {amplitude: residuals(amplitude * ARCSEC) for amplitude in AMPLITUDES}
    rows = tuple(
        (name, *(_ce90(found[amplitude][name], height) for amplitude in AMPLITUDES))
        for name in NAMES
    )
    head = ("Correction", *(f"{amplitude:g} arcsec" for amplitude in AMPLITUDES))
    caption = (
        f"CE90 on the ground from the thermal misalignment that is left, in metres, over the year "
        f"after a campaign of {CAMPAIGN_DAYS:g} days, by amplitude of the first thermal harmonic."
    )
    return Study(caption, head, rows)


def ages() -> Study:
    """Positioning error against the time since calibration.

    Returns
    -------
    Study
        One row per correction; radius on the ground that holds 90 %, in metres.
    """
    height = twin_study.altitude(given(twin_study.SATELLITE))
    times = year()[0]
    times = times[np.searchsorted(times, 0.0) :]
    found = residuals(AGE_AMPLITUDE * ARCSEC)
    spans = (*AGES, LAST_DAY)
    rows = []
    for name in NAMES:
        chosen = [found[name][(times >= low) & (times < high)] for low, high, _ in spans]
        rows.append((name, *(_ce90(errors, height) for errors in chosen)))
    caption = (
        f"CE90 on the ground by age of the calibration, in metres, for a thermal amplitude of "
        f"{AGE_AMPLITUDE:g} arcsec."
    )
    return Study(caption, ("Correction", *(name for _, _, name in spans)), tuple(rows))
