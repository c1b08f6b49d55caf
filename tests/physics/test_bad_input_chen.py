"""Every public function of the misalignment physics says what it wants when it gets nonsense."""

import inspect

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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
# What may be zero or negative; all else is a length, a count or a set of directions.
LENGTHS = {
    "focal_length",
    "pixel_pitch",
    "altitude",
    "resolution",
    "count",
    "pixel_angle",
}
SIGMAS = {"sigma", "centroid_sigma", "single", "floor", "weights"}
# Integers: their own checks speak of whole numbers.
COUNTS = {(averaging.moving_average, "count")}


def spoilt(function, name, value):
    call = {**GOOD[function], name: value}
    with pytest.raises((ValueError, TypeError)) as caught:
        function(**call)
    message = str(caught.value)
    assert "expected" in message
    assert "got" in message
    return message


def test_every_public_function_is_tried():
    modules = [rotations, platform, angles, averaging, monitoring, imaging]
    public = {
        function
        for module in modules
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if not name.startswith("_") and function.__module__ == module.__name__
    }
    assert public | {validate.rotations} == set(GOOD) | INNER


def test_the_good_calls_are_good():
    for function, arguments in GOOD.items():
        function(**arguments)


@given(
    argument=st.sampled_from(ARGUMENTS),
    poison=st.sampled_from([np.nan, np.inf, -np.inf]),
    place=st.integers(0, 1000),
)
@settings(max_examples=300, deadline=None, derandomize=True)
def test_nan_and_infinity_are_refused_by_name(argument, poison, place):
    function, name = argument
    if argument in COUNTS or name == "counts":
        spoilt(function, name, poison if name == "count" else [poison])
        return
    value = np.array(GOOD[function][name], dtype=float)
    value.flat[place % value.size] = poison
    message = spoilt(function, name, value)
    assert GOOD[function].get("name", name) in message


@pytest.mark.parametrize("argument", ARGUMENTS, ids=lambda x: f"{x[0].__name__}-{x[1]}")
def test_empty_text_complex_and_wrong_shapes_are_errors(argument):
    function, name = argument
    good = GOOD[function][name]
    spoilt(function, name, "twelve" if name != "counts" else ["twelve"])
    if name in ("count", "counts"):
        spoilt(function, name, np.zeros(0))
        return
    shape = np.shape(good)
    spoilt(function, name, np.zeros((0, *shape[1:])))
    spoilt(function, name, np.asarray(good) * 1j)
    if shape:
        wide = np.zeros((*shape[:-1], shape[-1] + 4)) + 1.0
        if name not in ("series", "direction_jacobian", "jacobian"):
            spoilt(function, name, wide)


@given(
    argument=st.sampled_from([a for a in ARGUMENTS if a[1] in LENGTHS]),
    value=st.floats(-1e300, 0.0),
)
@settings(max_examples=100, deadline=None, derandomize=True)
def test_lengths_and_counts_are_above_zero(argument, value):
    spoilt(*argument, int(value) if argument in COUNTS else value)


@given(
    argument=st.sampled_from([a for a in ARGUMENTS if a[1] in SIGMAS]),
    value=st.floats(-1e300, -1e-300),
)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_sigmas_and_weights_are_not_negative(argument, value):
    function, name = argument
    message = spoilt(function, name, np.full(np.shape(GOOD[function][name]), value))
    assert name in message


BATCHED = [
    (function, name)
    for function, name in ARGUMENTS
    if len(GOOD[function].keys() - {"name"}) > 1
    and name not in ("counts", "series", "times")
    and (function, name) not in COUNTS
]


def test_batches_that_do_not_fit_together_are_errors():
    for function, name in BATCHED:
        other = next(key for key in GOOD[function] if key != name)
        call = dict(GOOD[function])
        for key, size in ((name, 2), (other, 3)):
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


@given(
    argument=st.sampled_from(DIRECTIONS),
    direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(
        lambda v: max(map(abs, v)) > 1e-3
    ),
    lengths=st.tuples(*[st.floats(0.1, 10)] * 3),
)
@settings(max_examples=150, deadline=None, derandomize=True)
def test_collinear_directions_are_refused(argument, direction, lengths):
    function, name = argument
    rows = np.outer(lengths, direction)
    call = {**GOOD[function], name: rows}
    with pytest.raises(DegenerateGeometryError):
        function(**call)


def test_zero_vectors_and_unequal_rows_are_errors():
    for argument in DIRECTIONS:
        for rows in ([[0, 0, 0], [0, 1, 0], [0, 0, 1]], EYE[:2]):
            spoilt(*argument, rows)


def test_zero_weights_are_refused():
    assert "weights" in spoilt(rotations.attitude, "weights", [0.0, 0, 0])
    with pytest.raises(DegenerateGeometryError):
        rotations.attitude(**{**GOOD[rotations.attitude], "weights": [0.0, 1, 0]})


def test_reflections_and_stretched_matrices_are_errors():
    for function, name in ARGUMENTS:
        if "_from_" in name:
            for wrong in (2 * EYE, -EYE):
                assert name in spoilt(function, name, wrong)
