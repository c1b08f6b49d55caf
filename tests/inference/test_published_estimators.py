"""The papers' own estimators: what they know, their errors, and how often their intervals cover."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

import calibrations
from calibrations import LEVELS, intervals, simulated
from estimators import Quest, estimate
from reproduce.inference import Normal
from reproduce.inference.models import (
    SpotStatistics,
    distortion_model,
    joint_model,
    misalignment_model,
)

REPLICATES = 600
SEED = 3
PIVOT = np.array([1030.0, 770.0])
DRIFT = tuple(f"drift-{a}" for a in "xyz")


def held(model, **values):
    """The model with some parameters known: what its estimator does not know is then no error."""
    parameters = tuple(
        replace(p, prior=Normal(values[p.name], 1e-12, "known"))
        if p.name in values
        else p
        for p in model.parameters
    )
    return replace(model, parameters=parameters)


def pair(registration, red=2.0, blue=0.5):
    """Both channels, with scales far from one: there the noise of the sources weighs otherwise."""
    data = registration.likelihood
    blue_points = 0.5 * data.source + 0.07
    model = joint_model((data.source, blue_points), data.target, (PIVOT, PIVOT + 3.0))
    return held(model, **{"red-scale": red, "blue-scale": blue})


def group(frames=400, groups=2, lever=0.0):
    """Statistics of as many images; their values are replaced by simulated ones."""
    spots = np.zeros((groups, 4, 2))
    levers = np.zeros(groups)
    levers[-1] = lever
    return SpotStatistics(spots, spots, np.full(groups, float(frames)), levers, 1.0)


# Each model with what makes it one for which its estimator is meant.
WELL_SPECIFIED = {
    "registration": lambda r, _: r,
    "registration-joint": lambda r, _: pair(r),
    "registration-joint-alike": lambda r, _: pair(r, 1.0, 1.0),
    "registration-distortion": lambda r, _: held(
        distortion_model(r), **{"source-distortion": 0.0, "target-distortion": 0.0}
    ),
    "misalignment": lambda _, p: misalignment_model(p, group()),
    "misalignment-drift": lambda _, p: held(
        misalignment_model(p, group(lever=134.0), drifts=True),
        **dict.fromkeys(DRIFT, 0.0),
    ),
}


def surprises(model):
    """Probability of covering so much more or less often than claimed; (levels, parameters)."""
    covered = intervals(model, SEED, REPLICATES)
    known = (covered >= 0).all(axis=(0, 1))
    counts = covered.sum(axis=0)[:, known]
    found = [
        [binomtest(int(n), REPLICATES, level).pvalue for n in row]
        for row, level in zip(counts, LEVELS, strict=True)
    ]
    names = [name for name, one in zip(model.names, known, strict=True) if one]
    return dict(zip(names, np.array(found).min(axis=0), strict=True))


@pytest.mark.parametrize("case", WELL_SPECIFIED)
def test_intervals_cover_as_often_as_claimed(case, registration, platform):
    """At every level, wherever the estimator's own assumptions hold."""
    found = surprises(WELL_SPECIFIED[case](registration, platform))
    assert found
    # The least of up to nine parameters and three levels: one false alarm in a thousand models.
    assert min(found.values()) > 1e-3 / 27, found


def test_rough_errors_of_the_start_do_not_cover_as_claimed(registration, monkeypatch):
    """What the check above is for: errors of another scale, and of one channel, are found out."""
    for scales, wrong in (((2.0, 0.5), "red-scale"), ((1.0, 1.0), "noise")):
        assert surprises(pair(registration, *scales))[wrong] > 1e-4
        with monkeypatch.context() as rough:
            # Source noise as if all scales were one.
            rough.setattr(
                calibrations, "estimate", lambda likelihood: likelihood.start()
            )
            assert surprises(pair(registration, *scales))[wrong] < 1e-6


@pytest.mark.parametrize("name", ["misalignment", "misalignment-drift"])
def test_errors_of_quest_are_its_response_to_every_spot(name, platform):
    """Independent: each mean coordinate moved by itself, QUEST run again, nothing linearised."""
    _, fitted = simulated(WELL_SPECIFIED[name](None, platform), SEED, 1)
    data = fitted.likelihood
    means, step = data.statistics.means, 1e-3
    variance = np.zeros(fitted.dimension)
    for index in np.ndindex(means.shape):
        off = np.zeros(means.shape)
        off[index] = step
        ends = [
            estimate(
                replace(data, statistics=replace(data.statistics, means=means + side))
            )[0]
            for side in (off, -off)
        ]
        variance += (
            np.square((ends[0] - ends[1]) / (2 * step))
            / data.statistics.counts[index[0]]
        )
    scatter, _ = Quest(data.platform, data.statistics).scatter
    _, errors = estimate(data)
    known = ~np.isnan(errors[:-1])
    expected = scatter * np.sqrt(variance[:-1])
    np.testing.assert_allclose(errors[:-1][known], expected[known], rtol=3e-4)


def test_drift_is_taken_for_noise(platform):
    """The scatter about the mean of a drifting group holds the drift."""
    model = misalignment_model(platform, group(lever=134.0), drifts=True)
    truth = np.array([0, 0, 0, 0, 0, 0, 4e-4, 0, 0, 1.0, 0.017])
    data = model.likelihood.with_data(
        model.likelihood.simulate(truth, np.random.default_rng(1))
    )
    noise = estimate(data)[0][-1]
    slopes = data.statistics.slopes[1]
    whole = np.hypot(0.017, np.sqrt(np.square(slopes).mean() * 134.0 / (2 * 399)))
    np.testing.assert_allclose(noise, whole, rtol=0.03)
    assert noise > 3 * 0.017
