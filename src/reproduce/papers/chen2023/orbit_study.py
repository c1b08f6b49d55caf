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
from reproduce.physics.ground.errors import circular_error
from reproduce.physics.ground.imaging import ground_jacobian
from reproduce.physics.ground.orbits import (
    DAY,
    Thermal,
    last_orbits,
    orbital_period,
    thermal_series,
    trend_and_fourier,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.units import RADIANS_PER_ARCSEC

RATE = "chen2023/text-accuracy#frame-rate"
CALIBRATION = 0.5 * RADIANS_PER_ARCSEC
PER_ORBIT = 64
# Long enough for the trend of (b) to stand out from what wanders; a week makes it far worse.
CAMPAIGN_DAYS = 60.0
YEAR_DAYS = 365.0
AMPLITUDES = (0.5, 2.0, 10.0, 50.0)
AGES = ((0.0, 1.0, "first day"), (6.0, 7.0, "after a week"), (30.0, 31.0, "after a month"))
LAST_DAY = (364.0, 365.0, "after a year")
# The year is looked at every so many samples where only a quantile of all of it is asked for.
STRIDE = 7
# Where the search for the amplitude that a correction still tolerates begins, and its steps.
LARGEST, HALVINGS = 4096.0, 40
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

    Shape (samples,). In days, zero at the end of the campaign. Shape (samples, 2). Misalignment
    about X and Y over the amplitude. Shape (samples, 2). Standard normal numbers for the errors of
    calibrations and of the monitoring.
    """
    period = float(orbital_period(twin_study.altitude(given(twin_study.SATELLITE))))
    orbits = int(np.ceil((YEAR_DAYS + CAMPAIGN_DAYS) * DAY / period))
    generator = default_rng(seed_of("chen2023/year"))
    times, angles = thermal_series(Thermal(1.0), period, PER_ORBIT, orbits, generator)
    return times - CAMPAIGN_DAYS, angles, generator.standard_normal(angles.shape)


def residuals(amplitude: float) -> dict[str, FloatArray]:
    """Return what each correction leaves of the misalignment, from the end of the campaign on.

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


def _ce90(errors: FloatArray, height: float) -> float:
    return float(np.quantile(np.hypot(errors[:, 0], errors[:, 1]), 0.9) * height)


def strategies() -> Study:
    """Positioning error over a year, for four corrections and four thermal amplitudes."""
    height = twin_study.altitude(given(twin_study.SATELLITE))
    found = {amplitude: residuals(amplitude * RADIANS_PER_ARCSEC) for amplitude in AMPLITUDES}
    rows = tuple(
        (name, *(f"{_ce90(found[amplitude][name], height):.2f}" for amplitude in AMPLITUDES))
        for name in NAMES
    )
    head = ("Correction", *(f"{amplitude:g} arcsec" for amplitude in AMPLITUDES))
    caption = (
        f"CE90 on the ground from the thermal misalignment that is left, in metres, over the year "
        f"after a campaign of {CAMPAIGN_DAYS:g} days, by amplitude of the first thermal harmonic."
    )
    return Study(caption, head, rows)


def _spans() -> dict[str, slice]:
    """Return the samples of each age, from the end of the campaign on; last, the whole year."""
    times = year()[0]
    times = times[np.searchsorted(times, 0.0) :]
    ages = {
        name: slice(*(int(i) for i in np.searchsorted(times, (low, high))))
        for low, high, name in (*AGES, LAST_DAY)
    }
    return {**ages, "over the year": slice(0, None, STRIDE)}


def ages() -> Study:
    """Positioning error against the time since calibration, for every thermal amplitude."""
    height = twin_study.altitude(given(twin_study.SATELLITE))
    spans = [_spans()[name] for *_, name in (*AGES, LAST_DAY)]
    found = {amplitude: residuals(amplitude * RADIANS_PER_ARCSEC) for amplitude in AMPLITUDES}
    rows = tuple(
        (
            name,
            f"{amplitude:g}",
            *(f"{_ce90(found[amplitude][name][span], height):.2f}" for span in spans),
        )
        for name in NAMES[1:]
        for amplitude in AMPLITUDES
    )
    caption = "CE90 on the ground by thermal amplitude and age of the calibration, in metres."
    head = ("Correction", "Amplitude (arcsec)", *(name for *_, name in (*AGES, LAST_DAY)))
    return Study(caption, head, rows)


def suffices() -> Study:
    """Up to which thermal amplitude each correction suffices, by age of the calibration."""
    door = given((*twin_study.SATELLITE, *ground_study.READS))
    height = twin_study.altitude(door)
    spans = _spans()
    # Every correction is linear in what is true and in the noise: two runs tell all amplitudes.
    noise, whole = residuals(0.0), residuals(RADIANS_PER_ARCSEC)
    rows = []
    for name in NAMES[1:]:
        for said, limit in _limits(door).items():
            pairs = [
                (whole[name][span] - noise[name][span], noise[name][span])
                for span in spans.values()
            ]
            entries = [largest_amplitude(*pair, limit / height) for pair in pairs]
            rows.append((name, f"{said}, {limit:.2f}", *(_amplitude(one) for one in entries)))
    caption = (
        "Largest amplitude of the first thermal harmonic, in arc seconds, at which CE90 on the "
        "ground stays below a limit; none where noise alone exceeds it."
    )
    return Study(caption, ("Correction", "limit (m)", *spans), tuple(rows))


def _limits(door: Given) -> dict[str, float]:
    """Return errors on the ground that a correction may be asked to keep below, in metres."""
    view = ground_study.look(door, 0.0, 0.0)
    jacobian = ground_jacobian(view.vectors, view.satellite, view.chain)
    attitude = ground_study.analytic(jacobian, ground_study.terms(door)[0])
    return {
        "panchromatic pixel": door[twin_study.SATELLITE[2]],
        "what the tracker itself errs by": float(circular_error(attitude)),
    }


def largest_amplitude(slope: FloatArray, noise: FloatArray, limit: float) -> float:
    """Return the amplitude at which nine tenths of the errors just stay within a limit.

    In the unit of the slope, from 0 to `LARGEST`; not a number if noise alone goes beyond.
    """
    if _ce90(noise, 1.0) > limit:
        return float("nan")
    low, high = 0.0, LARGEST
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        within = _ce90(middle * slope + noise, 1.0) <= limit
        low, high = (middle, high) if within else (low, middle)
    return low


def _amplitude(value: float) -> str:
    return "none" if np.isnan(value) else f"{value:.2g}"
