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
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics.registration.closed_form import _closed_similarity
from reproduce.physics.registration.transforms import Registration, as_complex, as_points
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    NonNegative,
    Number,
    Point,
    Points,
    checked,
    kernel,
    non_negative,
    positive,
    whole_number,
)

BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]

_PARAMETERS = 4
_Vector = Annotated[Any, (_PARAMETERS,)]
_Others = Annotated[Any, ("m", 2)]
# Below this share of the spread about the centroid in the spread about the pivot, squared, the
# columns of J are too close to dependent for double precision.
_SINGULAR_SPREAD = 1e-7


@checked
def model_points(parameters: _Vector, source: Points, pivot: Point) -> FloatArray:
    """Where the model lays the source points, f_x and f_y, for any parameter vector.

    Unlike a `Registration` it takes a negative scale too, which an iteration may pass through.

    Parameters
    ----------
    parameters : array_like, shape (..., 4)
    source : array_like, shape (..., n, 2), in px
    pivot : array_like, shape (..., 2)
        The source channel's principal point, in px.

    Returns
    -------
    ndarray, shape (..., n, 2), in the target channel, in px

    Examples
    --------
    >>> model_points((2, 0, 1, 0), [[6, 5]], (5, 5))
    array([[6., 5.]])
    """
    origin = as_complex(pivot)[..., None]
    shift = as_complex(parameters[..., 2:])[..., None]
    factor = parameters[..., :1] * np.exp(1j * parameters[..., 1:2])
    return as_points(factor * (as_complex(source) - origin) + (origin - shift))


_model = kernel(model_points)


@checked
def jacobian(parameters: _Vector, source: Points, pivot: Point) -> FloatArray:
    """Derivatives of the model by its four parameters: all rows of f_x, then all rows of f_y.

    Implements: niu2024 (25).

    Arguments are those of `model_points`.

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
    n = source.shape[-2]
    turn = np.exp(1j * parameters[..., 1])[..., None]
    by_scale = turn * (as_complex(source) - as_complex(pivot)[..., None])
    by_rotation = 1j * parameters[..., :1] * by_scale
    rows = np.zeros((*by_rotation.shape[:-1], 2 * n, _PARAMETERS))
    rows[..., :n, 0], rows[..., n:, 0] = by_scale.real, by_scale.imag
    rows[..., :n, 1], rows[..., n:, 1] = by_rotation.real, by_rotation.imag
    rows[..., :n, 2] = rows[..., n:, 3] = -1
    return rows


_jacobian = kernel(jacobian)


@checked
def deviations(parameters: _Vector, source: Points, target: Points, pivot: Point) -> FloatArray:
    """Observed target minus model, in the order of the rows of `jacobian`.

    Implements: niu2024 (25).

    Arguments are those of `model_points`, and the target points, as many, in px.

    Returns
    -------
    ndarray, shape (..., 2n)
        T: all deviations in x, then all in y, in px.

    Examples
    --------
    >>> deviations((1, 0, 0, 0), [[7, 5]], [[8, 3]], (5, 5))
    array([ 1., -2.])
    """
    left = target - _model(parameters, source, pivot)
    return np.concatenate([left[..., 0], left[..., 1]], axis=-1)


_deviations = kernel(deviations)


@checked
def gauss_newton_step(
    parameters: _Vector,
    source: Points,
    target: Points,
    pivot: Point,
    free: int = _PARAMETERS,
) -> FloatArray:
    """One Gauss-Newton update, u + (J^T J)^-1 J^T T, with the sign that converges.

    Implements: niu2024 (24).

    T is observed minus modelled and J the derivative of the model, as (25) prints both; then the
    correction must be added. As extracted it is subtracted, see `gauss_newton_step_printed`.

    Arguments are those of `deviations`, and the number of leading parameters, 1 to 4, that are
    `free` to move: 2 for scale and rotation alone, 4 for all.

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
    return parameters + _regular_step(parameters, source, target, pivot, free)


