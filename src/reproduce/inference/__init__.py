"""Posteriors: models with priors, summaries of draws, convergence criteria, checks.

`sampling` is imported separately, because it imports emcee.
"""

from reproduce.inference.diagnostics import (
    ConvergenceCriteria,
    Summary,
    UnconvergedError,
    autocorrelation_time,
    summarised,
    thinned,
)
from reproduce.inference.model import (
    Derived,
    Estimate,
    Likelihood,
    LogUniform,
    Model,
    Normal,
    Parameter,
    Prior,
    Progress,
    Quantity,
    Uniform,
)
from reproduce.inference.posterior import PosteriorSamples
