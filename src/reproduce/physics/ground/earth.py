"""Rotation of the Earth, places on the WGS84 ellipsoid and circular orbits.

The inertial frame is the celestial frame of the IAU (GCRS), that of star catalogues. The J2000
frame of mean equator and equinox differs from it by 0.02 arcsec. The Earth-fixed frame is the
terrestrial frame (ITRS), which differs from WGS84 by centimetres. The models are those of
IAU 2006/2000A, computed by pyerfa. Their corrections by observation, the length of the day and the
motion of the pole, are arguments, and nothing is downloaded. Lengths are in metres, angles in
radians.
"""

from __future__ import annotations

from datetime import datetime

import erfa
import numpy as np

from reproduce.physics import validate
from reproduce.physics.attitude import unit
from reproduce.physics.validate import Direction, FloatArray

# Largest UT1 - UTC in seconds and pole in radians. The IERS prints UT1 - UTC in seconds, below 0.9,
# and the pole in seconds of arc, so larger numbers are in another unit.
_LARGEST_UT1_UTC, _LARGEST_POLE = 1.0, 1e-4
# Defining constants of the World Geodetic System 1984 (NGA.STND.0036): equatorial radius in m.
EARTH_RADIUS, _FLATTENING = 6378137.0, 1.0 / 298.257223563
# Semi-axes along X, Y and Z, in m.
EARTH_AXES = EARTH_RADIUS * np.array([1.0, 1.0, 1.0 - _FLATTENING])


def earth_from_inertial(
    utc: str,
    ut1_utc: float,
    pole: tuple[float, float] = (0.0, 0.0),
    celestial_pole: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """Return the rotation from the celestial frame to the Earth-fixed frame.

    Parameters
    ----------
    utc : str
        ISO date and time in UTC.
    ut1_utc : float
        UT1 - UTC, in seconds.
    pole : (float, float)
        Polar motion x_p, y_p, in radians.
    celestial_pole : (float, float)
        Offsets dX, dY of the celestial pole from IAU 2006/2000A, in radians.

    Returns
    -------
    ndarray, shape (3, 3)
        R_J2000^WGS84 of the imaging model (1), from the frame of star catalogues.

    Examples
    --------
    In a day the Earth rotates by 360.99 deg.

    >>> first, second = (earth_from_inertial(f"2020-01-0{day}", -0.18) for day in (1, 2))
    >>> day = second @ first.T
    >>> round(float(np.degrees(np.arctan2(day[0, 1], day[0, 0]))), 2)
    0.99
    """
    largest = np.abs([*pole, *celestial_pole]).max()
    if not (abs(ut1_utc) <= _LARGEST_UT1_UTC and largest <= _LARGEST_POLE):
        raise ValueError(
            f"ut1_utc, pole: expected up to {_LARGEST_UT1_UTC:g} s and {_LARGEST_POLE:g} rad, got "
            f"{ut1_utc:g} and {largest:g}. Convert milliseconds or seconds of arc"
        )
    time = datetime.fromisoformat(utc)
    seconds = time.second + time.microsecond / 1e6
    day = erfa.dtf2d("UTC", *time.timetuple()[:5], seconds)
    tt = erfa.taitt(*erfa.utctai(*day))
    x, y, s = erfa.xys06a(*tt)
    intermediate = erfa.c2ixys(x + celestial_pole[0], y + celestial_pole[1], s)
    rotation = erfa.era00(*erfa.utcut1(*day, ut1_utc))
    return erfa.c2tcio(intermediate, rotation, erfa.pom00(*pole, erfa.sp00(*tt)))


@validate.checked
def earth_fixed(coordinates: Direction) -> FloatArray:
    """Return Earth-fixed positions of longitude, latitude and height.

    Parameters
    ----------
    coordinates : array_like, shape (..., 3)
        Longitude and geodetic latitude (within pi/2) in radians, height above WGS84 in metres.

    Returns
    -------
    ndarray, shape (..., 3)
        Positions, in metres.

    Examples
    --------
    >>> earth_fixed([0.0, 0.0, 500.0]).round(3)
    array([6378637.,       0.,       0.])
    """
    if (largest := np.abs(coordinates[..., 1]).max()) > np.pi / 2 + 1e-12:
        raise ValueError(
            "coordinates: expected latitudes from -pi/2 to pi/2 in the second column, got "
            f"{largest:g}. Give angles in radians, longitude first"
        )
    return erfa.gd2gce(EARTH_RADIUS, _FLATTENING, *np.moveaxis(coordinates, -1, 0))


@validate.checked
def local_axes(positions: Direction) -> FloatArray:
    """Return the rotation from Earth-fixed axes to east, north and up at points on the ground.

    Parameters
    ----------
    positions : array_like, shape (..., 3)
        Earth-fixed positions on the WGS84 ellipsoid, except the poles, in metres. Up is the normal
        of the ellipsoid.

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
    up = unit("positions", positions / EARTH_AXES**2)
    east = unit("positions", np.cross([0.0, 0.0, 1.0], up))
    return np.stack([east, np.cross(up, east), up], axis=-2)


@validate.checked
def satellite_from_inertial(position: Direction, velocity: Direction) -> FloatArray:
    """Return the rotation to axes of the orbit: X along the flight, Z to the centre of the Earth.

    Parameters
    ----------
    position, velocity : array_like, shape (..., 3)
        Position and velocity of the satellite, in one inertial frame, in any unit.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        satellite_from_inertial; Y is opposite to the normal of the orbit.

    Raises
    ------
    ValueError
        If the velocity is parallel to the position.

    Examples
    --------
    >>> satellite_from_inertial([1.0, 0, 0], [0, 1.0, 0])
    array([[ 0.,  1.,  0.],
           [-0., -0., -1.],
           [-1., -0., -0.]])
    """
    down = -unit("position", position)
    side = -unit("velocity", np.cross(position, velocity))
    return np.stack([np.cross(side, down), side, down], axis=-2)
