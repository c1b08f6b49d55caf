"""The misalignment models: sufficient statistics, signs, the small-angle limit."""

import numpy as np
import pytest
from errors import mcse_deviation, mcse_mean
from scipy import stats
from scipy.spatial.transform import Rotation

from reproduce.inference import LogUniform
from reproduce.inference.diagnostics import mcse_quantile
from reproduce.inference.models import (
    SpotStatistics,
    misalignment_model,
    small_angle_posterior,
)
from reproduce.inference.models.misalignment import _given_noise
from reproduce.inference.sampling import Plan, sample
from reproduce.physics.attitude import (
    emitted_directions,
    laser_transform,
    misalignment,
    misalignment_angles,
    received_directions,
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
        true = platform.predicted(np.zeros((frames, 3)), path[:, None])[:, 0]
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
    still, turned = images(
        platform, [(np.zeros(3),) * 2, (TURN, TURN)], frames=3, noise=0.0
    )
    camera = emitted_directions(platform.lasers, 2.0)
    optics = (
        platform.principal_point,
        platform.pixel_pitch,
        platform.tracker_focal_length,
    )
    zero = laser_transform(camera, received_directions(still[0], *optics))
    found = misalignment(camera, received_directions(turned[0], *optics), zero)
    np.testing.assert_allclose(misalignment_angles(found), TURN, rtol=1e-5)


def image_by_image(likelihood, parameters, images):
    """Log likelihood from all images, the camera turning evenly."""
    first, last = likelihood.turns(parameters)
    noise = parameters[:, -1, None, None]
    total = np.zeros(len(parameters))
    for group, spots in enumerate(images):
        for u, frame in zip(np.linspace(0, 1, len(spots)), spots, strict=True):
            turn = (1 - u) * first[:, group] + u * last[:, group]
            predicted = likelihood.landed(parameters, turn[:, None])[:, 0]
            total += stats.norm.logpdf(frame, predicted, noise).sum(axis=(-2, -1))
    return total


def test_sufficient_statistics_agree_with_all_images(constant, spots):
    points = constant.start(np.random.default_rng(1), 8)
    whole = image_by_image(constant.likelihood, points, spots)
    np.testing.assert_allclose(constant.likelihood(points), whole, rtol=1e-11)


def test_drift_statistics_agree_with_all_images(platform):
    """Near the posterior; the bend of the paths is all that differs."""
    groups = images(
        platform, [(np.zeros(3),) * 2, (TURN - DRIFT / 2, TURN + DRIFT / 2)]
    )
    model = misalignment_model(
        platform, SpotStatistics.of(groups, (False, True)), drifts=True
    )
    centre, spread = model.likelihood.start()
    points = centre + 0.5 * spread * np.random.default_rng(1).normal(
        size=(8, len(centre))
    )
    whole = image_by_image(model.likelihood, points, groups)
    ours = model.likelihood(points)
    assert np.ptp(whole) > 1
    np.testing.assert_allclose(ours, whole, atol=0.01)
    drift = (centre[6:9] - DRIFT) / spread[6:9]
    assert np.abs(drift).max() < 4


def test_sampler_agrees_with_the_small_angle_limit(constant, posterior):
    """Mean, covariance and quantiles of the exact linear posterior, within Monte Carlo errors."""
    mean, covariance = small_angle_posterior(constant)
    generator, count = np.random.default_rng(3), 200_000
    noise, weight, means, roots = _given_noise(constant)
    chosen = generator.choice(len(noise), count, p=weight)
    normal = generator.normal(size=(count, means.shape[1]))
    others = means[chosen] + np.einsum("nij,nj->ni", roots[chosen], normal)
    direct = np.column_stack([others, noise[chosen]])
    widths = np.sqrt(np.diagonal(covariance))
    for i, name in enumerate(constant.names):
        chain = posterior.chain[..., i]
        assert abs(chain.mean() - mean[i]) < 4 * mcse_mean(chain), name
        assert abs(chain.std() - widths[i]) < 4.5 * mcse_deviation(chain), name
        for probability in (0.025, 0.5, 0.975):
            found, known = (np.quantile(d, probability) for d in (chain, direct[:, i]))
            assert abs(found - known) < 5 * mcse_quantile(chain, probability), name
    ours = np.corrcoef(posterior.draws.T)
    known = covariance / np.outer(widths, widths)
    assert np.abs(ours - known).max() < 5 / np.sqrt(len(posterior.draws))
    assert np.abs(known - np.eye(len(known))).max() > 0.3, "a covariance worth the name"


def test_small_angle_posterior_is_the_normal_law_of_all_images(platform):
    """Independent: few images, SciPy's Gaussian of all spots with the parameters summed out."""
    groups = images(platform, [(np.zeros(3),) * 2, (TURN, TURN)], frames=5)
    model = misalignment_model(platform, SpotStatistics.of(groups, (False, False)))
    noises, weight, *_ = _given_noise(model)
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
    for noise in noises[::40]:
        spots = stats.multivariate_normal(
            at_centre + design @ off,
            noise**2 * np.eye(80) + design * sigma**2 @ design.T,
        )
        logs.append(
            spots.logpdf(measured)
            + float(model.parameters[-1].prior.log_density(noise))
        )
    ratio = np.exp(np.array(logs) - logs[5])
    np.testing.assert_allclose(ratio, weight[::40] / weight[200], rtol=1e-4)


def all_images(platform, parameters, groups):
    """Log likelihood from every spot of every image, by SciPy's rotations; (n,)."""
    off = -platform.lasers
    rays = np.column_stack([off, np.full(len(off), platform.camera_focal_length)])
    rough = -(platform.spots - platform.principal_point) * platform.pixel_pitch
    arrived = np.column_stack([rough, np.full(len(off), platform.tracker_focal_length)])
    units = [
        one / np.linalg.norm(one, axis=1, keepdims=True) for one in (arrived, rays)
    ]
    designed, _ = Rotation.align_vectors(*units)
    mount, angle, drift = (parameters[:, i : i + 3] for i in (0, 3, 6))
    scale, noise = parameters[:, 9], parameters[:, 10]
    rays = np.tile(rays, (len(parameters), 1, 1))
    rays[..., :2] *= scale[:, None, None]
    total = np.zeros(len(parameters))
    for group, spots in enumerate(groups):
        for share, seen in zip(np.linspace(-0.5, 0.5, len(spots)), spots, strict=True):
            turn = group * (angle + share * drift)
            rotation = (
                designed * Rotation.from_rotvec(mount) * Rotation.from_rotvec(turn)
            )
            x, y, z = np.moveaxis(
                np.einsum("nij,nlj->nli", rotation.as_matrix(), rays), -1, 0
            )
            slopes = np.stack([x / z, y / z], axis=-1)
            focal = platform.tracker_focal_length / platform.pixel_pitch
            landed = platform.principal_point - focal * slopes
            total += stats.norm.logpdf(seen, landed, noise[:, None, None]).sum(
                axis=(1, 2)
            )
    return total


def test_drift_posterior_is_that_of_the_raw_images(platform):
    """Independent of statistics, rotations and sampler: importance weights of all the spots."""
    turns = [(np.zeros(3),) * 2, (TURN - DRIFT / 2, TURN + DRIFT / 2)]
    groups = images(platform, turns, frames=12)
    model = misalignment_model(
        platform, SpotStatistics.of(groups, (False, True)), drifts=True
    )
    sampled = sample(model, Plan(5, steps=500, warmup=200))
    centre, width = sampled.draws.mean(axis=0), sampled.draws.std(axis=0)
    proposal = stats.multivariate_t(
        shape=1.1 * np.corrcoef(sampled.draws.T), df=8, seed=4
    )
    standard = proposal.rvs(20_000)
    points = centre + width * standard
    logs = all_images(platform, points, groups) - proposal.logpdf(standard)
    for column, one in zip(points.T, model.parameters, strict=True):
        flat = isinstance(one.prior, LogUniform)
        logs += (
            -np.log(column)
            if flat
            else stats.norm.logpdf(column, one.prior.mean, one.prior.sigma)
        )
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    assert 1 / np.square(weights).sum() > 5000
    for i, name in enumerate(model.names):
        column, chain = points[:, i], sampled.chain[..., i]
        mean = weights @ column
        left = column - mean
        error = np.sqrt(np.square(weights) @ np.square(left))
        assert abs(chain.mean() - mean) < 4 * np.hypot(error, mcse_mean(chain)), name
        spread = np.sqrt(weights @ left**2)
        error = np.sqrt(np.square(weights) @ np.square(left**2 - spread**2)) / (
            2 * spread
        )
        assert abs(chain.std() - spread) < 4 * np.hypot(error, mcse_deviation(chain)), (
            name
        )


def test_error_of_the_calibration_group_is_included(platform, posterior, spots):
    """Both groups are equally long: the angle is root two wider than with a perfect zero point."""
    still = [np.repeat(spots[0], 50, axis=0), spots[1]]
    sure = misalignment_model(platform, SpotStatistics.of(still, (False, False)))
    ratio = posterior.chain[..., 3].std() / sure.likelihood.start()[1][3]
    np.testing.assert_allclose(ratio, np.sqrt(2), rtol=0.05)


def test_statistics_simulated_as_drawn_from_images(constant, platform):
    """Mean and scatter of simulated statistics follow those of simulated images."""
    truth = constant.likelihood.start()[0]
    drawn = [
        constant.likelihood.simulate(truth, np.random.default_rng(seed))
        for seed in range(300)
    ]
    squares = np.array([one.squares for one in drawn]) / truth[-1] ** 2
    freedom = constant.likelihood.statistics.freedom
    assert abs(squares.mean() - freedom) < 4 * np.sqrt(2 * freedom / 300)
    means = np.stack([one.means for one in drawn])
    expected = truth[-1] / np.sqrt(400)
    np.testing.assert_allclose(means.std(axis=0), expected, rtol=0.2)
