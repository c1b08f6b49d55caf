"""Spots and their centres against integrals, closed forms and the bound."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.stats import norm

from reproduce.physics.images import (
    centre_of_gravity,
    centre_of_gravity_error,
    cramer_rao_variance,
    render_frame,
    spot_windows,
    window_corners,
)
from reproduce.physics.validate import DegenerateGeometryError


def test_a_window_is_the_integral_of_the_gaussian():
    across = spot_windows([0.3, 0.0], 1.0, 0.7, [-1, -30], 61)[:, :3].sum(axis=0)
    by_hand = [quad(norm(0.3, 0.7).pdf, p - 0.5, p + 0.5)[0] for p in (-1, 0, 1)]
    assert_allclose(across, by_hand, rtol=1e-10)


def test_a_frame_is_cut_out_of_a_larger_one():
    """Spots may lie beyond every edge: what they throw into the frame stays."""
    inside = np.array(
        [[-3.4, 2.0], [12.9, 3.0], [4.0, -3.4], [5.0, 10.9], [12.9, 10.9], [6.2, 3.9]]
    )
    frame = render_frame(inside, 1e3, 1.0, (10, 8))
    larger = render_frame(np.add(inside, [20, 30]), 1e3, 1.0, (50, 60))
    assert_allclose(frame, larger[30:38, 20:30], atol=1e-12)


def test_both_tails_of_a_spot_keep_their_digits():
    """By symmetry: one minus nearly one would lose a tail beyond eight radii."""
    row = spot_windows([0.0, 0.0], 1.0, 0.5, [-15, -15], 31)[15]
    assert_allclose(row, row[::-1], rtol=1e-12)
    assert (row > 0).all()


def test_pixels_far_from_the_spot_tell_nothing_of_it():
    """A window that grows beyond the spot leaves the bound as it is."""
    bounds = [
        cramer_rao_variance([0.2, 0.0], 1e4, 1.5, [-half, -half], 2 * half + 1)
        for half in (10, 15, 30)
    ]
    assert_allclose(bounds[1:], np.broadcast_to(bounds[0], (2, 2)), rtol=1e-6)


def test_a_frame_holds_the_same_spots_as_the_windows():
    points = np.array([[6.2, 5.7], [20.4, 9.9]])
    frame = render_frame(points, [100.0, 50.0], 0.6, (32, 16))
    corners = window_corners(points, 5)
    assert_allclose(
        [frame[y : y + 5, x : x + 5] for x, y in corners],
        spot_windows(points, [100.0, 50.0], 0.6, corners, 5),
        atol=1e-9,
    )
    assert frame.shape == (16, 32)


def test_a_tight_window_pushes_the_scatter_below_the_unbiased_bound_but_not_the_biased():
    bound = cramer_rao_variance([0.1, 0.1], 1200.0, 2.6, [-2, -2], 5)
    (bias, variance), (moved, _) = (
        centre_of_gravity_error([place, place], 1200.0, 2.6, [-2, -2], 5)
        for place in (0.1, 0.1001)
    )
    assert (variance < 0.5 * bound).all()
    slope = 1 + (moved - bias) / 1e-4
    assert (variance >= slope**2 * bound).all()


def test_dark_windows_and_even_ones_are_refused():
    with pytest.raises(DegenerateGeometryError, match="every window"):
        centre_of_gravity(np.zeros((2, 5, 5)), [0, 0])
    with pytest.raises(ValueError, match="odd"):
        window_corners([1.0, 1.0], 4)
    with pytest.raises(ValueError, match="radius"):
        spot_windows([0.0, 0.0], 1.0, 0.0, [0, 0], 5)


def test_dark_windows_of_a_batch_are_named():
    windows = np.ones((1158, 5, 5))
    windows[[77, 100]] = 0
    with pytest.raises(ValueError, match=r"windows: .* 2 of 1158 .* 77"):
        centre_of_gravity(windows, (0, 0))
