"""The scatter of fits against the covariance of a fit whose errors are known."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose

from reproduce.physics.registration import Registration, fit_registration

POINTS = default_rng(3).uniform(0, 2000, (9, 2))
TRUTH = Registration.similarity(1.3, 0.4, (2.0, -1.0), (900.0, 700.0))


def test_the_closed_form_reaches_the_bound():
    target, noise = TRUTH.apply(POINTS), default_rng(4)
    source = POINTS + 0.2 * noise.standard_normal((6000, *POINTS.shape))
    noisy = target + 0.3 * noise.standard_normal((6000, *POINTS.shape))
    scatter = fit_registration(source, noisy, TRUTH.pivot).parameters.var(axis=0)
    known = {
        "source_covariance": 0.2**2 * np.eye(2),
        "target_covariance": 0.3**2 * np.eye(2),
    }
    bound = fit_registration(POINTS, target, TRUTH.pivot, **known).covariance
    assert_allclose(scatter, bound.diagonal(), rtol=5 * np.sqrt(2 / 6000))
