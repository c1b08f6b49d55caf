"""Robust fits: what their covariance covers, and which points known errors let them drop."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from reproduce.physics.registration import Registration, fit_registration

PIVOT = np.array([1031.0, 770.0])
TRUE = np.array([1.002, 0.01, -3.0, 2.0])


def field(generator, trials, n, wrong=0.0, sigma=0.1):
    """Return points and their targets, of which a fraction is matched wrongly."""
    source = generator.uniform((0, 0), (2064, 1544), (trials, n, 2))
    target = Registration("similarity", TRUE, PIVOT).apply(source)
    target += sigma * generator.standard_normal(target.shape)
    dropped = generator.random((trials, n)).argsort(axis=1) < round(wrong * n)
    target += dropped[..., None] * generator.uniform(-400, 400, target.shape)
    return source, target


@pytest.mark.parametrize("known", ["covariances", "weights"])
def test_points_are_judged_by_their_own_errors(known):
    generator = default_rng(2)
    sigma = np.tile([0.02, 0.5], 40)[:, None]
    source, target = field(generator, 300, 80, sigma=sigma)
    target[:, 0, 0] += 50 * 0.02
    errors = np.square(sigma)[..., None] * np.eye(2)
    given = {"target_covariance": errors} if known == "covariances" else {}
    weights = None if known == "covariances" else sigma[:, 0] ** -2.0
    fit = fit_registration(source, target, PIVOT, weights, robust=True, **given)
    assert (fit.weights[:, 0] == 0).all(), "fifty standard deviations off"
    assert (fit.weights[:, 1::2] > 0).mean() > 0.99, "as far off as they may be"
    assert (fit.weights[:, 2::2] > 0).mean() > 0.99
    best = fit_registration(
        source[:, 1:], target[:, 1:], PIVOT, target_covariance=errors[1:]
    )
    normal = np.square(fit.parameters - TRUE).mean(axis=0)
    np.testing.assert_array_less(
        normal, 1.4 * np.square(best.parameters - TRUE).mean(axis=0)
    )
    claimed = np.diagonal(fit.covariance, axis1=-2, axis2=-1).mean(axis=0)
    assert_allclose(claimed / normal, 1, atol=5 * np.sqrt(2 / len(source)))


def test_a_large_field_is_judged_by_a_part_of_itself_as_by_the_whole(monkeypatch):
    """The part decides only on points at the limit, of which there are hardly any."""
    source, target = field(default_rng(4), 2, 8000, 0.3)
    weights = np.tile([1.0, 0.0, 2.0, 1.0], 2000)
    part = fit_registration(source, target, PIVOT, weights, robust=True)
    monkeypatch.setattr("reproduce.physics.registration.fit._MAX_TESTED", 10_000)
    whole = fit_registration(source, target, PIVOT, weights, robust=True)
    assert 0.2 < whole.rejected.mean() < 0.26  # three quarters of 0.3
    assert (part.rejected != whole.rejected).mean() < 1e-3
    assert not part.rejected[:, 1::4].any()
    assert np.abs((part.parameters - TRUE) / part.standard_errors).max() < 5
