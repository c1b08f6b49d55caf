"""Robust fits: what their covariance covers, and which points known errors let them drop."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from simulated import PIVOT, SHIFT, TRUTH, stars

from reproduce.physics.registration import MODELS, Registration, fit_registration


@pytest.mark.parametrize("known", ["covariances", "weights"])
def test_points_are_judged_by_their_own_errors(known):
    sigma = np.tile([0.02, 0.5], 40)[:, None]
    source, target = stars(80, sigma, batch=(300,))
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
    normal = np.square(fit.parameters - TRUTH.parameters).mean(axis=0)
    np.testing.assert_array_less(
        normal, 1.4 * np.square(best.parameters - TRUTH.parameters).mean(axis=0)
    )
    claimed = np.diagonal(fit.covariance, axis1=-2, axis2=-1).mean(axis=0)
    assert_allclose(claimed / normal, 1, atol=5 * np.sqrt(2 / len(source)))


@pytest.mark.parametrize("model", MODELS)
def test_few_right_points_are_kept(model):
    for count in (5, 6) if model in ("affine", "similarity+radial") else (4, 5):
        source, target = stars(count, truth=SHIFT, batch=(200,))
        fit = fit_registration(source, target, PIVOT, model=model, robust=True)
        assert fit.rejected.mean() < 0.01


@pytest.mark.parametrize("model", MODELS)
def test_a_wrong_match_of_five_is_rejected(model):
    source, target = stars(5, [0.3, 0.03], 1, SHIFT, 1, (100,))
    known = {"source_covariance": np.diag([0.09, 0.0009])}
    fit = fit_registration(source, target, PIVOT, model=model, robust=True, **known)
    assert (fit.rejected == [True, False, False, False, False]).mean() > 0.99


def test_wrong_matches_of_a_turned_field_are_rejected():
    truth = Registration("similarity", np.array([1.1, 2.0, 30.0, -20.0]), PIVOT)
    source, target = stars(40, wrong=15, truth=truth)
    fit = fit_registration(source, target, PIVOT, robust=True)
    assert fit.rejected.sum() >= 14
    assert np.abs((fit.parameters - truth.parameters) / fit.standard_errors).max() < 5


def test_a_large_field_is_judged_by_a_part_of_itself_as_by_the_whole(monkeypatch):
    """The part decides only on points at the limit, of which there are hardly any."""
    source, target = stars(8000, wrong=2400, batch=(2,))
    weights = np.tile([1.0, 0.0, 2.0, 1.0], 2000)
    part = fit_registration(source, target, PIVOT, weights, robust=True)
    monkeypatch.setattr("reproduce.physics.registration.fit._MAX_TESTED", 10_000)
    whole = fit_registration(source, target, PIVOT, weights, robust=True)
    assert 0.2 < whole.rejected.mean() < 0.26  # three quarters of 0.3
    assert (part.rejected != whole.rejected).mean() < 1e-3
    assert not part.rejected[:, 1::4].any()
    assert np.abs((part.parameters - TRUTH.parameters) / part.standard_errors).max() < 5
