"""Mirrors and retro-reflectors: what is known of them without a program."""

import numpy as np
import pytest

from reproduce.physics.attitude import rotation_from_vector
from reproduce.physics.light import (
    CORNER,
    ROOF,
    Cone,
    fold_mirror_tilt,
    mirror_train,
    reflection,
    turn_response,
)

RNG = np.random.default_rng(4)


def turned_train(train, turn):
    rotation = rotation_from_vector(turn)
    return rotation @ train @ rotation.T


def directions(count):
    rows = RNG.normal(size=(count, 3))
    return rows / np.linalg.norm(rows, axis=-1, keepdims=True)


def test_a_corner_cube_returns_every_direction_however_it_turns():
    train = mirror_train(CORNER)
    for turn in RNG.normal(size=(20, 3)):
        np.testing.assert_allclose(turned_train(train, turn), -np.eye(3), atol=1e-12)


def test_the_order_of_mirrors_in_a_corner_does_not_matter():
    for order in ([0, 1, 2], [2, 0, 1], [1, 0, 2]):
        np.testing.assert_allclose(mirror_train(CORNER[order]), -np.eye(3), atol=1e-12)


def test_two_mirrors_at_a_right_angle_turn_about_their_edge_without_effect():
    train = mirror_train(ROOF)
    np.testing.assert_allclose(turned_train(train, [0, 0.7, 0]), train, atol=1e-12)
    np.testing.assert_allclose(train, np.diag([-1.0, 1.0, -1.0]), atol=1e-12)


def test_two_mirrors_turned_across_their_edge_double_the_turn():
    turn = 1e-3
    found = turned_train(mirror_train(ROOF), [turn, 0, 0]) @ [0, 0, 1.0]
    assert np.arccos(-found[2]) == pytest.approx(2 * turn, rel=1e-6)


def test_two_mirrors_turned_about_the_beam_roll_the_pattern():
    train = turned_train(mirror_train(ROOF), [0, 0, 1e-3])
    np.testing.assert_allclose(train @ [0, 0, 1.0], [0, 0, -1.0], atol=1e-12)
    beam = np.array([0.01, 0.0, 1.0])
    moved = (train - mirror_train(ROOF)) @ beam
    assert np.linalg.norm(moved) == pytest.approx(2 * 1e-3 * 0.01, rel=1e-3)


@pytest.mark.parametrize(
    "train", [mirror_train(CORNER), mirror_train(ROOF), reflection([1, 2, 3])]
)
def test_the_response_is_the_derivative_of_the_turned_train(train):
    step = 1e-6
    for direction in directions(3):
        found = turn_response(train, direction)
        for axis, turn in enumerate(np.eye(3) * step):
            ends = [turned_train(train, sign * turn) @ direction for sign in (1, -1)]
            np.testing.assert_allclose(
                found[:, axis], (ends[0] - ends[1]) / (2 * step), atol=1e-9
            )


def ring(offset=0.0, count=12):
    around = 2 * np.pi * (np.arange(count) + 0.5) / count
    origins = np.stack(
        [0.3 * np.cos(around), 0.3 * np.sin(around), np.full(count, -2.0)], axis=-1
    )
    beam = np.array([np.sin(offset), 0, np.cos(offset)])
    return origins, np.broadcast_to(beam, origins.shape)


def returned(origins, beam):
    return Cone(np.zeros(3)).send(origins, beam)[1]


def test_a_cone_returns_light_along_its_axis():
    origins, beam = ring()
    np.testing.assert_allclose(returned(origins, beam), -beam, atol=1e-12)


def test_a_cone_turns_light_back_to_first_order_only():
    """Ten times the angle makes a hundred times the error, and a corner cube none at all."""
    worst = []
    for offset in (1e-4, 1e-3):
        origins, beam = ring(offset)
        worst.append(np.linalg.norm(returned(origins, beam) + beam, axis=1).max())
    assert worst[1] < 5e-6
    assert worst[1] / worst[0] == pytest.approx(100, rel=0.02)


def test_turning_the_cone_is_turning_the_light_the_other_way():
    origins, beam = ring(2e-3)
    turn = np.array([1e-3, 2e-3, 0.3])
    rotation = rotation_from_vector(turn)
    _, found = Cone(np.zeros(3), turn).send(origins @ rotation.T, beam @ rotation.T)
    np.testing.assert_allclose(found, returned(origins, beam) @ rotation.T, atol=1e-12)


@pytest.mark.parametrize("angle", np.radians([60.0, 120.0, 150.0]))
def test_the_fold_mirror_sends_the_light_down_the_boresight(angle):
    """The traced light, with the mirror at the tilt that the closed form gives."""
    tracker = rotation_from_vector([angle, 0, 0]) @ [0, 0, 1.0]
    tilt = float(fold_mirror_tilt(angle))
    # The mirror's plane leaves the plane across the tracker's boresight by its tilt.
    found = [
        reflection(rotation_from_vector([angle + sign * tilt, 0, 0]) @ [0, 0, 1.0])
        @ [0, 0, -1.0]
        for sign in (1, -1)
    ]
    assert min(np.linalg.norm(out + tracker) for out in found) < 1e-12


def test_bad_light_is_refused():
    with pytest.raises(ValueError, match="normal"):
        reflection([0.0, 0.0, 0.0])
