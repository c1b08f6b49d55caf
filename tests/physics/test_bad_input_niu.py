"""Bad input meets an error that says what was expected, what came, and what to do."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.random import default_rng

from reproduce.physics import optics, registration
from reproduce.physics.attitude import attitude
from reproduce.physics.images import fitted_centre
from reproduce.physics.optics import arrangements, camera, rotary
from reproduce.physics.registration import (
    calibration,
    fit_registration,
    registered_image,
    transforms,
)
from reproduce.physics.validate import DegenerateGeometryError

SOURCE = np.array([[100.0, 200.0], [900.0, 300.0], [500.0, 1200.0], [40.0, 1000.0]])
TARGET = SOURCE * 1.001 + 0.5
LINE = np.array([[0.0, 5.0], [10.0, 5.5], [20.0, 6.0]])
START = np.array([1.0, 0.0, 0.0, 0.0])
PIVOT = np.array([500.0, 400.0])
CAMERA = camera.Camera(25e-3, PIVOT, 40.0, 4e-6)
STARLIGHT = np.array([[0.1, 0.0, 1.0], [0.0, 0.1, 1.0]])
SIMILARITY = transforms.Registration.similarity(1.001, 0.001, (0.5, 0.5), PIVOT)
FIT = {"source": SOURCE, "target": TARGET, "pivot": PIVOT}
STEP = {"parameters": START, **FIT}

# Every public function, with arguments that it takes; arrays and floats among them are spoilt.
CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "detector_centre": (camera.detector_centre, {"pixels": np.array([2064.0, 1544.0])}),
    "Camera": (
        camera.Camera,
        {
            "focal_length": 25e-3,
            "principal_point": PIVOT,
            "radial_distortion": 40.0,
            "pixel_pitch": 4e-6,
        },
    ),
    "ideal_positions": (
        camera.ideal_positions,
        {"directions": STARLIGHT, "focal_length": 25e-3},
    ),
    "radial_displacements": (
        camera.radial_displacements,
        {"ideal": SOURCE, "radial_distortion": 1.0},
    ),
    "turned_onto_detector": (
        camera.turned_onto_detector,
        {"positions": SOURCE, "rotation": 0.1},
    ),
    "image_points": (
        camera.image_points,
        {"directions": STARLIGHT, "camera": CAMERA, "rotation": 0.1},
    ),
    "field_of_view": (
        camera.field_of_view,
        {"pixels": 1000.0, "pixel_pitch": 4e-6, "focal_length": 25e-3},
    ),
    "angle_from_pixels": (
        camera.angle_from_pixels,
        {"pixels": 10.0, "pixel_pitch": 4e-6, "focal_length": 25e-3},
    ),
    "scale_factor": (
        camera.scale_factor,
        {"reference_focal_length": 25e-3, "focal_length": 25e-3},
    ),
    "distortion_ratio": (
        camera.distortion_ratio,
        {"scale": 1.0, "reference_distortion": 40.0, "distortion": 40.0},
    ),
    "reference_points_scaled": (
        camera.reference_points_scaled,
        {"points": SOURCE, "scale": 1.0, "principal_point": PIVOT},
    ),
    "rotary_matrix": (rotary.rotary_matrix, {"external": 0.1, "middle": 0.1}),
    "rotary_matrix_printed": (
        rotary.rotary_matrix_printed,
        {"external": 0.1, "middle": 0.1},
    ),
    "starlight": (rotary.starlight, {"external": 0.1, "middle": 0.1}),
    "similarity": (
        transforms.Registration.similarity,
        {"scale": 1.0, "rotation": 0.1, "shift": np.zeros(2), "pivot": PIVOT},
    ),
    "apply": (SIMILARITY.apply, {"points": SOURCE}),
    "principal_point_shift": (
        transforms.principal_point_shift,
        {"principal_point": PIVOT, "reference_principal_point": PIVOT},
    ),
    "similarity_between": (
        transforms.similarity_between,
        {"camera": CAMERA, "rotation": 0.1, "reference": CAMERA},
    ),
    "fit_registration": (fit_registration, {**FIT, "weights": np.ones(4)}),
    "registration_bound": (
        calibration.registration_bound,
        {
            "source": SOURCE,
            "similarity": SIMILARITY,
            "source_sigma": 0.1,
            "target_sigma": 0.1,
        },
    ),
    "rmse": (transforms.rmse, {"points": SOURCE, "reference": TARGET}),
    "rmse_per_axis": (
        transforms.rmse_per_axis,
        {"points": SOURCE, "reference": TARGET},
    ),
    "paired_points": (transforms.paired_points, {"source": SOURCE, "target": TARGET}),
    "jacobian": (
        calibration.jacobian,
        {"parameters": START, "source": SOURCE, "pivot": PIVOT},
    ),
    "deviations": (calibration.deviations, STEP),
    "gauss_newton_step": (calibration.gauss_newton_step, STEP),
    "gauss_newton_step_printed": (calibration.gauss_newton_step_printed, STEP),
    "starting_values": (
        calibration.starting_values,
        {
            "source_line": LINE,
            "target_line": LINE,
            "source_zero": PIVOT,
            "target_zero": PIVOT,
        },
    ),
    "random_starts": (
        calibration.random_starts,
        {"start": START, "half_widths": START, "count": 2, "generator": default_rng(1)},
    ),
    "calibrate": (calibration.calibrate, {**FIT, "start": START}),
    "constraint": (calibration.constraint, {"rotation": 0.1}),
    "constraint_printed": (calibration.constraint_printed, {"rotation": 0.1}),
    "arrangement_angles": (
        arrangements.arrangement_angles,
        {
            "name": arrangements.arrangement_names()[0],
            "half_x": 8.0,
            "half_y": 6.0,
            "step": 0.9,
        },
    ),
    "error_field": (
        transforms.error_field,
        {"channels": transforms.Channels(CAMERA, CAMERA), "positions": SOURCE * 1e-6},
    ),
    "even_positions": (
        transforms.even_positions,
        {"half_size": np.array([4e-3, 3e-3])},
    ),
    "channel_centroids": (
        rotary.channel_centroids,
        {"cameras": [CAMERA], "rotations": np.zeros(1), "angles": SOURCE * 1e-4},
    ),
}
SPOILABLE = [
    (name, argument)
    for name, (_, arguments) in CALLS.items()
    for argument, value in arguments.items()
    if isinstance(value, (np.ndarray, float))
]
COUNTS = [
    (name, argument)
    for name, (_, arguments) in CALLS.items()
    for argument, value in arguments.items()
    if isinstance(value, int)
]
LENGTHS = {
    "focal_length",
    "reference_focal_length",
    "pixel_pitch",
    "scale",
    "half_x",
    "step",
}


def call(name: str, **changes: Any) -> Any:
    function, arguments = CALLS[name]
    return function(**arguments | changes)


def refuses(name: str, argument: str, value: Any) -> str:
    with pytest.raises((ValueError, TypeError)) as caught:
        call(name, **{argument: value})
    message = str(caught.value)
    assert argument in message, message
    assert re.search(r"expected .*, got .*[;.] \w+", message, re.DOTALL), message
    return message


def test_the_table_holds_every_public_function() -> None:
    modules = (
        calibration,
        camera,
        arrangements,
        rotary,
        transforms,
    )
    # These take arrays that others have checked, to go fast; test_intrinsics tries the last. An
    # image may have any shape; test_resample spoils it.
    inner = {
        "arrangement_names",
        "as_complex",
        "as_points",
        "fit_camera",
        "registered_image",
    }
    public = {*vars(optics), *vars(registration)}
    for module in modules:
        for name, thing in vars(module).items():
            own = getattr(thing, "__module__", None) == module.__name__
            if (
                own
                and callable(thing)
                and not isinstance(thing, type)
                and name in public
            ):
                assert name in CALLS or name in inner, f"{module.__name__}.{name}"


@pytest.mark.parametrize("name", CALLS)
def test_the_unspoilt_call_works(name: str) -> None:
    call(name)


@given(st.data())
def test_nan_and_infinity_are_refused(data: st.DataObject) -> None:
    name, argument = data.draw(st.sampled_from(SPOILABLE))
    good = np.asarray(CALLS[name][1][argument], dtype=float)
    spoilt = good.copy()
    index = tuple(data.draw(st.integers(0, side - 1)) for side in good.shape)
    spoilt[index] = data.draw(st.sampled_from([np.nan, np.inf, -np.inf]))
    assert "finite" in refuses(name, argument, spoilt)


@pytest.mark.parametrize(("name", "argument"), SPOILABLE)
def test_empty_text_and_complex_are_refused(name: str, argument: str) -> None:
    good = np.asarray(CALLS[name][1][argument], dtype=float)
    refuses(name, argument, np.empty((0, *good.shape)))
    refuses(name, argument, "ten")
    refuses(name, argument, good + 1j)


@given(st.data())
def test_a_wrong_shape_is_refused(data: st.DataObject) -> None:
    arrays = [pair for pair in SPOILABLE if np.ndim(CALLS[pair[0]][1][pair[1]])]
    name, argument = data.draw(st.sampled_from(arrays))
    good = np.asarray(CALLS[name][1][argument])
    shape = data.draw(npst.array_shapes(min_dims=0, max_dims=2, min_side=1, max_side=5))
    # One row is enough for most, and a row more or less may be a different number of points.
    assume(shape[-1:] != good.shape[-1:])
    with pytest.raises((ValueError, TypeError), match="expected"):
        call(name, **{argument: np.ones(shape)})


@pytest.mark.parametrize(
    ("name", "argument"), [pair for pair in SPOILABLE if pair[1] in LENGTHS]
)
@given(value=st.floats(max_value=0, allow_infinity=False))
def test_a_length_of_zero_or_less_is_refused(
    name: str, argument: str, value: float
) -> None:
    assert "above zero" in refuses(name, argument, value)


@pytest.mark.parametrize(("name", "argument"), COUNTS)
def test_a_count_that_is_none_is_refused(name: str, argument: str) -> None:
    for bad in (0, -3, 2.5, True, "2"):
        refuses(name, argument, bad)


@given(st.floats(max_value=0, exclude_max=True, allow_infinity=False))
def test_negative_sigma_weights_and_widths_are_refused(value: float) -> None:
    assert "zero or more" in refuses(
        "fit_registration", "weights", np.array([1, 1, value, 1])
    )
    assert "zero or more" in refuses("random_starts", "half_widths", START + value)


def test_unlike_counts_are_refused() -> None:
    for name in (
        "fit_registration",
        "rmse",
        "deviations",
        "gauss_newton_step",
        "calibrate",
    ):
        second = "reference" if name == "rmse" else "target"
        assert "4 and 3" in refuses(name, second, TARGET[:3])
    refuses("channel_centroids", "rotations", np.zeros(2))


@pytest.mark.parametrize(
    ("name", "argument", "value"),
    [
        ("fit_registration", "pivot", np.zeros((3, 2))),
        ("rmse", "reference", np.stack([TARGET] * 3)),
        ("calibrate", "start", np.stack([START] * 3)),
        ("apply", "points", None),
        ("image_points", "rotation", np.zeros(3)),
        ("rotary_matrix", "middle", np.zeros(3)),
    ],
)
def test_unlike_batches_are_refused(name: str, argument: str, value: Any) -> None:
    function, arguments = CALLS[name]
    two = {
        key: np.stack([value, value])
        for key, value in arguments.items()
        if isinstance(value, np.ndarray) and key != argument
    } or {key: np.zeros(2) for key in arguments if key == "external"}
    if name == "apply":
        pairs = transforms.Registration.similarity([1, 1], 0, (0, 0), PIVOT)
        function, two, value = pairs.apply, {}, np.stack([SOURCE] * 3)
    with pytest.raises(ValueError, match=r"expected leading .* got .*; give"):
        function(**{**arguments, **two, argument: value})


@pytest.mark.parametrize("name", ["fit_registration", "calibrate", "gauss_newton_step"])
@given(
    point=st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), count=st.integers(1, 4)
)
def test_one_point_and_coincident_points_are_refused(
    name: str, point: tuple[float, float], count: int
) -> None:
    same = np.tile(point, (count, 1))
    changes = {"source": same, "target": TARGET[:count]}
    if name == "fit_registration":
        changes["weights"] = None
    with pytest.raises(DegenerateGeometryError, match=r"expected .*, got .*[;.] \w+"):
        call(name, **changes)


def test_coincident_targets_are_refused() -> None:
    same = np.tile(TARGET[:1], (4, 1))
    for name in ("fit_registration", "calibrate"):
        with pytest.raises(DegenerateGeometryError, match="target"):
            call(name, target=same)


def test_zero_weights_are_refused_and_one_is_not_enough() -> None:
    assert "at least one" in refuses("fit_registration", "weights", np.zeros(4))
    with pytest.raises(DegenerateGeometryError, match="weight above zero"):
        call("fit_registration", weights=[0, 0, 1, 0])


@given(
    point=st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), count=st.integers(1, 5)
)
def test_a_line_needs_two_points(point: tuple[float, float], count: int) -> None:
    with pytest.raises(DegenerateGeometryError, match=r"expected .*, got .*[;.] \w+"):
        calibration.starting_values(np.tile(point, (count, 1)), LINE, PIVOT, PIVOT)
    with pytest.raises(DegenerateGeometryError, match="alike"):
        calibration.starting_values(
            LINE, [[0, 0], [1, 0], [1, 1], [0, 1]], PIVOT, PIVOT
        )


@given(
    npst.arrays(float, (3,), elements=st.floats(-10, 10)).filter(
        lambda star: star[2] <= 1e-10 * np.abs(star[:2]).max()
    )
)
def test_stars_beside_and_behind_the_camera_are_refused(star: np.ndarray) -> None:
    assert "in front" in refuses("ideal_positions", "directions", star[None])


def test_special_refusals() -> None:
    assert "no ratio" in refuses("distortion_ratio", "distortion", 0.0)
    assert "radians" in refuses("arrangement_angles", "step", 1e-5)
    assert "one number" in refuses("arrangement_angles", "step", np.array([0.9, 0.8]))


@given(st.data())
def test_a_fit_of_anything_is_finite_or_refused(data: st.DataObject) -> None:
    count = data.draw(st.integers(1, 5))
    # Few different values, so that points coincide, mirror and line up.
    elements = st.one_of(st.integers(-2, 2).map(float), st.floats(-1e4, 1e4, width=32))
    source, target = (
        data.draw(npst.arrays(float, (count, 2), elements=elements)) for _ in range(2)
    )
    try:
        fit = fit_registration(source, target, (0.0, 0.0))
    except DegenerateGeometryError:
        return
    assert np.isfinite(fit.parameters).all()
    assert np.isfinite(fit.cofactor).all()
    size = 1 + np.abs(target).max()
    np.testing.assert_allclose(fit.residuals.sum(axis=0), 0, atol=1e-9 * size)
    again = target - fit.transform.apply(source)
    np.testing.assert_allclose(fit.residuals, again, atol=1e-9 * size)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([[1, 2], [3]], "got rows of unequal length"),
        ([["1", "2"], ["3", "four"]], "real numbers"),
        ([["1", "2"], ["3", "4"]], "real numbers"),
        ([[1, {}], [2, 3]], "real numbers"),
        ([[10**400, 1], [1, 1]], "real numbers"),
        (np.array([["2020-01-01"] * 2] * 2, dtype="M8[D]"), "real numbers"),
        ([[1, 2j], [3, 4]], "real numbers"),
    ],
)
def test_what_holds_no_numbers_is_refused_in_one_line(value: Any, message: str) -> None:
    good, image = [[1.0, 2.0], [3.0, 5.0]], np.ones((5, 5))
    calls: list[Callable[[], object]] = [
        lambda: fit_registration(value, good, (0, 0)),
        lambda: fit_registration(good, value, (0, 0)),
        lambda: fit_registration(good, good, value),
        lambda: fit_registration(good, good, (0, 0), target_covariance=value),
        lambda: fitted_centre(value, (0, 0), 0.6),
        lambda: registered_image(value, SIMILARITY),
        lambda: registered_image(image, SIMILARITY, corner=value),
        lambda: attitude(value, value),
    ]
    for call in calls:
        with pytest.raises(TypeError, match=message) as caught:
            call()
        assert "\n" not in str(caught.value)
