"""Checks on what a public function is given: once, at the border; kernels behind it trust it.

A function under `checked` declares what it takes by annotations such as `Points` or `Positive`, and
has float arrays in its body. Every message says what was expected, what came and what to do.
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

# What an argument of a `checked` function may be, leading (batch) axes aside: its trailing shape,
# or what it is. A dimension with a name, such as n, is the same number in all arguments.
Number = Annotated[Any, ()]
Positive = Annotated[Any, "positive"]
NonNegative = Annotated[Any, "non-negative"]
Size = Annotated[Any, "size"]  # one positive number, which stays a float
Point = Annotated[Any, (2,)]
Points = Annotated[Any, ("n", 2)]
Direction = Annotated[Any, (3,)]
Directions = Annotated[Any, ("n", 3)]
Rotation = Annotated[Any, "rotation"]
Weights = Annotated[Any, ("n",)]
Image = Annotated[Any, (None, None)]
# A matrix this far from orthogonal is a transcription error, not a rounding error.
_ORTHOGONALITY_TOLERANCE = 1e-6
# What NumPy's kinds of arrays that hold no numbers are called.
_KINDS = {"U": "text", "S": "bytes", "m": "time differences", "M": "dates"}


class DegenerateGeometryError(ValueError):
    """The observations leave a parameter free, so no unique answer exists."""


class MirroredPointsError(DegenerateGeometryError):
    """The target points are a mirror image of the source points."""


@dataclass(frozen=True)
class Finding:
    """What is to be said of measurements: its kind, the sentence, the rows (from 0) it is about."""

    kind: str
    text: str
    rows: tuple[int, ...] = ()


def finite_array(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return `value` as a float array after checking its trailing shape and its finiteness.

    Parameters
    ----------
    name : str
        What the caller calls the array; it opens the error message.
    value : array_like
        Anything NumPy turns into floating point numbers; not copied when it is a float64 array.
    shape : tuple of int, str or None
        The trailing dimensions; a name or None leaves one open, but it must not be empty.
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


def number_array(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return what `finite_array` does, but let NaN and infinity pass."""
    if type(value) is not np.ndarray:
        _refuse_metadata(name, value)
    try:
        raw = np.asarray(value)
    except ValueError:
        raise TypeError(
            f"{name}: expected an array of numbers, got rows of unequal length; "
            "give every row as many numbers"
        ) from None
    if raw.dtype.kind == "c":
        raise TypeError(
            f"{name}: expected real numbers, got complex ones; pass the real part"
        )
    if raw.dtype.kind in "USmM":
        raise TypeError(
            f"{name}: expected numbers, got {_KINDS[raw.dtype.kind]}; convert them"
        )
    try:
        array = np.asarray(raw, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(
            f"{name}: expected an array of numbers, got an entry that is none or too large; remove "
            "or convert it"
        ) from None
    fits = array.ndim >= len(shape) and all(
        not isinstance(want, int) or want == have
        for want, have in zip(shape[::-1], array.shape[::-1], strict=False)
    )
    if not fits:
        wanted = ", ".join(str(want or "n") for want in shape)
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


def _refuse_metadata(name: str, value: object) -> None:
    """Refuse what `numpy.asarray` would drop in silence: a mask, and a unit."""
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        masked = int(np.ma.getmaskarray(value).sum())
        raise ValueError(
            f"{name}: expected an array without a mask, got {masked} masked entries; leave "
            "these rows out first"
        )
    unit = getattr(value, "units", getattr(value, "unit", None))
    if unit is not None and hasattr(value, "to"):
        raise TypeError(
            f"{name}: expected plain numbers, got a quantity in {str(unit) or 'no unit'}; convert "
            "it to the unit of the docstring and pass its magnitude"
        )


def positive(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return what `finite_array` does, and refuse zero and negative values with a ValueError."""
    array = finite_array(name, value, shape=shape)
    _refuse_low(name, array, array <= 0, "values above zero", "its sign and its unit")
    return array


def non_negative(name: str, value: ArrayLike, *, shape: _Shape = ()) -> FloatArray:
    """Return what `finite_array` does, and refuse negative values with a ValueError."""
    array = finite_array(name, value, shape=shape)
    _refuse_low(name, array, array < 0, "zero or more", "its sign")
    return array


def _refuse_low(
    name: str, array: FloatArray, low: Any, wanted: str, doubt: str
) -> None:
    if low.any():
        raise ValueError(
            f"{name}: expected {wanted}, got a smallest value of {array.min():g}; check {doubt}"
        )


def rotations(name: str, matrices: ArrayLike, *, shape: _Shape = (3, 3)) -> FloatArray:
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


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Check arguments by their annotations, and that batches broadcast; None passes.

    The function gets float arrays in their place.

    Examples
    --------
    >>> @checked
    ... def offsets(points: Points, pivot: Point):
    ...     return points - pivot[..., None, :]
    >>> offsets([[1, 2]], (1, 0))
    array([[0., 2.]])
    """
    signature = inspect.signature(function)
    aliases = function.__globals__
    hints = {n: aliases.get(hint, hint) for n, hint in function.__annotations__.items()}
    kinds = {
        n: get_args(hint)[1]
        for n, hint in hints.items()
        if get_origin(hint) is Annotated
    }

    @functools.wraps(function)
    def at_the_border(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = signature.bind(*args, **kwargs)
        bound.apply_defaults()
        given = bound.arguments
        batches, sizes = {}, dict[str, tuple[str, int]]()
        for name, value in given.items():
            kind = kinds.get(name)
            if kind is None or value is None:
                if isinstance(batch := getattr(value, "batch", None), tuple):
                    batches[name if name != "self" else type(value).__name__] = batch
                continue
            if isinstance(kind, str):
                array, inner = (
                    _CHECKS[kind](name, value),
                    2 if kind == "rotation" else 0,
                )
            else:
                array, inner = finite_array(name, value, shape=kind), len(kind)
                _refuse_other_size(name, kind, array, sizes)
            given[name] = float(array) if kind == "size" else array
            batches[name] = array.shape[: array.ndim - inner]
        common_batch(**batches)
        return function(*bound.args, **bound.kwargs)

    return at_the_border


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Return a checked function without its checks, for arrays that have passed them."""
    return inspect.unwrap(function)


def _size(name: str, value: ArrayLike) -> FloatArray:
    array = positive(name, value)
    if array.ndim:
        raise ValueError(
            f"{name}: expected one number, got shape {array.shape}; give one"
        )
    return array


_CHECKS: dict[str, Callable[[str, ArrayLike], FloatArray]] = {
    "size": _size,
    "positive": positive,
    "non-negative": non_negative,
    "rotation": rotations,
}


def _refuse_other_size(
    name: str, shape: _Shape, array: FloatArray, sizes: dict[str, tuple[str, int]]
) -> None:
    for dimension, size in zip(
        shape, array.shape[array.ndim - len(shape) :], strict=True
    ):
        if isinstance(dimension, str):
            first, wanted = sizes.setdefault(dimension, (name, size))
            if size != wanted:
                raise ValueError(
                    f"{first} and {name}: expected as many rows, got {wanted} and {size}; row i "
                    "of both must be the same observation"
                )


def weights_for(weights: ArrayLike | None, count: int) -> FloatArray:
    """Return `count` relative weights, shape (..., count), all one where none are given.

    Weights are zero or more, but not zero for all observations at once; else a ValueError.
    """
    if weights is None:
        return np.ones(count)
    array = non_negative("weights", weights, shape=(count,))
    if (array.sum(axis=-1) <= 0).any():
        raise ValueError(
            "weights: expected at least one above zero, got all zero; drop the set"
        )
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
