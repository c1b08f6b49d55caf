"""From misalignment to metres on the ground: the error budget of SVGF-1, and a year of orbits.

The assumptions, which no paper prints: centimetre orbits are 0.05 m along each axis, the principal
point moves by one panchromatic pixel, a calibration has an error of 0.5 arcsec at each sample, and
heat behaves as in `physics.ground.thermal_series`. Angle errors of the monitoring are those of the
ground platform.

The paper argues for monitoring and does not compare. Here four corrections of a thermal
misalignment, and no correction, get the same simulated year. The three methods without lasers get
more calibrations than any ground segment has.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import default_rng

from reproduce.papers.chen2023 import accuracy, platform, satellite
from reproduce.papers.declare import (
    Column,
    Results,
    reproduces,
    seed_of,
    studied,
)
from reproduce.physics import ground
from reproduce.physics.attitude import rotation_from_vector
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd


_POINTING = f"{satellite.SATELLITE}#tracker-pointing-accuracy.value"
_MONITORING = (*platform.INSTRUMENT, f"{platform.SCATTER}#2-*", accuracy.SMOOTHED)
READS = (*_MONITORING, *satellite.CAMERA, _POINTING)
_YEAR_READS = (*_MONITORING, *satellite.CAMERA, accuracy.RATE)
_ORBIT_ERROR_M = 0.05
_SINGLE, _AVERAGED = "one frame", "averaged"
# Views of the satellite: name, tilt off the nadir in deg, distance of the target from it in m.
LOOKS = (
    ("nadir, centre", 0.0, 0.0),
    ("nadir, 5 km off", 0.0, 5e3),
    ("30° aside, centre", 30.0, 0.0),
)
# Kinds of errors, with their displayed unit.
_UNITS = {
    "satellite": (1.0, "m"),
    "turn": (RADIANS_PER_ARCSEC, "arcsec"),
    "image": (1e-6, "µm"),
}
_CALIBRATION_ERROR = 0.5 * RADIANS_PER_ARCSEC
_SAMPLES_PER_ORBIT = 64
# Long enough for the trend to stand out from what wanders; a week makes it far worse.
_CAMPAIGN_DAYS = 60.0
_YEAR_DAYS = 365.0
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
    inputs=[f"{satellite.SATELLITE}#*ground-resolution.value"],
)
def quoted_resolution(inputs: Inputs) -> Results:
    """Ground resolutions of Table I, quoted again in the introduction."""
    return {
        f"{sensor}-resolution": inputs[
            f"{satellite.SATELLITE}#{sensor}-ground-resolution.value"
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
    """Set the satellite up over a place of middle latitude.

    Image vector, place and rotation chain, as the imaging model takes them.
    """
    height, focal = satellite.altitude(inputs), inputs[satellite.CAMERA[0]]
    place = ground.earth_fixed([0.5, 0.8, height])
    flight = np.cross(np.cross(place, [0.0, 0.0, 1.0]), place)
    down = ground.satellite_from_inertial(place, flight).T
    chain = down @ rotation_from_vector([np.radians(tilt), 0.0, 0.0])
    return np.array([[off / height * focal, 0.0, -focal]]), place, chain


def _covariances(inputs: Inputs) -> dict[str, FloatArray]:
    """Return the covariances of east and north of each term, (looks, 2, 2), in square metres.

    The last two are of all terms, with one frame and with the average of many.
    """
    jacobians = [
        ground.ground_jacobian(*_look(inputs, tilt, off)) for _, tilt, off in LOOKS
    ]
    places = np.concatenate([one.position for one in jacobians])
    found = {}
    for name, (kind, sigma) in _terms(inputs).items():
        slopes = np.concatenate([getattr(one, f"by_{kind}") for one in jacobians])
        found[name] = ground.ground_covariance(places, slopes, np.diag(sigma**2))
    together = {
        f"all together, {mean}": np.sum(
            [one for name, one in found.items() if not name.endswith(other)], axis=0
        )
        for mean, other in ((_SINGLE, _AVERAGED), (_AVERAGED, _SINGLE))
    }
    return found | together


@studied("chen2023/budget", inputs=READS)
def _budget(inputs: Inputs) -> pd.DataFrame:
    """Error budget of SVGF-1 on the ground, term by term."""
    terms, rows = _terms(inputs), []
    for name, covariances in _covariances(inputs).items():
        size, unit = np.nan, ""
        if name in terms:
            kind, sigma = terms[name]
            scale, unit = _UNITS[kind]
            size = sigma.max() / scale
        rows.append((name, size, unit, *ground.circular_error(covariances).tolist()))
    return _budget.frame(rows, altitude=satellite.altitude(inputs) / 1e3)


@lru_cache(maxsize=1)  # a year is large
def _year(height: float, root: int | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Simulate the campaign and the year after it at an altitude, for a thermal amplitude of one.

    Shape (samples,). In days, zero at the end of the campaign. Shape (samples, 2). Misalignment
    about X and Y over the amplitude. Shape (samples, 2). Standard normal numbers for the errors of
    calibrations and of the monitoring.
    """
    period = float(ground.orbital_period(height))
    orbits = int(np.ceil((_YEAR_DAYS + _CAMPAIGN_DAYS) * ground.DAY_SECONDS / period))
    generator = default_rng(seed_of("chen2023/year", root))
    times, angles = ground.thermal_series(period, _SAMPLES_PER_ORBIT, orbits, generator)
    return times - _CAMPAIGN_DAYS, angles, generator.standard_normal(angles.shape)


