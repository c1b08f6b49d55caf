"""Images of stars: spots, detectors, centroids and their errors."""

from reproduce.physics.images.centroid_theory import (
    CentroidError,
    centre_of_gravity_error,
    cramer_rao_variance,
    s_curve_bias,
)
from reproduce.physics.images.centroids import (
    centre_of_gravity,
    cut_windows,
    detect_spots,
    windowed_centre,
)
from reproduce.physics.images.detector import Detector, electrons, expose
from reproduce.physics.images.phase_study import (
    Light,
    biased_bound,
    bound,
    even_phases,
    observed_scatter,
    predicted_errors,
    predicted_scatter,
    simulated_errors,
)
from reproduce.physics.images.spectra import blackbody_band, channel_ratio, tabulated_star
from reproduce.physics.images.spot_fit import fitted_centre
from reproduce.physics.images.spots import render_frame, spot_windows, window_corners
