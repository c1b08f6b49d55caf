"""Posteriors: models with priors, what draws say, diagnostics, checks.

`sampling` stands apart: it loads emcee.
"""

from reproduce.inference.diagnostics import (
    Gates,
    UnconvergedError,
    autocorrelation_time,
    diagnose,
    thinned,
)
from reproduce.inference.model import (
    Consequence,
    Coordinates,
    Derived,
    LogUniform,
    Model,
    Normal,
    Parameter,
    Prior,
    Progress,
    Uniform,
)
from reproduce.inference.posterior import (
    PredictiveCheck,
    Sampled,
    Summary,
    leanings,
    misfit,
    posterior_checks,
)
