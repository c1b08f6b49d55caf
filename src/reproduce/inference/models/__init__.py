"""Models of the posteriors: which file serves which posterior.

- registration: `registration`, with its posterior without a sampler; registration-joint; and what
  all of them foretell of new stars.
- registration-distortion, registration-mixture: `mixture`, star by star.
- misalignment, misalignment-drift: `misalignment`, of many images, and without a sampler.
"""

from reproduce.inference.models.misalignment import (
    AXES,
    MOUNT,
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
    Together,
    free_priors,
    joint_model,
    registration_model,
)
