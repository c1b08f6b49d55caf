"""The misalignment models: sufficient statistics, signs, the small-angle limit."""

import numpy as np
import pytest

from reproduce.inference.lasers import SpotStatistics
from reproduce.inference.misalignment import (
    ARCSEC,
    drift_model,
    misalignment_model,
    states_model,
)
from reproduce.inference.sampling import Plan, sample
from reproduce.physics.lasers import emitted_directions, received_directions
from reproduce.physics.misalignment import laser_transform, misalignment, misalignment_angles
from reproduce.physics.stage import stage_angles

NOISE = 0.017
TURN = np.array([5.0, -3.0, 20.0]) / ARCSEC
DRIFT = np.array([4.0, 1.0, 0.0]) / ARCSEC


def images(platform, turns, frames=400, seed=3, noise=NOISE):
    generator = np.random.default_rng(seed)
    groups = []
    for first, last in turns:
        path = first + np.linspace(0, 1, frames)[:, None] * (last - first)
        true = platform.predicted(np.zeros((frames, 3)), path[:, None], np.ones(frames), 2.0)[:, 0]
        groups.append(true + noise * generator.normal(size=true.shape))
    return groups


@pytest.fixture(scope="module")
def spots(platform):
    return images(platform, [(np.zeros(3),) * 2, (TURN, TURN)])


@pytest.fixture(scope="module")
def constant(platform, spots):
    return misalignment_model(platform, SpotStatistics.of(spots, (False, False)))


@pytest.fixture(scope="module")
def posterior(constant):
    return sample(constant, Plan(5, steps=800, warmup=300))


def test_predicted_spots_follow_quest(platform):
    """Independent of the likelihood: directions, Wahba's problem, angles; one-sided in sign."""
    still, turned = images(platform, [(np.zeros(3),) * 2, (TURN, TURN)], frames=3, noise=0.0)
    camera = emitted_directions(platform.lasers, 2.0)
    optics = (platform.principal_point, platform.pixel_pitch, platform.tracker_focal_length)
    zero = laser_transform(camera, received_directions(still[0], *optics))
    found = misalignment(camera, received_directions(turned[0], *optics), zero)
    np.testing.assert_allclose(misalignment_angles(found), TURN, rtol=1e-5)


def test_sufficient_statistics_agree_with_all_images(constant, spots):
    points = constant.start(np.random.default_rng(1), 8)
    whole = constant.likelihood.full(points, spots)
    np.testing.assert_allclose(constant.likelihood(points), whole, rtol=1e-11)


def test_drift_statistics_agree_with_all_images(platform):
    """Near the posterior; the bend of the paths is all that differs."""
    groups = images(platform, [(np.zeros(3),) * 2, (TURN - DRIFT / 2, TURN + DRIFT / 2)])
    model = drift_model(platform, SpotStatistics.of(groups, (False, True)))
    centre, spread = model.likelihood.start()
    points = centre + 0.5 * spread * np.random.default_rng(1).normal(size=(8, len(centre)))
    whole = model.likelihood.full(points, groups)
    ours = model.likelihood(points)
    assert np.ptp(whole) > 1
    np.testing.assert_allclose(ours, whole, atol=0.01)
    drift = (centre[6:9] - DRIFT) / spread[6:9]
    assert np.abs(drift).max() < 4


def test_sampler_agrees_with_the_small_angle_limit(constant, posterior):
    """Linear response, Gaussian priors, noise near its estimate: exact to parts in 1,000."""
    likelihood = constant.likelihood
    centre, errors = likelihood.start()
    for i, (name, one) in enumerate(zip(constant.names, posterior.diagnoses, strict=True)):
        chain = posterior.chain[..., i]
        # Ridge and prior differ by far less than a Monte Carlo error for all but nothing here.
        assert abs(chain.mean() - centre[i]) < 0.02 * errors[i] + 4 * one.mcse, name
        assert abs(chain.std() / errors[i] - 1) < 0.03, name


def test_error_of_the_calibration_group_is_included(platform, posterior, spots):
    """Both groups are equally long: the angle is root two wider than with a perfect zero point."""
    still = [np.repeat(spots[0], 50, axis=0), spots[1]]
    sure = misalignment_model(platform, SpotStatistics.of(still, (False, False)))
    ratio = posterior.chain[..., 3].std() / sure.likelihood.start()[1][3]
    np.testing.assert_allclose(ratio, np.sqrt(2), rtol=0.05)


def test_states_hold_the_ratio_of_stage_scale_and_focal_length(platform):
    motions = np.stack([np.arange(5) * 20e-6] * 2, axis=-1)
    turns = [(angle, angle) for angle in stage_angles(motions, 2.0)]
    statistics = SpotStatistics.of(images(platform, turns), (False,) * 5)
    model = states_model(platform, statistics, motions)
    focal, scale = (sample(model, Plan(5, steps=600, warmup=300)).draws[:, i] for i in (3, 4))
    ratio = scale / focal * 2.0
    assert abs(ratio.mean() - 1) < 4 * ratio.std()
    # The data hold the ratio; the stage scale keeps its prior, and the focal length adds the two.
    np.testing.assert_allclose(scale.std(), 0.002, rtol=0.05)
    np.testing.assert_allclose((focal / 2.0).std(), np.hypot(ratio.std(), scale.std()), rtol=0.05)


def test_statistics_simulated_as_drawn_from_images(constant, platform):
    """Mean and scatter of simulated statistics follow those of simulated images."""
    truth = constant.likelihood.start()[0]
    drawn = [constant.simulate(truth, np.random.default_rng(seed)) for seed in range(300)]
    squares = np.array([one.squares for one in drawn]) / truth[-1] ** 2
    freedom = constant.likelihood.statistics.freedom
    assert abs(squares.mean() - freedom) < 4 * np.sqrt(2 * freedom / 300)
    means = np.stack([one.means for one in drawn])
    expected = truth[-1] / np.sqrt(400)
    np.testing.assert_allclose(means.std(axis=0), expected, rtol=0.2)


def test_short_group_is_refused():
    with pytest.raises(ValueError, match="group 1: expected three or more"):
        SpotStatistics.of([np.zeros((2, 4, 2))], (False,))
