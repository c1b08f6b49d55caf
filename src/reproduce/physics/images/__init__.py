"""Images of stars: spots, detectors, centroids and their errors."""

from reproduce.physics.images.centroids import (
    CentroidError,
    centre_of_gravity,
    centre_of_gravity_error,
    cramer_rao_variance,
    cut_windows,
    detect_spots,
    s_curve_bias,
    windowed_centre,
)
from reproduce.physics.images.detector import (
    Detector,
    blackbody_band,
    channel_ratio,
    electrons,
    expose,
    tabulated_star,
)
from reproduce.physics.images.phase_study import (
    Light,
    bound,
    even_phases,
    observed_scatter,
    predicted_errors,
    predicted_scatter,
    simulated_errors,
)
from reproduce.physics.images.spots import fitted_centre, render_frame, spot_windows, window_corners
