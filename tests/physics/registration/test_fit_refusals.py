"""What a registration with known errors refuses: covariances that are none."""

import numpy as np
import pytest

from reproduce.physics.registration import fit_registration
from reproduce.physics.validate import DegenerateGeometryError

SOURCE = np.random.default_rng(8).uniform(0, 1000, (6, 2))


@pytest.mark.parametrize(
    "matrix",
    [
        [
            [-0.5, 0.0],
            [0.0, 1.0],
        ],  # a variance below zero, if only by half a pixel squared
        [[1.0, 1.5], [1.5, 1.0]],  # a correlation above one
        [[1.0, 0.0], [0.0, 0.0]],  # no variance at all along y
        [[1.0, 0.2], [0.0, 1.0]],  # not symmetric
    ],
)
def test_what_is_no_covariance_is_refused(matrix):
    matrices = np.broadcast_to(np.array(matrix), (6, 2, 2))
    with pytest.raises(ValueError, match="target_covariance: expected symmetric"):
        fit_registration(SOURCE, SOURCE + 1, np.zeros(2), target_covariance=matrices)


def test_sizes_whose_squares_overflow_are_refused():
    """Nothing can be said of residuals that are not finite, however good the fit looks."""
    with (
        np.errstate(over="ignore"),
        pytest.raises(DegenerateGeometryError, match="target"),
    ):
        fit_registration(SOURCE, SOURCE * 1e155, np.zeros(2))
