"""Every public function of the misalignment physics says what it wants when it gets nonsense."""

import inspect

import numpy as np
import pytest

from reproduce.physics import validate
from reproduce.physics.attitude import (
    angles,
    averaging,
    monitoring,
    platform,
    rotations,
)
from reproduce.physics.ground import imaging
from reproduce.physics.validate import DegenerateGeometryError

EYE = np.eye(3)
POINTS = np.array([[0.0, 0.1], [0.2, 0.0], [0.1, 0.1]])
TRACKER = {"principal_point": (0.0, 0.0), "pixel_pitch": 1e-5, "focal_length": 0.06}

# A good call of every public function that takes arrays; the tests spoil one argument each.
GOOD = {
    rotations.attitude: {
        "target_vectors": EYE,
        "source_vectors": EYE,
        "weights": [1.0, 2, 3],
    },
    rotations.quest: {
        "target_vectors": EYE,
        "source_vectors": EYE,
        "weights": [1.0, 2, 3],
    },
    rotations.mean_rotation: {"matrices": [EYE, EYE]},
    validate.rotations: {"name": "R", "matrices": EYE},
    rotations.unit: {"name": "v", "vectors": EYE},
    rotations.cross_matrix: {"vectors": EYE},
    rotations.rotation_from_vector: {"rotation_vector": EYE},
    rotations.vector_from_rotation: {"rotation": EYE},
    platform.emitted_directions: {
        "points": POINTS,
        "focal_length": 1.0,
        "principal_point": (0.0, 0.0),
    },
    platform.received_directions: {"spots": POINTS, **TRACKER},
    platform.received_spots: {
        "directions": [[0.0, 0.1, 1.0], [0.1, 0.0, 1.0]],
        **TRACKER,
    },
    platform.received_jacobian: {"spots": POINTS, **TRACKER},
    angles.laser_transform: {
        "camera_directions": EYE,
        "tracker_directions": EYE,
    },
    angles.misalignment: {
        "camera_directions": EYE,
        "tracker_directions": EYE,
        "tracker_from_camera_zero": EYE,
    },
    angles.misalignment_angles: {"camera_now_from_camera_zero": EYE},
    angles.angle_jacobian: {
        "camera_directions": EYE,
        "tracker_directions": EYE,
        "direction_jacobian": np.ones((3, 3, 2)),
    },
    angles.moved_laser_transform: {
        "tracker_from_camera_zero": EYE,
        "camera_now_from_camera_zero": EYE,
    },
    angles.misalignment_between: {
        "tracker_from_camera_now": EYE,
        "tracker_from_camera_zero": EYE,
    },
    angles.transform_error_printed: {
        "tracker_from_camera": EYE,
        "tracker_from_camera_reference": EYE,
    },
    angles.inertial_attitude: {
        "camera_now_from_camera_zero": EYE,
        "camera_zero_from_tracker": EYE,
        "tracker_from_inertial": EYE,
    },
    angles.misalignment_in_tracker: {
        "camera_now_from_camera_zero": EYE,
        "tracker_from_camera_zero": EYE,
    },
    angles.stage_angle: {"shift": 1e-5, "focal_length": 2.0},
    angles.stage_angle_printed: {"shift": 1e-5, "focal_length": 2.0},
    angles.stage_angles: {"shifts": [1e-5, 2e-5], "focal_length": 2.0},
    averaging.moving_average: {"series": np.arange(9.0), "count": 2},
    averaging.scatter_of_averages: {"series": np.arange(9.0), "counts": [1, 2]},
    averaging.allan_deviation: {"series": np.arange(9.0), "counts": [1, 2]},
    averaging.stability: {
        "times": np.arange(20.0),
        "series": np.arange(20.0)[:, None] % 3,
    },
    averaging.averaged_error: {"count": 4.0, "single": 1.0, "floor": 0.1},
    averaging.attitude_accuracy: {
        "centroid_sigma": 0.1,
        "count": 4.0,
        "pixel_angle": 1e-4,
    },
    imaging.ground_resolution: {
        "focal_length": 1.0,
        "pixel_pitch": 1e-5,
        "altitude": 5e5,
    },
    imaging.altitude_for_resolution: {
        "focal_length": 1.0,
        "pixel_pitch": 1e-5,
        "resolution": 1.0,
    },
    imaging.image_vectors: {
        "points": POINTS,
        "focal_length": 1.0,
        "principal_point": (0.0, 0.0),
        "distortion": 0.0 * POINTS,
    },
    imaging.imaged_position: {
        "vectors": [[0.0, 0.0, 1.0]],
        "satellite": [0.0, 0.0, 7e6],
        "earth_from_camera": EYE,
    },
    imaging.ground_jacobian: {
        "vectors": [[0.0, 0.0, 1.0]],
        "satellite": [0.0, 0.0, 7e6],
        "earth_from_camera": EYE,
    },
    imaging.ground_covariance: {
        "position": [6.4e6, 0.0, 0.0],
        "jacobian": EYE,
        "covariance": EYE,
    },
    imaging.circular_error: {"covariance": [[2.0, 0.0], [0.0, 1.0]]},
}
# The function that test_monitoring tries.
INNER = {monitoring.monitored}
ARGUMENTS = [
    (function, name)
    for function, good in GOOD.items()
    for name in good
    if name != "name"
]
# Lengths and counts are above zero; sigmas and weights may be zero.
LENGTHS = "focal_length pixel_pitch altitude resolution count pixel_angle".split()
SIGMAS = "centroid_sigma single floor weights".split()
INTEGERS = [
    (averaging.moving_average, "count"),
    (averaging.scatter_of_averages, "counts"),
    (averaging.allan_deviation, "counts"),
]
ARRAYS = [argument for argument in ARGUMENTS if argument not in INTEGERS]


