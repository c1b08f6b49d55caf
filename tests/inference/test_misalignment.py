"""The misalignment models: sufficient statistics, signs, the small-angle limit."""

import numpy as np
import pytest
from errors import mcse_deviation, mcse_mean
from scipy import stats
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp

from reproduce.inference.diagnostics import mcse_quantile
from reproduce.inference.models import (
    SpotStatistics,
    misalignment_model,
)
from reproduce.inference.sampling import Plan, sample
from reproduce.printed.inputs import load_inputs
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.posterior import book_posterior

NOISE = 0.017
TURN = np.array([5.0, -3.0, 20.0]) / ARCSEC_PER_RADIAN
DRIFT = np.array([4.0, 1.0, 0.0]) / ARCSEC_PER_RADIAN


def images(platform, drift, frames):
    """Images of two groups: at the zero point, and about `TURN`."""
    generator, zero, groups = np.random.default_rng(3), np.zeros(3), []
    for first, last in ((zero, zero), (TURN - drift / 2, TURN + drift / 2)):
        path = first + np.linspace(0, 1, frames)[:, None] * (last - first)
        true = platform.predicted(np.zeros((frames, 3)), path[:, None])[:, 0]
        groups.append(true + NOISE * generator.normal(size=true.shape))
    return groups


@pytest.fixture(scope="module")
def constant(platform):
    spots = images(platform, np.zeros(3), 400)
    return misalignment_model(platform, SpotStatistics.of(spots, (False, False)))


def given_noise(model):
    """The posterior for a linear prediction, as a mixture of Gaussians over the noise.

    Values of the noise and their probabilities, means of all other parameters given the noise, and
    roots of their covariances.
    """
    likelihood = model.likelihood
    *others, last = (one.prior for one in model.parameters)
    middle, sigma = np.array([(one.mean, one.sigma) for one in others]).T
    centre, spread = likelihood.start()
    scale = spread[:-1]
    response, left = likelihood.linearised(centre, scale)
    # In units of the errors, or the matrices cannot be inverted.
    response, off = response * scale, (middle - centre[:-1]) / scale
    held = np.square(scale / sigma)
    noise = centre[-1] + spread[-1] * np.linspace(-9, 9, 401)
    precise = noise[:, None] ** -2
    inverse = np.linalg.inv(response.T @ response * precise[..., None] + np.diag(held))
    pull = response.T @ left * precise + held * off
    means = np.einsum("mij,mj->mi", inverse, pull)
    roots = np.linalg.cholesky(inverse)
    squares = likelihood.statistics.squares + left @ left
    logs = last.log_density(noise) - likelihood.statistics.size * np.log(noise)
    logs += 0.5 * (np.vecdot(means, pull) - squares / noise**2)
    logs += np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    weight = np.exp(logs - logsumexp(logs))
    return noise, weight, centre[:-1] + means * scale, roots * scale[:, None]


def test_sampler_agrees_with_the_small_angle_limit(constant):
    """Mean, covariance and quantiles of the exact linear posterior, within Monte Carlo errors."""
    posterior = sample(constant, Plan(5, steps=300, warmup=120))
    generator, count = np.random.default_rng(3), 200_000
    noise, weight, means, roots = given_noise(constant)
    rows = np.column_stack([means, noise])
    mean = weight @ rows
    covariance = ((rows - mean).T * weight) @ (rows - mean)
    covariance[:-1, :-1] += np.einsum("m,mik,mjk->ij", weight, roots, roots)
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
    known = covariance / np.outer(widths, widths)
    found = np.corrcoef(posterior.draws.T)
    assert np.abs(found - known).max() < 5 / np.sqrt(len(posterior.draws))
    assert np.abs(known - np.eye(len(known))).max() > 0.3, "parameters are correlated"


def test_small_angle_posterior_is_the_normal_law_of_all_images(platform):
    """Independent: few images, SciPy's Gaussian of all spots with the parameters summed out."""
    groups = images(platform, np.zeros(3), 5)
    model = misalignment_model(platform, SpotStatistics.of(groups, (False, False)))
    noises, weight, *_ = given_noise(model)
    centre, spread = model.likelihood.start()
    response, left = model.likelihood.linearised(centre, spread[:-1])
    half = len(left) // 2  # without the slopes, which are zero at rest
    response, left = response[:half] / np.sqrt(5), left[:half] / np.sqrt(5)
    measured = np.concatenate([g.reshape(5, -1) for g in groups], axis=1)
    at_centre = np.tile(measured.mean(axis=0) - left, 5)
    design = np.tile(response, (5, 1))
    *priors, last = (p.prior for p in model.parameters)
    sigma = np.array([prior.sigma for prior in priors])
    mean = at_centre + design @ ([prior.mean for prior in priors] - centre[:-1])
    spread = design * sigma**2 @ design.T
    logs = np.array(
        [
            stats.multivariate_normal(mean, noise**2 * np.eye(80) + spread).logpdf(
                measured.ravel()
            )
            + float(last.log_density(noise))
            for noise in noises[::40]
        ]
    )
    ratio = np.exp(logs - logs[5])
    np.testing.assert_allclose(ratio, weight[::40] / weight[200], rtol=1e-4)


