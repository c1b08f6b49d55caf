"""Checks of the arguments of public functions.

A function under `checked` declares its arguments by annotations such as `Points` or `Positive` and
receives float arrays, or the object itself for `Text` and `Flag`. An error contains the argument,
the expected and the given value, and a remedy.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Annotated, Any, ParamSpec, TypeVar, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike, NDArray

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
# Spots of all images at the zero point and at the present, shape (frames, n, 2) each.
Images = tuple[FloatArray, FloatArray]
_Shape = tuple[int | str | None, ...]
P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C")
# Largest error of the products of rows of a rotation matrix. Rounding errors are smaller.
_ORTHOGONALITY_TOLERANCE = 1e-6


class DegenerateGeometryError(ValueError):
    """The observations do not determine every parameter."""


class MirroredPointsError(ValueError):
    """The target points are a mirror image of the source points."""


@dataclass(frozen=True)
class Finding:
    """A fault of measurements: its kind, a sentence, and the numbers of its rows, from 0."""

    kind: str
    text: str
    rows: tuple[int, ...] = ()


def without_none(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments that have a value."""
    return {name: value for name, value in arguments.items() if value is not None}


def number_array(
    name: str, value: ArrayLike, *, shape: _Shape = (), exact: bool = False
) -> FloatArray:
    """Return `value` as `finite_array` does, but accept NaN, which masked values become.

    Infinity is accepted, too. An exact shape has no leading dimensions.
    """
    content: object = "rows of unequal length"
    try:
        # The entries of nested lists may have units or masks.
        parts: Any = [value]
        while parts and isinstance(parts[0], (list, tuple)):
            parts = [*chain.from_iterable(parts)]
        if any(
            getattr(p, "unit", getattr(p, "units", None)) is not None for p in parts
        ):
            content = "a quantity"
            raise TypeError
        if any(map(np.ma.isMaskedArray, parts)):
            value = np.ma.asarray(parts).reshape(np.shape(value))
        raw = np.asarray(value)
        content = raw.dtype
        if raw.dtype.kind in "cUSmM":
            raise TypeError
        array = raw.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(
            f"{name}: expected an array of real numbers, got {content}. Convert the entries to "
            "numbers in the unit of the docstring"
        ) from None
    more = array.ndim - len(shape)
    fits = (more == 0 if exact else more >= 0) and all(
        not isinstance(length, int) or length == actual
        for length, actual in zip(shape[::-1], array.shape[::-1], strict=False)
    )
    if not fits or array.size == 0:
        lengths = [length or "n" for length in shape]
        expected = ", ".join(map(str, lengths if exact else ["...", *lengths]))
        raise ValueError(
            f"{name}: expected shape ({expected}), got {array.shape or value}. Rows are "
            "observations, at least one row, and columns are coordinates"
        )
    masked = np.ma.is_masked(value)
    return np.where(np.ma.getmask(value), np.nan, array) if masked else array


