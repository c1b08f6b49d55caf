"""The calibration procedure of niu2024, section 3.2: Gauss-Newton in two stages.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); parameter vectors u = (k, theta, shift x, shift y) have shape (..., 4); the leading axes are
a batch of independent calibrations. Starting vectors come from two lines and the zero position
(`starting_values`). `fit.fit_registration` reaches the same minimum in closed form. This module
contains the iteration of the paper and its convergence. No step needs the constraint
cos^2 + sin^2 = 1, because the angle is the parameter.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from reproduce.physics.registration._least_squares import gauss_newton
from reproduce.physics.registration._similarity import as_complex, squared
from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.registration.transforms import Registration
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    Point,
    Points,
    checked,
)

_PARAMETERS = 4
_Vector = Annotated[Any, (_PARAMETERS,)]
_Others = Annotated[Any, ("m", 2)]
# Root mean square movement of the points, in px, below which a stage has converged, and its steps,
# at most.
_LAST_MOVEMENT, _MAX_STEPS = 1e-9, 50


@checked
def jacobian(parameters: _Vector, source: Points, pivot: Point) -> FloatArray:
    """Return the derivatives of the model by its parameters: rows of f_x, then rows of f_y.

    Implements: niu2024 (25).

    Parameters
    ----------
    parameters : array_like, shape (..., 4)
        Vector u.
    source : array_like, shape (..., n, 2)
        Source points, in px.
    pivot : array_like, shape (..., 2)
        Principal point of the source channel, in px.

    Returns
    -------
    ndarray, shape (..., 2n, 4)
        J = [A_1 ... A_n B_1 ... B_n]^T, in px per unit of the parameter.

    Examples
    --------
    >>> jacobian((1, 0, 0, 0), [[7, 5]], (5, 5)) + 0.0
    array([[ 2.,  0., -1.,  0.],
           [ 0.,  2.,  0., -1.]])
    """
    rows = Registration("similarity", parameters, pivot).jacobian(source)
    return rows.swapaxes(-3, -2).reshape(*rows.shape[:-3], -1, _PARAMETERS)


@checked
def deviations(
    parameters: _Vector, source: Points, target: Points, pivot: Point
) -> FloatArray:
    """Return observed minus modelled target points, in the order of the rows of `jacobian`.

    Implements: niu2024 (25).

    Parameters are those of `jacobian`, and the target points, (..., n, 2), in px.

    Returns
    -------
    ndarray, shape (..., 2n)
        T: all deviations in x, then all in y, in px.

    Examples
    --------
    >>> deviations((1, 0, 0, 0), [[7, 5]], [[8, 3]], (5, 5))
    array([ 1., -2.])
    """
    modelled = Registration("similarity", parameters, pivot).apply(source)
    residuals = (target - modelled).swapaxes(-2, -1)
    return residuals.reshape(*residuals.shape[:-2], -1)


@checked
def gauss_newton_step(
    parameters: _Vector, source: Points, target: Points, pivot: Point
) -> FloatArray:
    """Return one Gauss-Newton update, u + (J^T J)^-1 J^T T, with the sign that converges.

    Implements: niu2024 (24).

    T is observed minus modelled and J the derivative of the model, as printed in (25), so the
    correction is added. In the extracted text it is subtracted, see `gauss_newton_step_printed`.

    Parameters are those of `deviations`.

    Returns
    -------
    ndarray, shape (..., 4)
        Updated vector.

    Raises
    ------
    DegenerateGeometryError
        If the points, or a scale of zero, leave a parameter undetermined.

    Examples
    --------
    >>> step = gauss_newton_step((1, 0, 0, 0), [[0, 0], [1, 0]], [[3, 0], [5, 0]], (0, 0))
    >>> step.round(9) + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    return parameters + _correction(parameters, source, target, pivot)[0]


@checked
def gauss_newton_step_printed(
    parameters: _Vector, source: Points, target: Points, pivot: Point
) -> FloatArray:
    """Return one update with the sign as extracted, u - (J^T J)^-1 J^T T.

    Printed form of niu2024 (24).

    It diverges: an error of the shift doubles at each step. It would be correct with T as model
    minus observation, but (25) prints observation minus model.

    Parameters and errors are those of `gauss_newton_step`.

    Examples
    --------
    The solution is (2, 0, -3, 0), in the opposite direction.

    >>> step = gauss_newton_step_printed((1, 0, 0, 0), [[0, 0], [1, 0]], [[3, 0], [5, 0]], (0, 0))
    >>> step.round(9) + 0.0
    array([0., 0., 3., 0.])
    """
    return parameters - _correction(parameters, source, target, pivot)[0]


