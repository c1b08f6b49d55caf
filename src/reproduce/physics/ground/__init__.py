"""Positions on the ground: Earth, orbit, imaging and its errors."""

from reproduce.physics.ground.earth import EARTH_RADIUS, local_axes
from reproduce.physics.ground.imaging import (
    circular_error,
    ground_jacobian,
    ground_resolution,
    image_vectors,
    imaged_position,
)
