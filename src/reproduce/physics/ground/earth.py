"""The WGS84 ellipsoid, and local axes on it.

Positions are Earth-fixed, in metres: Z to the pole, X to the meridian of zero longitude. The
function `gd2gc` of ERFA returns the position of a longitude, latitude and height.
"""

from __future__ import annotations

import numpy as np

from reproduce.physics.attitude import unit
from reproduce.physics.validate import Direction, FloatArray, checked

# Defining constants of the World Geodetic System 1984 (NGA.STND.0036): equatorial radius in m.
EARTH_RADIUS, _FLATTENING = 6378137.0, 1.0 / 298.257223563
# Semi-axes along X, Y and Z, in m.
EARTH_AXES = EARTH_RADIUS * np.array([1.0, 1.0, 1.0 - _FLATTENING])


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
