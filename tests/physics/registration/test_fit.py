"""Registering points: against other software, an iterating solver, known laws, wrong matches."""

import cv2
import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import least_squares

from reproduce.physics.registration import MODELS, Registration, fit_registration
from reproduce.physics.validate import DegenerateGeometryError

GENERATOR = default_rng(11)
POINTS = GENERATOR.uniform((0, 0), (2064, 1544), (40, 2))
PIVOT = np.array([1031.0, 770.0])
TRUE = {
    "shift": [-3.0, 2.0],
    "rigid": [0.01, -3.0, 2.0],
    "similarity": [1.002, 0.01, -3.0, 2.0],
    "similarity+radial": [1.002, 0.01, -3.0, 2.0, 2e-9],
    "affine": [1.001, 0.002, -0.003, 0.998, -3.0, 2.0],
}
# What a parameter moves at the edge of the field, to compare parameters in px.
REACH = {"shift-x": 1.0, "shift-y": 1.0, "radial": 1e9}


def reach(model):
    return np.array([REACH.get(name, 1e3) for name in MODELS[model]])


def noisy(model, sigma=0.1, shape=()):
    clean = Registration(model, np.array(TRUE[model]), PIVOT).apply(POINTS)
    return clean + sigma * GENERATOR.standard_normal((*shape, *clean.shape))


def test_agrees_with_opencv_in_single_precision():
    target = noisy("similarity")
    matrix, inliers = cv2.estimateAffinePartial2D(
        POINTS, target, method=cv2.RANSAC, ransacReprojThreshold=5.0, refineIters=100
    )
    assert inliers.all()
    ours = fit_registration(POINTS, target, PIVOT).transform
    theirs = POINTS @ matrix[:, :2].T + matrix[:, 2]
    assert_allclose(ours.apply(POINTS), theirs, rtol=0, atol=1e-4)


@pytest.mark.parametrize("model", MODELS)
def test_the_minimum_and_its_covariance_are_those_of_an_iterating_solver(model):
    target, weights = noisy(model), GENERATOR.uniform(0.5, 2, len(POINTS))

    def left(scaled):
        transform = Registration(model, scaled / reach(model), PIVOT)
        return (np.sqrt(weights)[:, None] * (target - transform.apply(POINTS))).ravel()

    start = np.array(TRUE[model]) * reach(model)
    found = least_squares(left, start, "3-point", x_scale="jac", xtol=1e-15, ftol=1e-15)
    fit = fit_registration(POINTS, target, PIVOT, weights, model)
    assert_allclose(fit.parameters * reach(model), found.x, rtol=0, atol=1e-6)
    inverse = np.linalg.inv(found.jac.T @ found.jac) / np.outer(
        reach(model), reach(model)
    )
    scale = np.sqrt(np.outer(np.diag(inverse), np.diag(inverse)))
    assert_allclose(fit.cofactor / scale, inverse / scale, atol=1e-6)
    assert_allclose(fit.chi_square, 2 * found.cost, rtol=1e-9)
    freedom = 2 * len(POINTS) - len(MODELS[model])
    assert int(fit.degrees_of_freedom) == freedom
    assert_allclose(fit.covariance, fit.cofactor * fit.chi_square / freedom, rtol=1e-12)