@checked
def gauss_newton_step_printed(
    parameters: _Vector,
    source: Points,
    target: Points,
    pivot: Point,
    free: int = _PARAMETERS,
) -> FloatArray:
    """One update with the sign as extracted from the print, u - (J^T J)^-1 J^T T.

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
    return parameters - _regular_step(parameters, source, target, pivot, free)


@checked
def two_line_rotation(source_line: Points, target_line: _Others) -> FloatArray:
    """Starting value of theta: the angle between two lines seen by both channels.

    Parameters
    ----------
    source_line, target_line : array_like, shape (..., n, 2)
        Centroids while the middle frame of the rotary table turns alone, in px. The number of
        spots may differ.

    Returns
    -------
    ndarray, shape (...)
        Direction in the target minus direction in the source, in radians, within (-pi/2, pi/2].

    Raises
    ------
    DegenerateGeometryError
        If the spots of a channel fix no line.

    Examples
    --------
    >>> float(np.degrees(two_line_rotation([[0, 0], [1, 0]], [[0, 0], [1, 1]])).round(9))
    45.0
    """
    between = _direction("target_line", target_line) - _direction("source_line", source_line)
    return np.asarray(np.angle(np.exp(2j * between)) / 2)


@checked
def starting_values(
    source_line: Points, target_line: _Others, source_zero: Point, target_zero: Point
) -> FloatArray:
    """The starting vector u: scale one, the angle of two lines, the shift at the zero position.

    Parameters
    ----------
    source_line, target_line : array_like, shape (..., n, 2)
        As for `two_line_rotation`.
    source_zero, target_zero : array_like, shape (..., 2)
        Centroids at the table's zero position, in px: each channel's principal point, nearly.

    Returns
    -------
    ndarray, shape (..., 4)
        (1, theta, shift x, shift y).

    Raises
    ------
    DegenerateGeometryError
        If the spots of a channel fix no line.

    Examples
    --------
    >>> starting_values([[0, 0], [1, 0]], [[0, 0], [1, 0]], (7, 9), (5, 10))
    array([ 1.,  0.,  2., -1.])
    """
    rotation = kernel(two_line_rotation)(source_line, target_line)
    shift = source_zero - target_zero
    values = np.ones((*np.broadcast_shapes(rotation.shape, shift.shape[:-1]), _PARAMETERS))
    values[..., 1] = rotation
    values[..., 2:] = shift
    return values


@checked
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
    box = non_negative("half_widths", half_widths, shape=(_PARAMETERS,))
    return start + box * generator.uniform(-1, 1, (whole_number("count", count), *start.shape))


class ConvergenceError(ArithmeticError):
    """An iteration did not settle within the steps it was allowed."""


@dataclass(frozen=True)
class Stopping:
    """When an iteration stops.

    Attributes
    ----------
    movement : float
        Stop once a step moves the modelled points by less than this, root mean square, in px.
    steps : int
        Give up after this many steps of one stage.
    """

    movement: float = 1e-9
    steps: int = 50

    def __post_init__(self) -> None:
        positive("movement", self.movement)
        whole_number("steps", self.steps)


@dataclass(frozen=True, eq=False)
class Calibration:
    """The outcome of the two-stage iteration, with its path.

    Attributes
    ----------
    history : ndarray, shape (m + 1, ..., 4)
        The vector u before the first step and after each of the m steps. A calibration that has
        settled stays put while others of its batch still move.
    first_stage : int
        How many of the steps moved scale and rotation alone.
    converged : ndarray of bool, shape (...)
        Whether the last stage settled.
    source, target : ndarray, shape (..., n, 2)
        The spots, in px.
    pivot : ndarray, shape (..., 2)
        The source channel's principal point, in px.
    """

    history: FloatArray
    first_stage: int
    converged: BoolArray
    source: FloatArray
    target: FloatArray
    pivot: FloatArray

    @cached_property
    def cost(self) -> FloatArray:
        """Sum of squared deviations at each vector of the history, (m + 1, ...), in px^2."""
        left = _deviations(self.history, self.source, self.target, self.pivot)
        return np.asarray(np.square(left).sum(axis=-1))

    @property
    def parameters(self) -> FloatArray:
        """Final vector u, shape (..., 4), with k above zero and theta within (-pi, pi]."""
        last = self.history[-1]
        # (k, theta) and (-k, theta + pi) are one transform; an iteration may end at either.
        factor = last[..., 0] * np.exp(1j * last[..., 1])
        return np.concatenate(
            [np.abs(factor)[..., None], np.angle(factor)[..., None], last[..., 2:]], axis=-1
        )

    @property
    def transform(self) -> Registration:
        """The final transform."""
        final = self.parameters
        return Registration.similarity(final[..., 0], final[..., 1], final[..., 2:], self.pivot)


@checked
def calibrate(
    source: Points,
    target: Points,
    pivot: Point,
    start: _Vector,
    stopping: Stopping | None = None,
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
    stopping : Stopping, optional
        When a stage has settled; by default a movement below 1e-9 px within 50 steps.

    Returns
    -------
    Calibration

    Raises
    ------
    DegenerateGeometryError
        If the points coincide or mirror each other, or cluster too far from the pivot.
    ConvergenceError
        If a calibration of the batch has not settled.

    Examples
    --------
    >>> result = calibrate([[0, 0], [1, 0]], [[3, 0], [5, 0]], (0, 0), start=(1, 0, 0, 0))
    >>> result.parameters.round(9) + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    result = _two_stages(source, target, pivot, start, stopping or Stopping())
    if not result.converged.all():
        raise ConvergenceError(
            f"expected every calibration to settle, got {int((~result.converged).sum())} of "
            f"{result.converged.size} that did not; start closer, or allow more steps"
        )
    return result


@checked
@checked
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


@checked
def constraint_printed(rotation: Number) -> FloatArray:
    """The constraint as extracted from section 3.2: cos^2 + cos^2 - 1, which is cos(2 theta).

    It is zero at odd multiples of 45 degrees alone; a detector turned by a fraction of a degree
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


