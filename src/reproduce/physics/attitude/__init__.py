"""Attitude: rotations, Wahba's problem, and the misalignment of a camera from lasers."""

from reproduce.physics.attitude.angles import (
    inertial_attitude,
    laser_transform,
    misalignment,
    misalignment_angles,
    misalignment_between,
    misalignment_in_tracker,
    moved_laser_transform,
    stage_angle,
    stage_angle_printed,
    stage_angles,
)
from reproduce.physics.attitude.averaging import (
    Stability,
    allan_deviation,
    attitude_accuracy,
    averaged_error,
    moving_average,
    scatter_of_averages,
    shared_zero_chi_square,
    stability,
)
from reproduce.physics.attitude.monitoring import monitored
from reproduce.physics.attitude.platform import (
    Platform,
    emitted_directions,
    received_directions,
    received_spots,
)
from reproduce.physics.attitude.rotations import (
    attitude,
    mean_rotation,
    quest,
    rotation_from_vector,
    unit,
    vector_from_rotation,
)
