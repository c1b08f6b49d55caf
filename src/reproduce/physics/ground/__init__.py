"""Positions on the ground: Earth, orbit, imaging and its errors."""

from reproduce.physics.ground.earth import (
    DAY,
    WGS84,
    earth_fixed,
    earth_from_inertial,
    last_orbits,
    local_axes,
    orbital_period,
    satellite_from_inertial,
    thermal_series,
    trend_and_fourier,
)
from reproduce.physics.ground.imaging import (
    GroundJacobian,
    altitude_for_resolution,
    circular_error,
    ground_covariance,
    ground_jacobian,
    ground_resolution,
    image_vectors,
    imaged_position,
)