def all_images(platform, parameters, groups):
    """Log likelihood from every spot of every image, by SciPy's rotations; (n,)."""
    off = -platform.lasers
    rays = np.column_stack([off, np.full(len(off), platform.camera_focal_length)])
    rough = -(platform.spots - platform.principal_point) * platform.pixel_pitch
    arrived = np.column_stack([rough, np.full(len(off), platform.tracker_focal_length)])
    units = (
        one / np.linalg.norm(one, axis=1, keepdims=True) for one in (arrived, rays)
    )
    designed, _ = Rotation.align_vectors(*units)
    mount, angle = parameters[:, :3], parameters[:, 3:6]
    drift = parameters[:, 6:9] if parameters.shape[1] == 11 else np.zeros_like(angle)
    scale, noise = parameters[:, -2, None, None], parameters[:, -1, None, None]
    rays = np.tile(rays, (len(parameters), 1, 1))
    rays[..., :2] *= scale
    focal = platform.tracker_focal_length / platform.pixel_pitch
    total = np.zeros(len(parameters))
    for group, spots in enumerate(groups):
        for time, seen in zip(np.linspace(-0.5, 0.5, len(spots)), spots, strict=True):
            turn = Rotation.from_rotvec(group * (angle + time * drift))
            rotation = designed * Rotation.from_rotvec(mount) * turn
            arriving = rays @ np.swapaxes(rotation.as_matrix(), 1, 2)
            slopes = arriving[..., :2] / arriving[..., 2:]
            landed = platform.principal_point - focal * slopes
            total += stats.norm.logpdf(seen, landed, noise).sum(axis=(1, 2))
    return total


@pytest.mark.parametrize("drift", [DRIFT, 0 * DRIFT])
def test_statistics_give_the_likelihood_of_all_images(platform, drift):
    """Near the posterior; the bend of the paths of a drift is the only difference."""
    groups, drifts = images(platform, drift, 100), bool(drift.any())
    statistics = SpotStatistics.of(groups, (False, drifts))
    model = misalignment_model(platform, statistics, drifts=drifts)
    centre, spread = model.likelihood.start()
    steps = np.random.default_rng(1).normal(size=(8, len(centre)))
    points = centre + 0.5 * spread * steps
    whole = all_images(platform, points, groups)
    assert np.ptp(whole) > 1
    off = 0.01 if drifts else 1e-7
    np.testing.assert_allclose(model.likelihood(points), whole, rtol=0, atol=off)
    truth = np.concatenate([TURN, drift])[: len(centre) - 5]
    pulls = (centre[3:-2] - truth) / spread[3:-2]
    assert np.abs(pulls).max() < 4


def test_simulated_statistics_scatter_as_those_of_images(constant):
    truth, generator = constant.likelihood.start()[0], np.random.default_rng(1)
    drawn = [constant.likelihood.simulate(truth, generator) for _ in range(300)]
    squares = np.array([one.squares for one in drawn]) / truth[-1] ** 2
    freedom = constant.likelihood.statistics.freedom
    assert abs(squares.mean() - freedom) < 4 * np.sqrt(2 * freedom / 300)
    spread = np.std([one.means for one in drawn], axis=0)
    np.testing.assert_allclose(spread, truth[-1] / np.sqrt(400), rtol=0.2)


def test_free_directions_of_the_lasers_leave_the_uncertainties():
    """The first group then measures the directions, and the motion of the spots the angle."""
    found = book_posterior("misalignment")
    likelihood = found.model.likelihood
    centre, spread = likelihood.start()
    first, second = likelihood.statistics.counts
    response = likelihood.linearised(centre, spread[:-1])[0][:, 3:6]
    noise = centre[-1] ** 2 * (1 + second / first)
    covariance = np.linalg.inv(response.T @ response) * noise
    errors = found.draws[:, 3:6].std(axis=0)
    np.testing.assert_allclose(np.sqrt(np.diagonal(covariance)), errors, rtol=0.03)


def test_table_3_scatters_more_than_one_noise_allows():
    """Compared with repeats of the whole table, with the noise of the posterior."""
    printed = load_inputs(["chen2023/table-3"]).array("chen2023/table-3") / 3
    found = book_posterior("misalignment")
    noise = found.draws[:, -1].mean()
    repeats = np.sqrt(np.random.default_rng(2).chisquare(799, (20_000, 16)) / 799)
    furthest = np.quantile(np.abs(np.log(repeats)).max(axis=1), 0.95)
    assert (np.abs(np.log(printed / noise)) > furthest).sum() > 1
