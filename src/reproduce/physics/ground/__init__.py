"""Positions on the ground: Earth, orbit, imaging and its errors."""

from reproduce.physics.ground.earth import (
    DAY,
    EarthOrientation,
    Thermal,
    earth_fixed,
    earth_from_inertial,
    last_orbits,
    local_axes,
    orbital_period,
    satellite_from_inertial,
    thermal_series,
    trend_and_fourier,
)
from reproduce.physics.ground.errors import (
    altitude_for_resolution,
    circular_error,
    ellipse,
    ground_covariance,
    ground_error,
    ground_resolution,
)
from reproduce.physics.ground.imaging import (
    WGS84,
    GroundJacobian,
    distance_to_ground,
    ground_jacobian,
    image_vectors,
    imaged_position,
    imaging_chain,
)
