"""The paper's own calibration: Gauss-Newton steps on (k, theta, shift x, shift y), in two stages.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); parameter vectors u = (k, theta, shift x, shift y) have shape (..., 4); the leading axes are
a batch of calibrations. `registration.fit_similarity` reaches the same minimum in closed form;
this module exists to show the iteration, its starting values and its convergence.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics.registration import paired_points
from reproduce.physics.similarity import as_complex, as_points
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    common_batch,
    finite_array,
    whole_number,
)

BoolArray = NDArray[np.bool_]

PARAMETERS = 4
# Below this share of the spread about the centroid in the spread about the pivot, squared, the
# columns of J are too close to dependent for double precision.
SINGULAR_SPREAD = 1e-7


def model_points(parameters: ArrayLike, source: ArrayLike, pivot: ArrayLike) -> FloatArray:
    """Where the model lays the source points, f_x and f_y, for any parameter vector.

    Unlike `Similarity` it takes a negative scale too, which an iteration may pass through.

    Parameters
    ----------
    parameters : array_like, shape (..., 4)
        The vector u.
    source : array_like, shape (..., n, 2)
        In px.
    pivot : array_like, shape (..., 2)
        The source channel's principal point, in px.

    Returns
    -------
    ndarray, shape (..., n, 2)
        In the target channel, in px.

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape.

    Examples
    --------
    >>> model_points((2, 0, 1, 0), [[6, 5]], (5, 5))
    array([[6., 5.]])
    """
    parameters, source, pivot = _checked(parameters, source, pivot)
    origin = as_complex(pivot)[..., None]
    shift = as_complex(parameters[..., 2:])[..., None]
    return as_points(_factor(parameters) * (as_complex(source) - origin) + (origin - shift))


def jacobian(parameters: ArrayLike, source: ArrayLike, pivot: ArrayLike) -> FloatArray:
    """Derivatives of the model by its four parameters: all rows of f_x, then all rows of f_y.

    Implements: niu2024 (25).

    Parameters
    ----------
    parameters : array_like, shape (..., 4)
        The vector u.
    source : array_like, shape (..., n, 2)
        In px.
    pivot : array_like, shape (..., 2)
        The source channel's principal point, in px.

    Returns
    -------
    ndarray, shape (..., 2n, 4)
        J = [A_1 ... A_n B_1 ... B_n]^T, in px per unit of the parameter.

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape.

    Examples
    --------
    >>> jacobian((1, 0, 0, 0), [[7, 5]], (5, 5)) + 0.0
    array([[ 2.,  0., -1.,  0.],
           [ 0.,  2.,  0., -1.]])
    """
    parameters, source, pivot = _checked(parameters, source, pivot)
    n = source.shape[-2]
    turn = np.exp(1j * parameters[..., 1])[..., None]
    by_scale = turn * (as_complex(source) - as_complex(pivot)[..., None])
    by_rotation = 1j * parameters[..., :1] * by_scale
    rows = np.zeros((*by_rotation.shape[:-1], 2 * n, PARAMETERS))
    rows[..., :n, 0], rows[..., n:, 0] = by_scale.real, by_scale.imag
    rows[..., :n, 1], rows[..., n:, 1] = by_rotation.real, by_rotation.imag
    rows[..., :n, 2] = rows[..., n:, 3] = -1
    return rows


def deviations(
    parameters: ArrayLike, source: ArrayLike, target: ArrayLike, pivot: ArrayLike
) -> FloatArray:
    """Observed target minus model, in the order of the rows of `jacobian`.

    Implements: niu2024 (25).

    Parameters
    ----------
    parameters : array_like, shape (..., 4)
        The vector u.
    source, target : array_like, shape (..., n, 2)
        The same spots in both channels, in px.
    pivot : array_like, shape (..., 2)
        The source channel's principal point, in px.

    Returns
    -------
    ndarray, shape (..., 2n)
        T: all deviations in x, then all in y, in px.

    Raises
    ------
    ValueError
        If an argument is not finite, has the wrong shape, or the counts differ.

    Examples
    --------
    >>> deviations((1, 0, 0, 0), [[7, 5]], [[8, 3]], (5, 5))
    array([ 1., -2.])
    """
    source, target = paired_points(source, target)
    model = model_points(parameters, source, pivot)
    common_batch(model=model.shape[:-2], target=target.shape[:-2])
    left = target - model
    return np.concatenate([left[..., 0], left[..., 1]], axis=-1)


def gauss_newton_step(
    parameters: ArrayLike,
    source: ArrayLike,
    target: ArrayLike,
    pivot: ArrayLike,
    free: int = PARAMETERS,
) -> FloatArray:
    """One Gauss-Newton update, u + (J^T J)^-1 J^T T, with the sign that converges.

    Implements: niu2024 (24).

    T is observed minus modelled and J the derivative of the model, as (25) prints both; then the
    correction must be added. As extracted it is subtracted, see `gauss_newton_step_printed`.

    Parameters
    ----------
    parameters : array_like, shape (..., 4)
        The vector u.
    source, target : array_like, shape (..., n, 2)
        The same spots in both channels, in px.
    pivot : array_like, shape (..., 2)
        The source channel's principal point, in px.
    free : int
        How many leading parameters move: 2 for scale and rotation alone, 4 for all.

    Returns
    -------
    ndarray, shape (..., 4)
        The updated vector.

    Raises
    ------
    ValueError
        If an argument is not finite, has the wrong shape, the counts differ, or `free` is not
        between 1 and 4.
    DegenerateGeometryError
        If the points, or a scale of zero, leave a parameter undetermined.

    Examples
    --------
    >>> step = gauss_newton_step((1, 0, 0, 0), [[0, 0], [1, 0]], [[3, 0], [5, 0]], (0, 0))
    >>> step.round(9) + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    step, _, regular = correction(parameters, source, target, pivot, free)
    _refuse_singular(regular)
    return np.asarray(parameters, dtype=np.float64) + step


