"""The calibration procedure of niu2024, section 3.2: Gauss-Newton in two stages, with restarts.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); parameter vectors u = (k, theta, shift x, shift y) have shape (..., 4); the leading axes are
a batch of calibrations, each of which comes out as it would alone. Starting vectors come from two
lines and the zero position (`starting_values`) and at random (`random_starts`).
`fit.fit_registration` reaches the same minimum in closed form: this module shows the paper's
iteration, its convergence, and the Cramér-Rao bound that no unbiased calibration goes below.

The print couples the iteration to the constraint cos^2 + cos^2 = 1, which holds at odd multiples of
45 degrees alone (`constraint_printed`). The identity meant is cos^2 + sin^2 = 1 (`constraint`); it
holds by itself where the angle is the parameter, so no step needs to enforce it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.registration._least_squares import gauss_newton, model_jacobian
from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.registration.transforms import Registration, as_complex
from reproduce.physics.validate import FloatArray, NonNegative, Number, Point, Points

_PARAMETERS = 4
_Vector = Annotated[Any, (_PARAMETERS,)]
_Others = Annotated[Any, ("m", 2)]
# A stage has settled once a step moves the points by less, root mean square, in px; it is given up
# after so many steps.
_MOVEMENT, _STEPS = 1e-9, 50


@validate.checked
def jacobian(parameters: _Vector, source: Points, pivot: Point) -> FloatArray:
    """Derivatives of the model by its four parameters: all rows of f_x, then all rows of f_y.

    Implements: niu2024 (25).

    Parameters
    ----------
    parameters : array_like, shape (..., 4)
    source : array_like, shape (..., n, 2), in px
    pivot : array_like, shape (..., 2)
        The source channel's principal point, in px.

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
    rows = model_jacobian("similarity", parameters, source - pivot[..., None, :])
    return rows.swapaxes(-3, -2).reshape(*rows.shape[:-3], -1, _PARAMETERS)


_jacobian = validate.kernel(jacobian)


@validate.checked
def deviations(
    parameters: _Vector, source: Points, target: Points, pivot: Point
) -> FloatArray:
    """Observed target minus model, in the order of the rows of `jacobian`.

    Implements: niu2024 (25).

    Arguments are those of `jacobian`, and the target points, as many, in px.

    Returns
    -------
    ndarray, shape (..., 2n)
        T: all deviations in x, then all in y, in px.

    Examples
    --------
    >>> deviations((1, 0, 0, 0), [[7, 5]], [[8, 3]], (5, 5))
    array([ 1., -2.])
    """
    left = target - Registration._unchecked("similarity", parameters, pivot)._apply(
        source
    )
    return np.concatenate([left[..., 0], left[..., 1]], axis=-1)


_deviations = validate.kernel(deviations)


@validate.checked
def gauss_newton_step(
    parameters: _Vector, source: Points, target: Points, pivot: Point
) -> FloatArray:
    """One Gauss-Newton update, u + (J^T J)^-1 J^T T, with the sign that converges.

    Implements: niu2024 (24).

    T is observed minus modelled and J the derivative of the model, as (25) prints both; then the
    correction must be added. As extracted it is subtracted, see `gauss_newton_step_printed`.

    Arguments are those of `deviations`.

    Returns
    -------
    ndarray, shape (..., 4)
        The updated vector.

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


@validate.checked
def gauss_newton_step_printed(
    parameters: _Vector, source: Points, target: Points, pivot: Point
) -> FloatArray:
    """One update with the sign as extracted, u - (J^T J)^-1 J^T T.

    Printed form of niu2024 (24).

    It walks away from the solution: an error in the shift doubles at each step. Only the solution
    itself stays where it is. It would be right with T as model minus observation, but (25) prints
    observation minus model.

    Arguments and errors are those of `gauss_newton_step`.

    Examples
    --------
    The solution is (2, 0, -3, 0); the step goes the other way.

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
    rows = _jacobian(parameters, source, pivot)[..., :free]
    found, _ = gauss_newton(rows, _deviations(parameters, source, target, pivot), rows)
    moved = np.square((rows @ found[..., None])[..., 0]).sum(axis=-1)
    step = np.concatenate(
        [found, np.zeros((*found.shape[:-1], _PARAMETERS - free))], axis=-1
    )
    return step, np.sqrt(moved / source.shape[-2])


