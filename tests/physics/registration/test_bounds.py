"""The covariance of a fit against the whole information matrix, true positions included."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose

from reproduce.physics.registration import (
    Registration,
    fit_registration,
    jacobian,
)

POINTS = default_rng(3).uniform(0, 2000, (9, 2))
TRUTH = Registration.similarity(1.3, 0.4, (2.0, -1.0), (900.0, 700.0))


def whole_information(source_sigma, target_sigma):
    """Fisher information of four parameters and eighteen coordinates, all unknown."""
    count = len(POINTS)
    by_parameters = jacobian(TRUTH.parameters, POINTS, TRUTH.pivot)
    by_position = np.zeros((2 * count, 2 * count))
    for i in range(count):
        by_position[np.ix_([i, count + i], [2 * i, 2 * i + 1])] = TRUTH.matrix
    target_rows = np.hstack([by_parameters, by_position]) / target_sigma
    source_rows = (
        np.hstack([np.zeros((2 * count, 4)), np.eye(2 * count)]) / source_sigma
    )
    return target_rows.T @ target_rows + source_rows.T @ source_rows


def bound(source_sigma, target_sigma):
    """Return the covariance of a fit of points without noise, whose errors are known."""
    return fit_registration(
        POINTS,
        TRUTH.apply(POINTS),
        TRUTH.pivot,
        source_covariance=source_sigma**2 * np.eye(2),
        target_covariance=target_sigma**2 * np.eye(2),
    ).covariance


def test_the_bound_is_that_of_the_whole_problem():
    information = whole_information(0.2, 0.3)
    size = np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information / np.outer(size, size)) / np.outer(size, size)
    assert_allclose(bound(0.2, 0.3), inverse[:4, :4], rtol=1e-7, atol=1e-14)


def test_the_closed_form_reaches_the_bound():
    generator = default_rng(4)
    source = POINTS + 0.2 * generator.standard_normal((6000, *POINTS.shape))
    target = TRUTH.apply(POINTS) + 0.3 * generator.standard_normal(
        (6000, *POINTS.shape)
    )
    scatter = fit_registration(source, target, TRUTH.pivot).parameters.var(axis=0)
    assert_allclose(scatter, bound(0.2, 0.3).diagonal(), rtol=5 * np.sqrt(2 / 6000))