def error_of(function, name, value):
    """Return the message of the error, which names the argument."""
    arguments = {**GOOD[function], name: value}
    with pytest.raises((ValueError, TypeError), match=r"expected .*, got ") as caught:
        function(**arguments)
    return str(caught.value)


def test_every_public_function_is_tried():
    modules = [rotations, platform, angles, averaging, monitoring, imaging]
    public = {
        function
        for module in modules
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if not name.startswith("_") and function.__module__ == module.__name__
    }
    assert public | {validate.rotations} == set(GOOD) | INNER
    for function, arguments in GOOD.items():
        function(**arguments)


def test_nan_and_infinity_are_errors_that_name_the_argument():
    for function, name in ARRAYS:
        for poison in (np.nan, np.inf, -np.inf):
            value = np.array(GOOD[function][name], dtype=float)
            value.flat[-1] = poison
            message = error_of(function, name, value)
            assert GOOD[function].get("name", name) in message


def test_empty_text_complex_and_wrong_shapes_are_errors():
    for function, name in ARRAYS:
        good = np.asarray(GOOD[function][name])
        error_of(function, name, "twelve")
        error_of(function, name, good * 1j)
        error_of(function, name, np.zeros((0, *good.shape[1:])))
        if good.shape and name not in ("series", "direction_jacobian", "jacobian"):
            error_of(function, name, np.ones((*good.shape[:-1], good.shape[-1] + 4)))


def test_counts_that_are_not_whole_numbers_are_errors():
    for function, name in INTEGERS:
        for wrong in (2.0, 0, -3):
            error_of(function, name, wrong if name == "count" else [wrong])


def test_lengths_are_above_zero_and_sigmas_are_not_negative():
    for function, name in ARRAYS:
        for value in [0.0, -1e-300] * (name in LENGTHS) + [-1e-300] * (name in SIGMAS):
            shape = np.shape(GOOD[function][name])
            assert name in error_of(function, name, np.full(shape, value))


def test_batches_that_do_not_fit_together_are_errors():
    for function, name in ARRAYS:
        others = [key for key in GOOD[function] if key not in (name, "name", "counts")]
        if others and name not in ("series", "times"):
            call = dict(GOOD[function])
            for key, size in ((name, 2), (others[0], 3)):
                value = np.asarray(call[key], dtype=float)
                call[key] = np.broadcast_to(value, (size, *value.shape))
            with pytest.raises(ValueError, match=f"{name} .2|expected one number"):
                function(**call)


DIRECTIONS = [
    (rotations.attitude, "target_vectors"),
    (angles.laser_transform, "camera_directions"),
    (angles.misalignment, "tracker_directions"),
    (angles.angle_jacobian, "tracker_directions"),
]


def test_bad_directions_are_errors():
    generator = np.random.default_rng(1)
    for function, name in DIRECTIONS:
        for rows in ([[0, 0, 0], [0, 1, 0], [0, 0, 1]], EYE[:2]):
            error_of(function, name, rows)
        collinear = np.outer([1.0, -0.2, 7.0], generator.normal(size=3))
        with pytest.raises(DegenerateGeometryError):
            function(**{**GOOD[function], name: collinear})


def test_zero_weights_are_errors():
    assert "weights" in error_of(rotations.attitude, "weights", [0.0, 0, 0])
    with pytest.raises(DegenerateGeometryError):
        rotations.attitude(**{**GOOD[rotations.attitude], "weights": [0.0, 1, 0]})


def test_reflections_and_stretched_matrices_are_errors():
    for function, name in ARGUMENTS:
        if "_from_" in name:
            for wrong in (2 * EYE, -EYE):
                assert name in error_of(function, name, wrong)