def finite_array(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return `value` as a float array after checking its trailing shape and its finiteness.

    Parameters
    ----------
    name : str
        Name of the argument, the first word of an error message.
    value : array_like
        Real numbers. An array of float64 is not copied.
    shape : tuple of int, str or None
        Trailing dimensions. A name or None stands for any length above zero. Leading (batch)
        dimensions are always allowed.

    Returns
    -------
    ndarray
        The values, with the shape of `value`.

    Raises
    ------
    TypeError
        If `value` is not numeric.
    ValueError
        If it has the wrong shape, is empty, or contains NaN, infinity or masked values.

    Examples
    --------
    >>> finite_array("points", [[1, 2]], shape=(None, 2))
    array([[1., 2.]])
    """
    array = number_array(name, value, shape=shape)
    return valid(name, array, np.isfinite(array), "finite numbers")


def positive(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return `value` as `finite_array` does; raise ValueError for zero and negative values."""
    array = finite_array(name, value, shape=shape)
    return valid(name, array, array > 0, "values above zero")


def non_negative(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return `value` as `finite_array` does; raise ValueError for negative values."""
    array = finite_array(name, value, shape=shape)
    return valid(name, array, array >= 0, "zero or more")


def valid(name: str, value: ArrayLike, inside: Any, expected: str) -> FloatArray:
    """Return numbers as an array; raise ValueError with the first number that is not `inside`."""
    array, mask = np.asarray(value), np.asarray(inside)
    if not mask.all():
        first = tuple(np.argwhere(~mask)[0].tolist())
        place, row = (
            (f" at index {first}", ", or remove the row") if first else ("", "")
        )
        raise ValueError(
            f"{name}: expected {expected}, got {array[first]:g}{place}. Correct the number, its "
            f"sign and its unit{row}"
        )
    return array


def _single(
    check: Callable[..., FloatArray], name: str, value: ArrayLike, *, shape: _Shape
) -> float:
    """Return one number as a float, after another check."""
    array = check(name, value, shape=shape)
    if array.ndim:
        raise ValueError(
            f"{name}: expected one number, got shape {array.shape}. Give a scalar"
        )
    return float(array)


def _instance(
    kind: type | tuple[type, ...],
    expected: str,
    name: str,
    value: Any,
    *,
    shape: _Shape,
) -> Any:
    """Return an object of some type; raise TypeError for another object."""
    if not isinstance(value, kind):
        raise TypeError(f"{name}: expected {expected}, got {value!r}. Give {expected}")
    return value


def rotations(name: str, matrices: ArrayLike, *, shape: _Shape = (3, 3)) -> FloatArray:
    """Return matrices (..., 3, 3) as floats after checking that they are proper rotations.

    A matrix that is not orthogonal to 1e-6, or a reflection, raises a ValueError. `shape` may
    contain more dimensions than the last two.
    """
    array = finite_array(name, matrices, shape=shape)
    error = np.abs(array @ array.mT - np.eye(3)).max()
    if error > _ORTHOGONALITY_TOLERANCE or (np.linalg.det(array) < 0).any():
        raise ValueError(
            f"{name}: expected rotation matrices, got an error of {error:.2g} in the products of "
            "rows, or a reflection. Normalise the rows and check their order"
        )
    return array


# Annotations of `checked`: the trailing shape, and a check other than `finite_array`. A dimension
# with a name, such as n, has one length in all arguments.
Number = Annotated[Any, ()]
Positive = Annotated[Any, (), positive]
NonNegative = Annotated[Any, (), non_negative]
Size = Annotated[Any, (), functools.partial(_single, positive)]
Amount = Annotated[Any, (), functools.partial(_single, non_negative)]
Count = Annotated[Any, (), lambda name, value, shape: whole_number(name, value)]
Sides = Annotated[Any, (2,), positive]
Point = Annotated[Any, (2,)]
Points = Annotated[Any, ("n", 2)]
Direction = Annotated[Any, (3,)]
Directions = Annotated[Any, ("n", 3)]
Rotation = Annotated[Any, (3, 3), rotations]
Weights = Annotated[Any, ("n",)]
Image = Annotated[Any, (None, None)]
Text = Annotated[str, (), functools.partial(_instance, str, "text")]
Flag = Annotated[
    bool, (), functools.partial(_instance, (bool, np.bool_), "True or False")
]


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Check the arguments of a function by their annotations, and their batches.

    None is valid where it is the default. The function receives float arrays.

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
            kinds[name] = shape, (*check, finite_array)[0]

    @functools.wraps(function)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = signature.bind(*args, **kwargs)
        bound.apply_defaults()
        batches, lengths = {}, dict[str, tuple[str, int]]()
        for name, value in bound.arguments.items():
            default = signature.parameters[name].default
            if name in kinds and (value is not None or default is not None):
                shape, check = kinds[name]
                bound.arguments[name] = array = check(name, value, shape=shape)
                full = np.shape(array)
                batches[name] = full[: len(full) - len(shape)]
                for dimension, length in zip(shape[::-1], full[::-1], strict=False):
                    first, expected = lengths.setdefault(dimension, (name, length))
                    if isinstance(dimension, str) and length != expected:
                        raise ValueError(
                            f"{first} and {name}: expected equal numbers of rows, got {expected} "
                            f"and {length}. Row i of both must be the same observation"
                        )
            elif isinstance(batch := getattr(value, "batch", None), tuple):
                batches[name if name != "self" else type(value).__name__] = batch
        try:
            np.broadcast_shapes(*batches.values())
        except ValueError as error:
            shapes = ", ".join(f"{name} {shape}" for name, shape in batches.items())
            raise ValueError(
                f"expected leading (batch) shapes that broadcast together, got {shapes}. Give "
                "each argument the same batch axes, or none"
            ) from error
        return function(*bound.args, **bound.kwargs)

    return wrapper


def checked_fields(cls: type[C]) -> type[C]:
    """Check the fields of a dataclass when they are set, as `checked` does with arguments."""
    cls.__init__ = checked(cls.__init__)  # type: ignore[method-assign]  # a decorator wraps it
    return cls


def weights_for(weights: ArrayLike | None, count: int) -> FloatArray:
    """Return `count` relative weights, shape (..., count); all are 1 by default.

    Negative weights, or weights that are all zero, raise a ValueError.
    """
    if weights is None:
        return np.ones(count)
    array = non_negative("weights", weights, shape=(count,))
    largest = array.max(axis=-1)
    valid("weights", largest, largest > 0, "at least one above zero")
    return array


def whole_number(name: str, value: int, *, least: int = 1) -> int:
    """Return an integer of Python or NumPy as an int; raise an error if it is below `least`."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(
            f"{name}: expected a whole number, got {value!r}. Give an integer"
        )
    return int(valid(name, value, value >= least, f"{least} or more"))
