"""From misalignment to metres on the ground: the error budget of SVGF-1, and a year of orbits.

The paper does not print the following values, which are assumed: centimetre orbits are 0.05 m along
each axis, the principal point moves by one panchromatic pixel, a calibration has an error of 0.5
arcsec at each sample, and heat has the effect of `physics.ground.thermal_series`. Angle errors of
the monitoring are the errors of the ground platform.

The paper gives arguments for monitoring, without a comparison. Here four corrections of a thermal
misalignment, and no correction, are applied to one simulated year. The three methods without lasers
have more calibrations than any ground segment.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.random import default_rng

from reproduce.papers.chen2023 import accuracy, platform, satellite
from reproduce.papers.declare import Results, Rows, reproduces, seed_of, studied
from reproduce.physics import ground
from reproduce.physics.attitude import rotation_from_vector
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import RADIANS_PER_ARCSEC

_POINTING = "chen2023/table-1#tracker-pointing-accuracy.value"
_MONITORING = (*platform.INSTRUMENT, "chen2023/table-3#2-*", accuracy.SMOOTHED)
INPUTS = (*_MONITORING, *satellite.CAMERA, _POINTING)
_YEAR_INPUTS = (*_MONITORING, *satellite.CAMERA, accuracy.RATE)
_ORBIT_ERROR_M = 0.05
_SINGLE, _AVERAGED = "one frame", "averaged"
# Views of the satellite: tilt off the nadir in deg, distance of the target from it in m.
LOOKS = ((0.0, 0.0), (0.0, 5e3), (30.0, 0.0))
# Kinds of errors, with their displayed unit.
_UNITS = {
    "satellite": (1.0, "m"),
    "turn": (RADIANS_PER_ARCSEC, "arcsec"),
    "image": (1e-6, "µm"),
}
_CALIBRATION_ERROR = 0.5 * RADIANS_PER_ARCSEC
_SAMPLES_PER_ORBIT = 64
# Long enough to distinguish the trend from slow variations. A week has a far larger error.
_CAMPAIGN_DAYS = 60.0
_YEAR_DAYS = 365.0
# Fraction of the errors below CE90.
_LEVEL = 0.9
# Amplitudes of the columns of the table.
_AMPLITUDES_ARCSEC = (0.5, 2.0, 10.0, 50.0)
UNCORRECTED, *CORRECTIONS = (
    "no correction",
    "one calibration",
    "trend and Fourier series of degree 2, fitted to the campaign",
    "Fourier series of degree 3 over the three last orbits",
    "star–laser monitoring, averaged",
)


@reproduces(
    "chen2023/text-positioning",
    cells=["*-resolution"],
    inputs=["chen2023/table-1#*ground-resolution.value"],
)
def quoted_resolution(inputs: Inputs) -> Results:
    """Return the ground resolutions of Table I, which the introduction quotes."""
    return {
        f"{sensor}-resolution": inputs[
            f"chen2023/table-1#{sensor}-ground-resolution.value"
        ]
        for sensor in ("panchromatic", "multispectral")
    }


def _terms(inputs: Inputs) -> dict[str, tuple[str, FloatArray]]:
    """Return the errors of the imaging model for SVGF-1, by name.

    Each has a kind, ``satellite``, ``turn`` or ``image``, for its derivative, and standard
    deviations along or about X, Y, Z, in metres or radians. The misalignment is given axis by axis,
    for one frame and for the average of many.
    """
    limit = np.full(3, inputs[_POINTING] / platform.SIGMAS)
    terms = {"attitude of the tracker, at its limit": ("turn", limit)}
    for frames, mean in ((1, _SINGLE), (inputs.count(accuracy.SMOOTHED), _AVERAGED)):
        sigmas = np.diag(platform.angle_sigma(inputs, 2, frames))
        for axis, sigma in zip(("X", "Y", "Z (roll)"), sigmas, strict=True):
            terms[f"misalignment about {axis}, {mean}"] = ("turn", sigma)
    terms["orbit"] = ("satellite", np.full(3, _ORBIT_ERROR_M))
    pixel = np.array([1.0, 1.0, 0.0]) * inputs[satellite.CAMERA[1]]
    terms["principal point, one pixel"] = ("image", pixel)
    return terms


def _look(
    inputs: Inputs, tilt: float, off: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return image vector, position and rotation of the satellite at a middle latitude."""
    height, focal = satellite.altitude(inputs), inputs[satellite.CAMERA[0]]
    position = ground.earth_fixed([0.5, 0.8, height])
    flight = np.cross(np.cross(position, [0.0, 0.0, 1.0]), position)
    down = ground.satellite_from_inertial(position, flight).T
    chain = down @ rotation_from_vector([np.radians(tilt), 0.0, 0.0])
    return np.array([[off / height * focal, 0.0, -focal]]), position, chain


