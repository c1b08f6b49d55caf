"""Resampled images: light and centroids arrive where the transform says."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from reproduce.physics.images import centre_of_gravity, render_frame
from reproduce.physics.registration import Registration, registered_image

TRANSFORM = Registration.similarity(1.01, 0.02, (1.3, -0.7), (30.0, 20.0))
BENT = Registration(
    "similarity+radial", np.array([1.05, 0.05, 3.2, -1.4, 2e-4]), np.zeros(2)
)
SPOT = np.array([[33.3, 27.8]])


@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        ("shift", [3.2, -1.4]),
        ("rigid", [0.05, 3.2, -1.4]),
        ("affine", [1.05, 0.03, -0.06, 0.97, 3.2, -1.4]),
        ("affine", [-1.0, 0.0, 0.0, 1.0, 3.2, -1.4]),  # a mirror image
        ("similarity", [1.01, 0.02, 1.3, -0.7]),
    ],
)
def test_a_spot_arrives_with_its_light_where_the_transform_says(model, parameters):
    transform = Registration(model, np.array(parameters), np.array([30.0, 22.0]))
    image = render_frame(SPOT, 1e5, 1.2, (64, 48))
    found = registered_image(image, transform)
    assert found.sum() == pytest.approx(1e5, rel=2e-3)
    expected = transform.apply(SPOT)[0]
    assert_allclose(centre_of_gravity(found, (0, 0)), expected, atol=0.01)


def test_a_window_is_a_part_of_the_whole():
    image = render_frame(SPOT + 40, 1e5, 1.0, (140, 140))
    whole = registered_image(image, TRANSFORM)
    part = registered_image(image[40:100, 45:105], TRANSFORM, corner=(45, 40))
    assert_allclose(part[5:-5, 5:-5], whole[45:95, 50:100], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: registered_image(np.ones((2, 3, 3)), TRANSFORM), "^image: "),
        (lambda: registered_image(np.ones((3, 3)), BENT), "radial term"),
        (
            lambda: registered_image(
                np.ones((3, 3)), Registration.similarity([1, 1], 0, (0, 0), (0, 0))
            ),
            "^image: ",
        ),
    ],
)
def test_bad_input_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
