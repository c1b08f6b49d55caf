"""Posteriors: model, priors, parts, diagnostics, checks.

`sampling` and `quadrature` stand apart: they load emcee and the splines of SciPy.
"""

from reproduce.inference.checks import (
    PredictiveCheck,
    Published,
    Repeat,
    Share,
    leanings,
    misfit,
    posterior_checks,
    repeats,
)
from reproduce.inference.diagnostics import (
    Gates,
    UnconvergedError,
    autocorrelation_time,
    diagnose,
    thinned,
)
from reproduce.inference.model import (
    Consequence,
    Derived,
    Estimated,
    Model,
    Parameter,
    StartError,
    UnsuitableModelError,
    from_scores,
    log_slope,
    scores,
    weighted,
)
from reproduce.inference.parts import Progress, ResumeError, Store, processes, run_parts
from reproduce.inference.posterior import Sampled, Summary
from reproduce.inference.priors import HalfNormal, LogNormal, LogUniform, Normal, Prior, Uniform
