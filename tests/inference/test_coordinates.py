"""Coordinates of the moves: a one-to-one map and its volume."""

import numpy as np
import pytest

from calibrations import drawn_prior
from reproduce.papers.posteriors import posteriors


@pytest.mark.parametrize("seed", range(5))
def test_the_map_is_one_to_one_with_the_stated_volume(seed):
    generator = np.random.default_rng(seed)
    model = posteriors()["registration-mixture"].model()
    data = model.likelihood.simulate(drawn_prior(model, generator, 1)[0], generator)
    points, there = model.with_data(data).start(generator, 6), model.coordinates
    straight = there.straight(points)
    assert not np.allclose(straight[:, 4:], points[:, 4:])
    np.testing.assert_allclose(there.parameters(straight), points, rtol=1e-9)
    jacobian = np.stack(
        [
            (there.parameters(straight + step) - there.parameters(straight - step))
            / 2e-5
            for step in 1e-5 * np.eye(6)
        ],
        axis=-1,
    )
    expected = np.linalg.slogdet(jacobian)[1]
    np.testing.assert_allclose(there.log_volume(points), expected, atol=1e-4)
