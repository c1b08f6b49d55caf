"""Spots and their centres against integrals, closed forms and the bound."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from reproduce.physics.images import (
    Detector,
    centre_of_gravity,
    centre_of_gravity_error,
    cramer_rao_variance,
    detect_spots,
    expose,
    fitted_centre,
    render_frame,
    spot_windows,
    window_corners,
)
from reproduce.physics.images.spots import _share_slopes, _shares
from reproduce.physics.validate import DegenerateGeometryError

ROW = np.array([0.3, 0.7, -1.0])  # a spot's place and radius, and the first pixel of a row
PHASES = np.linspace(-0.5, 0.5, 21)


def test_shares_are_the_integral_of_the_gaussian():
    shares = _shares(*ROW, 3)
    by_hand = [quad(norm(0.3, 0.7).pdf, p - 0.5, p + 0.5)[0] for p in (-1, 0, 1)]
    np.testing.assert_allclose(shares, by_hand, rtol=1e-10)


def test_both_tails_of_a_spot_keep_their_digits():
    """By symmetry; a tail taken from one less nearly one would be lost beyond eight radii."""
    shares = _shares(*np.array([0.0, 0.5, -15]), 31)
    np.testing.assert_allclose(shares, shares[::-1], rtol=1e-12)
    assert (shares > 0).all()
    assert shares.sum() == pytest.approx(1.0, abs=1e-15)


def test_pixels_far_from_the_spot_tell_nothing_of_it():
    """A window that grows beyond the spot leaves the bound as it is."""
    bounds = [
        cramer_rao_variance([0.2, 0.0], 1e4, 1.5, [-half, -half], 2 * half + 1)
        for half in (10, 15, 30)
    ]
    np.testing.assert_allclose(bounds[1:], np.broadcast_to(bounds[0], (2, 2)), rtol=1e-6)


def test_slopes_are_the_derivative_of_the_shares():
    step = 1e-6
    moved = _shares(ROW[0] + step, *ROW[1:], 3) - _shares(ROW[0] - step, *ROW[1:], 3)
    np.testing.assert_allclose(_share_slopes(*ROW, 3), moved / (2 * step), rtol=1e-7)


def test_x_runs_along_columns_and_y_along_rows():
    window = spot_windows([12.0, 31.0], 100.0, 0.4, [10, 30], 5)
    assert window.shape == (5, 5)
    assert np.unravel_index(window.argmax(), window.shape) == (1, 2)


def test_windows_stand_around_the_pixel_that_holds_the_spot():
    corners = window_corners([[10.49, 0.0], [10.51, -0.51]], 5)
    assert corners.tolist() == [[8, -2], [9, -3]]


def test_a_frame_holds_the_same_spots_as_the_windows():
    points = np.array([[6.2, 5.7], [20.4, 9.9]])
    frame = render_frame(points, [100.0, 50.0], 0.6, (32, 16))
    corners = window_corners(points, 5)
    np.testing.assert_allclose(
        [frame[y : y + 5, x : x + 5] for x, y in corners],
        spot_windows(points, [100.0, 50.0], 0.6, corners, 5),
        atol=1e-9,
    )
    assert frame.shape == (16, 32)


def test_spots_at_the_edge_leave_what_falls_inside():
    frame = render_frame([[-0.5, 3.0], [99.0, 3.0], [500.0, 3.0]], 100.0, 0.5, (100, 8))
    assert frame.sum() == pytest.approx(50.0 + 100.0 * norm.cdf(1.0), abs=0.01)


def test_every_spot_is_found_once_even_when_it_is_saturated():
    frame = render_frame([[10.0, 8.0], [30.5, 20.0]], [1000.0, 4000.0], 0.8, (48, 32))
    frame = np.minimum(frame, 200.0)
    found = detect_spots(frame, 20.0)
    assert sorted(found[:, 0]) == [10, 30]
    assert detect_spots(frame, 1e9).shape == (0, 2)


def test_a_flat_patch_is_one_spot_at_its_middle_whatever_its_size():
    frame = np.zeros((200, 300))
    frame[20:101, 30:141] = 4095.0
    frame[150:153, 200] = 4095.0
    assert detect_spots(frame, 10.0).tolist() == [[85, 60], [200, 151]]


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_spots_are_those_that_nothing_near_outshines(seed):
    frame = np.random.default_rng(seed).standard_normal((40, 50))
    brute = [
        (x, y)
        for y in range(40)
        for x in range(50)
        if frame[y, x] > 0.5
        and frame[y, x] == frame[max(y - 4, 0) : y + 5, max(x - 4, 0) : x + 5].max()
    ]
    brute.sort(key=lambda at: -frame[at[1], at[0]])
    assert detect_spots(frame, 0.5).tolist() == [list(at) for at in brute]


def test_estimators_agree_on_a_wide_clean_spot():
    window = spot_windows([10.23, 19.81], 1e5, 1.2, [0, 9], 21)
    for found in (
        centre_of_gravity(window, (0, 9)),
        fitted_centre(window, (0, 9), 1.2),
        fitted_centre(window, (0, 9), 1.2, 5.0),
    ):
        np.testing.assert_allclose(found, [10.23, 19.81], atol=1e-4)


@pytest.mark.parametrize("radius", [0.2, 0.35, 0.58])
def test_the_s_curve_is_what_a_wide_window_shows(radius):
    points = np.stack([PHASES, np.zeros_like(PHASES)], axis=-1)
    windows = spot_windows(points, 1.0, radius, [-8, -8], 17)
    found = centre_of_gravity(windows, [-8, -8])[:, 0] - PHASES
    order = np.arange(1, 21)[:, np.newaxis]  # the series of the page
    damping = np.exp(-2 * (np.pi * order * radius) ** 2)
    waves = damping * np.sin(2 * np.pi * order * PHASES)
    series = ((-1.0) ** order / (np.pi * order) * waves).sum(axis=0)
    np.testing.assert_allclose(series, found, atol=1e-12)
    assert np.abs(found).max() > 1e-4


def test_the_slope_is_that_of_the_expected_position():
    step = 1e-6
    law = centre_of_gravity_error([0.2, -0.1], 1000.0, 0.9, [-2, -2], 5)
    ends = [
        centre_of_gravity(spot_windows([0.2 + s, -0.1], 1000.0, 0.9, [-2, -2], 5), [-2, -2])[0]
        for s in (-step, step)
    ]
    assert law.slope[0] == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-7)
    assert law.slope[0] < 0.96, "the window cuts this spot, so the centre follows too slowly"


@pytest.fixture(scope="module")
def trials():
    """Spots at one phase, seen 20,000 times with photon and read noise."""
    point, count, corners = np.array([0.31, -0.12]), 20_000, np.array([-2, -2])
    light = spot_windows(point, 3000.0, 0.6, corners, 5)
    noisy = expose(
        np.broadcast_to(light, (count, 5, 5)), Detector(read_noise=4.0), np.random.default_rng(3)
    )
    return point, corners, noisy


def test_the_scatter_of_the_centre_of_gravity_is_as_predicted(trials):
    point, corners, noisy = trials
    found = centre_of_gravity(noisy, corners)
    law = centre_of_gravity_error(point, 3000.0, 0.6, corners, 5, 4.0)
    np.testing.assert_allclose(found.var(axis=0), law.variance, rtol=4 * np.sqrt(2 / len(found)))
    error = np.sqrt(law.variance / len(found))
    assert (np.abs(found.mean(axis=0) - point - law.bias) < 4 * error).all()
    assert (np.abs(law.bias) > 4 * error).any(), "a bias of zero would pass as well"


def test_read_noise_pushes_the_centre_of_gravity_away_from_the_middle_of_the_window():
    point, corners, count = np.array([0.45, 0.0]), np.array([-2, -2]), 100_000
    light = np.broadcast_to(spot_windows(point, 400.0, 0.6, corners, 5), (count, 5, 5))
    noisy = expose(light, Detector(read_noise=10.0), np.random.default_rng(11))
    found = centre_of_gravity(noisy, corners)[:, 0]
    law = centre_of_gravity_error(point, 400.0, 0.6, corners, 5, 10.0)
    quiet = centre_of_gravity_error(point, 400.0, 0.6, corners, 5)
    error = np.sqrt(law.variance[0] / count)
    assert abs(found.mean() - point[0] - law.bias[0]) < 4 * error
    assert law.bias[0] - quiet.bias[0] > 8 * error


def test_likelihood_reaches_the_bound_and_nothing_beats_it(trials):
    point, corners, noisy = trials
    bound = cramer_rao_variance(point, 3000.0, 0.6, corners, 5, 4.0)
    margin = 4 * np.sqrt(2 / len(noisy))
    ratio = fitted_centre(noisy, corners, 0.6, 4.0).var(axis=0) / bound
    assert (np.abs(ratio - 1) < margin).all()
    law = centre_of_gravity_error(point, 3000.0, 0.6, corners, 5, 4.0)
    assert (law.variance > 1.2 * bound).all(), "read noise in far pixels costs"


def test_a_tight_window_pushes_the_scatter_below_the_unbiased_bound_but_not_the_biased():
    bound = cramer_rao_variance([0.1, 0.1], 1200.0, 2.6, [-2, -2], 5)
    law = centre_of_gravity_error([0.1, 0.1], 1200.0, 2.6, [-2, -2], 5)
    assert (law.variance < 0.5 * bound).all()
    assert (law.variance >= law.slope**2 * bound).all()


def test_dark_windows_and_even_ones_are_refused():
    with pytest.raises(DegenerateGeometryError, match="light in every window"):
        centre_of_gravity(np.zeros((2, 5, 5)), [0, 0])
    with pytest.raises(ValueError, match="one image"):
        detect_spots(np.zeros((2, 9, 9)), 1.0)
    with pytest.raises(ValueError, match="odd"):
        window_corners([1.0, 1.0], 4)
    with pytest.raises(ValueError, match="radius"):
        spot_windows([0.0, 0.0], 1.0, 0.0, [0, 0], 5)


def test_dark_windows_of_a_batch_are_named():
    windows = np.ones((1158, 5, 5))
    windows[[77, 100]] = 0
    with pytest.raises(ValueError, match=r"got 2 of 1158 with none in sum \(77, 100\); take"):
        centre_of_gravity(windows, (0, 0))
