"""Check the arguments of public functions once; kernels take arrays that are checked.

A function under `checked` declares its arguments by annotations such as `Points` or `Positive`, and
gets float arrays. A message contains the argument, the expected value, the value and the remedy.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ParamSpec, TypeVar, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
_Shape = tuple[int | str | None, ...]
P = ParamSpec("P")
R = TypeVar("R")
# Largest error of the products of rows of a rotation matrix: more is no rounding error.
_ORTHOGONALITY_TOLERANCE = 1e-6


class DegenerateGeometryError(ValueError):
    """The observations leave a parameter free, so no unique answer exists."""


class MirroredPointsError(DegenerateGeometryError):
    """The target points are a mirror image of the source points."""


@dataclass(frozen=True)
class Finding:
    """A fault of measurements: its kind, a sentence, and the numbers of its rows, from 0."""

    kind: str
    text: str
    rows: tuple[int, ...] = ()


def number_array(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return `value` as `finite_array` does, but accept NaN and infinity."""
    unit = getattr(value, "units", getattr(value, "unit", None))
    if np.ma.is_masked(value) or (unit is not None and hasattr(value, "to")):
        raise (TypeError if unit is not None else ValueError)(
            f"{name}: expected numbers without a mask or unit, got {type(value).__name__}; "
            "remove masked rows, and convert a quantity to the unit of the docstring"
        )
    got: object = "rows of unequal length"
    try:
        raw = np.asarray(value)
        got = raw.dtype
        if raw.dtype.kind in "cUSmM":
            raise TypeError
        array = raw.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(
            f"{name}: expected an array of real numbers, got {got}; convert the entries"
        ) from None
    fits = array.ndim >= len(shape) and all(
        not isinstance(want, int) or want == have
        for want, have in zip(shape[::-1], array.shape[::-1], strict=False)
    )
    if not fits or array.size == 0:
        wanted = ", ".join(str(want or "n") for want in shape)
        raise ValueError(
            f"{name}: expected shape (..., {wanted}) and at least one value, got {array.shape}; "
            "rows are observations, columns are coordinates"
        )
    return array


