"""Boxes of correlated printed numbers: the rule of Table IV against plainer and finer integrals."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from reproduce.inference.models import averaging, rounded
from reproduce.inference.quadrature import small_log_evidence, summed
from reproduce.inference.sampling import Plan, sample
from reproduce.papers.chen2023.posteriors import COLUMNS, column_model
from reproduce.papers.posteriors import posteriors


@pytest.fixture(scope="module")
def sampled():
    return {name: sample(column_model(name), Plan(5, steps=250, warmup=100)) for name in COLUMNS}


def plain_integral(mean, covariance, low, high, nodes=5):
    """Sum the density itself over a product of rules: nothing is conditioned or standardised."""
    places, weights = np.polynomial.legendre.leggauss(nodes)
    middle, half = (high + low) / 2, (high - low) / 2
    grid = np.stack(np.meshgrid(*middle[:, None] + half[:, None] * places, indexing="ij"), axis=-1)
    shares = np.meshgrid(*np.log(half[:, None] * weights), indexing="ij")
    total = np.sum(shares, axis=0).ravel()
    grid = grid.reshape(-1, len(low))
    found = []
    for centre, square in zip(mean, covariance, strict=True):
        root = np.linalg.cholesky(square)
        scaled = np.linalg.solve(root, (grid - centre).T)
        logs = -0.5 * (scaled**2).sum(axis=0) - 0.5 * len(low) * np.log(2 * np.pi)
        found.append(logsumexp(logs + total) - np.log(np.diagonal(root)).sum())
    return np.array(found)


@dataclass(frozen=True, eq=False)
class PlainAveraging(averaging.AveragingLikelihood):
    """The same likelihood with four nodes of the density itself along every number."""

    def __call__(self, parameters):
        return plain_integral(*self._distribution(parameters), *self.box, nodes=4)


def scipys(mean, covariance, low, high):
    """Log probability of one box by SciPy, in units of the scatter."""
    scale = np.sqrt(np.diagonal(covariance))
    correlation = covariance / np.outer(scale, scale)
    share = stats.multivariate_normal.cdf(
        (high - mean) / scale, np.zeros(len(mean)), correlation, lower_limit=(low - mean) / scale,
        maxpts=2_000_000, abseps=1e-14, releps=3e-4, rng=np.random.default_rng(1),
    )  # fmt: skip
    return np.log(share)


def posterior_like(posterior):
    """Draws of a posterior, those with the greatest floors among them."""
    draws = posterior.draws[np.argsort(posterior.draws[:, 1])]
    return np.concatenate([draws[:: len(draws) // 20], draws[-10:]])


@pytest.mark.parametrize("name", COLUMNS)
def test_likelihood_is_the_integral_of_the_density(sampled, name):
    likelihood, points = sampled[name].model.likelihood, posterior_like(sampled[name])
    distribution = likelihood._distribution(points)
    plain = plain_integral(*distribution, *likelihood.box)
    np.testing.assert_allclose(likelihood(points), plain, rtol=0, atol=2e-3)
    middle = len(points) // 2
    theirs = scipys(*(part[middle] for part in distribution), *likelihood.box)
    assert abs(theirs - plain[middle]) < 1e-3


def test_likelihood_of_data_from_the_prior():
    """Coarse print and fine, against many points: good in the bulk, and never far off."""
    model = posteriors()["frame-averaging"].model()
    generator = np.random.default_rng(2)
    errors = []
    for truth in model.draw_prior(generator, 24):
        likelihood = model.given(model.simulate(truth, generator)).likelihood
        around = truth * np.array([[1.0, 1.0], [1.02, 0.7], [0.98, 1.3]])
        mean, covariance = likelihood._distribution(around)
        order = likelihood.rule.order
        root = np.linalg.cholesky(covariance[:, order[:, None], order])
        low, high = likelihood.box
        points = rounded.quasi_random(6, 2**13, seed=3)
        many = rounded.log_box(mean[:, order], root, low[order], high[order], points)
        # Where a posterior would be.
        errors.append(np.abs(likelihood(around) - many)[many > many.max() - 8].max())
    assert np.median(errors) < 2e-3
    assert np.quantile(errors, 0.8) < 0.02
    assert max(errors) < 0.2


@pytest.mark.parametrize("size", [5, 12])
def test_independent_numbers_multiply(size):
    """Narrow and wide boxes in any order; twelve numbers need points."""
    generator = np.random.default_rng(size)
    scatter, mean = generator.uniform(0.2, 3, size), generator.normal(size=(4, size))
    low = generator.normal(size=size)
    high = low + generator.uniform(0.05, 4, size)
    covariance = np.repeat(np.diag(scatter**2)[None], 4, axis=0)
    rule = rounded.BoxRule.of(covariance[0], high - low)
    assert (rule.points is not None) == (size == 12)
    found = rounded.log_box_by_rule(mean, covariance, low, high, rule)
    exact = rounded.log_interval((low - mean) / scatter, (high - mean) / scatter).sum(axis=1)
    np.testing.assert_allclose(found, exact, atol=2e-3)


def test_narrow_numbers_come_first_and_take_few_nodes():
    widths = np.array([0.5, 0.01, 9.0, 0.1, 1.0])
    rule = rounded.BoxRule.of(np.eye(5), widths)
    np.testing.assert_array_equal(rule.order, np.argsort(widths))
    assert rule.nodes == (1, 2, 3, 4)
    assert not any(rule.wide)
    # The second number is narrow given the first, not by itself.
    close = np.array([[1.0, 0.9, 0], [0.9, 1.0, 0], [0, 0, 1.0]])
    rule = rounded.BoxRule.of(close, np.array([1.0, 1.01, 1.5]))
    np.testing.assert_array_equal(rule.order, [0, 2, 1])
    assert rule.wide == (False, True)


def test_rows_do_not_depend_on_each_other(sampled):
    """More rows than are worked on at once."""
    likelihood, draws = sampled[COLUMNS[0]].model.likelihood, sampled[COLUMNS[0]].draws[:300]
    assert len(draws) * likelihood.rule.size > 2 * rounded.AT_ONCE
    alone = np.concatenate([likelihood(row[None]) for row in draws[::37]])
    np.testing.assert_allclose(likelihood(draws)[::37], alone, rtol=1e-13)


@pytest.mark.parametrize("kind", ["points", "rule"])
def test_result_is_smooth_where_intervals_change_sides(kind):
    covariance = 0.7 + 0.3 * np.eye(3)
    low, high = np.array([-1.0, -2.0, -0.5]), np.array([2.0, 1.5, 1.0])
    mean = np.linspace(-1, 1, 2001)[:, None] * np.array([1.0, 0.7, 0.4])
    many = np.repeat(covariance[None], len(mean), axis=0)
    if kind == "rule":
        rule = rounded.BoxRule.of(covariance, high - low)
        assert all(rule.wide)
        found = rounded.log_box_by_rule(mean, many, low, high, rule)
    else:
        root = np.linalg.cholesky(many)
        found = rounded.log_box(mean, root, low, high, rounded.quasi_random(3))
    # Bends of a smooth function are as small as the square of the step.
    assert np.abs(np.diff(found, 2)).max() < 10 * (mean[1, 0] - mean[0, 0]) ** 2


@pytest.mark.parametrize("floor", [True, False])
def test_evidence_by_quadrature_against_a_finer_integral(floor):
    """Other nodes for the parameters, and another integral of the box."""
    model = column_model("misalignment-x", floor)
    likelihood = model.likelihood
    plain = PlainAveraging(
        likelihood.counts, likelihood.printed, likelihood.half_unit, likelihood.frames, floor
    )
    finer = summed(replace(model, likelihood=plain), 0.2)
    assert abs(small_log_evidence(model) - finer.log_evidence) < 1e-3
