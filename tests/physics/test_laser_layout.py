"""Layouts of lasers: closed forms, simulation, and optima against trying every place."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from reproduce.physics.errors_on_ground import circular_error
from reproduce.physics.laser_layout import Field, best_layout, image_error, layout_covariance
from reproduce.physics.lasers import received_directions
from reproduce.physics.misalignment import laser_transform, misalignment, misalignment_angles
from reproduce.physics.rotations import rotation_from_vector

PIXEL = 13e-6 / 60e-3
NARROW = Field(24.0, 5 * 2**0.5, 13e-6, 60e-3, 500e3, 5e3)
WIDE = replace(NARROW, half_width=500.0)


def diamond(size):
    return size * np.array([[1, 0], [0, 1], [-1, 0], [0, -1.0]])


def test_near_the_boresight_the_covariance_has_its_closed_form():
    spots = np.array([[20, 3], [-8, 14], [5, -22], [-17, 5], [0, 0.0]])
    found = layout_covariance(spots, NARROW)
    arms = ((spots - spots.mean(axis=0)) ** 2).sum()
    np.testing.assert_allclose(found[:2, :2], PIXEL**2 / 5 * np.eye(2), rtol=3e-4, atol=1e-11)
    assert found[2, 2] == pytest.approx(1.0 / arms, rel=3e-4)


@pytest.mark.parametrize("size", [20.0, 400.0])
def test_the_covariance_is_the_scatter_of_solutions(size):
    field = replace(NARROW, half_width=size)
    spots = np.add(diamond(size), [0.3 * size, 0.1 * size])
    tracker = ((0.0, 0.0), field.pixel_pitch, field.focal_length)
    rest = received_directions(spots, *tracker)
    noise = 0.01 * np.random.default_rng(3).standard_normal((6000, 4, 2))
    zero = laser_transform(rest, rest)
    found = misalignment_angles(
        misalignment(rest, received_directions(spots + noise, *tracker), zero)
    )
    expected = 0.01**2 * layout_covariance(spots, field)
    scale = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    assert (np.abs(found.T @ found / 6000 - expected) < 5 * scale / np.sqrt(6000)).all()


def test_the_error_over_the_image_is_the_mean_of_its_points():
    covariance = layout_covariance(np.add(diamond(24.0), [5.0, -3.0]), NARROW) * 0.017**2
    rng = np.random.default_rng(4)
    turns = rng.multivariate_normal(np.zeros(3), covariance, 20_000)
    points = rng.uniform(-5e3, 5e3, (20_000, 2))
    looks = np.column_stack([points, np.full(20_000, 500e3)])
    moved = np.cross(turns, looks)[:, :2]
    found = np.sqrt((moved**2).sum(axis=1).mean())
    assert found == pytest.approx(float(image_error(covariance, NARROW)), rel=0.02)


@pytest.mark.parametrize("field", [NARROW, WIDE, replace(NARROW, half_image=20e3)])
@pytest.mark.parametrize(("count", "grid"), [(2, 15), (3, 9), (4, 5)])
def test_no_layout_on_a_grid_is_better(count, grid, field):
    places = np.linspace(-field.half_width, field.half_width, grid)
    points = np.stack(np.meshgrid(places, places), axis=-1).reshape(-1, 2)
    tried = np.array(list(combinations(range(len(points)), count)))
    errors = np.concatenate(
        [
            image_error(layout_covariance(points[some], field), field)
            for some in np.array_split(tried, 1 + len(tried) // 20_000)
        ]
    )
    found = best_layout(count, field, np.random.default_rng(count))
    least = float(image_error(layout_covariance(found, field), field))
    assert least <= errors.min() * (1 + 1e-9)
    assert least > 0.98 * errors.min(), "a grid with the corners on it comes close"


def test_four_lasers_go_to_the_corners_and_hold_the_roll_better_than_a_diamond():
    found = best_layout(4, NARROW, np.random.default_rng(1))
    np.testing.assert_allclose(np.abs(found), 24.0, atol=0.01)
    rolls = [layout_covariance(spots, NARROW)[2, 2] for spots in (diamond(24.0), found)]
    assert np.sqrt(rolls[0] / rolls[1]) == pytest.approx(np.sqrt(2.0), rel=1e-3)


@pytest.mark.parametrize("count", [5, 6, 8])
def test_spots_keep_their_distance_and_stay_in_the_field(count):
    found = best_layout(count, NARROW, np.random.default_rng(count))
    assert np.abs(found).max() <= 24.0 + 1e-6
    apart = [np.linalg.norm(one - other) for one, other in combinations(found, 2)]
    assert min(apart) > 5 * 2**0.5 * (1 - 1e-6)
    rng = np.random.default_rng(7)
    least = image_error(layout_covariance(found, NARROW), NARROW)
    others = rng.uniform(-24.0, 24.0, (4000, count, 2))
    assert (image_error(layout_covariance(others, NARROW), NARROW) > least).all()


def test_with_the_same_light_in_all_more_lasers_gain_nothing():
    """Photon noise: half the light in a spot is twice the variance, and that is all there is."""
    errors = []
    for count in (2, 4, 8):
        spots = best_layout(count, NARROW, np.random.default_rng(count))
        errors.append(float(image_error(layout_covariance(spots, NARROW), NARROW) * count**0.5))
    assert errors[0] == pytest.approx(errors[1], rel=1e-3)
    assert errors[2] > errors[1], "they stand in each other's way in the corners"


def test_a_layout_off_the_centre_brings_the_roll_into_the_tilt():
    """Why three lasers do not simply take three corners of a small field."""
    centred = layout_covariance(diamond(24.0), WIDE)
    aside = layout_covariance(np.add(diamond(24.0), [300.0, 0.0]), WIDE)
    assert aside[0, 0] > 5 * centred[0, 0]
    assert circular_error(aside[:2, :2]) > circular_error(centred[:2, :2])


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="widen the field"):
        best_layout(9, replace(NARROW, half_width=5.0), np.random.default_rng(1), starts=2)
    with pytest.raises(ValueError, match="count"):
        best_layout(1, NARROW, np.random.default_rng(1))
    with pytest.raises(ValueError, match="half_width"):
        replace(NARROW, half_width=0.0)


def test_turning_the_whole_layout_turns_nothing_else():
    turn = rotation_from_vector([0, 0, 0.7])[:2, :2]
    spots = np.add(diamond(24.0), [2.0, 1.0])
    one, other = (layout_covariance(rows, NARROW) for rows in (spots, spots @ turn.T))
    assert image_error(one, NARROW) == pytest.approx(float(image_error(other, NARROW)), rel=1e-9)
