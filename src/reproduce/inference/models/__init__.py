"""Models of the posteriors: which file serves which posterior.

- registration of the book and of your stars, registration-joint, predictions of new stars:
  `registration`.
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
    exact_draws,
    fitted_model,
    joint_model,
    registration_model,
)
