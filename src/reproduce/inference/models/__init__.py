"""Models of the posteriors: which file serves which posterior.

- registration: `registration`, with the published estimator and the posterior without a sampler.
- registration-distortion: `variants`, point by point; registration-mixture: `mixture`, likewise.
- registration-joint: `joint`, of two `registration`. What all of them foretell: `new_stars`.
- centroid-noise: `centroid_noise`, of printed digits.
- misalignment, misalignment-drift: `misalignment`, of many images, and without a sampler.
- frame-averaging: `averaging`.
- table-5: `stage_table`; beside it `table_sums`, without a sampler.
"""

from reproduce.inference.models.averaging import AveragingLikelihood, averaging_model, by_column
from reproduce.inference.models.centroid_noise import CentroidNoiseLikelihood, centroid_noise_model
from reproduce.inference.models.joint import JointRegistration, joint_model
from reproduce.inference.models.misalignment import (
    AXES,
    MOUNT,
    SpotLikelihood,
    SpotStatistics,
    errors_with_free_lasers,
    misalignment_model,
    small_angle_posterior,
)
from reproduce.inference.models.mixture import MixtureRegistration, mixture_model, probability_false
from reproduce.inference.models.new_stars import NewStars, StarModel, Together, rmse_at, true_places
from reproduce.inference.models.registration import (
    GaussianRegistration,
    free_priors,
    noise_growth,
    registration_model,
    registration_posterior,
    with_priors,
)
from reproduce.inference.models.stage_table import (
    ReferenceAngles,
    StageTableLikelihood,
    table_model,
)
from reproduce.inference.models.table_sums import TableResult, interchanged
from reproduce.inference.models.variants import PointwiseRegistration, distortion_model
