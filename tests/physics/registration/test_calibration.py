"""The paper's iteration: derivatives, convergence, starting values, and its printed form."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from simulated import PIVOT, TRUTH, stars

from reproduce.physics.registration import (
    calibrate,
    calibration,
    deviations,
    fit_registration,
    gauss_newton_step,
    gauss_newton_step_printed,
    jacobian,
    starting_values,
)
from reproduce.physics.validate import DegenerateGeometryError

START = (1.0, 0.0, 0.0, 0.0)


def rotation(source_line, target_line):
    return float(starting_values(source_line, target_line, (0, 0), (0, 0))[1])


def test_jacobian_agrees_with_finite_differences():
    source, target = stars(9)
    u = np.array([1.2, 0.4, 3.0, -2.0])
    steps = np.diag([1e-5, 1e-5, 1e-2, 1e-2])
    differences = [
        (
            deviations(u - step, source, target, PIVOT)
            - deviations(u + step, source, target, PIVOT)
        )
        / (2 * step.sum())
        for step in steps
    ]
    assert_allclose(
        jacobian(u, source, PIVOT), np.stack(differences, axis=-1), rtol=1e-8, atol=1e-6
    )


@pytest.fixture
def path(monkeypatch):
    """The vectors before each step of a calibration."""
    vectors, correction = [], calibration._correction

    def recorded(vector, *arguments):
        vectors.append(vector)
        return correction(vector, *arguments)

    monkeypatch.setattr(calibration, "_correction", recorded)
    return vectors


def test_first_stage_holds_the_shift_and_every_step_lowers_the_cost(path):
    source, target = stars()
    start = (1.0, 0.002, 0.3, 0.3)
    calibrate(source, target, PIVOT, start)
    assert_array_equal(path[0], start)
    held = [(u[2:] == 0.3).all() for u in path]
    assert 1 < sum(held) < len(path) - 1
    assert held == sorted(held, reverse=True)
    costs = [np.square(deviations(u, source, target, PIVOT)).sum() for u in path]
    assert (np.diff(costs) <= 1e-9 * costs[0]).all()


def test_a_settled_calibration_stays_put_while_others_move(path):
    source, target = stars()
    closed = fit_registration(source, target, PIVOT).parameters
    starts = np.stack([closed, np.add(closed, (0.2, 1.0, 9, 9))])
    calibrate(source, target, PIVOT, starts)
    held = [u for u in path if (u[0, 2:] == closed[2:]).all()]
    settled, moving = np.swapaxes(held, 0, 1)
    assert len(settled) > 4
    assert (settled[1:] == settled[1]).all()
    assert (moving[2] != moving[1]).any()


def test_printed_sign_walks_away_from_every_start_but_the_solution():
    source, _ = stars()
    target = TRUTH.apply(source)
    solution = TRUTH.parameters
    for offset in ((0, 0, 1e-3, 0), (0, 0, 0, -1.0), (0, 0, 2.0, 3.0)):
        u = solution + offset
        for step in range(1, 6):
            u = gauss_newton_step_printed(u, source, target, PIVOT)
            assert_allclose(u - solution, np.multiply(offset, 2.0**step), atol=1e-7)
    stay = gauss_newton_step_printed(solution, source, target, PIVOT)
    assert_allclose(stay, solution, atol=1e-9)


def test_line_direction_by_singular_vectors():
    rng = default_rng(4)
    points = rng.normal(size=(30, 2)) * (5, 0.5) @ [[0.8, 0.6], [-0.6, 0.8]] + (100, 50)
    direction = rotation([[0, 0], [1, 0]], points)
    axis = np.linalg.svd(points - points.mean(axis=0))[2][0]
    assert abs(np.cos(direction) * axis[1] - np.sin(direction) * axis[0]) < 1e-12


def test_starting_values_are_the_truth_without_noise():
    line = np.stack([np.linspace(0, 2000, 9), np.full(9, 770.0)], axis=-1)
    source = TRUTH.inverse().apply(line)
    target_zero = PIVOT - TRUTH.shift
    start = starting_values(source, line, PIVOT, target_zero)
    assert_allclose(start, (1.0, *TRUTH.parameters[1:]), atol=1e-12)
    several = starting_values([source, source + 50], [line, line + 50], PIVOT, PIVOT)
    one = starting_values(source, line, PIVOT, PIVOT)
    assert_allclose(several, [one, one], atol=1e-12)


def test_two_line_rotation_takes_the_short_way_round():
    up = [[0, 0], [np.cos(1.5), np.sin(1.5)]]
    over = [[0, 0], [np.cos(1.7), np.sin(1.7)]]
    assert rotation(up, over) == pytest.approx(0.2)
    assert rotation(over, up) == pytest.approx(-0.2)


def test_random_restarts_all_end_at_the_closed_form():
    source, target = stars(15, batch=(3,))
    moves = default_rng(5).uniform(-1, 1, (20, 3, 4)) * (0.5, 3.0, 50, 50)
    ends = [calibrate(source, target, PIVOT, START + m) for m in moves]
    closed = fit_registration(source, target, PIVOT)
    assert_allclose(ends, np.broadcast_to(closed.parameters, (20, 3, 4)), atol=1e-9)


def test_a_start_at_scale_zero_is_reported():
    source, target = stars()
    with pytest.raises(DegenerateGeometryError, match="fix every parameter"):
        gauss_newton_step((0, 0, 0, 0), source, target, PIVOT)
    with pytest.raises(DegenerateGeometryError, match="fix every parameter"):
        calibrate(source, target, PIVOT, (0, 0, 0, 0))
