"""Cameras and channels: where a star falls on each detector, in ideal and distorted positions."""

from reproduce.physics.optics.arrangements import arrangement_angles
from reproduce.physics.optics.camera import (
    Camera,
    angle_from_pixels,
    detector_centre,
    distortion_ratio,
    field_of_view,
    fit_camera,
    ideal_positions,
    image_points,
    radial_displacements,
    reference_points_scaled,
    scale_factor,
    turned_onto_detector,
)
from reproduce.physics.optics.rotary import (
    channel_centroids,
    rotary_matrix,
    rotary_matrix_printed,
    starlight,
)
