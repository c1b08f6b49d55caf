"""The similarity and its closed-form fit against SciPy, linear algebra and invariances."""

from __future__ import annotations

import numpy as np
import pytest

from reproduce.physics.optics import Camera, image_points
from reproduce.physics.registration import (
    Registration,
    RegistrationFit,
    fit_registration,
    principal_point_shift,
    rmse,
    rmse_per_axis,
    similarity_between,
)
from reproduce.physics.validate import DegenerateGeometryError

TRUTH = Registration.similarity(1.003, 0.0011, (-0.4, 0.7), (1030.0, 770.0))


def spots(
    count: int = 60, seed: int = 1, sigma: float = 0.05
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    source = rng.uniform((0, 0), (2064, 1544), (count, 2))
    return source, TRUTH.apply(source) + sigma * rng.normal(size=source.shape)


def residuals_by_matrix(
    u: np.ndarray, source: np.ndarray, target: np.ndarray
) -> np.ndarray:
    """The model with an explicit matrix, independent of the complex numbers inside."""
    c, s = np.cos(u[1]), np.sin(u[1])
    turned = (source - TRUTH.pivot) @ (u[0] * np.array([[c, s], [-s, c]]))
    return target - (turned + TRUTH.pivot - u[2:])


def covariance_units(fit: RegistrationFit) -> np.ndarray:
    """One standard deviation each, to compare covariances of unlike units."""
    sd = np.sqrt(np.diagonal(fit.cofactor, axis1=-2, axis2=-1))
    return sd[..., :, None] * sd[..., None, :]


def test_transform_is_the_matrix_form() -> None:
    source, target = spots(sigma=0)
    np.testing.assert_allclose(
        residuals_by_matrix(TRUTH.parameters, source, target), 0, atol=1e-11
    )


def test_affine_form_gives_the_same_points() -> None:
    source, target = spots(sigma=0)
    matrix, translation = TRUTH.affine()
    np.testing.assert_allclose(source @ matrix.T + translation, target, atol=1e-11)
    assert np.linalg.det(matrix) == pytest.approx(1.003**2)


def test_limits_of_the_transform() -> None:
    source, _ = spots()
    np.testing.assert_array_equal(
        Registration.similarity(1, 0, (0, 0), (5, 6)).apply(source), source
    )
    shifted = Registration.similarity(1, 0, (2, -3), (0, 0)).apply(source)
    np.testing.assert_allclose(shifted, source - (2, -3))
    quarter = Registration.similarity(1, np.pi / 2, (0, 0), (0, 0)).apply([[1, 0]])
    np.testing.assert_allclose(quarter, [[0, 1]], atol=1e-15)
    scaled = Registration.similarity(3, 0.4, (0, 0), (5, 6)).apply([[5, 6]])
    np.testing.assert_allclose(scaled, [[5, 6]])


def test_the_inverse_is_a_similarity() -> None:
    source, target = spots(sigma=0)
    assert TRUTH.inverse().model == "similarity"
    np.testing.assert_allclose(TRUTH.inverse().apply(target), source, atol=1e-11)


def test_fit_agrees_with_linear_algebra() -> None:
    source, target = spots(12)
    q = source - TRUTH.pivot
    one, zero = np.ones(len(q)), np.zeros(len(q))
    design = np.concatenate(
        [
            np.stack([q[:, 0], -q[:, 1], -one, zero], 1),
            np.stack([q[:, 1], q[:, 0], zero, -one], 1),
        ]
    )
    observed = (target - TRUTH.pivot).T.ravel()
    (a, b, *shift), chi_square, *_ = np.linalg.lstsq(design, observed)
    fit = fit_registration(source, target, TRUTH.pivot)
    np.testing.assert_allclose(
        fit.parameters,
        (np.hypot(a, b), np.arctan2(b, a), *shift),
        rtol=1e-9,
        atol=1e-12,
    )
    assert fit.chi_square == pytest.approx(chi_square[0])


def test_fit_without_noise_returns_the_truth() -> None:
    for truth in (
        TRUTH,
        Registration.similarity(0.2, 3.1, (900, -5), (0, 0)),
        Registration.similarity(1, 0, (0, 0), (9, 9)),
    ):
        source, _ = spots()
        fit = fit_registration(source, truth.apply(source), truth.pivot)
        np.testing.assert_allclose(
            fit.parameters, truth.parameters, rtol=1e-12, atol=1e-10
        )
        np.testing.assert_allclose(fit.residuals, 0, atol=1e-10)


def test_residuals_are_target_minus_transformed_source() -> None:
    source, target = spots()
    fit = fit_registration(source, target, TRUTH.pivot)
    np.testing.assert_allclose(
        fit.residuals, target - fit.transform.apply(source), atol=1e-11
    )
    np.testing.assert_allclose(fit.residuals.sum(axis=0), 0, atol=1e-9)


def test_scale_and_rotation_do_not_depend_on_pivot_or_translation() -> None:
    source, target = spots()
    fit = fit_registration(source, target, TRUTH.pivot)
    moved = fit_registration(source - 50.0, target + 7.0, (-300.0, 9000.0))
    np.testing.assert_allclose(moved.parameters[:2], fit.parameters[:2], rtol=1e-11)
    np.testing.assert_allclose(moved.residuals, fit.residuals, atol=1e-10)
    about_zero = fit_registration(source, target, (0, 0))
    np.testing.assert_allclose(
        about_zero.transform.apply(source), fit.transform.apply(source), atol=1e-10
    )


def test_a_far_origin_costs_no_digits() -> None:
    source, target = spots()
    near = fit_registration(source, target, TRUTH.pivot)
    far = fit_registration(source + 1e9, target + 1e9, TRUTH.pivot + 1e9)
    # Coordinates of 1e9 px are themselves rounded to 1e-7 px.
    np.testing.assert_allclose(far.parameters[:2], near.parameters[:2], atol=1e-9)
    np.testing.assert_allclose(far.transform.shift, near.transform.shift, atol=1e-6)


def test_weights_act_like_repeated_points_and_zero_like_absence() -> None:
    source, target = spots(6)
    weights = np.array([2, 1, 3, 0, 1, 1])
    weighted = fit_registration(source, target, TRUTH.pivot, weights)
    repeated = fit_registration(
        np.repeat(source, weights, axis=0),
        np.repeat(target, weights, axis=0),
        TRUTH.pivot,
    )
    np.testing.assert_allclose(weighted.parameters, repeated.parameters, atol=1e-10)
    np.testing.assert_allclose(
        weighted.cofactor / covariance_units(weighted),
        repeated.cofactor / covariance_units(weighted),
        atol=1e-12,
    )
    assert weighted.chi_square == pytest.approx(repeated.chi_square)
    assert weighted.degrees_of_freedom == 2 * 5 - 4


def test_two_points_fit_exactly_and_tell_no_variance() -> None:
    source, target = spots(2)
    fit = fit_registration(source, target, TRUTH.pivot)
    np.testing.assert_allclose(fit.residuals, 0, atol=1e-10)
    assert fit.cofactor.shape == (4, 4)
    with pytest.raises(DegenerateGeometryError, match=r"^covariance: "):
        _ = fit.covariance


def test_similarity_between_cameras_is_exact_without_distortion() -> None:
    slopes = np.random.default_rng(6).uniform(-0.1, 0.1, (9, 2))
    stars = np.concatenate([slopes, np.ones((9, 1))], axis=1)
    green = Camera(25e-3, (1030, 770), 0, 4e-6)
    blue = Camera(24e-3, (1029, 772), 0, 3e-6)
    theta = 0.02
    between = similarity_between(blue, theta, green)
    np.testing.assert_allclose(
        between.apply(image_points(stars, blue, theta)),
        image_points(stars, green),
        atol=1e-10,
    )
    np.testing.assert_array_equal(
        between.shift,
        principal_point_shift(blue.principal_point, green.principal_point),
    )


def test_similarity_between_cameras_holds_distortion_scaled_as_assumed() -> None:
    k, theta = 1.002, -0.001
    stars = [[0.1, -0.08, 1.0], [0.0, 0.1, 1.0]]
    green = Camera(25e-3, (1030, 770), 40.0, 4e-6)
    blue = Camera(25e-3 / k, (1029, 772), 40.0 * k**2, 4e-6)
    between = similarity_between(blue, theta, green)
    np.testing.assert_allclose(
        between.apply(image_points(stars, blue, theta)),
        image_points(stars, green),
        atol=1e-10,
    )


def test_rmse_counts_both_axes() -> None:
    rng = np.random.default_rng(7)
    points, reference = rng.normal(size=(2, 3, 30, 2))
    per_axis = rmse_per_axis(points, reference)
    assert per_axis.shape == (3, 2)
    np.testing.assert_allclose(
        per_axis**2, ((points - reference) ** 2).sum(axis=1) / 30
    )
    np.testing.assert_allclose(rmse(points, reference), np.hypot(*per_axis.T))
