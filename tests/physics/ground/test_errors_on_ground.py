"""Ellipses and CE90 against closed forms and draws."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from reproduce.physics.ground import circular_error


@pytest.mark.parametrize("ratio", [1.0, 0.7, 0.3, 0.05, 0.001])
def test_ce90_holds_ninety_in_a_hundred(ratio):
    covariance = np.diag([4.0, 4.0 * ratio**2])
    radius = float(circular_error(covariance))
    draws = default_rng(6).normal(size=(400_000, 2)) * np.sqrt(covariance.diagonal())
    share = (np.linalg.norm(draws, axis=1) < radius).mean()
    assert share == pytest.approx(0.9, abs=4 * np.sqrt(0.09 / 400_000))


def test_limits_have_their_closed_forms():
    assert_allclose(circular_error(np.eye(2)), np.sqrt(-2 * np.log(0.1)), rtol=1e-6)
    assert_allclose(circular_error(np.diag([1.0, 0.0])), 1.64485363, rtol=1e-8)
    assert circular_error(np.zeros((2, 2))) == 0.0
    assert_allclose(circular_error(np.eye(2), 0.5), np.sqrt(2 * np.log(2)), rtol=1e-6)


def test_nonsense_is_refused():
    with pytest.raises(ValueError, match="negative variance"):
        circular_error(np.diag([1.0, -1.0]))
    with pytest.raises(ValueError, match="share"):
        circular_error(np.eye(2), 90.0)
