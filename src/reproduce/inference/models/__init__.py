"""Models of the posteriors: which file serves which posterior.

- registration: `registration`; beside it `closed_form` (its posterior without a sampler).
- registration-distortion: `variants`, point by point; registration-mixture: `mixture`, likewise.
- registration-joint: `joint`, of two `registration`.
- All of these share `least_squares` (the published estimator) and `new_stars` (its consequences).
- centroid-noise: `centroid_noise`, with the printed digits of `rounded`.
- misalignment, misalignment-drift: `misalignment`, of the data in `lasers`; beside them
  `small_angle`, without a sampler.
- frame-averaging: `averaging`.
- table-5: `stage_table`, of `reference_angles`; beside it `table_sums`, without a sampler.
"""

from reproduce.inference.models.averaging import AveragingLikelihood, averaging_model, by_column
from reproduce.inference.models.centroid_noise import CentroidNoiseLikelihood, centroid_noise_model
from reproduce.inference.models.closed_form import registration_posterior
from reproduce.inference.models.joint import JointRegistration, joint_model
from reproduce.inference.models.lasers import SpotStatistics
from reproduce.inference.models.least_squares import noise_growth
from reproduce.inference.models.misalignment import AXES, MOUNT, SpotLikelihood, misalignment_model
from reproduce.inference.models.mixture import MixtureRegistration, mixture_model, probability_false
from reproduce.inference.models.new_stars import NewStars, StarModel, Together, rmse_at, true_places
from reproduce.inference.models.reference_angles import ReferenceAngles
from reproduce.inference.models.registration import (
    GaussianRegistration,
    free_priors,
    registration_model,
    with_priors,
)
from reproduce.inference.models.small_angle import errors_with_free_lasers, small_angle_posterior
from reproduce.inference.models.stage_table import StageTableLikelihood, table_model
from reproduce.inference.models.table_sums import TableResult, interchanged
from reproduce.inference.models.variants import PointwiseRegistration, distortion_model
