"""The TASTE test: its law by Monte Carlo, and what it notices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, kstest

from reproduce.physics.attitude import taste

ROWS = np.array([[1, 0, 0.1], [0, 1, 0.2], [0.3, 0, 1], [0.5, -0.5, 0.7], [0.1, 0.2, -1.0]])
ROWS /= np.linalg.norm(ROWS, axis=-1, keepdims=True)


def seen(rows, sigma, shape, seed):
    """Directions with errors across them, in a frame turned at random for each set."""
    rng = np.random.default_rng(seed)
    turns = Rotation.random(int(np.prod(shape)), random_state=rng).as_matrix()
    exact = rows @ np.swapaxes(turns.reshape(*shape, 3, 3), -1, -2)
    moved = exact + np.asarray(sigma)[..., np.newaxis] * rng.standard_normal(exact.shape)
    return moved / np.linalg.norm(moved, axis=-1, keepdims=True)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_the_statistic_follows_the_chi_square_law(count):
    sigma = np.geomspace(1e-5, 4e-5, count)
    rows = ROWS[:count]
    statistic, probability = taste(seen(rows, sigma, (50, 80), 1), rows, sigma)
    assert statistic.shape == probability.shape == (50, 80)
    assert kstest(statistic.ravel(), chi2(2 * count - 3).cdf).pvalue > 1e-3
    assert kstest(probability.ravel(), "uniform").pvalue > 1e-3


def test_spots_close_together_follow_it_too():
    spots = np.array([[0, 5e-3, 1], [0, -5e-3, 1], [5e-3, 0, 1], [-5e-3, 0, 1]])
    target = seen(spots / np.linalg.norm(spots, axis=-1, keepdims=True), [4e-6] * 4, (4000,), 2)
    assert kstest(taste(target, spots, 4e-6)[0], chi2(5).cdf).pvalue > 1e-3


def test_errors_of_both_sides_add_in_quadrature():
    target, source = seen(ROWS, [3e-5] * 5, (3000,), 3), seen(ROWS, [4e-5] * 5, (3000,), 4)
    assert kstest(taste(target, source, 5e-5)[1], "uniform").pvalue > 1e-3
    assert kstest(taste(target, source, 4e-5)[1], "uniform").pvalue < 1e-9


def test_a_direction_that_is_not_where_it_is_said_to_be_is_noticed():
    target = seen(ROWS, [1e-5] * 5, (500,), 6)
    target[:, 2] += 1e-4 * target[:, 0]
    target /= np.linalg.norm(target, axis=-1, keepdims=True)
    assert (taste(target, ROWS, 1e-5)[1] < 0.01).mean() > 0.99


def test_two_directions_leave_one_degree_of_freedom_their_angle():
    target = seen(ROWS[:2], [1e-5] * 2, (200,), 7)
    # For small errors half the squared excess of the angle between them is left over.
    angles = [np.arccos(np.einsum("...i,...i->...", r[..., 0, :], r[..., 1, :]))
              for r in (target, ROWS[:2])]  # fmt: skip
    expected = (angles[0] - angles[1]) ** 2 / 2 / 1e-5**2
    np.testing.assert_allclose(taste(target, ROWS[:2], 1e-5)[0], expected, rtol=1e-3, atol=1e-6)


def test_wrong_sigmas_are_refused():
    with pytest.raises(ValueError, match=r"sigma: expected shape \(\.\.\., 3\)"):
        taste(np.eye(3), np.eye(3), [1e-5, 1e-5])
    with pytest.raises(ValueError, match="sigma"):
        taste(np.eye(3), np.eye(3), 0.0)
    with pytest.raises(ValueError, match="batch"):
        taste(np.tile(np.eye(3), (2, 1, 1)), np.eye(3), np.full((3, 3), 1e-5))