def gauss_newton_step_printed(
    parameters: ArrayLike,
    source: ArrayLike,
    target: ArrayLike,
    pivot: ArrayLike,
    free: int = PARAMETERS,
) -> FloatArray:
    """One update with the sign as extracted from the print, u - (J^T J)^-1 J^T T.

    Printed form of niu2024 (24).

    It walks away from the solution: an error in the shift doubles at each step. Only the solution
    itself stays where it is. It would be right with T as model minus observation, but (25) prints
    observation minus model.

    Parameters and errors are those of `gauss_newton_step`.

    Examples
    --------
    The solution is (2, 0, -3, 0); the step goes the other way.

    >>> step = gauss_newton_step_printed((1, 0, 0, 0), [[0, 0], [1, 0]], [[3, 0], [5, 0]], (0, 0))
    >>> step.round(9) + 0.0
    array([0., 0., 3., 0.])
    """
    step, _, regular = correction(parameters, source, target, pivot, free)
    _refuse_singular(regular)
    return np.asarray(parameters, dtype=np.float64) - step


def correction(
    parameters: ArrayLike,
    source: ArrayLike,
    target: ArrayLike,
    pivot: ArrayLike,
    free: int = PARAMETERS,
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """The correction (J^T J)^-1 J^T T, how far it moves the points, and where it exists.

    Parameters are those of `gauss_newton_step`.

    Returns
    -------
    step : ndarray, shape (..., 4)
        Zero where a parameter is held or the normal matrix is singular.
    movement : ndarray, shape (...)
        Root mean square movement of the modelled points under the step, in px.
    regular : ndarray of bool, shape (...)
        False where the normal matrix is singular.

    Examples
    --------
    >>> step, movement, regular = correction((1, 0, 0, 0), [[7, 5]], [[9, 5]], (5, 5), free=1)
    >>> step, float(movement), bool(regular)
    (array([1., 0., 0., 0.]), 2.0, True)
    """
    if whole_number("free", free) > PARAMETERS:
        raise ValueError(f"free: expected 1 to {PARAMETERS} parameters, got {free}; leave it out")
    left = deviations(parameters, source, target, pivot)
    rows = jacobian(parameters, source, pivot)[..., :free]
    transposed = np.swapaxes(rows, -1, -2)
    normal = transposed @ rows
    size = np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1))
    regular = np.asarray((size > 0).all(axis=-1))
    size = np.where(regular[..., None], size, 1.0)
    # With columns of length one the determinant says how far they are from dependent.
    scaled = normal / (size[..., :, None] * size[..., None, :])
    regular &= np.linalg.det(scaled) > SINGULAR_SPREAD**2
    scaled = np.where(regular[..., None, None], scaled, np.eye(free))
    pull = (transposed @ left[..., None])[..., 0] / size
    solved = np.linalg.solve(scaled, pull[..., None])[..., 0] * regular[..., None]
    step = np.zeros((*solved.shape[:-1], PARAMETERS))
    step[..., :free] = solved / size
    squared = (solved * pull).sum(axis=-1)
    movement = np.sqrt(np.maximum(squared, 0) * (2 / left.shape[-1]))
    return step, np.asarray(movement), np.broadcast_to(regular, movement.shape)


def _factor(parameters: FloatArray) -> FloatArray:
    return np.asarray(parameters[..., :1] * np.exp(1j * parameters[..., 1:2]))


def _checked(
    parameters: ArrayLike, source: ArrayLike, pivot: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    parameters = finite_array("parameters", parameters, shape=(PARAMETERS,))
    source = finite_array("source", source, shape=(None, 2))
    pivot = finite_array("pivot", pivot, shape=(2,))
    common_batch(parameters=parameters.shape[:-1], source=source.shape[:-2], pivot=pivot.shape[:-1])
    return parameters, source, pivot


def _refuse_singular(regular: BoolArray) -> None:
    if not regular.all():
        raise DegenerateGeometryError(
            f"expected points that fix every free parameter, got {int((~regular).sum())} singular "
            "normal matrices; give two or more different points (far from a distant pivot use "
            "fit_similarity) and a starting scale other than zero"
        )
