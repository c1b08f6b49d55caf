"""Mean misalignment from laser spots: its error against replicates, both groups noisy."""

import numpy as np
import pytest

from reproduce.physics.attitude.monitoring import mean_misalignment, monitored_angles

LASERS = 0.02 * np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])
TRACKER = ((0.0, 0.0), 5.5e-6, 0.05)
SPOTS = LASERS / 4.0 * TRACKER[2] / TRACKER[1]


@pytest.mark.parametrize(("zero", "now"), [(5, 5), (2, 40), (40, 1)])
def test_the_error_of_the_mean_covers_what_replicates_do(zero, now):
    """The zero point's own noise moves every image of the present alike."""
    rng = np.random.default_rng(5)
    means, errors = [], []
    for _ in range(600):
        before, after = (SPOTS + rng.normal(0, 0.1, (n, 4, 2)) for n in (zero, now))
        angles, zeros = (
            monitored_angles(before, one, LASERS, 4.0, TRACKER) for one in (after, before)
        )
        mean, _, error = mean_misalignment(angles, zeros)
        means.append(mean)
        errors.append(error)
    spread = np.std(means, axis=0)
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(errors), axis=0)), spread, rtol=0.12)


def test_one_image_in_each_group_says_nothing_of_the_error():
    mean, scatter, error = mean_misalignment([[1.0, 2, 3]], [[0.0, 0, 0]])
    np.testing.assert_array_equal(mean, [1, 2, 3])
    assert np.isnan([*scatter, *error]).all()
