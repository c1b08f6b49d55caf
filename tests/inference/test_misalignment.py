"""The misalignment models: sufficient statistics, signs, the small-angle limit."""

import numpy as np
import pytest
from scipy import stats

from reproduce.inference.diagnostics import mcse_deviation, mcse_mean, mcse_quantile
from reproduce.inference.directions import directions_model
from reproduce.inference.evidence import log_evidence
from reproduce.inference.lasers import SpotStatistics
from reproduce.inference.misalignment import (
    drift_model,
    misalignment_model,
)
from reproduce.inference.model import UnsuitableModelError
from reproduce.inference.sampling import Plan, sample
from reproduce.inference.small_angle import small_angle_posterior, spot_bound
from reproduce.inference.states import states_model
from reproduce.papers.posteriors import posteriors
from reproduce.physics.attitude.lasers import emitted_directions, received_directions
from reproduce.physics.attitude.misalignment import (
    laser_transform,
    misalignment,
    misalignment_angles,
    stage_angles,
)
from reproduce.units import ARCSEC_PER_RADIAN

NOISE = 0.017
TURN = np.array([5.0, -3.0, 20.0]) / ARCSEC_PER_RADIAN
DRIFT = np.array([4.0, 1.0, 0.0]) / ARCSEC_PER_RADIAN


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
    """Mean, covariance and quantiles of the exact linear posterior, within Monte Carlo errors."""
    exact = small_angle_posterior(constant)
    direct = exact.draw(np.random.default_rng(3), 200_000)
    widths = np.sqrt(np.diagonal(exact.covariance))
    for i, name in enumerate(constant.names):
        chain = posterior.chain[..., i]
        assert abs(chain.mean() - exact.mean[i]) < 4 * mcse_mean(chain), name
        assert abs(chain.std() - widths[i]) < 4.5 * mcse_deviation(chain), name
        for probability in (0.025, 0.5, 0.975):
            found, known = (np.quantile(d, probability) for d in (chain, direct[:, i]))
            assert abs(found - known) < 5 * mcse_quantile(chain, probability), name
    ours = np.corrcoef(posterior.draws.T)
    known = exact.covariance / np.outer(widths, widths)
    assert np.abs(ours - known).max() < 5 / np.sqrt(len(posterior.draws))
    assert np.abs(known - np.eye(len(known))).max() > 0.3, "a covariance worth the name"


def test_small_angle_posterior_is_the_normal_law_of_all_images(platform):
    """Independent: few images, SciPy's Gaussian of all spots with the parameters summed out."""
    groups = images(platform, [(np.zeros(3),) * 2, (TURN, TURN)], frames=5)
    model = misalignment_model(platform, SpotStatistics.of(groups, (False, False)))
    exact = small_angle_posterior(model)
    centre, spread = model.likelihood.start()
    scale = spread[:-1]
    response, left = model.likelihood.linearised(centre, scale)
    half = len(left) // 2  # the slopes, which a still camera has not
    response, left = response[:half] / np.sqrt(5), left[:half] / np.sqrt(5)
    measured = np.concatenate([g.reshape(5, -1) for g in groups], axis=1).ravel()
    means = np.concatenate([g.mean(axis=0).ravel() for g in groups])
    at_centre = np.tile(means - left, 5)
    design = np.tile(response, (5, 1))
    sigma = np.array([p.prior.sigma for p in model.parameters[:-1]])
    off = np.array([p.prior.mean for p in model.parameters[:-1]]) - centre[:-1]
    logs = []
    for noise in exact.noise[::40]:
        spots = stats.multivariate_normal(
            at_centre + design @ off, noise**2 * np.eye(80) + design * sigma**2 @ design.T
        )
        logs.append(spots.logpdf(measured) + float(model.parameters[-1].prior.log_density(noise)))
    ratio = np.exp(np.array(logs) - logs[5])
    np.testing.assert_allclose(ratio, exact.weight[::40] / exact.weight[200], rtol=1e-4)
    step = exact.noise[1] - exact.noise[0]
    known = logs[5] + np.log(step) - np.log(exact.weight[200])
    np.testing.assert_allclose(exact.log_evidence, known, atol=1e-4)


def test_posteriors_are_as_wide_as_the_bound(posterior, directions):
    """Weak priors: nothing narrower, and hardly wider. Where priors decide there is no bound."""
    for one in (posterior, directions):
        bound = spot_bound(one.model)
        for i, name in enumerate(one.model.names):
            chain = one.chain[..., i]
            assert abs(chain.std() / bound[i] - 1) < 5 * mcse_deviation(chain) / bound[i] + 2e-3, (
                name
            )
    with pytest.raises(UnsuitableModelError, match="leave a combination"):
        spot_bound(posteriors()["misalignment-states"].model())


def test_evidence_of_scale_and_directions_is_the_exact_one(constant, posterior, directions):
    for sampled in (posterior, directions):
        found = log_evidence(sampled, 1)
        assert found.reliable
        exact = small_angle_posterior(sampled.model).log_evidence
        assert abs(found.value - exact) < 4 * found.error + 1e-3


@pytest.fixture(scope="module")
def directions(platform, spots):
    model = directions_model(platform, SpotStatistics.of(spots, (False, False)))
    return sample(model, Plan(5, steps=800, warmup=300))


def test_directions_of_the_lasers_are_found(platform):
    """Lasers set askew come back, each its own way, and the misalignment beside them."""
    askew = np.array([[3.0, -4.0], [0.0, 6.0], [-5.0, 0.0], [2.0, 2.0]]) / ARCSEC_PER_RADIAN
    lasers = np.broadcast_to(platform.lasers - 2.0 * askew, (1, 4, 2))
    generator = np.random.default_rng(3)
    groups = [
        platform.landed(np.zeros((1, 3)), turn[None, None], lasers, 2.0)[:, 0]
        + NOISE * generator.normal(size=(400, 4, 2))
        for turn in (np.zeros(3), TURN)
    ]
    model = directions_model(platform, SpotStatistics.of(groups, (False, False)))
    centre, spread = model.likelihood.start()
    truth = np.concatenate([TURN, askew.ravel(), [NOISE]])
    assert np.abs((centre - truth) / spread).max() < 4
    assert np.abs(askew).max() > 20 * spread[3:-1].max()


def test_directions_reduce_to_the_common_scale(platform, constant, spots):
    """A pattern that is larger by a share has directions that are larger by it."""
    model = directions_model(platform, SpotStatistics.of(spots, (False, False)))
    point = np.concatenate([np.zeros(3), TURN, [1.01, 0.02]])
    slopes = -platform.lasers / platform.camera_focal_length
    free = np.concatenate([TURN, (0.01 * slopes).ravel(), [0.02]])
    found = model.likelihood(free[None])
    np.testing.assert_allclose(found, constant.likelihood(point[None]), rtol=1e-12)
    whole = model.likelihood.full(free[None], spots)
    np.testing.assert_allclose(found, whole, rtol=1e-11)


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
