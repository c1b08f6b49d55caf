"""Bad input of public functions: the checks, and the check of each argument."""

import pkgutil
import re
from importlib import import_module

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.testing import assert_allclose

from reproduce import physics
from reproduce.physics import attitude, ground, images, optics, registration
from reproduce.physics.validate import (
    DegenerateGeometryError,
    MirroredPointsError,
    NonNegative,
    Number,
    Points,
    Positive,
    Rotation,
    Size,
    Weights,
    checked,
    weights_for,
    whole_number,
)

SOURCE = np.array([[100.0, 200.0], [900.0, 300.0], [500.0, 1200.0], [40.0, 1000.0]])
TARGET = SOURCE * 1.001 + 0.5
PIVOT = np.array([500.0, 400.0])
LINE = np.array([[0.0, 5.0], [10.0, 5.5], [20.0, 6.0]])
START = np.array([1.0, 0.0, 0.0, 0.0])
SERIES, EYE = np.arange(20.0), np.eye(3)
CAMERA = {
    "focal_length": 25e-3,
    "principal_point": PIVOT,
    "radial_distortion": 40.0,
    "pixel_pitch": 4e-6,
}
STEP = {"source": SOURCE, "target": TARGET, "pivot": PIVOT}


@checked
def sample(
    points: Points,
    weights: Weights = None,
    scale: Positive = 1.0,
    step: Size = 2,
    sigma: NonNegative = 0.0,
    turn: Rotation = EYE,
):
    return points, weights, scale, step


def test_arguments_become_arrays_and_optional_ones_stay_none():
    points, weights, scale, step = sample([[1, 2]])
    assert points.dtype == scale.dtype == np.float64
    assert weights is None
    assert (step, type(step)) == (2.0, float)


class Quantity(np.ndarray):
    unit = "m"


# Arguments that `sample` rejects, and the error.
BAD = [
    *(({"points": [[value, 2]]}, ValueError) for value in (np.nan, np.inf, -np.inf)),
    *(({"points": np.ones(shape)}, ValueError) for shape in ((0, 2), (3,), (2, 3), ())),
    ({"points": "ten"}, TypeError),
    ({"points": [[1, 2j]]}, TypeError),
    ({"points": [[1, 2], [3]]}, TypeError),
    ({"points": [["1", "2"]]}, TypeError),
    ({"points": [[10**400, 1]]}, TypeError),
    ({"points": np.array([["2020-01-01"] * 2], dtype="M8[D]")}, TypeError),
    ({"points": np.ma.masked_greater([[1.0, 2.0]], 1)}, ValueError),
    ({"points": np.ones((2, 2)).view(Quantity)}, TypeError),
    ({"points": [[np.ones(2).view(Quantity)]]}, TypeError),
    ({"points": [[np.ma.masked_greater([1.0, 2.0], 1)]]}, ValueError),
    ({"scale": 0.0}, ValueError),
    ({"step": [1, 2]}, ValueError),
    ({"step": 0}, ValueError),
    ({"sigma": -1e-300}, ValueError),
    ({"turn": -EYE}, ValueError),
    ({"turn": EYE + 2e-6}, ValueError),
]


@pytest.mark.parametrize(("changes", "error"), BAD)
def test_bad_arguments_are_named_in_one_line(changes, error):
    with pytest.raises(error) as caught:
        sample(**{"points": [[1, 2]]} | changes)
    assert re.match(
        rf"{next(iter(changes))}: expected [^\n]*, got [^\n]*\. \w+[^\n]*$",
        str(caught.value),
    )


def test_equal_rows_and_batches_are_required():
    with pytest.raises(ValueError, match=r"points and weights: .* 2 and 3"):
        sample(np.zeros((2, 2)), np.ones(3))
    with pytest.raises(ValueError, match=r"points .4,., .*scale .3,."):
        sample(np.zeros((4, 1, 2)), scale=np.ones(3))


