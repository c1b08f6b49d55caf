"""The calibration procedure of niu2024, section 3.2: two stages, random restarts.

Image points have shape (..., n, 2), in px, x before y, with the centre of the first pixel at
(0, 0); parameter vectors u = (k, theta, shift x, shift y) have shape (..., 4); the leading axes are
a batch of calibrations, each of which comes out as it would alone. Starting vectors come from
`starting.starting_values` and `starting.random_starts`.

The print couples the iteration to the constraint cos^2 + cos^2 = 1, which holds at odd multiples of
45 degrees alone (`constraint_printed`). The identity meant is cos^2 + sin^2 = 1 (`constraint`); it
holds by itself where the angle is the parameter, so no step needs to enforce it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.gauss_newton import (
    PARAMETERS,
    SINGULAR_SPREAD,
    BoolArray,
    correction,
    deviations,
)
from reproduce.physics.registration import fit_similarity, paired_points
from reproduce.physics.similarity import Similarity, as_complex
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    common_batch,
    finite_array,
    positive,
    whole_number,
)


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
    cost : ndarray, shape (m + 1, ...)
        Sum of squared deviations at each of them, in px^2.
    first_stage : int
        How many of the steps moved scale and rotation alone.
    converged : ndarray of bool, shape (...)
        Whether the last stage settled.
    pivot : ndarray, shape (..., 2)
        The source channel's principal point, in px.
    """

    history: FloatArray
    cost: FloatArray
    first_stage: int
    converged: BoolArray
    pivot: FloatArray

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
    def similarity(self) -> Similarity:
        """The final transform."""
        final = self.parameters
        return Similarity(final[..., 0], final[..., 1], final[..., 2:], self.pivot)


