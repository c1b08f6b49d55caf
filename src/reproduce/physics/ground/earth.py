"""Places on the WGS84 ellipsoid and circular orbits.

Positions are Earth-fixed: Z to the pole, X to the meridian of zero longitude. Lengths are in
metres, angles in radians.
"""

from __future__ import annotations

import erfa
import numpy as np

from reproduce.physics.attitude import unit
from reproduce.physics.validate import (
    Direction,
    FloatArray,
    checked,
    valid,
)

# Defining constants of the World Geodetic System 1984 (NGA.STND.0036): equatorial radius in m.
EARTH_RADIUS, _FLATTENING = 6378137.0, 1.0 / 298.257223563
# Semi-axes along X, Y and Z, in m.
EARTH_AXES = EARTH_RADIUS * np.array([1.0, 1.0, 1.0 - _FLATTENING])


@checked
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
    longitude, latitude, height = np.moveaxis(coordinates, -1, 0)
    valid(
        "coordinates",
        latitude,
        np.abs(latitude) <= np.pi / 2 + 1e-12,
        "latitudes from -pi/2 to pi/2 rad",
    )
    return erfa.gd2gce(EARTH_RADIUS, _FLATTENING, longitude, latitude, height)


@checked
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


@checked
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
