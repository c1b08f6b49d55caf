"""Tests of leading axes of spots, and of the edges of a frame."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from reproduce.physics.images import cramer_rao_variance, render_frame


def test_batches_that_do_not_fit_are_refused_with_their_shapes():
    with pytest.raises(ValueError, match=r"expected leading .*\(2,.*\(3,"):
        cramer_rao_variance(np.zeros((2, 2)), np.ones(3), 1.0, (-3, -3), 7)


def test_a_frame_is_cut_out_of_a_larger_one():
    """Spots may lie beyond every edge: what they throw into the frame stays."""
    inside = np.array(
        [[-3.4, 2.0], [12.9, 3.0], [4.0, -3.4], [5.0, 10.9], [12.9, 10.9], [6.2, 3.9]]
    )
    frame = render_frame(inside, 1e3, 1.0, (10, 8))
    larger = render_frame(np.add(inside, [20, 30]), 1e3, 1.0, (50, 60))
    assert_allclose(frame, larger[30:38, 20:30], atol=1e-12)