@validate.checked
def starting_values(
    source_line: Points, target_line: _Others, source_zero: Point, target_zero: Point
) -> FloatArray:
    """The starting vector u: scale one, the angle of two lines, the shift at the zero position.

    Parameters
    ----------
    source_line, target_line : array_like, shape (..., n, 2)
        Centroids while the middle frame of the rotary table rotates and the external frame is at
        rest, in px. The number of spots may differ.
    source_zero, target_zero : array_like, shape (..., 2)
        Centroids at the table's zero position, in px: each channel's principal point, nearly.

    Returns
    -------
    ndarray, shape (..., 4)
        (1, theta, shift x, shift y); theta is the direction in the target minus the one in the
        source, within (-pi/2, pi/2].

    Raises
    ------
    DegenerateGeometryError
        If the spots of a channel fix no line.

    Examples
    --------
    >>> starting_values([[0, 0], [1, 0]], [[0, 0], [1, 0]], (7, 9), (5, 10))
    array([ 1.,  0.,  2., -1.])
    """
    between = _direction("target_line", target_line) - _direction(
        "source_line", source_line
    )
    rotation = np.angle(np.exp(2j * between)) / 2
    shift = source_zero - target_zero
    values = np.ones(
        (*np.broadcast_shapes(rotation.shape, shift.shape[:-1]), _PARAMETERS)
    )
    values[..., 1] = rotation
    values[..., 2:] = shift
    return values


@validate.checked
def random_starts(
    start: _Vector, half_widths: ArrayLike, count: int, generator: np.random.Generator
) -> FloatArray:
    """Random starting vectors, uniform within a box about a given one.

    Parameters
    ----------
    start : array_like, shape (..., 4)
        The centre of the box.
    half_widths : array_like, shape (4,)
        Half the box in k, theta (radians), shift x and shift y (px); zero or more.
    count : int
    generator : numpy.random.Generator

    Returns
    -------
    ndarray, shape (count, ..., 4)
        Starts, each one for `calibrate`.

    Examples
    --------
    >>> random_starts((1, 0, 0, 0), (0, 0, 0, 0), 2, np.random.default_rng(1))
    array([[1., 0., 0., 0.],
           [1., 0., 0., 0.]])
    """
    box = validate.non_negative("half_widths", half_widths, shape=(_PARAMETERS,))
    count = validate.whole_number("count", count)
    return start + box * generator.uniform(-1, 1, (count, *start.shape))


@dataclass(frozen=True, eq=False)
class Calibration:
    """The outcome of the two-stage iteration, with its path.

    Attributes
    ----------
    history : ndarray, shape (m + 1, ..., 4)
        The vector u before the first step and after each of the m steps. A calibration that has
        settled stays put while others of its batch still move.
    first_stage : int
        Number of steps that change only scale and rotation.
    pivot : ndarray, shape (..., 2)
        The source channel's principal point, in px.
    """

    history: FloatArray
    first_stage: int
    pivot: FloatArray

    @property
    def parameters(self) -> FloatArray:
        """Final vector u, shape (..., 4), with k above zero and theta within (-pi, pi]."""
        last = self.history[-1]
        # (k, theta) and (-k, theta + pi) are one transform; an iteration may end at either.
        factor = last[..., 0] * np.exp(1j * last[..., 1])
        return np.concatenate(
            [np.abs(factor)[..., None], np.angle(factor)[..., None], last[..., 2:]],
            axis=-1,
        )


