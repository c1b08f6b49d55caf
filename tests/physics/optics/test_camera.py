"""The camera and its pixel angles against closed forms and limits."""

from __future__ import annotations

import numpy as np
import pytest

from reproduce.physics.optics import (
    Camera,
    angle_from_pixels,
    distortion_ratio,
    field_of_view,
    ideal_positions,
    image_points,
    radial_displacements,
    reference_points_scaled,
    scale_factor,
    turned_onto_detector,
)
from reproduce.units import ARCSEC_PER_RADIAN

PITCH = 4e-6


def directions(count: int = 40, seed: int = 1) -> np.ndarray:
    slopes = np.random.default_rng(seed).uniform(-0.15, 0.15, (count, 2))
    return np.concatenate([slopes, np.ones((count, 1))], axis=-1)


def camera(**changes: object) -> Camera:
    values = {
        "focal_length": 20e-3,
        "principal_point": (800.0, 600.0),
        "radial_distortion": 40.0,
        "pixel_pitch": PITCH,
    }
    return Camera(**values | changes)


def test_length_of_a_direction_does_not_matter() -> None:
    stars = directions()
    lengths = np.random.default_rng(2).uniform(0.1, 9, (len(stars), 1))
    np.testing.assert_allclose(
        image_points(stars * lengths, camera()),
        image_points(stars, camera()),
        rtol=1e-14,
    )


def test_boresight_meets_the_principal_point_whatever_the_distortion_and_rotation() -> (
    None
):
    point = image_points([[0, 0, 1]], camera(radial_distortion=1e4), rotation=1.0)
    np.testing.assert_array_equal(point, [[800.0, 600.0]])


def test_radius_grows_by_the_radial_term_and_the_azimuth_stays() -> None:
    stars = directions()
    ideal = ideal_positions(stars, 20e-3)
    moved = ideal + radial_displacements(ideal, 40.0)
    radius = np.hypot(*ideal.T)
    np.testing.assert_allclose(
        np.hypot(*moved.T), radius + 40.0 * radius**3, rtol=1e-14
    )
    np.testing.assert_allclose(np.arctan2(*moved.T), np.arctan2(*ideal.T), rtol=1e-13)


def test_a_turned_detector_is_undone_by_turning_back() -> None:
    positions = np.random.default_rng(3).normal(size=(6, 2))
    theta = 0.3
    forward = np.array(
        [[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]]
    )
    np.testing.assert_allclose(
        turned_onto_detector(positions, theta) @ forward.T, positions
    )


def test_sign_of_the_detector_rotation() -> None:
    # A detector turned from x towards y sees a spot on its old x axis below its new one.
    x, y = turned_onto_detector([[1.0, 0.0]], 0.1)[0]
    assert x > 0
    assert y < 0


def test_without_distortion_and_rotation_it_is_the_pinhole() -> None:
    stars = directions()
    expected = (800, 600) + 20e-3 / PITCH * stars[:, :2]
    np.testing.assert_allclose(
        image_points(stars, camera(radial_distortion=0)), expected
    )


def test_a_batch_of_cameras_is_a_loop_over_cameras() -> None:
    rng = np.random.default_rng(4)
    focal, radial = rng.uniform(19e-3, 21e-3, 5), rng.uniform(0, 50, 5)
    principal, theta = rng.uniform(500, 900, (5, 2)), rng.uniform(-1, 1, 5)
    stars = np.stack([directions(seed=seed) for seed in range(5)])
    together = image_points(
        stars,
        camera(focal_length=focal, radial_distortion=radial, principal_point=principal),
        theta,
    )
    for i in range(5):
        alone = camera(
            focal_length=focal[i],
            radial_distortion=radial[i],
            principal_point=principal[i],
        )
        np.testing.assert_array_equal(
            together[i], image_points(stars[i], alone, theta[i])
        )
    assert camera(focal_length=focal).batch == (5,)


def test_ratio_of_distortions_is_the_ratio_of_computed_displacements() -> None:
    stars, green, blue = directions(), (21e-3, 50.0), (20e-3, 40.0)
    k = scale_factor(green[0], blue[0])
    ideal_blue = ideal_positions(stars, blue[0])
    np.testing.assert_allclose(
        k * ideal_blue, ideal_positions(stars, green[0]), rtol=1e-14
    )
    displaced = [
        radial_displacements(ideal_positions(stars, f), m) for f, m in (green, blue)
    ]
    expected = distortion_ratio(k, green[1], blue[1])
    np.testing.assert_allclose(displaced[0] / displaced[1], expected, rtol=1e-12)


def test_the_approximations_of_the_ratio_are_limits_of_it() -> None:
    k = np.array([0.998, 1.0, 1.002])
    np.testing.assert_array_equal(distortion_ratio(k), distortion_ratio(k, 7.0, 7.0))
    moved = reference_points_scaled([[1.0, 0.0]], k, (0.0, 0.0))
    error = moved[:, 0, 0] / distortion_ratio(k) - 1
    np.testing.assert_allclose(error, 2 * (1 - k), atol=2e-5)


def test_scaled_points_are_exact_where_distortion_is_shared_as_assumed() -> None:
    # With coefficients in the ratio 1/k^2 the displacements scale by k, as (9) assumes of all.
    k, origin = 1.05, (800.0, 600.0)
    blue = camera(radial_distortion=40.0)
    green = camera(focal_length=20e-3 * k, radial_distortion=40.0 / k**2)
    np.testing.assert_allclose(
        reference_points_scaled(image_points(directions(), blue), k, origin),
        image_points(directions(), green),
        rtol=1e-13,
    )


def test_field_of_view_is_twice_the_angle_of_the_edge() -> None:
    assert field_of_view(1000, PITCH, 20e-3) == pytest.approx(2 * np.arctan(0.1))
    edge = angle_from_pixels(500, PITCH, 20e-3)
    stars = [[np.sin(edge), 0, np.cos(edge)]]
    spot = image_points(stars, camera(radial_distortion=0))[0, 0]
    assert spot == pytest.approx(800 + 500)


def test_pixels_and_angles_are_inverse() -> None:
    pixels = np.linspace(-1000, 1000, 7)
    back = np.tan(angle_from_pixels(pixels, PITCH, 20e-3)) * 20e-3 / PITCH
    np.testing.assert_allclose(back, pixels, atol=1e-9)


def test_a_small_angle_in_arcsec_is_pixels_times_pitch_over_focal_length() -> None:
    arcsec = angle_from_pixels(0.2, PITCH, 20e-3) * ARCSEC_PER_RADIAN
    assert arcsec == pytest.approx(0.2 * PITCH / 20e-3 * 206264.80624709636, rel=1e-9)