def finite_array(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return `value` as a float array after checking its trailing shape and its finiteness.

    Parameters
    ----------
    name : str
        Name of the argument, the first word of an error message.
    value : array_like
        Real numbers; an array of float64 is not copied.
    shape : tuple of int, str or None
        Trailing dimensions; a name or None stands for any length above zero. Leading (batch)
        dimensions are always allowed.

    Raises
    ------
    TypeError
        If `value` is not numeric.
    ValueError
        If it has the wrong shape, is empty, or contains NaN or infinity.

    Examples
    --------
    >>> finite_array("points", [[1, 2]], shape=(None, 2))
    array([[1., 2.]])
    """
    array = number_array(name, value, shape=shape)
    return _accepted(name, array, np.isfinite(array), "finite numbers")


def positive(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return `value` as `finite_array` does; raise ValueError for zero and negative values."""
    array = finite_array(name, value, shape=shape)
    return _accepted(name, array, array > 0, "values above zero")


def non_negative(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return `value` as `finite_array` does; raise ValueError for negative values."""
    array = finite_array(name, value, shape=shape)
    return _accepted(name, array, array >= 0, "zero or more")


def _accepted(name: str, array: FloatArray, valid: Any, wanted: str) -> FloatArray:
    """Return an array; raise ValueError with the first value that is not valid."""
    if not valid.all():
        first = tuple(np.argwhere(~valid)[0].tolist())
        raise ValueError(
            f"{name}: expected {wanted}, got {array[first]:g} at index {first}; check its sign and "
            "its unit, or remove the row"
        )
    return array


def size(name: str, value: ArrayLike, *, shape: _Shape = ()) -> float:
    """Return one number above zero as a float."""
    array = positive(name, value)
    if array.ndim:
        raise ValueError(
            f"{name}: expected one number, got shape {array.shape}; give one number"
        )
    return float(array)


def rotations(name: str, matrices: ArrayLike, *, shape: _Shape = (3, 3)) -> FloatArray:
    """Return matrices (..., 3, 3) as floats after checking that they are proper rotations.

    A matrix that is not orthogonal to 1e-6, or a reflection, raises a ValueError. `shape` may
    contain more dimensions than the last two.
    """
    array = finite_array(name, matrices, shape=shape)
    excess = np.abs(array @ array.mT - np.eye(3)).max()
    least = np.linalg.det(array).min()
    if excess > _ORTHOGONALITY_TOLERANCE or least < 0:
        raise ValueError(
            f"{name}: expected rotation matrices, got an error of {excess:.2g} in the products of "
            f"rows and a determinant of {least:.2g}; normalise the rows and check their order"
        )
    return array


# Annotations of `checked`: the trailing shape, and a check other than `finite_array`. A dimension
# with a name, such as n, has one length in all arguments.
Number = Annotated[Any, ()]
Positive = Annotated[Any, (), positive]
NonNegative = Annotated[Any, (), non_negative]
Size = Annotated[Any, (), size]
Point = Annotated[Any, (2,)]
Points = Annotated[Any, ("n", 2)]
Direction = Annotated[Any, (3,)]
Directions = Annotated[Any, ("n", 3)]
Rotation = Annotated[Any, (3, 3), rotations]
Weights = Annotated[Any, ("n",)]
Image = Annotated[Any, (None, None)]


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Check the arguments of a function by their annotations, and their batches; None passes.

    The function gets float arrays.

    Examples
    --------
    >>> @checked
    ... def offsets(points: Points, pivot: Point):
    ...     return points - pivot[..., None, :]
    >>> offsets([[1, 2]], (1, 0))
    array([[0., 2.]])
    """
    signature = inspect.signature(function)
    kinds = {}
    for name, hint in function.__annotations__.items():
        alias = function.__globals__.get(hint, hint)
        if get_origin(alias) is Annotated:
            _, shape, *check = get_args(alias)
            kinds[name] = shape, check[0] if check else finite_array

    @functools.wraps(function)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = signature.bind(*args, **kwargs)
        bound.apply_defaults()
        batches, lengths = {}, dict[str, tuple[str, int]]()
        for name, value in bound.arguments.items():
            if name in kinds and value is not None:
                shape, check = kinds[name]
                bound.arguments[name] = array = check(name, value, shape=shape)
                came = np.shape(array)
                inner = len(came) - len(shape)
                batches[name] = came[:inner]
                for dimension, length in zip(shape, came[inner:], strict=True):
                    first, wanted = lengths.setdefault(dimension, (name, length))
                    if isinstance(dimension, str) and length != wanted:
                        raise ValueError(
                            f"{first} and {name}: expected as many rows, got {wanted} and "
                            f"{length}; row i of both must be the same observation"
                        )
            elif isinstance(batch := getattr(value, "batch", None), tuple):
                batches[name if name != "self" else type(value).__name__] = batch
        common_batch(**batches)
        return function(*bound.args, **bound.kwargs)

    return wrapper


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Return a checked function without its checks, for arrays that have passed them."""
    return inspect.unwrap(function)


def weights_for(weights: ArrayLike | None, count: int) -> FloatArray:
    """Return `count` relative weights, shape (..., count); all are 1 by default.

    Negative weights, or weights that are all zero, raise a ValueError.
    """
    if weights is None:
        return np.ones(count)
    array = non_negative("weights", weights, shape=(count,))
    if (array.sum(axis=-1) <= 0).any():
        raise ValueError(
            "weights: expected at least one above zero, got all zero; remove the set"
        )
    return array


def whole_number(name: str, value: int, *, least: int = 1) -> int:
    """Return `value` as an int; raise TypeError if it is not whole, ValueError if too small.

    Integers of NumPy are accepted, booleans and floats are not.
    """
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(
            f"{name}: expected a whole number, got {value!r} of type {type(value).__name__}; "
            "give an int"
        )
    if value < least:
        raise ValueError(
            f"{name}: expected {least} or more, got {value}; give a larger one"
        )
    return int(value)


def common_batch(**batches: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape that leading (batch) shapes, by their arguments' names, broadcast to.

    Shapes that do not broadcast together raise a ValueError that names their arguments.

    Examples
    --------
    >>> common_batch(points=(1000,), pivot=())
    (1000,)
    """
    try:
        return np.broadcast_shapes(*batches.values())
    except ValueError as error:
        came = ", ".join(f"{name} {shape}" for name, shape in batches.items())
        raise ValueError(
            f"expected leading (batch) shapes that broadcast together, got {came}; give each "
            "argument the same batch axes, or none"
        ) from error