def calibrate(
    source: ArrayLike,
    target: ArrayLike,
    pivot: ArrayLike,
    start: ArrayLike,
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
        Final parameters and the path to them.

    Raises
    ------
    ValueError
        If an argument is not finite, has the wrong shape, or the counts differ.
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


def calibrate_from_all(
    source: ArrayLike,
    target: ArrayLike,
    pivot: ArrayLike,
    starts: ArrayLike,
    stopping: Stopping | None = None,
) -> Calibration:
    """Calibrate from every start and keep, for each calibration, the end of lowest cost.

    Parameters
    ----------
    source, target, pivot, stopping
        As for `calibrate`.
    starts : array_like, shape (s, ..., 4)
        Starting vectors, from `random_starts` for one; s of them for each calibration.

    Returns
    -------
    Calibration
        The best of the s calibrations; those that have not settled are never chosen.

    Raises
    ------
    ValueError
        If an argument is not finite, has the wrong shape, or the counts differ.
    DegenerateGeometryError
        If the points coincide or mirror each other, or cluster too far from the pivot.
    ConvergenceError
        If no start of some calibration has settled.

    Examples
    --------
    >>> starts = [(1, 0, 0, 0), (3, 0.1, 5, 5)]
    >>> best = calibrate_from_all([[0, 0], [1, 0]], [[3, 0], [5, 0]], (0, 0), starts)
    >>> best.parameters.round(9) + 0.0
    array([ 2.,  0., -3.,  0.])
    """
    starts = finite_array("starts", starts, shape=(None, PARAMETERS))
    every = _two_stages(source, target, pivot, starts, stopping or Stopping())
    if not every.converged.any(axis=0).all():
        raise ConvergenceError(
            f"expected one of {len(starts)} starts to settle, got none for some calibration; "
            "start closer, or allow more steps"
        )
    final = np.where(every.converged, every.cost[-1], np.inf)
    best = final.argmin(axis=0)[None]
    history = np.take_along_axis(every.history, best[None, ..., None], axis=1)[:, 0]
    cost = np.take_along_axis(every.cost, best[None], axis=1)[:, 0]
    settled = np.take_along_axis(every.converged, best, axis=0)[0]
    return Calibration(history, cost, every.first_stage, settled, every.pivot)


def constraint(rotation: ArrayLike) -> FloatArray:
    """The identity that ties cosine and sine: cos^2 + sin^2 - 1, zero at every angle.

    Parameters
    ----------
    rotation : array_like, shape (...)
        Angle theta, in radians.

    Returns
    -------
    ndarray, shape (...)
        Zero, up to rounding.

    Raises
    ------
    ValueError
        If `rotation` is not finite.

    Examples
    --------
    >>> float(constraint(0.0))
    0.0
    """
    rotation = finite_array("rotation", rotation)
    return np.asarray(np.cos(rotation) ** 2 + np.sin(rotation) ** 2 - 1)


def constraint_printed(rotation: ArrayLike) -> FloatArray:
    """The constraint as extracted from section 3.2: cos^2 + cos^2 - 1, which is cos(2 theta).

    It is zero at odd multiples of 45 degrees alone; a detector turned by a fraction of a degree
    misses it by almost one.

    Parameters
    ----------
    rotation : array_like, shape (...)
        Angle theta, in radians.

    Returns
    -------
    ndarray, shape (...)
        cos(2 theta).

    Raises
    ------
    ValueError
        If `rotation` is not finite.

    Examples
    --------
    >>> float(constraint_printed(0.0))
    1.0
    """
    rotation = finite_array("rotation", rotation)
    return np.asarray(np.cos(rotation) ** 2 + np.cos(rotation) ** 2 - 1)


def _two_stages(
    source: ArrayLike, target: ArrayLike, pivot: ArrayLike, start: ArrayLike, stopping: Stopping
) -> Calibration:
    source, target = paired_points(source, target)
    pivot = finite_array("pivot", pivot, shape=(2,))
    start = finite_array("start", start, shape=(PARAMETERS,))
    batch = common_batch(
        source=source.shape[:-2],
        target=target.shape[:-2],
        pivot=pivot.shape[:-1],
        start=start.shape[:-1],
    )
    # The closed form refuses what has no unique answer; the iteration would settle anywhere.
    fit_similarity(source, target, pivot)
    _refuse_narrow(source, pivot)
    start = np.broadcast_to(start, (*batch, PARAMETERS))
    first, _ = _iterate(source, target, pivot, start, (2, stopping))
    second, settled = _iterate(source, target, pivot, first[-1], (PARAMETERS, stopping))
    history = np.stack(first + second[1:])
    left = deviations(history, source, target, pivot)
    cost = np.square(left).sum(axis=-1)
    return Calibration(history, cost, len(first) - 1, settled, pivot)


def _refuse_narrow(source: FloatArray, pivot: FloatArray) -> None:
    offsets = as_complex(source) - as_complex(pivot)[..., None]
    about_pivot = np.square(np.abs(offsets)).sum(axis=-1)
    centred = offsets - offsets.mean(axis=-1, keepdims=True)
    spread = np.square(np.abs(centred)).sum(axis=-1)
    if (spread <= SINGULAR_SPREAD * about_pivot).any():
        raise DegenerateGeometryError(
            "source: expected points spread over more than a three-thousandth of their distance "
            "from the pivot, got a narrow cluster; add spots across the field of view, or use "
            "fit_similarity"
        )


def _iterate(
    source: FloatArray,
    target: FloatArray,
    pivot: FloatArray,
    start: FloatArray,
    stage: tuple[int, Stopping],
) -> tuple[list[FloatArray], BoolArray]:
    """Repeat the step with `free` parameters until every calibration has settled."""
    free, stopping = stage
    path, moving = [start], np.ones(start.shape[:-1], dtype=bool)
    settled = ~moving
    for _ in range(stopping.steps):
        step, movement, regular = correction(path[-1], source, target, pivot, free)
        regular = regular & np.isfinite(step).all(axis=-1)
        # Those that have settled are held, so that a batch gives what each would give alone.
        path.append(path[-1] + np.where((moving & regular)[..., None], step, 0.0))
        settled |= moving & regular & (movement < stopping.movement)
        moving &= regular & ~settled
        if not moving.any():
            break
    return path, settled
