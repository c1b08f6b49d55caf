"""The misalignment models: sufficient statistics, signs, the small-angle limit."""

import numpy as np
import pytest
from errors import mcse_deviation, mcse_mean
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy import stats
from scipy.spatial.transform import Rotation

from reproduce.inference.models import SpotLikelihood, misalignment_model
from reproduce.inference.sampling import Plan, sample
from reproduce.printed.inputs import load_inputs
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.posterior import book_posterior

NOISE = 0.017
TURN = np.array([5.0, -3.0, 20.0]) / ARCSEC_PER_RADIAN
DRIFT = np.array([4.0, 1.0, 0.0]) / ARCSEC_PER_RADIAN


def images(platform, drift, frames):
    """Images of two groups: at the zero point, and about `TURN`."""
    generator, zero, groups = default_rng(3), np.zeros(3), []
    for first, last in ((zero, zero), (TURN - drift / 2, TURN + drift / 2)):
        path = first + np.linspace(0, 1, frames)[:, None] * (last - first)
        true = platform.predicted(path)
        groups.append(true + NOISE * generator.normal(size=true.shape))
    return groups


@pytest.fixture(scope="module")
def constant(platform):
    spots = images(platform, np.zeros(3), 400)
    return misalignment_model(SpotLikelihood.of(platform, spots))


def test_sampler_agrees_with_the_small_angle_limit(constant):
    """The normal law of a linear prediction with known noise, within Monte Carlo errors."""
    posterior = sample(constant, Plan(5, ensembles=2, steps=300, warmup=120))
    likelihood = constant.likelihood
    *priors, _ = (one.prior for one in constant.parameters)
    middle, sigma = np.array([(one.mean, one.sigma) for one in priors]).T
    start, spread = likelihood.start()
    centre, scale = start[:-1], spread[:-1]
    response, left = likelihood.linearised(start, scale)
    # In units of the errors, or the matrices cannot be inverted.
    response, held = response * scale / start[-1], np.square(scale / sigma)
    covariance = np.linalg.inv(response.T @ response + np.diag(held))
    pull = response.T @ left / start[-1] + held * (middle - centre) / scale
    mean, errors = covariance @ pull, np.sqrt(covariance.diagonal())
    for i, name in enumerate(constant.names[:-1]):
        chain = (posterior.chain[..., i] - centre[i]) / scale[i]
        assert abs(chain.mean() - mean[i]) < 4 * mcse_mean(chain), name
        assert abs(chain.std() - errors[i]) < 4.5 * mcse_deviation(chain), name
    known = covariance / np.outer(errors, errors)
    found = np.corrcoef(posterior.draws.T)[:-1, :-1]
    assert np.abs(found - known).max() < 5 / np.sqrt(len(posterior.draws))
    assert np.abs(known - np.eye(len(known))).max() > 0.3, "parameters are correlated"


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
    times = 0, drifts * np.linspace(-1, 1, 100)
    model = misalignment_model(SpotLikelihood.of(platform, groups, times))
    centre, spread = model.likelihood.start()
    steps = default_rng(1).normal(size=(8, len(centre)))
    points = centre + 0.5 * spread * steps
    whole = all_images(platform, points, groups)
    assert np.ptp(whole) > 1
    off = 0.01 if drifts else 1e-7
    assert_allclose(model.likelihood(points), whole, rtol=0, atol=off)
    truth = np.concatenate([TURN, drift])[: len(centre) - 5]
    pulls = (centre[3:-2] - truth) / spread[3:-2]
    assert np.abs(pulls).max() < 4


def test_free_directions_of_the_lasers_leave_the_uncertainties():
    """The first group then measures the directions, and the motion of the spots the angle."""
    found = book_posterior("misalignment")
    likelihood = found.model.likelihood
    centre, spread = likelihood.start()
    first, second = likelihood.counts
    response = likelihood.linearised(centre, spread[:-1])[0][:, 3:6]
    noise = centre[-1] ** 2 * (1 + second / first)
    covariance = np.linalg.inv(response.T @ response) * noise
    errors = found.draws[:, 3:6].std(axis=0)
    assert_allclose(np.sqrt(np.diagonal(covariance)), errors, rtol=0.03)


def test_table_3_scatters_more_than_one_noise_allows():
    """Compared with repeats of the whole table, with the noise of the posterior."""
    printed = load_inputs(["chen2023/table-3"]).array("chen2023/table-3") / 3
    found = book_posterior("misalignment")
    noise = found.draws[:, -1].mean()
    repeats = np.sqrt(default_rng(2).chisquare(799, (20_000, 16)) / 799)
    furthest = np.quantile(np.abs(np.log(repeats)).max(axis=1), 0.95)
    assert (np.abs(np.log(printed / noise)) > furthest).sum() > 1
