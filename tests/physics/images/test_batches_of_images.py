"""Leading axes of the image side: a batch gives what each of its members gives alone."""

import numpy as np
import pytest

from reproduce.physics.images import (
    Light,
    centre_of_gravity,
    centre_of_gravity_error,
    cramer_rao_variance,
    render_frame,
    simulated_errors,
    spot_windows,
)
from reproduce.physics.optics import (
    Camera,
    reference_points_scaled,
    turned_onto_detector,
)
from reproduce.physics.registration import gauss_newton_step

DRAWS = np.random.default_rng(4)
POINTS = DRAWS.normal(size=(2, 5, 2))


@pytest.mark.parametrize(
    "call",
    [
        lambda: Camera([0.02, 0.03], np.zeros((3, 2)), 0.0, 4e-6),
        lambda: turned_onto_detector(POINTS, np.zeros(3)),
        lambda: cramer_rao_variance(np.zeros((2, 2)), np.ones(3), 1.0, (-3, -3), 7),
        lambda: spot_windows(np.zeros((2, 2)), 1.0, 0.5, np.zeros((3, 2)), 5),
        lambda: reference_points_scaled(POINTS, np.ones(3), (0, 0)),
    ],
    ids=["camera", "turn", "bound", "windows", "points"],
)
def test_batches_that_do_not_fit_are_refused_with_their_shapes(call):
    with pytest.raises(ValueError, match=r"expected leading .*\(2,.*\(3,"):
        call()


def test_points_of_a_batch_are_the_points_of_its_members():
    centre = np.array([7.0, 8.0])
    together = reference_points_scaled(POINTS, 1.5, centre)
    for found, points in zip(together, POINTS, strict=True):
        np.testing.assert_allclose(found, 1.5 * (points - centre) + centre, rtol=1e-14)


def test_a_cluster_a_thousand_times_narrower_than_far_is_still_fitted():
    """The columns are nearly dependent, but still far from where double precision is lost."""
    cluster = 1e3 + np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
    step = gauss_newton_step(
        (1, 0, 0, 0), cluster, np.add(cluster, [3.0, -4.0]), (0, 0)
    )
    np.testing.assert_allclose(step, [1, 0, -3, 4], atol=1e-6)


def test_the_errors_of_many_spots_are_those_of_each():
    points = DRAWS.uniform(-0.4, 0.4, size=(2, 3, 2))
    together = centre_of_gravity_error(points, 1e4, 0.5, (-3, -3), 7, 5.0)
    for i in np.ndindex(2, 3):
        alone = centre_of_gravity_error(points[i], 1e4, 0.5, (-3, -3), 7, 5.0)
        for name, value in vars(alone).items():
            np.testing.assert_allclose(
                vars(together)[name][i], value, atol=1e-12, err_msg=name
            )


def test_every_window_has_its_own_corner():
    corners = np.array([[10.0, 20.0], [-3.0, 4.0]])
    middles = np.add(corners, [3, 2])
    light = spot_windows(middles, 100.0, 0.4, corners, 7)[..., :5, :]
    np.testing.assert_allclose(centre_of_gravity(light, corners), middles, atol=1e-9)


def test_a_frame_is_cut_out_of_a_larger_one():
    """Spots may lie beyond every edge: what they throw into the frame stays."""
    inside = np.array(
        [[-3.4, 2.0], [12.9, 3.0], [4.0, -3.4], [5.0, 10.9], [12.9, 10.9], [6.2, 3.9]]
    )
    frame = render_frame(inside, 1e3, 1.0, (10, 8))
    larger = render_frame(np.add(inside, [20, 30]), 1e3, 1.0, (50, 60))
    np.testing.assert_allclose(frame, larger[30:38, 20:30], atol=1e-12)


def test_a_frame_holds_every_pixel_that_the_reach_touches():
    frame = render_frame([[10.45, 10.0]], 1e6, 1.0, (21, 21))
    touched = np.abs(np.arange(21) - 10.45) - 0.5 < 6.0
    assert touched.sum() == 13
    assert (frame[10, touched] > 0).all()


def test_simulated_spots_stand_in_the_middle_of_their_window():
    found = simulated_errors([0.0], Light(1e8), 0.5, 7, 50, np.random.default_rng(2))
    np.testing.assert_allclose(found, 0.0, atol=1e-3)
