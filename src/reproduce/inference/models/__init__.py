"""Models of the posteriors, with the posteriors of each module.

- `registration`: registration and registration-joint, and predictions of new stars.
- `mixture`: registration-distortion and registration-mixture, evaluated star by star.
- `misalignment`: misalignment and misalignment-drift, and the small-angle limit.
"""

from reproduce.inference.models.misalignment import (
    AXES,
    MOUNT_SIGMA,
    SpotLikelihood,
    SpotStatistics,
    misalignment_model,
    small_angle_posterior,
)
from reproduce.inference.models.mixture import (
    MixtureRegistration,
    distortion_model,
    mixture_model,
    probability_false,
)
from reproduce.inference.models.registration import (
    TRANSFORM,
    GaussianRegistration,
    JointRegistration,
    NewStars,
    exact_draws,
    fitted_model,
    joint_model,
    registration_model,
)
