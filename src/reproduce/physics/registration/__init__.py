"""Registration: the transform between two channels, fitted, bounded and diagnosed."""

from reproduce.physics.registration.approximations import (
    EFFECTS,
    Channels,
    analytic_bias,
    error_field,
    even_positions,
    second_term_from_share,
    simulated_bias,
)
from reproduce.physics.registration.calibration import (
    Calibration,
    calibrate,
    constraint,
    constraint_printed,
    deviations,
    gauss_newton_step,
    gauss_newton_step_printed,
    jacobian,
    model_points,
    random_starts,
    registration_bound,
    starting_values,
    two_line_rotation,
)
from reproduce.physics.registration.closed_form import paired_points, rmse, rmse_per_axis
from reproduce.physics.registration.diagnosis import (
    Finding,
    checked_pivot,
    diagnose,
    fits_exactly,
    robust_similarity,
    rounded,
)
from reproduce.physics.registration.fit import RegistrationFit, fit_registration
from reproduce.physics.registration.resample import fused_image, registered_image
from reproduce.physics.registration.transforms import (
    MODELS,
    UNITS,
    Registration,
    as_complex,
    as_points,
    principal_point_shift,
    similarity_between,
)
