"""What `checked` refuses and what it hands to a function."""

import numpy as np
import pytest

from reproduce.physics.validate import (
    Number,
    Points,
    Positive,
    Size,
    Weights,
    checked,
    kernel,
)


@checked
def weighted(
    points: Points, weights: Weights = None, scale: Positive = 1.0, step: Size = 2
):
    return points, weights, scale, step


def test_arguments_become_arrays_and_what_is_left_out_passes():
    points, weights, scale, step = weighted([[1, 2]])
    assert points.dtype == scale.dtype == np.float64
    assert weights is None
    assert (step, type(step)) == (2.0, float)


def test_a_named_dimension_is_one_number_in_all_arguments():
    with pytest.raises(ValueError, match=r"points and weights: .* 2 and 3"):
        weighted(np.zeros((2, 2)), np.ones(3))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"points": [1, 2, 3]}, "points:"),
        (
            {"points": np.zeros((4, 1, 2)), "scale": np.ones(3)},
            "points .4,., scale .3,.",
        ),
        ({"points": [[1, 2]], "scale": -1}, "scale:"),
        ({"points": [[1, 2]], "step": [1, 2]}, "step:"),
    ],
)
def test_each_is_refused_by_its_name(given, message):
    with pytest.raises(ValueError, match=message):
        weighted(**given)


def test_an_object_with_a_batch_joins_the_others():
    class Cameras:
        batch = (3,)

    @checked
    def turned(camera, angle: Number):
        return angle

    assert turned(Cameras(), np.zeros((2, 3))).shape == (2, 3)
    with pytest.raises(ValueError, match=r"camera .3,., angle .2,."):
        turned(Cameras(), [0, 0])


def test_the_kernel_is_the_function_without_its_checks():
    given = object()
    assert kernel(weighted)(given)[0] is given
