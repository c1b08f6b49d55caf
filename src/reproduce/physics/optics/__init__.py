"""Cameras and channels: where a star falls on each detector, in ideal and distorted positions."""

from reproduce.physics.optics.arrangements import Arrangement, arrangements_with
from reproduce.physics.optics.camera import (
    Camera,
    CameraFit,
    angle_from_pixels,
    detector_centre,
    field_of_view,
    fit_camera,
    ideal_positions,
    image_points,
    radial_displacements,
    turned_onto_detector,
)
from reproduce.physics.optics.chromatic import (
    distortion_ratio,
    distortion_ratio_equal_coefficients,
    distortion_ratio_linear,
    offsets_from_principal_point,
    reference_ideal_positions,
    reference_points_from_ideal,
    reference_points_scaled,
    scale_factor,
)
from reproduce.physics.optics.simulate import (
    channel_centroids,
    noisy_centroids,
    rotary_matrix,
    rotary_matrix_printed,
    spawned_angles,
    spawned_normals,
    spawned_streams,
    starlight,
    table_starlight,
)
