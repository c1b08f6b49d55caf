"""Models of the posteriors, with the posteriors of each module.

- `registration`: registration, and predictions of new stars.
- `mixture`: registration-distortion and registration-mixture, evaluated star by star.
- `misalignment`: misalignment and misalignment-drift.
- `published`: camera and simulation, from printed estimates and residuals.
- `bench`: averaging and stage, from printed noise and angles.
"""

from reproduce.inference.models.bench import (
    AveragedNoise,
    StageAngles,
)
from reproduce.inference.models.misalignment import (
    SpotLikelihood,
    misalignment_model,
)
from reproduce.inference.models.mixture import (
    DISTORTION_PRIOR,
    DistortedRegistration,
    MixtureRegistration,
)
from reproduce.inference.models.published import PrintedFit
from reproduce.inference.models.registration import (
    TRANSFORM,
    GaussianRegistration,
    fitted_model,
    registration_model,
    registration_parameter,
)
