"""The published estimators: their errors, and the coverage of their intervals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from calibrations import LEVELS, estimate, intervals, simulated
from reproduce.inference import Normal
from reproduce.inference.models import (
    DistortedRegistration,
    SpotLikelihood,
    misalignment_model,
    registration_model,
)

REPLICATES = 600
SEED = 3


def held(model, **values):
    """The model with some known parameters, whose estimator neglects them."""
    known = {name: Normal(value, 1e-12, "known") for name, value in values.items()}
    return model.with_priors({name.replace("_", "-"): p for name, p in known.items()})


def spots(platform, drifts=False, **known):
    """Two groups of 400 images; their values are replaced by simulated ones."""
    times = np.zeros(400), drifts * np.linspace(-1, 1, 400)
    spots = SpotLikelihood(platform, np.zeros((2, 2, 4, 2)), times, 1.0)
    model = misalignment_model(spots)
    return held(model, **known)


def distorted(model):
    """The same stars with two distortions, which are zero."""
    found = registration_model(DistortedRegistration(model.likelihood.problem))
    return held(found, source_distortion=0.0, target_distortion=0.0)


# Each model with the parameters for which its estimator is meant.
NO_DRIFT = dict.fromkeys(("drift_x", "drift_y", "drift_z"), 0.0)
WELL_SPECIFIED = {
    "registration": lambda r, _: r,
    "registration-distortion": lambda r, _: distorted(r),
    "misalignment": lambda _, p: spots(p),
    "misalignment-drift": lambda _, p: spots(p, drifts=True, **NO_DRIFT),
}


def coverage_probabilities(model):
    """Probability of a coverage so far from the level, the least of all levels, by parameter."""
    covered = intervals(model, SEED, REPLICATES)
    probabilities = {}
    for i, name in enumerate(model.names):
        if (covered[..., i] >= 0).all():
            counts = zip(covered[..., i].sum(axis=0), LEVELS, strict=True)
            found = (binomtest(int(n), REPLICATES, level).pvalue for n, level in counts)
            probabilities[name] = min(found)
    return probabilities


@pytest.mark.parametrize("case", WELL_SPECIFIED)
def test_intervals_cover_as_often_as_claimed(case, registration, platform):
    """At every level, if the assumptions of the estimator are right."""
    found = coverage_probabilities(WELL_SPECIFIED[case](registration, platform))
    # Up to nine parameters and three levels: one false alarm in 1000 models.
    assert min(found.values()) > 1e-3 / 27, found


def test_errors_of_quest_are_its_response_to_every_spot(platform):
    """Independent: each mean coordinate is moved, and QUEST is run again."""
    for case in ("misalignment", "misalignment-drift"):
        _, fitted = simulated(WELL_SPECIFIED[case](None, platform), SEED, 1)
        likelihood, step = fitted.likelihood, 1e-3
        variance = np.zeros(fitted.dimension)
        for index in np.ndindex(likelihood.spots.shape):
            ends = []
            for side in (step, -step):
                moments = likelihood.moments.copy()
                moments[(0, *index)] += side
                moved = replace(likelihood, moments=moments)
                ends.append(estimate(moved)[0])
            slope = (ends[0] - ends[1]) / (2 * step)
            variance += slope**2 / likelihood.counts[index[0]]
        centre, errors = estimate(likelihood)
        known = ~np.isnan(errors)
        known[-1] = False
        expected = centre[-1] * np.sqrt(variance)
        np.testing.assert_allclose(errors[known], expected[known], rtol=3e-4)


def test_quest_takes_a_drift_for_noise(platform):
    """The scatter about the mean of a drifting group contains the drift."""
    likelihood = spots(platform, drifts=True).likelihood
    truth = np.array([0, 0, 0, 0, 0, 0, 4e-4, 0, 0, 1.0, 0.017])
    drawn = likelihood.simulate(truth, np.random.default_rng(1))
    noise = estimate(drawn)[0][-1]
    drift = np.square(drawn.moments[1, 1]).mean() * drawn.weights[1, 1] / (2 * 399)
    assert noise == pytest.approx(np.hypot(0.017, np.sqrt(drift)), rel=0.03)
    assert noise > 3 * 0.017
