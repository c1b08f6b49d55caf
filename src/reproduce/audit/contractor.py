"""The door to codac, the library that narrows intervals through a formula.

Its interval arithmetic (gaol) leaves the processor rounding upwards, for the whole process, from
the moment it is imported. Every other computation would then differ in its last bit, so each
visit puts the rounding mode back to what it was.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import functools
import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from reproduce.audit.formula import evaluate
from reproduce.audit.quantity import Interval
from reproduce.audit.relation import Relation

_FUNCTIONS = ("abs", "min", "max", "sqrt", "sin", "cos", "tan", "atan")
_TARGETS = {
    "=": (0.0, 0.0),
    "<=": (-float("inf"), 0.0),
    ">=": (0.0, float("inf")),
}
Contract = Callable[[tuple[Interval, ...]], list[Interval] | None]


@functools.cache
def _processor() -> Any:
    """Return the C library that reads and sets the rounding mode."""
    name = "ucrtbase" if sys.platform == "win32" else ctypes.util.find_library("m")
    return ctypes.CDLL(name)


def rounding_mode() -> int:
    """Return the processor's rounding mode, as C's ``fegetround`` does."""
    return int(_processor().fegetround())


@functools.cache
def _library() -> tuple[Any, int]:
    """Import codac; return it with the rounding mode in which it works."""
    before = rounding_mode()
    codac = importlib.import_module("codac")
    inside = rounding_mode()
    _processor().fesetround(before)
    return codac, inside


@contextmanager
def visit() -> Iterator[Any]:
    """Work with codac in its own rounding mode, and leave the processor as it was.

    Yields
    ------
    module
        The codac package.
    """
    codac, inside = _library()
    before = rounding_mode()
    _processor().fesetround(inside)
    try:
        yield codac
    finally:
        _processor().fesetround(before)


@functools.lru_cache(maxsize=5_000)
def contractor(relation: Relation) -> Contract:
    """Compile a relation to a function that narrows a box of intervals.

    Parameters
    ----------
    relation : Relation
        The relation.

    Returns
    -------
    callable
        Takes one interval for each address, then one for the unknown and one for the departure
        that the tolerance allows; returns them narrowed, or None if nothing is left.
    """
    size = len(relation.addresses) + 2
    with visit() as codac:
        x = codac.VectorVar(size)
        by_address = {name: x[i] for i, name in enumerate(relation.addresses)}
        values = relation.values(by_address, x[size - 2])
        functions = {name: getattr(codac, name) for name in _FUNCTIONS}
        left, right = (
            evaluate(side, values, functions)
            for side in (relation.formula.left, relation.formula.right)
        )
        relative = relation.tolerance is not None and relation.tolerance.unit is None
        right = right * (1 + x[size - 1]) if relative else right + x[size - 1]
        target = codac.Interval(*_TARGETS[relation.formula.sign])
        inverse = codac.CtcInverse(codac.AnalyticFunction([x], left - right), target)

    def contract(box: tuple[Interval, ...]) -> list[Interval] | None:
        with visit() as codac:
            inside = codac.IntervalVector([[low, high] for low, high in box])
            inverse.contract(inside)
            if inside.is_empty():
                return None
            return [(inside[i].lb(), inside[i].ub()) for i in range(size)]

    return contract