def _covariances(inputs: Inputs) -> dict[str, FloatArray]:
    """Return the covariances of east and north of each term, (looks, 2, 2), in square metres.

    The last two are the covariances of all terms, with one frame and with the average of many.
    """
    jacobians = [ground.ground_jacobian(*_look(inputs, *look)) for look in LOOKS]
    positions = np.concatenate([jacobian.position for jacobian in jacobians])
    covariances = {}
    for name, (kind, sigma) in _terms(inputs).items():
        slopes = [getattr(jacobian, f"by_{kind}") for jacobian in jacobians]
        covariances[name] = ground.ground_covariance(
            positions, np.concatenate(slopes), np.diag(sigma**2)
        )
    sums = {}
    for mean, other in ((_SINGLE, _AVERAGED), (_AVERAGED, _SINGLE)):
        parts = [cov for name, cov in covariances.items() if not name.endswith(other)]
        sums[f"all together, {mean}"] = np.sum(parts, axis=0)
    return covariances | sums


def _budget_facts(inputs: Inputs) -> dict[str, float]:
    """Return the altitude of the satellite in kilometres."""
    return {"altitude": satellite.altitude(inputs) / 1e3}


@studied("chen2023/budget", inputs=INPUTS, named=_budget_facts)
def _budget(inputs: Inputs) -> Rows:
    """Compute the error budget of SVGF-1 on the ground, term by term."""
    terms = _terms(inputs)
    for name, covariances in _covariances(inputs).items():
        size, unit = np.nan, ""
        if name in terms:
            kind, sigma = terms[name]
            scale, unit = _UNITS[kind]
            size = sigma.max() / scale
        yield (name, size, unit, *ground.circular_error(covariances))


@lru_cache(maxsize=1)  # a year is large
def _year(height: float, root: int | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the simulated campaign and the year after it at an altitude in metres.

    Times, (samples,), in days, zero at the end of the campaign. Misalignment about X and Y for an
    amplitude of one, (samples, 2). Standard normal numbers for the errors of calibrations and of
    the monitoring, (samples, 2).
    """
    period = float(ground.orbital_period(height))
    orbits = int(np.ceil((_YEAR_DAYS + _CAMPAIGN_DAYS) * ground.DAY_SECONDS / period))
    generator = default_rng(seed_of("chen2023/year", root))
    times, angles = ground.thermal_series(period, _SAMPLES_PER_ORBIT, orbits, generator)
    return times - _CAMPAIGN_DAYS, angles, generator.standard_normal(angles.shape)


def _residuals(inputs: Inputs, amplitude: float) -> dict[str, FloatArray]:
    """Return the residual misalignment of each correction after the campaign.

    Name to errors of shape (samples, 2), in radians.
    """
    times, unit, noise = _year(satellite.altitude(inputs), inputs.root)
    true, known = amplitude * unit, int(np.searchsorted(times, 0.0))
    measured = true + _CALIBRATION_ERROR * noise
    # The lasers give the misalignment half an average late, with its noise.
    count = inputs.count(accuracy.SMOOTHED)
    late = times - 0.5 * count / inputs[accuracy.RATE] / ground.DAY_SECONDS
    delayed = np.stack([np.interp(late, times, angle) for angle in true.T], axis=-1)
    orbits = np.arange(len(times)) / _SAMPLES_PER_ORBIT
    estimates = (
        0.0,
        measured[known - 1],
        ground.trend_and_fourier(times, orbits, measured, known),
        ground.last_orbits(measured, _SAMPLES_PER_ORBIT),
        delayed + platform.angle_sigma(inputs, 2, count)[:2] * noise,
    )
    names = (UNCORRECTED, *CORRECTIONS)
    return {
        name: (true - estimate)[known:]
        for name, estimate in zip(names, estimates, strict=True)
    }


def _campaign_facts(inputs: Inputs) -> dict[str, float]:
    """Return the length of the campaign in days, and the level of the errors in per cent."""
    return {"campaign": _CAMPAIGN_DAYS, "level": 100 * _LEVEL}


@studied("chen2023/strategies", random=True, inputs=_YEAR_INPUTS, named=_campaign_facts)
def _strategies(inputs: Inputs) -> Rows:
    """Compute the positioning error over a year, for four corrections and four amplitudes."""
    height = satellite.altitude(inputs)
    years = [
        _residuals(inputs, amplitude * RADIANS_PER_ARCSEC)
        for amplitude in _AMPLITUDES_ARCSEC
    ]
    for name in (UNCORRECTED, *CORRECTIONS):
        lengths = [np.hypot(*errors[name].T) for errors in years]
        yield (name, *(np.quantile(lengths, _LEVEL, axis=1) * height))