@validate.checked
def calibrate(
    source: Points, target: Points, pivot: Point, start: _Vector
) -> Calibration:
    """Calibrate in two stages: scale and rotation first, then all four parameters.

    Parameters
    ----------
    source, target : array_like, shape (..., n, 2)
        The same spots in both channels, in px.
    pivot : array_like, shape (..., 2)
        The source channel's principal point, in px.
    start : array_like, shape (..., 4)
        Starting vector u, from `starting_values` for one.

    Returns
    -------
    Calibration

    Raises
    ------
    DegenerateGeometryError
        If the points coincide or mirror each other, or a step leaves a parameter undetermined.
    ArithmeticError
        If a calibration of the batch has not settled after 50 steps of a stage.

    Examples
    --------
    >>> result = calibrate([[0, 0], [1, 0]], [[3, 0], [5, 0]], (0, 0), start=(1, 0, 0, 0))
    >>> result.parameters.round(9) + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    # The closed form refuses what has no unique answer; the iteration would settle anywhere.
    closed = fit_registration(source, target, pivot).parameters
    path = [start + np.zeros_like(closed)]
    path += _iterated(path[-1], source, target, pivot, 2)
    first = len(path) - 1
    path += _iterated(path[-1], source, target, pivot, _PARAMETERS)
    return Calibration(np.stack(path), first, pivot)


def _iterated(
    start: FloatArray,
    source: FloatArray,
    target: FloatArray,
    pivot: FloatArray,
    free: int,
) -> list[FloatArray]:
    """Return the vectors after each step with `free` parameters, until all have settled."""
    path, moving = [start], np.ones(start.shape[:-1], dtype=bool)
    while moving.any():
        if len(path) > _STEPS:
            raise ArithmeticError(
                f"expected every calibration to settle, got {int(moving.sum())} of "
                f"{moving.size} that did not; start closer"
            )
        step, movement = _correction(path[-1], source, target, pivot, free)
        # Converged calibrations stay, so a batch equals separate calibrations.
        path.append(path[-1] + np.where(moving[..., None], step, 0.0))
        moving &= movement >= _MOVEMENT
    return path[1:]


@validate.checked
def constraint(rotation: Number) -> FloatArray:
    """The identity that ties cosine and sine: cos^2 + sin^2 - 1, zero at every angle.

    Parameters
    ----------
    rotation : array_like, shape (...)
        Angle theta, in radians.

    Returns
    -------
    ndarray, shape (...)

    Examples
    --------
    >>> float(constraint(0.0))
    0.0
    """
    return np.asarray(np.cos(rotation) ** 2 + np.sin(rotation) ** 2 - 1)


@validate.checked
def constraint_printed(rotation: Number) -> FloatArray:
    """The constraint as extracted from section 3.2: cos^2 + cos^2 - 1, which is cos(2 theta).

    It is zero only at odd multiples of 45 degrees; a detector turned by a fraction of a degree
    misses it by almost one. Arguments are those of `constraint`.

    Returns
    -------
    ndarray, shape (...)

    Examples
    --------
    >>> float(constraint_printed(0.0))
    1.0
    """
    return np.asarray(np.cos(rotation) ** 2 + np.cos(rotation) ** 2 - 1)


@validate.checked
def registration_bound(
    source: Points,
    similarity: Registration,
    source_sigma: NonNegative,
    target_sigma: NonNegative,
) -> FloatArray:
    """The Cramér-Rao bound of the four parameters where both channels are noisy.

    The true positions are unknown too, one for each spot. Eliminating them leaves the variance of
    one coordinate of target minus transformed source, target_sigma^2 + k^2 source_sigma^2.

    Parameters
    ----------
    source : array_like, shape (..., n, 2)
        True source points, in px.
    similarity : Registration
        The true transform.
    source_sigma, target_sigma : array_like, shape (...)
        Standard deviations of one coordinate of one spot, in px; not both zero.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Lower bound of the covariance of (k, theta, shift x, shift y).

    Raises
    ------
    DegenerateGeometryError
        If the points coincide.

    Examples
    --------
    Two points 2 px apart: the mean of two shifts, and the slope of a short lever.

    >>> identity = Registration.similarity(1.0, 0.0, (0, 0), (0, 0))
    >>> registration_bound([[-1, 0], [1, 0]], identity, 0.0, 1.0).diagonal()
    array([0.5, 0.5, 0.5, 0.5])
    """
    variance = target_sigma**2 + (similarity.scale * source_sigma) ** 2
    if (variance == 0).any():
        raise ValueError(
            "sigma: expected noise in one channel at least, got none; give one"
        )
    fit = fit_registration(source, similarity._apply(source), similarity.pivot)
    return variance[..., None, None] * fit.cofactor


def _direction(name: str, points: FloatArray) -> FloatArray:
    """Return the angle of the straight line that fits best, within (-pi/2, pi/2]."""
    numbers = as_complex(points - points.mean(axis=-2, keepdims=True))
    # Squaring doubles the angle, so that both senses of the line add up.
    doubled = (numbers**2).sum(axis=-1)
    spread = (np.abs(numbers) ** 2).sum(axis=-1)
    rounding = (1e-12 * np.abs(points).max(axis=(-2, -1))) ** 2 * points.shape[-2]
    if ((spread <= rounding) | (np.abs(doubled) <= 1e-12 * spread)).any():
        raise validate.DegenerateGeometryError(
            f"{name}: expected spots along a line, got coincident points or points that spread "
            "alike in all directions; rotate the middle frame alone, over a wider range"
        )
    return np.angle(doubled) / 2