def _correction(
    parameters: FloatArray,
    source: FloatArray,
    target: FloatArray,
    pivot: FloatArray,
    free: int = _PARAMETERS,
) -> tuple[FloatArray, FloatArray]:
    """Return (J^T J)^-1 J^T T of the leading `free` parameters, and the RMS movement, in px."""
    rows = jacobian(parameters, source, pivot)[..., :free]
    residuals = deviations(parameters, source, target, pivot)
    step = np.zeros((*residuals.shape[:-1], _PARAMETERS))
    step[..., :free], _ = gauss_newton(rows, residuals, rows)
    moved = np.square(rows @ step[..., :free, None]).sum(axis=(-2, -1))
    return step, np.sqrt(moved / source.shape[-2])


@checked
def starting_values(
    source_line: Points, target_line: _Others, source_zero: Point, target_zero: Point
) -> FloatArray:
    """Return the starting vector: scale one, angle of two lines, shift at the zero position.

    Parameters
    ----------
    source_line, target_line : array_like, shape (..., n, 2)
        Centroids while the middle frame of the rotary table rotates and the external frame is at
        rest, in px. The number of spots may differ.
    source_zero, target_zero : array_like, shape (..., 2)
        Centroids at the zero position of the table, close to the principal points, in px.

    Returns
    -------
    ndarray, shape (..., 4)
        (1, theta, shift x, shift y); theta is the direction in the target minus the direction in
        the source, within (-pi/2, pi/2].

    Raises
    ------
    DegenerateGeometryError
        If the spots of a channel do not determine a line.

    Examples
    --------
    >>> starting_values([[0, 0], [1, 0]], [[0, 0], [1, 0]], (7, 9), (5, 10))
    array([ 1.,  0.,  2., -1.])
    """
    directions = _direction("target_line", target_line) - _direction(
        "source_line", source_line
    )
    rotation = np.angle(np.exp(2j * directions)) / 2
    shift = np.moveaxis(source_zero - target_zero, -1, 0)
    return np.stack(np.broadcast_arrays(1.0, rotation, *shift), axis=-1)


@checked
def calibrate(
    source: Points, target: Points, pivot: Point, start: _Vector
) -> FloatArray:
    """Return the vector of a calibration in two stages: scale and rotation, then all parameters.

    Parameters
    ----------
    source, target : array_like, shape (..., n, 2)
        The same spots in both channels, in px.
    pivot : array_like, shape (..., 2)
        Principal point of the source channel, in px.
    start : array_like, shape (..., 4)
        Starting vector u, for example from `starting_values`.

    Returns
    -------
    ndarray, shape (..., 4)
        Final vector u, with k above zero and theta within (-pi, pi].

    Raises
    ------
    DegenerateGeometryError
        If the points coincide or mirror each other, or a step leaves a parameter undetermined.
    ArithmeticError
        If a calibration of the batch has not converged after 50 steps of a stage.

    Examples
    --------
    >>> calibrate([[0, 0], [1, 0]], [[3, 0], [5, 0]], (0, 0), (1, 0, 0, 0)).round(9) + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    # The closed form raises an error if there is no unique solution. The iteration may not.
    closed = fit_registration(source, target, pivot).parameters
    found = start + np.zeros_like(closed)
    for free in (2, _PARAMETERS):
        moving = np.ones(found.shape[:-1], dtype=bool)
        for _ in range(_MAX_STEPS):
            step, movement = _correction(found, source, target, pivot, free)
            # Converged calibrations stay, so a batch equals separate calibrations.
            found = found + np.where(moving[..., None], step, 0.0)
            moving &= movement >= _LAST_MOVEMENT
            if not moving.any():
                break
        else:
            raise ArithmeticError(
                f"start: expected every calibration to converge, got {int(moving.sum())} of "
                f"{moving.size} that did not. Start closer"
            )
    # (k, theta) and (-k, theta + pi) are one transform.
    factor = found[..., 0] * np.exp(1j * found[..., 1])
    found[..., :2] = np.stack([np.abs(factor), np.angle(factor)], axis=-1)
    return found


def _direction(name: str, points: FloatArray) -> FloatArray:
    """Return the angle of the best straight line, within (-pi/2, pi/2]."""
    numbers = as_complex(points - points.mean(axis=-2, keepdims=True))
    # Squaring doubles the angle, so that both senses of the line add up.
    doubled = (numbers**2).sum(axis=-1)
    spread = squared(numbers).sum(axis=-1)
    rounding = (1e-12 * np.abs(points).max(axis=(-2, -1))) ** 2 * points.shape[-2]
    if ((spread <= rounding) | (np.abs(doubled) <= 1e-12 * spread)).any():
        raise DegenerateGeometryError(
            f"{name}: expected spots along a line, got coincident points or points that spread "
            "alike in all directions. Rotate only the middle frame, over a wider range"
        )
    return np.angle(doubled) / 2
