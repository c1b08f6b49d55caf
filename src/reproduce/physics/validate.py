"""Checks on what a public function is given.

Every message says what was expected, what came and what to do about it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


# What NumPy's kinds of arrays that hold no numbers are called.
_KINDS = {"U": "text", "S": "bytes", "m": "time differences", "M": "dates"}


class DegenerateGeometryError(ValueError):
    """The observations leave a parameter free, so no unique answer exists."""


class MirroredPointsError(DegenerateGeometryError):
    """The target points are a mirror image of the source points."""


def finite_array(name: str, value: ArrayLike, *, shape: tuple[int | None, ...] = ()) -> FloatArray:
    """Return `value` as a float array after checking its trailing shape and its finiteness.

    Parameters
    ----------
    name : str
        What the caller calls the array; it opens the error message.
    value : array_like
        Anything NumPy turns into floating point numbers.
    shape : tuple of int or None
        The trailing dimensions; None leaves a dimension open, but it must not be empty.
        Leading (batch) dimensions are always allowed.

    Returns
    -------
    ndarray
        A float64 array; not a copy when `value` already is one.

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


def number_array(name: str, value: ArrayLike, *, shape: tuple[int | None, ...] = ()) -> FloatArray:
    """Return `value` as a float array after checking its trailing shape, not its finiteness.

    Parameters
    ----------
    name, value, shape
        As for `finite_array`.

    Returns
    -------
    ndarray
        A float64 array; not a copy when `value` already is one.

    Raises
    ------
    TypeError
        If `value` is not numeric.
    ValueError
        If it has the wrong shape or is empty.

    Examples
    --------
    >>> number_array("windows", [[1, float("nan")]], shape=(None, None))
    array([[ 1., nan]])
    """
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
    _check_shape(name, array, shape)
    if array.size == 0:
        raise ValueError(
            f"{name}: expected at least one value, got shape {array.shape}; "
            "check what was selected before this call"
        )
    return array


def _check_shape(name: str, array: FloatArray, shape: tuple[int | None, ...]) -> None:
    if not shape:
        return
    fits = array.ndim >= len(shape)
    if fits:
        for want, have in zip(shape, array.shape[-len(shape) :], strict=True):
            fits = fits and (want is None or want == have)
    if not fits:
        wanted = ", ".join("n" if want is None else str(want) for want in shape)
        raise ValueError(
            f"{name}: expected shape (..., {wanted}), got {array.shape}; "
            "rows are observations, columns are coordinates"
        )


def positive(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as a float array after checking that it is finite and above zero.

    Parameters
    ----------
    name : str
        What the caller calls the quantity; it opens the error message.
    value : array_like
        The quantity, in any unit.

    Returns
    -------
    ndarray
        A float64 array.

    Raises
    ------
    ValueError
        If a value is NaN, infinite, zero or negative.

    Examples
    --------
    >>> float(positive("focal_length", 25e-3))
    0.025
    """
    array = finite_array(name, value)
    if (array <= 0).any():
        raise ValueError(
            f"{name}: expected values above zero, got a smallest value of {array.min():g}; "
            "check its sign and its unit"
        )
    return array


def weights_for(weights: ArrayLike | None, count: int) -> FloatArray:
    """Return `count` non-negative weights, all one where none are given.

    Parameters
    ----------
    weights : array_like, shape (..., count), or None
        Relative weights, zero allowed but not for all observations at once.
    count : int
        How many observations there are.

    Returns
    -------
    ndarray, shape (..., count)
        The weights as floats.

    Raises
    ------
    ValueError
        If a weight is negative or not finite, or if all are zero.

    Examples
    --------
    >>> weights_for(None, 2)
    array([1., 1.])
    """
    if weights is None:
        return np.ones(count)
    array = finite_array("weights", weights, shape=(count,))
    if (array < 0).any():
        raise ValueError(
            f"weights: expected zero or more, got a smallest weight of {array.min():g}; "
            "weights are inverse variances"
        )
    if (array.sum(axis=-1) <= 0).any():
        raise ValueError("weights: expected at least one above zero, got all zero; drop the set")
    return array


def non_negative(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as a float array after checking that it is finite and not below zero.

    Parameters
    ----------
    name : str
        What the caller calls the quantity; it opens the error message.
    value : array_like
        The quantity, in any unit: a standard deviation, for one.

    Returns
    -------
    ndarray
        A float64 array.

    Raises
    ------
    ValueError
        If a value is NaN, infinite or negative.

    Examples
    --------
    >>> float(non_negative("sigma", 0))
    0.0
    """
    array = finite_array(name, value)
    if (array < 0).any():
        raise ValueError(
            f"{name}: expected zero or more, got a smallest value of {array.min():g}; "
            "check its sign"
        )
    return array


def whole_number(name: str, value: int, *, least: int = 1) -> int:
    """Return `value` as an int after checking that it is whole and not below `least`.

    Parameters
    ----------
    name : str
        What the caller calls the count; it opens the error message.
    value : int
        The count; NumPy integers are welcome, booleans and floats are not.
    least : int
        The smallest value allowed.

    Returns
    -------
    int
        The count.

    Raises
    ------
    TypeError
        If `value` is not an integer.
    ValueError
        If it is below `least`.

    Examples
    --------
    >>> whole_number("replicates", 10)
    10
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
    """Return the batch shape that the named leading shapes broadcast to.

    Parameters
    ----------
    **batches : tuple of int
        The leading (batch) shape of each argument, by the argument's name.

    Returns
    -------
    tuple of int
        Their common shape under NumPy's broadcasting rules.

    Raises
    ------
    ValueError
        If they do not broadcast together.

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
