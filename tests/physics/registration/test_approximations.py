"""Errors of the approximations: analytic and simulated in agreement, and both by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from reproduce.physics.optics import Camera, image_points, turned_onto_detector
from reproduce.physics.registration import (
    EFFECTS,
    Channels,
    Registration,
    error_field,
    even_positions,
    fit_registration,
    similarity_between,
)

PITCH = 3.45e-6
HALF = np.array([2064, 1544]) * PITCH / 2
EVEN = even_positions(HALF)
SOURCE = Camera(25.0601e-3, (1033.9, 774.3), 57.0, PITCH)
GREEN = Camera(25.0e-3, (1032.0, 772.0), 49.0, PITCH)
CHANNELS = Channels(
    SOURCE, GREEN, np.radians(0.07), (3.0, -4.0), (2e-4, -1e-4), (4e5, 3e5)
)


def simulated_bias(channels, positions):
    """Return the error of (k, theta, shift x, shift y) in a fit to exact image points."""
    truth = similarity_between(channels.source, channels.rotation, channels.reference)
    pivot = channels.source.principal_point + np.asarray(channels.pivot_error)
    shifted = Registration("similarity", truth.parameters, pivot)
    source = turned_onto_detector(positions, channels.rotation) / PITCH
    source = source + channels.source.principal_point
    reference = shifted.apply(source) + error_field(channels, positions)
    return fit_registration(source, reference, pivot).parameters - truth.parameters


def analytic_bias(channels, effect, sides):
    """The same to first order, over a detector covered evenly, as the page says it.

    A radial error c p |p|^2 changes only the scale, by c <r^4> / <r^2>. A tilt has an error
    proportional to the square of the position, and changes only the shift.
    """
    alone, k = channels.only(effect), channels.scale
    a, b = sides**2
    second, fourth = (a + b) / 3, (a**2 + b**2) / 5 + 2 * a * b / 9
    sixth = (a**3 + b**3) / 7 + a * b * (a + b) / 5
    source, reference = (
        float(c.radial_distortion) for c in (alone.source, alone.reference)
    )
    bias = np.zeros(4)
    if effect == "coefficients":
        bias[0] = k**3 * (reference - source) * fourth / second
    elif effect == "cube":
        bias[0] = (k**3 - k) * source * fourth / second
    elif effect == "second term":
        bias[0] = (
            (k**5 * alone.second_term[1] - k * alone.second_term[0]) * sixth / second
        )
    elif effect == "tilt":
        lever = np.asarray(alone.tilt) * sides**2 / 3
        bias[2:] = (
            k * lever / float(alone.source.focal_length * alone.source.pixel_pitch)
        )
    else:
        moved = np.asarray([alone.pivot_error])
        bias[2:] = (moved - k * turned_onto_detector(moved, -alone.rotation))[0]
    return bias


@pytest.mark.parametrize("effect", EFFECTS)
def test_analytic_and_simulated_bias_agree(effect):
    simulated = simulated_bias(CHANNELS.only(effect), EVEN)
    if (
        effect == "coefficients"
    ):  # the cube is at work in both, and the difference counts
        simulated = simulated - simulated_bias(CHANNELS.only("cube"), EVEN)
    analytic = analytic_bias(CHANNELS, effect, HALF)
    size = np.array([1 / 1e3, 1 / 1e3, 1.0, 1.0])  # a scale acts over a thousand pixels
    tolerance = 0.005 * np.abs(analytic / size).max() * size
    assert (np.abs(simulated - analytic) < tolerance).all()
    assert np.abs(analytic).max() > 0


@pytest.mark.parametrize("effect", ["coefficients", "cube"])
def test_the_bias_of_the_scale_holds_far_from_a_scale_of_one(effect):
    """Near one, a power of the scale more or less would pass unseen."""
    far = Channels(
        Camera(25e-3, (0, 0), 57.0, PITCH), Camera(15e-3, (0, 0), 49.0, PITCH)
    )
    simulated = simulated_bias(far.only(effect), EVEN)[0]
    if effect == "coefficients":
        simulated -= simulated_bias(far.only("cube"), EVEN)[0]
    assert simulated == pytest.approx(analytic_bias(far, effect, HALF)[0], rel=0.005)


def test_a_tilted_detector_is_a_plane_that_rays_intersect():
    """The same point by the length of the ray in three dimensions."""
    plain = Channels(Camera(25e-3, (0, 0), 0, PITCH), GREEN)
    tilted = replace(plain, tilt=(0.02, 0.0))
    position = np.array([[3e-3, 1e-3]])
    moved = error_field(plain, position) - error_field(tilted, position)
    # Plane: z = F + 0.02 x; ray: (3, 1, 25) times s.
    s = 25e-3 / (25e-3 - 0.02 * 3e-3)
    expected = [[np.hypot(3e-3 * s, 0.02 * 3e-3 * s), 1e-3 * s]]
    assert_allclose(position + moved * PITCH, expected, rtol=1e-9)


def test_without_tilt_and_second_term_the_error_is_that_of_two_cameras():
    plain, positions = Channels(SOURCE, GREEN, 0.01), EVEN[:40]
    directions = np.column_stack([positions, np.full(40, 25.0601e-3)])
    model = similarity_between(SOURCE, 0.01, GREEN)
    modelled = model.apply(image_points(directions, SOURCE, 0.01))
    expected = image_points(directions, GREEN) - modelled
    assert_allclose(error_field(plain, positions), expected, atol=1e-9)


def test_unknown_effects_are_refused():
    with pytest.raises(ValueError, match="effect"):
        CHANNELS.only("colour")
