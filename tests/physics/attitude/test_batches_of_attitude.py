"""Leading axes of the attitude side: a batch gives what each of its members gives alone."""

import numpy as np

from reproduce.physics.attitude import angle_jacobian, rotation_from_vector
from reproduce.physics.light import CORNER, mirror_train, reflection, turn_response, turned_train
from reproduce.physics.light.raytrace import ROOF

DRAWS = np.random.default_rng(9)


def test_the_jacobian_of_a_batch_is_that_of_its_members():
    camera = DRAWS.normal(size=(2, 4, 3))
    camera /= np.linalg.norm(camera, axis=-1, keepdims=True)
    tracker = camera @ rotation_from_vector([[0.1, 0.2, -0.3], [0.5, 0.0, 0.1]])
    moves = DRAWS.normal(size=(2, 4, 3, 5))
    together = angle_jacobian(camera, tracker, moves)
    for found, *one in zip(together, camera, tracker, moves, strict=True):
        np.testing.assert_allclose(found, angle_jacobian(*one), atol=1e-14)


def test_trains_of_mirrors_turn_one_by_one():
    trains = np.stack([mirror_train(CORNER[:2]), reflection([1, 2, 3])])
    turns = DRAWS.normal(size=(2, 3))
    together = turned_train(trains, turns)
    for found, *one in zip(together, trains, turns, strict=True):
        np.testing.assert_allclose(found, turned_train(*one), atol=1e-15)


def test_one_train_answers_every_direction():
    directions = DRAWS.normal(size=(5, 3))
    together = turn_response(mirror_train(ROOF), directions)
    for found, one in zip(together, directions, strict=True):
        np.testing.assert_allclose(found, turn_response(mirror_train(ROOF), one), atol=1e-15)
