"""Checks on what a public function is given: once, at the border; kernels behind it trust it.

Every message says what was expected, what came and what to do about it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "NON_NEGATIVE",
    "POSITIVE",
    "ROTATION",
    "DegenerateGeometryError",
    "FloatArray",
    "MirroredPointsError",
    "common_batch",
    "finite_array",
    "non_negative",
    "number_array",
    "positive",
    "rotations",
    "together",
    "weights_for",
    "whole_number",
]

FloatArray = NDArray[np.float64]
Shape = tuple[int | None, ...]

# What `together` is told of an argument, in place of its shape.
POSITIVE, NON_NEGATIVE, ROTATION = "positive", "non-negative", "rotation"
# A matrix this far from orthogonal is a transcription error, not a rounding error.
_ORTHOGONALITY_TOLERANCE = 1e-6
# What NumPy's kinds of arrays that hold no numbers are called.
_KINDS = {"U": "text", "S": "bytes", "m": "time differences", "M": "dates"}


class DegenerateGeometryError(ValueError):
    """The observations leave a parameter free, so no unique answer exists."""


class MirroredPointsError(DegenerateGeometryError):
    """The target points are a mirror image of the source points."""


def finite_array(name: str, value: ArrayLike, *, shape: Shape = ()) -> FloatArray:
    """Return `value` as a float array after checking its trailing shape and its finiteness.

    Parameters
    ----------
    name : str
        What the caller calls the array; it opens the error message.
    value : array_like
        Anything NumPy turns into floating point numbers; not copied when it is a float64 array.
    shape : tuple of int or None
        The trailing dimensions; None leaves a dimension open, but it must not be empty.
        Leading (batch) dimensions are always allowed.

    Raises
    ------
    TypeError
        If `value` is not numeric.
    ValueError
        If it has the wrong shape, is empty, or holds NaN or infinity.

    Examples
    --------
    >>> finite_array("points", [[1, 2]], shape=(None, 2))
    array([[1., 2.]])
    """
    array = number_array(name, value, shape=shape)
    finite = np.isfinite(array)
    if not finite.all():
        bad = ~finite
        first = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ValueError(
            f"{name}: expected finite numbers, got {int(bad.sum())} that are NaN or infinite, "
            f"the first at index {first}; remove or mask these rows first"
        )
    return array


def number_array(name: str, value: ArrayLike, *, shape: Shape = ()) -> FloatArray:
    """Return what `finite_array` does, but let NaN and infinity pass."""
    try:
        raw = np.asarray(value)
    except ValueError:
        raise TypeError(
            f"{name}: expected an array of numbers, got rows of unequal length; "
            "give every row as many numbers"
        ) from None
    if raw.dtype.kind == "c":
        raise TypeError(f"{name}: expected real numbers, got complex ones; pass the real part")
    if raw.dtype.kind in "USmM":
        raise TypeError(f"{name}: expected numbers, got {_KINDS[raw.dtype.kind]}; convert them")
    try:
        array = np.asarray(raw, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(
            f"{name}: expected an array of numbers, got an entry that is none or too large; remove "
            "or convert it"
        ) from None
    fits = array.ndim >= len(shape) and all(
        want is None or want == have
        for want, have in zip(shape[::-1], array.shape[::-1], strict=False)
    )
    if not fits:
        wanted = ", ".join("n" if want is None else str(want) for want in shape)
        raise ValueError(
            f"{name}: expected shape (..., {wanted}), got {array.shape}; "
            "rows are observations, columns are coordinates"
        )
    if array.size == 0:
        raise ValueError(
            f"{name}: expected at least one value, got shape {array.shape}; "
            "check what was selected before this call"
        )
    return array


def positive(name: str, value: ArrayLike, *, shape: Shape = ()) -> FloatArray:
    """Return what `finite_array` does, and refuse zero and negative values with a ValueError."""
    array = finite_array(name, value, shape=shape)
    if (array <= 0).any():
        raise ValueError(
            f"{name}: expected values above zero, got a smallest value of {array.min():g}; "
            "check its sign and its unit"
        )
    return array


def non_negative(name: str, value: ArrayLike, *, shape: Shape = ()) -> FloatArray:
    """Return what `finite_array` does, and refuse negative values with a ValueError."""
    array = finite_array(name, value, shape=shape)
    if (array < 0).any():
        raise ValueError(
            f"{name}: expected zero or more, got a smallest value of {array.min():g}; "
            "check its sign"
        )
    return array


def rotations(name: str, matrices: ArrayLike, *, shape: Shape = (3, 3)) -> FloatArray:
    """Return matrices (..., 3, 3) as floats after checking that they are rotations.

    One that is not orthogonal to 1e-6, or a reflection, raises a ValueError. `shape` may ask for
    more dimensions than the last two.
    """
    array = finite_array(name, matrices, shape=shape)
    excess = np.abs(array @ array.mT - np.eye(3)).max()
    if excess > _ORTHOGONALITY_TOLERANCE:
        raise ValueError(
            f"{name}: expected rotation matrices, got one whose rows miss unit length or right "
            f"angles by {excess:.2g}; check for a missing normalisation or a typing error"
        )
    if (np.linalg.det(array) < 0).any():
        raise ValueError(
            f"{name}: expected rotation matrices, got a reflection (determinant -1); "
            "one axis is flipped or two are swapped"
        )
    return array


def together(**arguments: tuple[ArrayLike, Shape | str]) -> tuple[FloatArray, ...]:
    """Return several arguments as float arrays after checking each, and that batches broadcast.

    Each argument is a pair: what came, and its trailing shape as `finite_array` takes it. The shape
    () is a number with batch axes; `POSITIVE` and `NON_NEGATIVE` stand for such a number with a
    sign, and `ROTATION` for a matrix (3, 3).

    Examples
    --------
    >>> together(points=([[1, 2]], (None, 2)), focal_length=(3, POSITIVE))
    (array([[1., 2.]]), array(3.))
    """
    checks = {POSITIVE: positive, NON_NEGATIVE: non_negative, ROTATION: rotations}
    arrays, batches = [], {}
    for name, (value, kind) in arguments.items():
        if isinstance(kind, str):
            array, inner = checks[kind](name, value), 2 if kind == ROTATION else 0
        else:
            array, inner = finite_array(name, value, shape=kind), len(kind)
        arrays.append(array)
        batches[name] = array.shape[: array.ndim - inner]
    common_batch(**batches)
    return tuple(arrays)


def weights_for(weights: ArrayLike | None, count: int) -> FloatArray:
    """Return `count` relative weights, shape (..., count), all one where none are given.

    Weights are zero or more, but not zero for all observations at once; else a ValueError.
    """
    if weights is None:
        return np.ones(count)
    array = non_negative("weights", weights, shape=(count,))
    if (array.sum(axis=-1) <= 0).any():
        raise ValueError("weights: expected at least one above zero, got all zero; drop the set")
    return array


def whole_number(name: str, value: int, *, least: int = 1) -> int:
    """Return `value` as an int; a TypeError if it is not whole, a ValueError if below `least`.

    NumPy's integers are welcome, booleans and floats are not.
    """
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(
            f"{name}: expected a whole number, got {value!r} of type {type(value).__name__}; "
            "pass an int"
        )
    if value < least:
        raise ValueError(f"{name}: expected {least} or more, got {value}; ask for more")
    return int(value)


def common_batch(**batches: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape that leading (batch) shapes, by their arguments' names, broadcast to.

    Raises a ValueError that names them if they do not broadcast together.

    Examples
    --------
    >>> common_batch(points=(1000,), pivot=())
    (1000,)
    """
    if not any(batches.values()):
        return ()
    try:
        return np.broadcast_shapes(*batches.values())
    except ValueError as error:
        came = ", ".join(f"{name} {shape}" for name, shape in batches.items())
        raise ValueError(
            f"expected leading (batch) shapes that broadcast together, got {came}; "
            "give each argument the same batch axes, or none"
        ) from error
