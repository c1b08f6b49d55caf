"""From the stars to the turning Earth, and a year of thermal misalignment on an orbit.

The inertial frame is the celestial one of the IAU (GCRS), in which star catalogues are given; the
J2000 frame of mean equator and equinox differs from it by two hundredths of an arc second. The
Earth-fixed frame is the terrestrial one (ITRS), which WGS84 follows to centimetres. The models
are those of IAU 2006/2000A, computed by pyerfa. What no model foretells, the length of the day
and the wandering of the pole, is an argument; nothing is downloaded. Lengths are in metres, angles
in radians.

Of the thermal misalignment, time is in days, angles are about X and Y of the camera, rows are
samples: series have shape (samples, 2). The phase of an orbit runs from 0 to 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import erfa
import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.attitude.rotations import _unit
from reproduce.physics.validate import Direction, FloatArray, Positive, Size

# Beyond these, in seconds and radians, Earth orientation is in another unit: IERS prints UT1 - UTC
# in seconds, below 0.9, and the pole in seconds of arc.
_LARGEST_UT1_UTC, _LARGEST_POLE = 1.0, 1e-4
# Gravitational constant of the Earth, m^3/s^2 (WGS84).
_EARTH_GM = 3.986004418e14
DAY = 86400.0
_YEAR_DAYS = 365.25
# How heat bends the camera against the tracker, relative to the first harmonic of the orbit: its
# harmonics; the share by which a year raises and lowers them; the standard deviation of what
# repeats with no orbit, and the days over which it forgets itself; the standard deviation of the
# drift over a year; jumps per year, and their standard deviation.
_HARMONICS, _SEASON = (1.0, 0.5, 0.25, 0.12, 0.06), 0.3
_WANDER, _WANDER_DAYS = 0.1, 0.2
_TREND, _JUMPS, _JUMP = 0.5, 4.0, 0.5


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid of revolution about the polar axis.

    Attributes
    ----------
    equatorial_radius : float, in metres
    flattening : float
        (equatorial - polar radius) / equatorial radius.
    """

    equatorial_radius: float
    flattening: float

    @property
    def axes(self) -> FloatArray:
        """The semi-axes along X, Y and Z (towards the poles), shape (3,), in metres."""
        return self.equatorial_radius * np.array([1.0, 1.0, 1.0 - self.flattening])


# Defining constants of the World Geodetic System 1984 (NGA.STND.0036).
WGS84 = Ellipsoid(equatorial_radius=6378137.0, flattening=1.0 / 298.257223563)


