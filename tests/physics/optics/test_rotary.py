"""The rotary table against SciPy's rotations, and what the printed matrix does."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from reproduce.physics.optics import rotary_matrix, rotary_matrix_printed, starlight

ANGLES = np.random.default_rng(1).uniform(-1.2, 1.2, (2, 20))


def test_matrix_is_a_proper_rotation() -> None:
    matrix = rotary_matrix(*ANGLES)
    np.testing.assert_allclose(
        matrix @ np.swapaxes(matrix, -1, -2),
        np.broadcast_to(np.eye(3), (20, 3, 3)),
        atol=1e-15,
    )
    np.testing.assert_allclose(np.linalg.det(matrix), 1)


def test_matrix_agrees_with_scipy() -> None:
    # Both frames are passive turns: SciPy's active ones by the opposite angle.
    external, middle = ANGLES
    expected = Rotation.from_euler("x", -external[:, None]) * Rotation.from_euler(
        "y", -middle[:, None]
    )
    np.testing.assert_allclose(
        rotary_matrix(external, middle), expected.as_matrix(), atol=1e-15
    )


def test_starlight_is_the_third_column_of_the_matrix() -> None:
    light = starlight(*ANGLES)
    np.testing.assert_allclose(light, rotary_matrix(*ANGLES) @ [0, 0, 1], atol=1e-16)
    np.testing.assert_allclose(np.linalg.norm(light, axis=-1), 1)


def test_signs_of_the_two_frames() -> None:
    assert starlight(0.0, 0.1)[0] < 0
    assert starlight(0.1, 0.0)[1] > 0
    np.testing.assert_array_equal(starlight(0.0, 0.0), [0, 0, 1])


def test_starlight_turns_by_the_angle_of_one_frame() -> None:
    for light in (starlight(0.3, 0.0), starlight(0.0, 0.3)):
        np.testing.assert_allclose(np.arccos(light[2]), 0.3)


def test_printed_matrix_is_no_rotation_away_from_zero() -> None:
    external, middle = ANGLES
    printed = rotary_matrix_printed(external, middle)
    np.testing.assert_allclose(np.linalg.det(printed), np.cos(2 * middle), atol=1e-14)
    first_times_third = (printed[:, :, 0] * printed[:, :, 2]).sum(axis=-1)
    np.testing.assert_allclose(first_times_third, -np.sin(2 * middle), atol=1e-15)
    np.testing.assert_array_equal(
        rotary_matrix_printed(external, 0.0), rotary_matrix(external, 0.0)
    )


def test_printed_matrix_gives_the_same_starlight_but_not_of_another_star() -> None:
    printed, right = rotary_matrix_printed(*ANGLES), rotary_matrix(*ANGLES)
    np.testing.assert_allclose(printed @ [0, 0, 1], starlight(*ANGLES), atol=1e-16)
    assert np.abs(printed @ [1, 0, 0] - right @ [1, 0, 0]).max() > 0.1


def test_a_batch_is_a_loop() -> None:
    external, middle = ANGLES
    grid = rotary_matrix(external[:, None], middle[:4])
    assert grid.shape == (20, 4, 3, 3)
    np.testing.assert_array_equal(grid[3, 2], rotary_matrix(external[3], middle[2]))
    np.testing.assert_array_equal(
        starlight(external, middle)[5], starlight(external[5], middle[5])
    )
