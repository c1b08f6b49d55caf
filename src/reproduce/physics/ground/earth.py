"""From the stars to the turning Earth: precession, nutation, Earth rotation, polar motion.

The inertial frame is the celestial one of the IAU (GCRS), in which star catalogues are given; the
J2000 frame of mean equator and equinox differs from it by two hundredths of an arc second. The
Earth-fixed frame is the terrestrial one (ITRS), which WGS84 follows to centimetres. The models
are those of IAU 2006/2000A, computed by pyerfa. What no model foretells, the length of the day
and the wandering of the pole, is an argument; nothing is downloaded. Angles are in radians.
"""

from __future__ import annotations

from dataclasses import dataclass

import erfa
import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics.ground.imaging import WGS84, Ellipsoid
from reproduce.physics.validate import Direction, FloatArray, checked

# Beyond a second a value of UT1 - UTC is a mistake: leap seconds keep it below 0.9 s.
_LARGEST_UT1_UTC = 1.0


@dataclass(frozen=True)
class EarthOrientation:
    """What observation adds to the models, as IERS publishes it.

    Attributes
    ----------
    ut1_utc : float
        UT1 - UTC, in seconds.
    pole : (float, float)
        Polar motion x_p, y_p, in radians.
    celestial_pole : (float, float)
        Offsets dX, dY of the celestial pole from IAU 2006/2000A, in radians.
    """

    ut1_utc: float
    pole: tuple[float, float] = (0.0, 0.0)
    celestial_pole: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        values = (self.ut1_utc, *self.pole, *self.celestial_pole)
        if not np.isfinite(values).all():
            raise ValueError(f"expected finite Earth orientation, got {values}")
        if abs(self.ut1_utc) > _LARGEST_UT1_UTC:
            raise ValueError(
                f"ut1_utc: expected seconds between -1 and 1, got {self.ut1_utc}; IERS prints "
                "UT1 - UTC in seconds, other files in milliseconds"
            )
        if max(abs(value) for value in values[1:]) > 1e-4:
            raise ValueError(
                f"pole: expected radians, got {values[1:]}; IERS prints seconds of arc"
            )


def earth_from_inertial(utc: ArrayLike, orientation: EarthOrientation) -> FloatArray:
    """Return the rotation from the celestial frame into the Earth-fixed one.

    Parameters
    ----------
    utc : array_like of datetime64 or ISO strings, shape (...)
        Times in UTC.
    orientation : EarthOrientation
        Held constant over all times.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        R_J2000^WGS84 of the imaging model (1), from the frame of star catalogues.

    Examples
    --------
    A day later the Earth has turned by a little more than once.

    >>> frames = earth_from_inertial(["2020-01-01", "2020-01-02"], EarthOrientation(-0.18))
    >>> turn = frames[1] @ frames[0].T
    >>> round(float(np.degrees(np.arctan2(turn[0, 1], turn[0, 0]))), 2)
    0.99
    """
    first, second = _julian(utc)
    tt = erfa.taitt(*erfa.utctai(first, second))
    ut1 = erfa.utcut1(first, second, orientation.ut1_utc)
    x, y, s = erfa.xys06a(*tt)
    dx, dy = orientation.celestial_pole
    intermediate = erfa.c2ixys(x + dx, y + dy, s)
    rotation = erfa.era00(*ut1)
    polar = erfa.pom00(*orientation.pole, erfa.sp00(*tt))
    return erfa.c2tcio(intermediate, rotation, polar)


@checked
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
        ellipsoid.equatorial_radius, ellipsoid.flattening, *np.moveaxis(coordinates, -1, 0)
    )


@checked
def local_axes(positions: Direction, ellipsoid: Ellipsoid = WGS84) -> FloatArray:
    """Return the rotation from Earth-fixed axes to east, north and up at given places.

    Parameters
    ----------
    positions : array_like, shape (..., 3)
        Earth-fixed, in metres.
    ellipsoid : Ellipsoid
        Whose normal is up.

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
        ellipsoid.equatorial_radius, ellipsoid.flattening, positions
    )
    zero = np.zeros_like(longitude)
    east = np.stack([-np.sin(longitude), np.cos(longitude), zero], axis=-1)
    up = np.stack(
        [
            np.cos(latitude) * np.cos(longitude),
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude),
        ],
        axis=-1,
    )
    return np.stack([east, np.cross(up, east), up], axis=-2)


@checked
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
        If the satellite falls straight down.

    Examples
    --------
    >>> satellite_from_inertial([1.0, 0, 0], [0, 1.0, 0])
    array([[ 0.,  1.,  0.],
           [-0., -0., -1.],
           [-1., -0., -0.]])
    """
    normal = np.cross(position, velocity)
    size = np.linalg.norm(normal, axis=-1, keepdims=True)
    if (size <= 0).any():
        raise ValueError("velocity: expected a motion across the radius, got one along it")
    down = -position / np.linalg.norm(position, axis=-1, keepdims=True)
    side = -normal / size
    return np.stack([np.cross(side, down), side, down], axis=-2)


def _julian(utc: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the two parts of the quasi-Julian date that the ERFA functions take for UTC."""
    try:
        times: NDArray[np.datetime64] = np.asarray(utc, dtype="datetime64[us]")
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"utc: expected datetime64 or ISO strings, got {utc!r} ({error}); "
            'write "2007-04-05T12:00:00"'
        ) from error
    if np.isnat(times).any():
        raise ValueError("utc: expected times, got some that are not a time; drop them first")
    days = times.astype("datetime64[D]")
    months = days.astype("datetime64[M]")
    year = days.astype("datetime64[Y]").astype(np.int64) + 1970
    month = months.astype(np.int64) % 12 + 1
    day = (days - months).astype(np.int64) + 1
    seconds = (times - days) / np.timedelta64(1, "s")
    minutes = np.floor(seconds / 60).astype(np.int64)
    first, second = erfa.dtf2d(
        "UTC", year, month, day, minutes // 60, minutes % 60, seconds - 60.0 * minutes
    )
    return first, second
