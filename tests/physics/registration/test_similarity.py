"""The similarity far from the origin, and between two cameras."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from simulated import PIVOT, stars

from reproduce.physics.optics import Camera, image_points
from reproduce.physics.registration import fit_registration, similarity_between


def test_a_far_origin_costs_no_digits():
    source, target = stars()
    near = fit_registration(source, target, PIVOT)
    far = fit_registration(source + 1e9, target + 1e9, PIVOT + 1e9)
    # Coordinates of 1e9 px are themselves rounded to 1e-7 px.
    assert_allclose(far.parameters[:2], near.parameters[:2], atol=1e-9)
    assert_allclose(far.transform.shift, near.transform.shift, atol=1e-6)


def test_similarity_between_cameras_is_exact_without_distortion():
    slopes = default_rng(6).uniform(-0.1, 0.1, (9, 2))
    stars = np.concatenate([slopes, np.ones((9, 1))], axis=1)
    green = Camera(25e-3, (1030, 770), 0, 4e-6)
    blue = Camera(24e-3, (1029, 772), 0, 3e-6, 0.02)
    between = similarity_between(blue, green)
    assert_allclose(
        between.apply(image_points(stars, blue)),
        image_points(stars, green),
        atol=1e-10,
    )
    assert_array_equal(between.shift, blue.principal_point - green.principal_point)
