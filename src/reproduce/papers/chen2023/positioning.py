"""From misalignment to metres on the ground: the error budget of SVGF-1, and a year of orbits.

What no paper prints and we choose, here and nowhere else: centimetre orbits are 0.05 m along each
axis, the principal point moves by one panchromatic pixel, a calibration errs by half an arc second
at each sample, and heat behaves as in `physics.ground.thermal_series`. Angle errors of the
monitoring are those of the ground platform.

The paper argues for monitoring and does not compare. Here four ways to correct a thermal
misalignment, and none, get the same simulated year; the three methods without lasers are given more
calibrations than any ground segment has.
"""

from __future__ import annotations

from dataclasses import dataclass
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
from reproduce.printed.given import Given
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    import pandas as pd


_POINTING = f"{satellite.SATELLITE}#tracker-pointing-accuracy.value"
_MONITORING = (*platform.INSTRUMENT, f"{platform.SCATTER}#2-*", accuracy.SMOOTHED)
READS = (*_MONITORING, *satellite.CAMERA, _POINTING)
_YEAR_READS = (*_MONITORING, *satellite.CAMERA, accuracy.RATE)
_ORBIT = 0.05
_SINGLE, _AVERAGED = "one frame", "averaged"
# Where the satellite stands and how it looks: name, tilt off the nadir, image point off the centre.
LOOKS = (
    ("nadir, centre", 0.0, 0.0),
    ("nadir, 5 km off", 0.0, 5e3),
    ("30° aside, centre", 30.0, 0.0),
)
# What an error goes through, and the unit in which it is written.
_UNITS = {
    "satellite": (1.0, "m"),
    "turn": (RADIANS_PER_ARCSEC, "arcsec"),
    "image": (1e-6, "µm"),
}
_CALIBRATION = 0.5 * RADIANS_PER_ARCSEC
_PER_ORBIT = 64
# Long enough for the trend to stand out from what wanders; a week makes it far worse.
_CAMPAIGN_DAYS = 60.0
_YEAR_DAYS = 365.0
_AMPLITUDES = (0.5, 2.0, 10.0, 50.0)
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
    given=[f"{satellite.SATELLITE}#*ground-resolution.value"],
)
def quoted_resolution(given: Given) -> Results:
    """Ground resolutions of Table I, quoted again in the introduction."""
    return {
        f"{sensor}-resolution": given[
            f"{satellite.SATELLITE}#{sensor}-ground-resolution.value"
        ]
        for sensor in ("panchromatic", "multispectral")
    }


@dataclass(frozen=True, eq=False)
class _Term:
    """One error of the imaging model.

    Attributes
    ----------
    name : str
        What errs.
    kind : str
        ``satellite``, ``turn`` or ``image``: which derivative it goes through.
    sigma : ndarray, shape (3,)
        Standard deviations along or about X, Y, Z, in metres or radians.
    """

    name: str
    kind: str
    sigma: FloatArray


def _terms(given: Given) -> tuple[_Term, ...]:
    """Return the errors of the imaging model for SVGF-1.

    The misalignment axis by axis, for one frame and for the average of many.
    """
    attitude = np.full(3, given[_POINTING] / platform.SIGMAS)
    turns = (
        _Term(f"misalignment about {axis}, {mean}", "turn", sigma * unit)
        for frames, mean in ((1, _SINGLE), (given.count(accuracy.SMOOTHED), _AVERAGED))
        for sigma in [platform.angle_sigma(given, 2, frames)]
        for axis, unit in zip(("X", "Y", "Z (roll)"), np.eye(3), strict=True)
    )
    pixel = np.array([1.0, 1.0, 0.0]) * given[satellite.CAMERA[1]]
    return (
        _Term("attitude of the tracker, at its limit", "turn", attitude),
        *turns,
        _Term("orbit", "satellite", np.full(3, _ORBIT)),
        _Term("principal point, one pixel", "image", pixel),
    )


def _together(given: Given) -> dict[str, tuple[_Term, ...]]:
    """Return the whole budget twice: monitoring with one frame, and with the average of many."""
    return {
        f"all together, {mean}": tuple(
            t for t in _terms(given) if not t.name.endswith(other)
        )
        for mean, other in ((_SINGLE, _AVERAGED), (_AVERAGED, _SINGLE))
    }


