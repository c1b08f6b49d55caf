"""A relation that printed numbers should keep, declared in one line."""

from __future__ import annotations

import ast
import fnmatch
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Literal, get_args

import numpy as np

from reproduce.audit.formula import Arithmetic, Formula, FormulaError, Plain, evaluate, read
from reproduce.audit.quantity import Quantity, Sheet
from reproduce.printed.units import UNITS, si_factor

Kind = Literal[
    "equation", "definition", "arithmetic", "statistics", "geometry", "repeat", "order", "print"
]
KINDS: tuple[Kind, ...] = get_args(Kind)
# Which of two independent readings of a paper found a relation; "merging" if neither did, and it
# was seen when their lists were laid side by side.
Reading = Literal["", "first", "second", "both", "merging"]
READINGS: tuple[Reading, ...] = get_args(Reading)


@dataclass(frozen=True)
class Unknown:
    """A number that is not printed, but that several relations share.

    Parameters
    ----------
    name : str
        Its name in the formulas.
    unit : str
        The unit in which it is shown.
    low, high : float
        Where it may lie, in that unit.
    label : str
        What it is.
    """

    name: str
    unit: str
    low: float
    high: float
    label: str


@dataclass(frozen=True)
class Tolerance:
    """How far the two sides may lie apart beyond rounding, and why.

    Parameters
    ----------
    size : float
        Relative to the right side, or absolute in `unit`.
    reason : str
        The approximation that makes the relation less than exact.
    unit : str, optional
        The unit of an absolute tolerance; none for a relative one.
    """

    size: float
    reason: str
    unit: str | None = None

    @property
    def absolute(self) -> float:
        """The size in SI, for an absolute tolerance."""
        return self.size * si_factor(self.unit or "1")

    @property
    def text(self) -> str:
        """The size as a reader sees it."""
        return f"{self.size:.3g} {self.unit}" if self.unit else f"{100 * self.size:.3g} %"


@dataclass(frozen=True, eq=False)  # compared by identity, so that work on it can be cached
class Relation:
    """An equation or inequality between printed cells.

    Parameters
    ----------
    name : str
        Its only name.
    formula : Formula
        What should hold.
    binding : mapping of str to str or tuple of str
        The address (or, for a list, the addresses) behind each name of the formula.
    source : str
        Where the paper says so: an equation, a definition, geometry.
    kind : str
        What sort of relation it is. In one of kind ``print`` the names stand for the unit of the
        last printed digit, not for the value.
    unknown : Unknown, optional
        The number that is not printed.
    tolerance : Tolerance, optional
        Beyond rounding.
    claim : str, optional
        The paper's conclusion that rests on this relation.
    reading : str
        Which reading of the paper found it: ``first``, ``second``, ``both`` or ``merging``;
        empty where nobody counts.
    line : str
        The name of the declaration that it comes from.
    supposition : str
        What it supposes that the paper does not say; empty where it supposes nothing. Such a
        relation is counted apart, and no contradiction of the paper follows from it.
    """

    name: str
    formula: Formula
    binding: Mapping[str, str | tuple[str, ...]]
    source: str
    kind: Kind
    unknown: Unknown | None = None
    tolerance: Tolerance | None = None
    claim: str | None = None
    reading: Reading = ""
    line: str = ""
    supposition: str = ""

    @property
    def compares(self) -> bool:
        """Whether it holds the value of a printed number against that of another one."""
        shared = len(self.addresses) > 1 or self.unknown is not None
        return shared and self.kind != "print"

    @cached_property
    def repeats(self) -> bool:
        """Whether it says that one number is printed twice.

        Whatever the rounding rule, one number prints the same digits each time. Two prints that
        differ in the last digit touch at a tie that rounds to one of them, never to both.
        """
        bare = isinstance(self.formula.left, ast.Name) and isinstance(self.formula.right, ast.Name)
        return bare and self.formula.sign == "=" and self.tolerance is None and self.unknown is None

    @cached_property
    def addresses(self) -> tuple[str, ...]:
        """The cells of the relation, each once."""
        bound = (a if isinstance(a, tuple) else (a,) for a in self.binding.values())
        return tuple(dict.fromkeys(itertools.chain.from_iterable(bound)))

    @property
    def result(self) -> str | None:
        """The cell that the right side computes, if the formula is solved for one."""
        name = self.formula.result
        bound = self.binding.get(name) if name else None
        return bound if isinstance(bound, str) else None

    def values(self, by_address: Mapping[str, Any], unknown: Any = None) -> dict[str, Any]:
        """Return what the names of the formula stand for."""
        found: dict[str, Any] = {
            name: [by_address[a] for a in bound] if isinstance(bound, tuple) else by_address[bound]
            for name, bound in self.binding.items()
        }
        if self.unknown is not None:
            found[self.unknown.name] = unknown
        return found

    def sides(self, by_address: Mapping[str, float], unknown: float = 0.0) -> tuple[float, float]:
        """Return both sides at given values of the cells, in SI."""
        values = self.values(by_address, unknown)
        left, right = self.formula.plain
        return _number(left, values), _number(right, values)


