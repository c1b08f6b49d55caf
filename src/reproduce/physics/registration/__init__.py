"""Registration: the transform between two channels, fitted, bounded and diagnosed."""

from reproduce.physics.registration._least_squares import Problem, prepare
from reproduce.physics.registration._similarity import (
    as_complex,
    as_points,
    closed_similarity,
)
from reproduce.physics.registration.calibration import (
    calibrate,
    deviations,
    gauss_newton_step,
    gauss_newton_step_printed,
    jacobian,
    starting_values,
)
from reproduce.physics.registration.diagnosis import (
    Finding,
    Sensitivity,
    checked_pivot,
    diagnose_fit,
    sensitivities,
)
from reproduce.physics.registration.fit import (
    RegistrationFit,
    fit_problem,
    fit_registration,
)
from reproduce.physics.registration.matching import (
    match_points,
    neighbours,
    pair_weights,
)
from reproduce.physics.registration.transforms import (
    MODELS,
    UNITS,
    Registration,
    error_field,
    registered_image,
    rmse,
    rmse_per_axis,
    similarity_between,
)