def test_an_object_with_a_batch_is_part_of_the_check():
    class Cameras:
        batch = (3,)

    @checked
    def rotated(camera, angle: Number):
        return angle

    assert rotated(Cameras(), np.zeros((2, 3))).shape == (2, 3)
    with pytest.raises(ValueError, match=r"camera .3,., angle .2,."):
        rotated(Cameras(), [0, 0])


def test_whole_numbers_and_weights():
    assert type(whole_number("n", np.int32(3))) is int
    for value in (True, 2.0, "2"):
        with pytest.raises(TypeError, match="n: expected a whole number"):
            whole_number("n", value)
    with pytest.raises(ValueError, match="n: expected 2 or more"):
        whole_number("n", 1, least=2)
    assert weights_for([[0, 1], [2, 3]], 2).shape == (2, 2)
    for weights in ([[0, 0], [1, 1]], [-1, 1]):
        with pytest.raises(ValueError, match="weights: expected"):
            weights_for(weights, 2)


POSITIVE = set(
    "altitude focal_length pixel_angle pixel_pitch radius reference_focal_length resolution "
    "scale temperature half_x half_y step".split()
)


def test_lengths_and_other_sizes_are_positive():
    for info in pkgutil.walk_packages(physics.__path__, "reproduce.physics."):
        for function in vars(import_module(info.name)).values():
            kinds = getattr(
                getattr(function, "__wrapped__", None), "__annotations__", {}
            )
            for argument in POSITIVE & {*kinds}:
                assert kinds[argument] in {"Positive", "Size"}, (function, argument)


# Calls of functions that check their arguments themselves; the arrays and numbers are spoilt.
CALLS = [
    (optics.detector_centre, {"pixels": np.array([2064.0, 1544.0])}),
    (optics.Camera, CAMERA),
    (
        optics.field_of_view,
        {"pixels": 1000.0, "pixel_pitch": 4e-6, "focal_length": 0.1},
    ),
    (optics.rotary_matrix_printed, {"external": 0.1, "middle": 0.1}),
    (
        optics.channel_centroids,
        {
            "cameras": [optics.Camera(**CAMERA)],
            "angles": LINE / 99,
        },
    ),
    (registration.fit_registration, {**STEP, "weights": np.ones(4)}),
    (registration.calibrate, {**STEP, "start": START}),
    (attitude.moving_average, {"series": SERIES}, {"count": 2}),
    (attitude.scatter_of_averages, {"series": SERIES}, {"counts": [1, 2]}),
    (attitude.allan_deviation, {"series": SERIES}, {"counts": [1, 2]}),
    (attitude.stability, {"times": SERIES, "series": SERIES[:, None] % 3}),
    (attitude.mean_rotation, {"matrices": np.stack([EYE, EYE])}),
    (images.fitted_spots, {"corners": np.zeros(2), "radius": 0.6}, {"windows": EYE}),
    (ground.circular_error, {"covariance": np.eye(2)}),
]


@pytest.mark.parametrize(
    ("function", "arguments", "argument", "others"),
    [
        (function, arguments, argument, (*others, {})[0])
        for function, arguments, *others in CALLS
        for argument, value in arguments.items()
        if isinstance(value, (np.ndarray, float))
    ],
)
def test_other_functions_name_their_argument(function, arguments, argument, others):
    good = np.asarray(arguments[argument])
    spoilt = [np.full(good.shape, value) for value in (np.nan, np.inf)]
    for value in (*spoilt, np.empty((0, *good.shape)), "ten", good + 1j):
        with pytest.raises((ValueError, TypeError), match=f"{argument}: expected"):
            function(**arguments | others | {argument: value})


def test_counts_are_whole_numbers_in_range():
    for call in (
        lambda n: attitude.moving_average(SERIES, n),
        lambda n: attitude.allan_deviation(SERIES, [n]),
        lambda n: images.centre_of_gravity_error((0, 0), 1.0, 0.6, (-1, -1), n),
    ):
        for count in (0, 2.5, "2"):
            with pytest.raises(
                (ValueError, TypeError), match=r"(count|size)s?: expected"
            ):
                call(count)


