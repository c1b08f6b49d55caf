"""The misalignment models: sufficient statistics, signs, the small-angle limit."""

import numpy as np
import pytest
from errors import mcse_deviation, mcse_mean
from scipy import stats
from scipy.spatial.transform import Rotation

from reproduce.inference.diagnostics import mcse_quantile
from reproduce.inference.models import (
    SpotStatistics,
    misalignment_model,
    small_angle_posterior,
)
from reproduce.inference.models.misalignment import _given_noise
from reproduce.inference.sampling import Plan, sample
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
    return sample(constant, Plan(5, steps=300, warmup=120))


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
    mount, angle = parameters[:, :3], parameters[:, 3:6]
    drift = parameters[:, 6:9] if parameters.shape[1] == 11 else np.zeros_like(angle)
    scale, noise = parameters[:, -2], parameters[:, -1]
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


@pytest.mark.parametrize("drift", [DRIFT, 0 * DRIFT])
def test_statistics_give_the_likelihood_of_all_images(platform, drift):
    """Near the posterior; the bend of the paths of a drift is the only difference."""
    turns = [(np.zeros(3),) * 2, (TURN - drift / 2, TURN + drift / 2)]
    groups, drifts = images(platform, turns, frames=100), bool(drift.any())
    statistics = SpotStatistics.of(groups, (False, drifts))
    model = misalignment_model(platform, statistics, drifts=drifts)
    centre, spread = model.likelihood.start()
    steps = np.random.default_rng(1).normal(size=(8, len(centre)))
    points = centre + 0.5 * spread * steps
    whole = all_images(platform, points, groups)
    assert np.ptp(whole) > 1
    off = 0.01 if drifts else 1e-7
    np.testing.assert_allclose(model.likelihood(points), whole, rtol=0, atol=off)
    assert np.abs((centre[3:6] - TURN) / spread[3:6]).max() < 4
    if drifts:
        assert np.abs((centre[6:9] - drift) / spread[6:9]).max() < 4


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
