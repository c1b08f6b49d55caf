"""Leading axes of the attitude side: a batch gives what each of its members gives alone."""

import numpy as np

from reproduce.physics.attitude import angle_jacobian, rotation_from_vector
from reproduce.physics.light import ROOF, mirror_train, turn_response

DRAWS = np.random.default_rng(9)


def test_the_jacobian_of_a_batch_is_that_of_its_members():
    camera = DRAWS.normal(size=(2, 4, 3))
    camera /= np.linalg.norm(camera, axis=-1, keepdims=True)
    tracker = camera @ rotation_from_vector([[0.1, 0.2, -0.3], [0.5, 0.0, 0.1]])
    moves = DRAWS.normal(size=(2, 4, 3, 5))
    together = angle_jacobian(camera, tracker, moves)
    for found, *one in zip(together, camera, tracker, moves, strict=True):
        np.testing.assert_allclose(found, angle_jacobian(*one), atol=1e-14)


def test_one_train_answers_every_direction():
    directions = DRAWS.normal(size=(5, 3))
    together = turn_response(mirror_train(ROOF), directions)
    for found, one in zip(together, directions, strict=True):
        np.testing.assert_allclose(
            found, turn_response(mirror_train(ROOF), one), atol=1e-15
        )