def test_unequal_counts_and_batches_are_errors():
    pairs = registration.Registration.similarity([1, 1], 0, (0, 0), PIVOT)
    for error, call in (
        ("rotation", lambda: optics.Camera([1, 1], PIVOT, 0, 1, [0, 0, 0])),
        ("expected leading", lambda: pairs.apply([SOURCE] * 3)),
    ):
        with pytest.raises(ValueError, match=error):
            call()


@given(
    point=st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), count=st.integers(1, 4)
)
def test_coincident_points_determine_nothing(point, count):
    same = np.tile(point, (count, 1))
    for call in (
        lambda: registration.fit_registration(same, TARGET[:count], PIVOT),
        lambda: registration.calibrate(same, TARGET[:count], PIVOT, START),
        lambda: registration.gauss_newton_step(START, same, TARGET[:count], PIVOT),
        lambda: registration.starting_values(same, LINE, PIVOT, PIVOT),
    ):
        with pytest.raises(DegenerateGeometryError, match=r"expected .*, got .*\. \w+"):
            call()


def test_other_degenerate_points_are_errors():
    same, square = np.tile(TARGET[:1], (4, 1)), [[0, 0], [1, 0], [1, 1], [0, 1]]
    for error, call in (
        ("target", lambda: registration.fit_registration(SOURCE, same, PIVOT)),
        ("target", lambda: registration.calibrate(SOURCE, same, PIVOT, START)),
        (
            "above zero",
            lambda: registration.fit_registration(**STEP, weights=[0, 0, 1, 0]),
        ),
        ("alike", lambda: registration.starting_values(LINE, square, PIVOT, PIVOT)),
    ):
        with pytest.raises(DegenerateGeometryError, match=error):
            call()


@given(
    npst.arrays(float, (3,), elements=st.floats(-10, 10)).filter(
        lambda star: star[2] <= 1e-10 * np.abs(star[:2]).max()
    )
)
def test_stars_next_to_and_behind_the_camera_are_errors(star):
    with pytest.raises(ValueError, match="in front"):
        optics.ideal_positions(star[None], 0.1)


def test_a_ratio_without_distortion_and_a_small_step_are_errors():
    with pytest.raises(ValueError, match="other than zero"):
        optics.distortion_ratio(1.0, 40.0, 0.0)
    with pytest.raises(ValueError, match="radians"):
        optics.arrangement_angles("square", 8.0, 6.0, 1e-5)
    for wrong in ("square", "square; centred; diamond"):
        with pytest.raises(ValueError, match=rf"^name: .*diamond.*got '{wrong}'"):
            optics.arrangement_angles(wrong, 8.0, 6.0, 1.0)


@given(st.data())
def test_a_fit_of_any_points_is_finite_or_an_error(data):
    count = data.draw(st.integers(1, 5))
    # Few different values, so that points coincide, mirror and line up.
    elements = st.one_of(st.integers(-2, 2).map(float), st.floats(-1e4, 1e4, width=32))
    source, target = (
        data.draw(npst.arrays(float, (count, 2), elements=elements)) for _ in range(2)
    )
    try:
        fit = registration.fit_registration(source, target, (0.0, 0.0))
    except (DegenerateGeometryError, MirroredPointsError):
        return
    assert np.isfinite(fit.parameters).all()
    assert np.isfinite(fit.cofactor).all()
    size = 1 + np.abs(target).max()
    assert_allclose(fit.residuals.sum(axis=0), 0, atol=1e-9 * size)
    residuals = target - fit.transform.apply(source)
    assert_allclose(fit.residuals, residuals, atol=1e-9 * size)


def test_bad_directions_are_errors():
    line = np.outer([1.0, -0.2, 7.0], [1, 2, 3])
    for function, *rest in (
        (attitude.laser_transform,),
        (attitude.misalignment, EYE),
    ):
        with pytest.raises(ValueError, match="expected"):
            function(EYE, EYE[:2], *rest)
        with pytest.raises(DegenerateGeometryError):
            function(EYE, line, *rest)