@checked
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
        raise ValueError("sigma: expected noise in one channel at least, got none; give one")
    rows = _jacobian(similarity.parameters, source, similarity.pivot)
    normal = rows.mT @ rows
    size = np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1))
    scaled = normal / (size[..., :, None] * size[..., None, :])
    if (np.linalg.det(scaled) < 1e-14).any():
        raise DegenerateGeometryError(
            "source: expected points that fix scale and rotation, got coincident ones; spread them"
        )
    inverse = np.linalg.inv(scaled) / (size[..., :, None] * size[..., None, :])
    return variance[..., None, None] * inverse


class _Sums(NamedTuple):
    """What the normal equations need of all points: sums about the pivot, in px or its square."""

    size: int
    offsets: ComplexArray  # of the source
    squares: FloatArray  # of their lengths
    moved: ComplexArray  # target less source: small, so that their sums keep their digits
    products: ComplexArray  # conjugated offsets times what each point is moved


def _summed(source: FloatArray, target: FloatArray, pivot: FloatArray) -> _Sums:
    offsets = as_complex(source) - as_complex(pivot)[..., None]
    moved = as_complex(target) - as_complex(source)
    squares = np.square(np.abs(offsets)).sum(axis=-1)
    products = (offsets.conj() * moved).sum(axis=-1)
    return _Sums(source.shape[-2], offsets.sum(-1), squares, moved.sum(-1), products)


def _normal_equations(parameters: FloatArray, sums: _Sums) -> tuple[FloatArray, FloatArray]:
    """Return J^T J, shape (..., 4, 4), and J^T T, shape (..., 4), of (24) and (25).

    A turn keeps lengths, so both follow from sums over the points that no step changes.
    """
    scale, turn = parameters[..., 0], np.exp(1j * parameters[..., 1])
    shift = as_complex(parameters[..., 2:])
    by_scale, change = turn * sums.offsets, scale * turn - 1.0
    left = sums.moved - change * sums.offsets + sums.size * shift
    along = sums.products - change * sums.squares + sums.offsets.conj() * shift
    along = turn.conj() * along
    pull = np.stack([along.real, scale * along.imag, -left.real, -left.imag], axis=-1)
    normal = np.zeros((*left.shape, _PARAMETERS, _PARAMETERS))
    normal[..., 0, 0], normal[..., 1, 1] = sums.squares, scale**2 * sums.squares
    normal[..., 2, 2] = normal[..., 3, 3] = sums.size
    normal[..., 0, 2], normal[..., 0, 3] = -by_scale.real, -by_scale.imag
    normal[..., 1, 2], normal[..., 1, 3] = scale * by_scale.imag, -scale * by_scale.real
    normal[..., 2:, :2] = normal[..., :2, 2:].mT
    return normal, pull


