"""Errors of the approximations: analytic and simulated in agreement, and both by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from reproduce.physics.optics import Camera, image_points, turned_onto_detector
from reproduce.physics.registration import (
    Registration,
    error_field,
    fit_registration,
    similarity_between,
)

PITCH = 3.45e-6
HALF = np.array([2064, 1544]) * PITCH / 2
MIDDLES = (np.arange(200) + 0.5) / 100 - 1
EVEN = np.stack(np.meshgrid(MIDDLES, MIDDLES), axis=-1).reshape(-1, 2) * HALF
ROTATION = np.radians(0.07)
SOURCE = Camera(25.0601e-3, (1033.9, 774.3), 57.0, PITCH, ROTATION)
GREEN = Camera(25.0e-3, (1032.0, 772.0), 49.0, PITCH)
STRAIGHT = [replace(camera, radial_distortion=0.0) for camera in (SOURCE, GREEN)]
PIVOT, TILT, SECOND = np.array([(3.0, -4.0), (2e-4, -1e-4), (4e5, 3e5)])


def simulated_bias(source, reference, pivot_error=(0.0, 0.0), **effect):
    """Return the error of (k, theta, shift x, shift y) in a fit to exact image points."""
    truth = similarity_between(source, reference)
    pivot = source.principal_point + np.asarray(pivot_error)
    shifted = Registration("similarity", truth.parameters, pivot)
    points = (
        turned_onto_detector(EVEN, source.rotation) / PITCH + source.principal_point
    )
    effect["pivot_error"] = pivot_error
    error = error_field(source, reference, EVEN, **effect)
    fitted = fit_registration(points, shifted.apply(points) + error, pivot)
    return fitted.parameters - truth.parameters


def agree(simulated, analytic):
    analytic = np.array(analytic)
    size = np.array([1 / 1e3, 1 / 1e3, 1.0, 1.0])  # a scale acts over a thousand pixels
    tolerance = 0.005 * np.abs(analytic / size).max() * size
    return (np.abs(simulated - analytic) < tolerance).all() and np.any(analytic)


def moments():
    """Return the means of the second, fourth and sixth power of the radius over the detector."""
    a, b = HALF**2
    fourth = (a**2 + b**2) / 5 + 2 * a * b / 9
    return (a + b) / 3, fourth, (a**3 + b**3) / 7 + a * b * (a + b) / 5


@pytest.mark.parametrize(
    ("source", "green"),
    [
        (SOURCE, GREEN),
        # Near one, a power of the scale more or less would pass unseen.
        (Camera(25e-3, (0, 0), 57.0, PITCH), Camera(15e-3, (0, 0), 49.0, PITCH)),
    ],
)
def test_distortions_change_the_scale(source, green):
    """A radial error c p |p|^2 changes only the scale, by c <r^4> / <r^2>."""
    k, (second, fourth, _) = green.focal_length / source.focal_length, moments()
    cube = simulated_bias(source, replace(green, radial_distortion=57.0))
    assert agree(cube, [(k**3 - k) * 57.0 * fourth / second, 0, 0, 0])
    # The cube is at work in both, and the difference counts.
    both = simulated_bias(source, green)
    assert agree(both - cube, [k**3 * (49.0 - 57.0) * fourth / second, 0, 0, 0])


def test_other_effects_change_the_scale_or_the_shift():
    """A tilt has an error proportional to the square of the position, and only shifts."""
    k, (second, _, sixth) = GREEN.focal_length / SOURCE.focal_length, moments()
    scale = (k**5 * SECOND[1] - k * SECOND[0]) * sixth / second
    assert agree(simulated_bias(*STRAIGHT, second_term=SECOND), [scale, 0, 0, 0])
    lever = k * TILT * HALF**2 / 3 / (SOURCE.focal_length * PITCH)
    assert agree(simulated_bias(*STRAIGHT, tilt=TILT), [0, 0, *lever])
    moved = PIVOT - k * turned_onto_detector(PIVOT[None], -ROTATION)[0]
    assert agree(simulated_bias(*STRAIGHT, pivot_error=PIVOT), [0, 0, *moved])


def test_a_tilted_detector_is_a_plane_that_rays_intersect():
    """The same point by the length of the ray in three dimensions."""
    plain, position = (Camera(25e-3, (0, 0), 0, PITCH), GREEN), np.array([[3e-3, 1e-3]])
    tilted = error_field(*plain, position, tilt=(0.02, 0.0))
    moved = error_field(*plain, position) - tilted
    # Plane: z = F + 0.02 x; ray: (3, 1, 25) times s.
    s = 25e-3 / (25e-3 - 0.02 * 3e-3)
    expected = [[np.hypot(3e-3 * s, 0.02 * 3e-3 * s), 1e-3 * s]]
    assert_allclose(position + moved * PITCH, expected, rtol=1e-9)


def test_without_tilt_and_second_term_the_error_is_that_of_two_cameras():
    directions = np.column_stack([EVEN[:40], np.full(40, 25.0601e-3)])
    model = similarity_between(SOURCE, GREEN)
    modelled = model.apply(image_points(directions, SOURCE))
    expected = image_points(directions, GREEN) - modelled
    assert_allclose(error_field(SOURCE, GREEN, EVEN[:40]), expected, atol=1e-9)