def _number(side: Plain, values: Mapping[str, Any]) -> float:
    try:
        return float(side(values))
    except (ArithmeticError, ValueError):  # a division by zero, a root of a negative number
        return math.nan


class Book:
    """The relations of one paper or table, collected as they are declared.

    Parameters
    ----------
    cells : mapping of str to Quantity
        The printed numbers.

    Examples
    --------
    >>> from reproduce.audit.quantity import quantity
    >>> book = Book({a: quantity(a, t) for a, t in {"t#1.a": "1", "t#1.b": "2"}.items()})
    >>> book.relate("twice", "b = 2 * a", "by name", "definition", {"a": "t#1.a", "b": "t#1.b"})
    >>> [relation.name for relation in book.relations]
    ['twice']
    """

    def __init__(self, cells: Sheet) -> None:
        self.cells = cells
        self.relations: list[Relation] = []

    def relate(
        self,
        name: str,
        formula: str,
        source: str,
        kind: Kind,
        cells: Mapping[str, str],
        *,
        unknown: Unknown | None = None,
        within: Tolerance | None = None,
        claim: str | None = None,
        reading: Reading = "",
        line: str = "",
        supposition: str = "",
    ) -> None:
        """Declare a relation."""
        if kind not in KINDS:
            raise FormulaError(f"{name!r}: unknown kind {kind!r}; expected one of {KINDS}")
        if reading not in READINGS:
            raise FormulaError(f"{name!r}: unknown reading {reading!r}; expected one of {READINGS}")
        bound = {symbol: self._cells(where) for symbol, where in cells.items()}
        given = (bound, source, kind, unknown, within, claim, reading, line or name, supposition)
        relation = Relation(name, read(formula), *given)
        self._refuse(relation)
        self.relations.append(relation)

    def _cells(self, where: str) -> str | tuple[str, ...]:
        if not any(sign in where for sign in "*?["):
            if where not in self.cells:
                raise FormulaError(f"no printed number at {where!r}; check the address")
            return where
        found = tuple(a for a in self.cells if fnmatch.fnmatchcase(a, where))
        if not found:
            raise FormulaError(f"no printed number matches {where!r}; check the address")
        return found

    def _refuse(self, relation: Relation) -> None:
        known = set(relation.binding) | ({relation.unknown.name} if relation.unknown else set())
        if stray := known ^ set(relation.formula.names):
            raise FormulaError(f"{relation.formula.text!r}: bound or named only once: {stray}")
        if any(relation.name == other.name for other in self.relations):
            raise FormulaError(f"{relation.name!r} is declared twice; give each its own name")
        refuse_mixed_dimensions(relation, self.cells)


def refuse_mixed_dimensions(relation: Relation, cells: Mapping[str, Quantity]) -> None:
    """Raise a FormulaError if the two sides of a relation have different dimensions."""
    units = relation.values({a: cells[a].unit for a in relation.addresses})
    if relation.unknown is not None:
        units[relation.unknown.name] = relation.unknown.unit
    # Of a list, each unit once: how long it is says nothing about the dimension.
    once = {n: tuple(dict.fromkeys(u)) if isinstance(u, list) else u for n, u in units.items()}
    if fault := _mixed(relation.formula, tuple(once.items())):
        raise FormulaError(f"{relation.formula.text!r}: {fault}")


@cache
def _mixed(formula: Formula, units: tuple[tuple[str, str | tuple[str, ...]], ...]) -> str:
    """Return what is wrong with the dimensions of a formula; empty if nothing is."""
    import pint

    registry = pint.application_registry

    def of(unit: str) -> Any:
        return registry.Quantity(1.0, UNITS[unit][0])

    physical: Arithmetic = {
        **{"abs": abs, "min": min, "max": max},
        **{"sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "tan": np.tan, "atan": np.arctan},
    }
    values = {n: of(u) if isinstance(u, str) else [of(one) for one in u] for n, u in units}
    try:
        left, right = (
            registry.Quantity(evaluate(side, values, physical, of))
            for side in (formula.left, formula.right)
        )
    except pint.DimensionalityError as error:
        return str(error)
    if left.dimensionality == right.dimensionality:
        return ""
    return f"the left side is {left.dimensionality}, the right side {right.dimensionality}"