def _regular_step(
    parameters: FloatArray, source: FloatArray, target: FloatArray, pivot: FloatArray, free: int
) -> FloatArray:
    """Return the correction of the leading `free` parameters; a singular one is refused."""
    if whole_number("free", free) > _PARAMETERS:
        raise ValueError(f"free: expected 1 to {_PARAMETERS} parameters, got {free}; leave it out")
    step, _, regular = _correction(parameters, _summed(source, target, pivot), free)
    if not regular.all():
        raise DegenerateGeometryError(
            f"expected points that fix every free parameter, got {int((~regular).sum())} singular "
            "normal matrices; give two or more different points (far from a distant pivot use "
            "fit_registration) and a starting scale other than zero"
        )
    return step


def _correction(
    parameters: FloatArray, sums: _Sums, free: int
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return (J^T J)^-1 J^T T, how far it moves the points (RMS, px), and where it exists.

    The correction is zero where a parameter is held or the normal matrix is singular.
    """
    normal, pull = _normal_equations(parameters, sums)
    normal, pull = normal[..., :free, :free], pull[..., :free]
    size = np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1))
    regular = np.asarray((size > 0).all(axis=-1))
    size = np.where(regular[..., None], size, 1.0)
    # With columns of length one the determinant says how far they are from dependent.
    scaled = normal / (size[..., :, None] * size[..., None, :])
    regular = regular & (np.linalg.det(scaled) > _SINGULAR_SPREAD**2)
    scaled = np.where(regular[..., None, None], scaled, np.eye(free))
    pull = pull / size
    solved = np.linalg.solve(scaled, pull[..., None])[..., 0] * regular[..., None]
    step = np.zeros((*solved.shape[:-1], _PARAMETERS))
    step[..., :free] = solved / size
    squared = (solved * pull).sum(axis=-1)
    movement = np.sqrt(np.maximum(squared, 0) / sums.size)
    return step, movement, np.broadcast_to(regular, movement.shape)


def _direction(name: str, points: FloatArray) -> FloatArray:
    """Return the angle of the straight line that fits best, within (-pi/2, pi/2]."""
    numbers = as_complex(points - points.mean(axis=-2, keepdims=True))
    # Squaring doubles the angle, so that both senses of the line add up.
    doubled = (numbers**2).sum(axis=-1)
    spread = (np.abs(numbers) ** 2).sum(axis=-1)
    rounding = (1e-12 * np.abs(points).max(axis=(-2, -1))) ** 2 * points.shape[-2]
    if ((spread <= rounding) | (np.abs(doubled) <= 1e-12 * spread)).any():
        raise DegenerateGeometryError(
            f"{name}: expected spots along a line, got coincident points or points that spread "
            "alike in all directions; rotate the middle frame alone, over a wider range"
        )
    return np.angle(doubled) / 2


def _two_stages(
    source: FloatArray, target: FloatArray, pivot: FloatArray, start: FloatArray, stopping: Stopping
) -> Calibration:
    # The closed form refuses what has no unique answer; the iteration would settle anywhere.
    _closed_similarity(source, target, pivot)
    sums = _summed(source, target, pivot)
    spread = sums.squares - np.square(np.abs(sums.offsets)) / sums.size
    if (spread <= _SINGULAR_SPREAD * sums.squares).any():
        raise DegenerateGeometryError(
            "source: expected points spread over more than a three-thousandth of their distance "
            "from the pivot, got a narrow cluster; add spots across the field of view, or use "
            "fit_registration"
        )
    batch = np.broadcast_shapes(
        start.shape[:-1], source.shape[:-2], target.shape[:-2], pivot.shape[:-1]
    )
    start = np.broadcast_to(start, (*batch, _PARAMETERS))
    first, _ = _iterate(sums, start, 2, stopping)
    second, settled = _iterate(sums, first[-1], _PARAMETERS, stopping)
    history = np.stack(first + second[1:])
    return Calibration(history, len(first) - 1, settled, source, target, pivot)


def _iterate(
    sums: _Sums, start: FloatArray, free: int, stopping: Stopping
) -> tuple[list[FloatArray], BoolArray]:
    """Repeat the step with `free` parameters until every calibration has settled."""
    path, moving = [start], np.ones(start.shape[:-1], dtype=bool)
    settled = ~moving
    for _ in range(stopping.steps):
        step, movement, regular = _correction(path[-1], sums, free)
        regular = regular & np.isfinite(step).all(axis=-1)
        # Those that have settled are held, so that a batch gives what each would give alone.
        path.append(path[-1] + np.where((moving & regular)[..., None], step, 0.0))
        settled |= moving & regular & (movement < stopping.movement)
        moving &= regular & ~settled
        if not moving.any():
            break
    return path, settled