def small_field(model, generator):
    """A field so small, and errors so large and unequal, that errors of the source matter."""
    n = 15
    points, truth = generator.uniform(-40, 40, (n, 2)), np.array(TRUE[model])
    if model == "similarity+radial":
        truth[-1] = 2e-5
    half = generator.uniform(-1, 1, (2, n, 2, 2)) + 2 * np.eye(2)
    covariances = half @ np.swapaxes(half, -1, -2)
    errors = (half @ generator.standard_normal((2, n, 2, 1)))[..., 0]
    target = Registration(model, truth, np.zeros(2)).apply(points) + errors[1]
    return points + errors[0], target, covariances


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("known", ["both", "source", "target"])
def test_the_maximum_of_the_whole_likelihood_is_that_of_an_iterating_solver(
    model, known
):
    """The solver moves the true points too, one by one, and knows no elimination."""
    source, target, (in_source, in_target) = small_field(model, default_rng(5))
    given = {
        "source_covariance": None if known == "target" else in_source,
        "target_covariance": None if known == "source" else in_target,
    }
    fit = fit_registration(source, target, np.zeros(2), None, model, **given)
    # An image without a covariance is taken as free of errors: here, as nearly so.
    tiny = np.broadcast_to(1e-8 * np.eye(2), in_source.shape)
    used = [tiny if c is None else c for c in given.values()]
    whitening = [np.linalg.inv(np.linalg.cholesky(c)) for c in used]
    size = np.where(np.array(MODELS[model]) == "radial", 1e-5, 1.0)
    count = len(size)

    def left(unknowns):
        points = unknowns[count:].reshape(-1, 2)
        transform = Registration(model, unknowns[:count] * size, np.zeros(2))
        parts = (source - points, target - transform.apply(points))
        white = [
            (w @ d[..., None])[..., 0] for w, d in zip(whitening, parts, strict=True)
        ]
        return np.concatenate(white).ravel()

    begin = np.concatenate([np.array(TRUE[model]) / size, source.ravel()])
    found = least_squares(
        left, begin, "3-point", x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    sd = np.sqrt(np.diag(fit.covariance))
    assert_allclose((fit.parameters - found.x[:count] * size) / sd, 0, atol=2e-5)
    assert float(fit.chi_square) == pytest.approx(2 * found.cost, rel=1e-6)
    whole = np.linalg.inv(found.jac.T @ found.jac)[:count, :count] * np.outer(
        size, size
    )
    assert_allclose(
        fit.covariance / np.outer(sd, sd), whole / np.outer(sd, sd), atol=1e-4
    )


@pytest.mark.parametrize("model", MODELS)
def test_two_fifths_of_wrong_matches_do_no_harm(model):
    target = noisy(model, 0.05)
    wrong = GENERATOR.permutation(len(POINTS))[:16]
    target[wrong] += GENERATOR.uniform(20, 400, (16, 2))
    right = np.ones(len(POINTS))
    right[wrong] = 0
    fit = fit_registration(POINTS, target, PIVOT, model=model, robust=True)
    clean = fit_registration(POINTS, target, PIVOT, right, model)
    assert (fit.weights[wrong] == 0).all()
    assert (fit.weights[right > 0] > 0).mean() > 0.9
    apart = fit.transform.apply(POINTS) - clean.transform.apply(POINTS)
    assert np.abs(apart).max() < 0.05
    again = fit_registration(POINTS, target, PIVOT, model=model, robust=True)
    assert_array_equal(again.parameters, fit.parameters)


@pytest.mark.parametrize("model", MODELS)
def test_a_batch_gives_what_each_gives_alone(model):
    targets = noisy(model, 0.1, (3,))
    together = fit_registration(POINTS, targets, PIVOT, model=model)
    for row, target in enumerate(targets):
        alone = fit_registration(POINTS, target, PIVOT, model=model)
        difference = (together.parameters[row] - alone.parameters) * reach(model)
        assert np.abs(difference).max() < 1e-8
        assert_allclose(together.covariance[row], alone.covariance, rtol=1e-6)


def test_transforms_are_undone():
    """One by one and in batches; a radial term has no inverse."""
    for model, truth in TRUE.items():
        batch = np.array(truth) * np.array([1, 0.999, 1.001])[:, None]
        transform = Registration(model, batch, PIVOT)
        if model == "similarity+radial":
            for call in (transform.inverse, transform.affine):
                with pytest.raises(ValueError, match="radial term"):
                    call()
            continue
        landed, back = transform.apply(POINTS), transform.inverse()
        points = np.stack([POINTS] * 3)
        assert_allclose(back.apply(landed), points, atol=1e-9)
        assert_allclose(back.inverse().apply(points), landed, atol=1e-9)


def test_bad_input_is_refused():
    """A covariance is symmetric, with variances above zero and a correlation below one."""
    for name, value in (
        ("model", "projective"),
        ("model", ["similarity"]),
        ("robust", "no"),
        ("target_covariance", np.eye(3)),
        ("target_covariance", -np.eye(2)),
        ("target_covariance", [[1, 1.5], [1.5, 1]]),
        ("target_covariance", [[1, 0], [0, 0]]),
        ("source_covariance", [[1, 0.5], [0, 1]]),
        ("source_covariance", np.ones((7, 2, 2)) + np.eye(2)),
    ):
        with pytest.raises((TypeError, ValueError), match=f"^{name}: "):
            fit_registration(POINTS, POINTS, PIVOT, **{name: value})


def test_sizes_whose_squares_overflow_are_refused():
    with (
        np.errstate(over="ignore"),
        pytest.raises(DegenerateGeometryError, match=r"^target: "),
    ):
        fit_registration(POINTS, POINTS * 1e155, PIVOT)


def test_points_that_fix_too_little_are_refused():
    line = np.column_stack([np.arange(9.0), np.arange(9.0)])
    with pytest.raises(DegenerateGeometryError, match="fix every parameter"):
        fit_registration(line, line, PIVOT, model="affine")
    with pytest.raises(DegenerateGeometryError, match="5 or more"):
        fit_registration(POINTS[:4], POINTS[:4], PIVOT, None, "affine", robust=True)
    with pytest.raises(DegenerateGeometryError, match="4 or more"):
        fit_registration(line, line, PIVOT, np.arange(9) < 3, robust=True)
    fit = fit_registration(line[:1], line[:1], PIVOT, model="shift")
    assert np.isnan([*fit.covariance, *fit.interval()]).all()
    with pytest.raises(DegenerateGeometryError, match="one place"):
        fit_registration(np.zeros((5, 2)), line[:5], PIVOT, robust=True, model="shift")