def _look(
    given: Given, tilt: float, off: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Set the satellite up over a place of middle latitude.

    Image vector, place and rotation chain, as the imaging model takes them.
    """
    height, focal = satellite.altitude(given), given[satellite.CAMERA[0]]
    place = ground.earth_fixed([0.5, 0.8, height])
    flight = np.cross(np.cross(place, [0.0, 0.0, 1.0]), place)
    down = ground.satellite_from_inertial(place, flight).T
    chain = down @ rotation_from_vector([np.radians(tilt), 0.0, 0.0])
    return np.array([[off / height * focal, 0.0, -focal]]), place, chain


def _analytic(jacobian: ground.GroundJacobian, term: _Term) -> FloatArray:
    """Return the covariance of east and north that a term causes, in square metres."""
    slopes = getattr(jacobian, f"by_{term.kind}")
    return np.asarray(
        ground.ground_covariance(jacobian.position, slopes, np.diag(term.sigma**2))[0]
    )


@studied("chen2023/budget", given=READS)
def _budget(given: Given) -> pd.DataFrame:
    """Error budget of SVGF-1 on the ground, term by term."""
    jacobians = [
        ground.ground_jacobian(*_look(given, tilt, off)) for _, tilt, off in LOOKS
    ]
    rows = []
    for name, errors in (
        {term.name: (term,) for term in _terms(given)} | _together(given)
    ).items():
        scale, unit = _UNITS[errors[0].kind] if len(errors) == 1 else (np.nan, "")
        exact = (sum(_analytic(one, error) for error in errors) for one in jacobians)
        radii = (
            float(ground.circular_error(np.asarray(covariance))) for covariance in exact
        )
        rows.append((name, errors[0].sigma.max() / scale, unit, *radii))
    return _budget.frame(rows, altitude=satellite.altitude(given) / 1e3)


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
    times, angles = ground.thermal_series(period, _PER_ORBIT, orbits, generator)
    return times - _CAMPAIGN_DAYS, angles, generator.standard_normal(angles.shape)


def _residuals(given: Given, amplitude: float) -> dict[str, FloatArray]:
    """Return what each correction leaves of the misalignment, from the end of the campaign on.

    Name to errors of shape (samples, 2), in radians.
    """
    times, unit, noise = _year(satellite.altitude(given), given.root)
    true, known = amplitude * unit, int(np.searchsorted(times, 0.0))
    measured = true + _CALIBRATION * noise
    # The lasers give the misalignment half an average late, with its noise.
    count = given.count(accuracy.SMOOTHED)
    late = times - 0.5 * count / given[accuracy.RATE] / ground.DAY_SECONDS
    delayed = np.stack([np.interp(late, times, angle) for angle in true.T], axis=-1)
    estimates = (
        np.zeros_like(true),
        measured[known - 1],
        ground.trend_and_fourier(
            times, np.arange(len(times)) / _PER_ORBIT, measured, known
        ),
        ground.last_orbits(measured, _PER_ORBIT),
        delayed + platform.angle_sigma(given, 2, count)[:2] * noise,
    )
    names = (UNCORRECTED, *CORRECTIONS)
    return {
        name: (true - found)[known:]
        for name, found in zip(names, estimates, strict=True)
    }


@studied(
    "chen2023/strategies",
    random=True,
    given=_YEAR_READS,
    columns=(
        Column("Correction"),
        *(Column(f"at {amplitude:g} arcsec (m)", ".2f") for amplitude in _AMPLITUDES),
    ),
    caption="CE90 on the ground from the thermal misalignment that is left, over the year after "
    f"a campaign of {_CAMPAIGN_DAYS:g} days, by amplitude of the first thermal harmonic.",
)
def _strategies(given: Given) -> list[tuple[str | float, ...]]:
    """Positioning error over a year, for four corrections and four thermal amplitudes."""
    height = satellite.altitude(given)
    left = [
        _residuals(given, amplitude * RADIANS_PER_ARCSEC) for amplitude in _AMPLITUDES
    ]
    lengths = {name: [np.hypot(*errors[name].T) for errors in left] for name in left[0]}
    return [
        (name, *(np.quantile(lengths[name], 0.9, axis=1) * height)) for name in lengths
    ]