def _residuals(inputs: Inputs, amplitude: float) -> dict[str, FloatArray]:
    """Return the residual misalignment of each correction, from the end of the campaign on.

    Name to errors of shape (samples, 2), in radians.
    """
    times, unit, noise = _year(satellite.altitude(inputs), inputs.root)
    true, known = amplitude * unit, int(np.searchsorted(times, 0.0))
    measured = true + _CALIBRATION_ERROR * noise
    # The lasers give the misalignment half an average late, with its noise.
    count = inputs.count(accuracy.SMOOTHED)
    late = times - 0.5 * count / inputs[accuracy.RATE] / ground.DAY_SECONDS
    delayed = np.stack([np.interp(late, times, angle) for angle in true.T], axis=-1)
    estimates = (
        np.zeros_like(true),
        measured[known - 1],
        ground.trend_and_fourier(
            times, np.arange(len(times)) / _SAMPLES_PER_ORBIT, measured, known
        ),
        ground.last_orbits(measured, _SAMPLES_PER_ORBIT),
        delayed + platform.angle_sigma(inputs, 2, count)[:2] * noise,
    )
    names = (UNCORRECTED, *CORRECTIONS)
    return {
        name: (true - found)[known:]
        for name, found in zip(names, estimates, strict=True)
    }


@studied(
    "chen2023/strategies",
    random=True,
    inputs=_YEAR_READS,
    columns=(
        Column("Correction"),
        *(
            Column(f"at {amplitude:g} arcsec (m)", ".2f")
            for amplitude in _AMPLITUDES_ARCSEC
        ),
    ),
    caption="CE90 on the ground from the thermal misalignment that is left, over the year after "
    f"a campaign of {_CAMPAIGN_DAYS:g} days, by amplitude of the first thermal harmonic.",
)
def _strategies(inputs: Inputs) -> Iterator[tuple[str | float, ...]]:
    """Positioning error over a year, for four corrections and four thermal amplitudes."""
    height = satellite.altitude(inputs)
    left = [
        _residuals(inputs, amplitude * RADIANS_PER_ARCSEC)
        for amplitude in _AMPLITUDES_ARCSEC
    ]
    for name in (UNCORRECTED, *CORRECTIONS):
        lengths = [np.hypot(*errors[name].T) for errors in left]
        yield (name, *(np.quantile(lengths, 0.9, axis=1) * height))