def earth_from_inertial(
    utc: ArrayLike,
    ut1_utc: float,
    pole: tuple[float, float] = (0.0, 0.0),
    celestial_pole: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """Return the rotation from the celestial frame into the Earth-fixed one.

    What observation adds to the models is held constant over all times.

    Parameters
    ----------
    utc : array_like of datetime64 or ISO strings, shape (...)
        Times in UTC.
    ut1_utc : float
        UT1 - UTC, in seconds.
    pole : (float, float)
        Polar motion x_p, y_p, in radians.
    celestial_pole : (float, float)
        Offsets dX, dY of the celestial pole from IAU 2006/2000A, in radians.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        R_J2000^WGS84 of the imaging model (1), from the frame of star catalogues.

    Examples
    --------
    A day later the Earth has turned by a little more than once.

    >>> frames = earth_from_inertial(["2020-01-01", "2020-01-02"], -0.18)
    >>> turn = frames[1] @ frames[0].T
    >>> round(float(np.degrees(np.arctan2(turn[0, 1], turn[0, 0]))), 2)
    0.99
    """
    largest = np.abs([*pole, *celestial_pole]).max()
    if not (abs(ut1_utc) <= _LARGEST_UT1_UTC and largest <= _LARGEST_POLE):
        raise ValueError(
            f"expected ut1_utc up to {_LARGEST_UT1_UTC:g} s and poles up to {_LARGEST_POLE:g} rad, "
            f"got {ut1_utc:g} and {largest:g}; are they in milliseconds, or in seconds of arc?"
        )
    first, second = _julian(utc)
    tt = erfa.taitt(*erfa.utctai(first, second))
    x, y, s = erfa.xys06a(*tt)
    intermediate = erfa.c2ixys(x + celestial_pole[0], y + celestial_pole[1], s)
    rotation = erfa.era00(*erfa.utcut1(first, second, ut1_utc))
    return erfa.c2tcio(intermediate, rotation, erfa.pom00(*pole, erfa.sp00(*tt)))


def _julian(utc: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the two parts of the quasi-Julian date that the ERFA functions take for UTC."""
    times = np.asarray(utc, dtype="datetime64[us]")
    days, months, years = (times.astype(f"datetime64[{unit}]") for unit in "DMY")
    seconds = (times - days) / np.timedelta64(1, "s")
    minutes = np.floor(seconds / 60).astype(np.int64)
    calendar = (
        years.astype(np.int64) + 1970,
        months.astype(np.int64) % 12 + 1,
        (days - months).astype(np.int64) + 1,
    )
    clock = minutes // 60, minutes % 60, seconds - 60.0 * minutes
    first, second = erfa.dtf2d("UTC", *calendar, *clock)
    return first, second


@validate.checked
def earth_fixed(coordinates: Direction, ellipsoid: Ellipsoid = WGS84) -> FloatArray:
    """Return Earth-fixed positions of longitude, latitude and height.

    Parameters
    ----------
    coordinates : array_like, shape (..., 3)
        Longitude and geodetic latitude (within pi/2) in radians, height above the ellipsoid in
        metres.
    ellipsoid : Ellipsoid

    Returns
    -------
    ndarray, shape (..., 3), in metres

    Examples
    --------
    >>> earth_fixed([0.0, 0.0, 500.0]).round(3)
    array([6378637.,       0.,       0.])
    """
    if (np.abs(coordinates[..., 1]) > np.pi / 2 + 1e-12).any():
        raise ValueError(
            "coordinates: expected latitudes from -pi/2 to pi/2 in the second column, got "
            f"{np.abs(coordinates[..., 1]).max():g}; angles are in radians, longitude first"
        )
    return erfa.gd2gce(
        ellipsoid.equatorial_radius,
        ellipsoid.flattening,
        *np.moveaxis(coordinates, -1, 0),
    )


@validate.checked
def local_axes(positions: Direction) -> FloatArray:
    """Return the rotation from Earth-fixed axes to east, north and up at given places.

    Parameters
    ----------
    positions : array_like, shape (..., 3)
        Earth-fixed, in metres; up is the normal of WGS84.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        local_from_earth; its rows are east, north and up.

    Examples
    --------
    On the equator at zero longitude: east is Y, north is Z, up is X.

    >>> local_axes([6378137.0, 0.0, 0.0]).round(12) + 0.0
    array([[0., 1., 0.],
           [0., 0., 1.],
           [1., 0., 0.]])
    """
    longitude, latitude, _ = erfa.gc2gde(
        WGS84.equatorial_radius, WGS84.flattening, positions
    )
    (se, ce), (sn, cn) = ((np.sin(one), np.cos(one)) for one in (longitude, latitude))
    east = np.stack([-se, ce, np.zeros_like(se)], axis=-1)
    up = np.stack([cn * ce, cn * se, sn], axis=-1)
    return np.stack([east, np.cross(up, east), up], axis=-2)


@validate.checked
def satellite_from_inertial(position: Direction, velocity: Direction) -> FloatArray:
    """Return the rotation into the orbit's own axes: X along the flight, Z to the Earth's centre.

    Parameters
    ----------
    position, velocity : array_like, shape (..., 3)
        Of the satellite, in one inertial frame, in any unit.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        satellite_from_inertial; Y is against the orbit's normal.

    Raises
    ------
    ValueError
        If the satellite falls straight down, which leaves no velocity across the radius.

    Examples
    --------
    >>> satellite_from_inertial([1.0, 0, 0], [0, 1.0, 0])
    array([[ 0.,  1.,  0.],
           [-0., -0., -1.],
           [-1., -0., -0.]])
    """
    down, side = (
        -_unit("position", position),
        -_unit("velocity", np.cross(position, velocity)),
    )
    return np.stack([np.cross(side, down), side, down], axis=-2)


@validate.checked
def orbital_period(altitude: Positive) -> FloatArray:
    """Return the period of a circular orbit.

    Parameters
    ----------
    altitude : array_like
        Above the equatorial radius, in metres.

    Returns
    -------
    ndarray, in seconds

    Examples
    --------
    A geostationary satellite needs a sidereal day.

    >>> round(float(orbital_period(35786e3)) / 3600, 2)
    23.93
    """
    radius = WGS84.equatorial_radius + altitude
    return np.asarray(2.0 * np.pi * np.sqrt(radius**3 / _EARTH_GM))


@validate.checked
def thermal_series(
    period: Size, per_orbit: int, orbits: int, generator: Generator
) -> tuple[FloatArray, FloatArray]:
    """Return times and misalignment over many orbits, for a first harmonic of amplitude one.

    The orbit's harmonics swing with the seasons; a wander that repeats with no orbit, a trend and a
    few jumps are added. All scale with the amplitude.

    Parameters
    ----------
    period : float, of the orbit, in seconds
    per_orbit : int
        Samples in an orbit, evenly spaced.
    orbits : int
    generator : numpy.random.Generator
        Draws phases, wander and jumps.

    Returns
    -------
    times : ndarray, shape (samples,), in days
    angles : ndarray, shape (samples, 2), over the amplitude

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
    times = phase * period / DAY
    year = 2.0 * np.pi * times / _YEAR_DAYS
    angles = np.zeros((steps, 2))
    for axis in range(2):
        start = generator.uniform(0.0, 2.0 * np.pi, len(_HARMONICS) + 1)
        swing = 1.0 + _SEASON * np.sin(year + start[-1])
        for order, share in enumerate(_HARMONICS, start=1):
            # The Sun moves through the year, and the hot part of the orbit with it.
            turn = 2.0 * np.pi * order * phase + start[order - 1] + 0.5 * np.sin(year)
            angles[:, axis] += share * swing * np.cos(turn)
        angles[:, axis] += generator.normal(0.0, _TREND) * times / _YEAR_DAYS
        angles[:, axis] += _WANDER * _wander(steps, times[1] - times[0], generator)
        angles[:, axis] += _jumps(times, generator)
    return times, angles


def _wander(steps: int, step: float, generator: Generator) -> FloatArray:
    """Return a stationary series of variance one that forgets itself exponentially."""
    from scipy.signal import lfilter  # only now: its import takes a second

    keep = float(np.exp(-step / _WANDER_DAYS))
    noise = generator.standard_normal(steps)
    noise[1:] *= np.sqrt(1.0 - keep**2)
    return lfilter([1.0], [1.0, -keep], noise)


def _jumps(times: FloatArray, generator: Generator) -> FloatArray:
    count = int(generator.poisson(_JUMPS * times[-1] / _YEAR_DAYS))
    moments = generator.uniform(0.0, times[-1], count)
    sizes = generator.normal(0.0, _JUMP, count)
    return (times[:, np.newaxis] >= moments) @ sizes


def trend_and_fourier(
    times: FloatArray,
    phase: FloatArray,
    measured: FloatArray,
    known: int,
    degree: int = 2,
) -> FloatArray:
    """Return the misalignment that a linear trend plus a Fourier series foretells.

    Parameters
    ----------
    times : ndarray, shape (samples,), in days
    phase : ndarray, shape (samples,), in orbits
    measured : ndarray, shape (samples, 2)
        Misalignment as calibrated.
    known : int
        How many samples, the first ones, are fitted.
    degree : int, of the Fourier series

    Returns
    -------
    ndarray, shape (samples, 2)
        The fitted function at all times.

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
    columns = np.hstack([times[:, np.newaxis], _fourier_columns(phase, degree)])
    if not columns.shape[1] <= known <= len(times):
        raise ValueError(
            f"known: expected from {columns.shape[1]} samples, as many as the fit has terms, to "
            f"{len(times)}, got {known}; calibrate longer or lower the degree"
        )
    fitted = np.linalg.lstsq(columns[:known], measured[:known], rcond=None)[0]
    return columns @ fitted


def last_orbits(measured: FloatArray, per_orbit: int, degree: int = 3) -> FloatArray:
    """Return the misalignment that the three orbits before each orbit foretell.

    Each orbit is fitted by a Fourier series; the coefficients of the three last orbits are
    extrapolated to the next along a straight line, by least squares.

    Parameters
    ----------
    measured : ndarray, shape (orbits * per_orbit, 2)
        Misalignment as calibrated throughout.
    per_orbit : int
        Samples in an orbit.
    degree : int, of the Fourier series

    Returns
    -------
    ndarray, shape (orbits * per_orbit, 2)
        Not a number for the first three orbits.

    Raises
    ------
    ValueError
        If there is a part of an orbit.

    Examples
    --------
    A swing that repeats is foretold exactly.

    >>> swing = np.tile(np.cos(2 * np.pi * np.arange(16) / 16), 5)
    >>> np.allclose(last_orbits(np.stack([swing, swing], axis=-1), 16)[48:, 0], swing[48:])
    True
    """
    orbits = measured.reshape(-1, per_orbit, 2)
    columns = _fourier_columns(np.arange(per_orbit) / per_orbit, degree)
    fits = np.einsum("kp,opa->oka", np.linalg.pinv(columns), orbits)
    # The line through values at -3, -2, -1, taken at 0.
    ahead = (-2.0 * fits[:-3] + fits[1:-2] + 4.0 * fits[2:-1]) / 3.0
    foretold = np.full_like(orbits, np.nan)
    foretold[3:] = np.einsum("pk,oka->opa", columns, ahead)
    return foretold.reshape(-1, 2)


def _fourier_columns(phase: FloatArray, degree: int) -> FloatArray:
    """Return one, cosines and sines of an orbit's harmonics, shape (n, 2 degree + 1)."""
    order = np.arange(1, degree + 1)
    angle = 2.0 * np.pi * phase[:, np.newaxis] * order
    return np.hstack([np.ones((len(phase), 1)), np.cos(angle), np.sin(angle)])
