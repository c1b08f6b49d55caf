"""Calibrating one channel: against an iterating solver, a known law, and bad input."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from reproduce.physics.optics import Camera, fit_camera, image_points
from reproduce.physics.validate import DegenerateGeometryError

PITCH = 3.45e-6
TRUTH = Camera(25.03e-3, (1030.2, 771.4), 34.1, PITCH)
GENERATOR = default_rng(7)
SLOPES = np.concatenate(
    [GENERATOR.uniform((-0.14, -0.1), (0.14, 0.1), (60, 2)), np.ones((60, 1))], axis=1
)
CLEAN = image_points(SLOPES, TRUTH)
SCALES = np.array([1e-3, 1.0, 1.0, 10.0])


def parameters(fit):
    """Focal length, principal point and distortion, in m, px, px, m^-2."""
    x, y = np.moveaxis(fit.principal_point, -1, 0)
    return np.stack([fit.focal_length, x, y, fit.radial_distortion], axis=-1)


def residuals(scaled, points):
    """The model (2) with (3), written out."""
    focal, x, y, m = scaled * SCALES
    ideal = focal * SLOPES[:, :2]
    radius = (ideal**2).sum(axis=1, keepdims=True)
    return (points - ideal * (1 + m * radius) / PITCH - (x, y)).ravel()


def test_the_minimum_is_that_of_an_iterating_solver():
    points = CLEAN + 0.1 * GENERATOR.standard_normal(CLEAN.shape)
    start = np.array([25e-3, 1000, 800, 0]) / SCALES
    iterated = least_squares(
        residuals,
        start,
        "3-point",
        args=(points,),
        x_scale="jac",
        xtol=1e-15,
        ftol=1e-15,
    )
    fit = fit_camera(SLOPES, points, PITCH)
    assert_allclose(parameters(fit) / SCALES, iterated.x, rtol=1e-7)


def test_clean_points_give_back_the_camera_also_of_a_turned_detector():
    points = image_points(SLOPES, replace(TRUTH, rotation=0.01))
    for field in (1, 1e-6):  # of longer telescopes
        fit = fit_camera(SLOPES * [field, field, 1], points, PITCH, 0.01)
        right = 25.03 / field, 1030.2, 771.4, 3.41
        assert_allclose(parameters(fit) / SCALES, right, rtol=1e-9)


def test_a_batch_gives_what_each_gives_alone():
    noisy = CLEAN + GENERATOR.standard_normal((3, *CLEAN.shape))
    together = fit_camera(SLOPES, noisy, PITCH)
    for row, points in enumerate(noisy):
        alone = fit_camera(SLOPES, points, PITCH)
        assert_allclose(parameters(together)[row], parameters(alone), rtol=1e-12)
        places = image_points(SLOPES, together)[row]
        assert_allclose(places, image_points(SLOPES, alone), rtol=1e-12)


def test_bad_input_is_rejected():
    for name, change in (
        ("directions", {"points": CLEAN[:5]}),
        ("points", {"points": np.full_like(CLEAN, np.nan)}),
        ("points", {"points": -CLEAN}),
        ("pixel_pitch", {"pixel_pitch": 0.0}),
        ("pixel_pitch", {"pixel_pitch": (1e-6, 2e-6)}),
    ):
        good = {"directions": SLOPES, "points": CLEAN, "pixel_pitch": PITCH}
        with pytest.raises(ValueError, match=name):
            fit_camera(**good | change)


def test_one_ring_of_directions_fixes_no_distortion():
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.stack([0.1 * np.cos(turn), 0.1 * np.sin(turn), np.ones(12)], axis=-1)
    with pytest.raises(DegenerateGeometryError, match="directions"):
        fit_camera(ring, image_points(ring, TRUTH), PITCH)
