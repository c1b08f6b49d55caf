"""Images of stars: spots, detectors, centroids and their errors."""

from reproduce.physics.images.centroids import (
    centre_of_gravity,
    centre_of_gravity_error,
    cramer_rao_variance,
    simulated_errors,
)
from reproduce.physics.images.detector import (
    Detector,
    blackbody_band,
    electrons,
    expose,
    tabulated_star,
)
from reproduce.physics.images.finding import Detections, find_spots, shape_finding
from reproduce.physics.images.spots import (
    Spots,
    fitted_spots,
    render_frame,
    spot_windows,
    window_corners,
)
