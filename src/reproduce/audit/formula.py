"""A relation as one line of text, read once and evaluated on numbers, units or intervals.

A formula is a comparison between two expressions in named cells: ``motion = position - first``,
``abs(difference) <= bound``. Units are written ``u.arcsec``; a cell stands for its SI value.
"""

from __future__ import annotations

import ast
import functools
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from reproduce.printed.units import UNITS, si_factor

__all__ = ["Formula", "FormulaError", "Side", "functions", "read"]

_SIGNS: dict[type[ast.cmpop], str] = {ast.Eq: "=", ast.LtE: "<=", ast.GtE: ">="}
_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div)
_OF_ONE = ("abs", "sqrt", "sin", "cos", "tan", "atan")
_OF_LISTS = ("mean", "rms", "sum", "min", "max", "count")
Functions = dict[str, Any]


class FormulaError(ValueError):
    """A formula is not one that the audit can read; the message says what is expected."""


def functions(known: Mapping[str, Callable[..., Any]]) -> Functions:
    """Return what formulas may call in some arithmetic, made of `min`, `max` and those of one."""
    lists = {name: functools.partial(_of_list, name, known) for name in _OF_LISTS}
    return {"__builtins__": {}, **{name: known[name] for name in _OF_ONE}, **lists}


def _of_list(name: str, known: Mapping[str, Callable[..., Any]], *arguments: Any) -> Any:
    entries = [x for entry in arguments for x in (entry if isinstance(entry, list) else [entry])]
    if name == "count":
        return len(entries)
    if name in {"min", "max"}:
        return functools.reduce(known[name], entries)
    if name == "rms":
        return known["sqrt"](_total([x * x for x in entries]) / len(entries))
    total = _total(entries)
    return total / len(entries) if name == "mean" else total


def _total(entries: list[Any]) -> Any:
    return functools.reduce(operator.add, entries)


FLOATS = functions(
    {"abs": abs, "min": min, "max": max, **{n: getattr(math, n) for n in _OF_ONE[1:]}}
)


class Side(Protocol):
    """One side of a formula, evaluated in any arithmetic."""

    def __call__(
        self,
        values: Mapping[str, Any],
        known: Functions = FLOATS,
        unit: Callable[[str], Any] = si_factor,
    ) -> Any:
        """Return its value for what its names, functions and units stand for."""


@dataclass(frozen=True)
class Formula:
    """A comparison between two expressions: its text, its sides, and the cells in order.

    `sign` is ``=``, ``<=`` or ``>=``; `result` is the name that stands alone on the left of an
    equation, empty if none does; `bare` tells whether both sides are nothing but a name.
    """

    text: str
    left: Side
    right: Side
    sign: str
    names: tuple[str, ...]
    result: str
    bare: bool

    def __reduce__(self) -> tuple[Callable[[str], Formula], tuple[str]]:
        """Keep the text alone, from which it can be read again."""
        return read, (self.text,)


@functools.cache
def read(text: str) -> Formula:
    """Read a formula.

    Examples
    --------
    >>> formula = read("motion = 2 * position - first")
    >>> formula.names, formula.right({"position": 5.0, "first": 1.0})
    (('motion', 'position', 'first'), 9.0)
    """
    try:
        tree = ast.parse(re.sub(r"(?<![<>=])=(?!=)", "==", text), mode="eval").body
    except SyntaxError as error:
        raise FormulaError(f"{text!r}: expected a formula such as 'a = b - c'") from error
    if not isinstance(tree, ast.Compare) or len(tree.ops) != 1 or type(tree.ops[0]) not in _SIGNS:
        raise FormulaError(f"{text!r}: expected two expressions with one of = <= >= between them")
    names: dict[str, None] = {}
    left, right = tree.left, tree.comparators[0]
    for side in (left, right):
        _check(side, text, names)
    sign = _SIGNS[type(tree.ops[0])]
    result = left.id if isinstance(left, ast.Name) and sign == "=" else ""
    bare = isinstance(left, ast.Name) and isinstance(right, ast.Name)
    return Formula(text, _compiled(left), _compiled(right), sign, tuple(names), result, bare)


def _check(node: ast.expr, text: str, names: dict[str, None]) -> None:
    """Refuse what is not arithmetic with the known functions, and collect the names."""
    match node:
        case ast.Constant(value=int() | float()):
            return
        case ast.Attribute(value=ast.Name(id="u"), attr=unit) if unit in UNITS:
            return
        case ast.Name(id=name):
            names.setdefault(name)
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            _check(inner, text, names)
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(value=int())):
            _check(base, text, names)
        case ast.BinOp(left=one, op=op, right=two) if isinstance(op, _OPERATORS):
            _check(one, text, names)
            _check(two, text, names)
        case ast.Call(func=ast.Name(id=name), args=[*inner], keywords=[]) if (
            inner and name in _OF_ONE + _OF_LISTS
        ):
            for one in inner:
                _check(one, text, names)
        case _:
            raise FormulaError(
                f"{text!r}: cannot read {ast.unparse(node)!r}; expected names, numbers, "
                f"+ - * / **, units as u.mm, and {', '.join(_OF_ONE + _OF_LISTS)}"
            )


class _LookUp(ast.NodeTransformer):
    """Turn names and units into what is looked up when the formula is evaluated."""

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Look a value up, since a cell may be called as a function is."""
        return ast.Subscript(ast.Name("values", ast.Load()), ast.Constant(node.id), ast.Load())

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Ask for the value of a unit."""
        return ast.Call(ast.Name("unit", ast.Load()), [ast.Constant(node.attr)], [])

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Leave the name of a function alone."""
        return ast.Call(node.func, [self.visit(entry) for entry in node.args], [])


def _compiled(side: ast.expr) -> Side:
    """Compile a side, of which `_check` has seen that it is arithmetic with known functions."""
    tree = ast.fix_missing_locations(ast.Expression(_LookUp().visit(side)))
    code = compile(tree, "<formula>", "eval")

    def value(
        values: Mapping[str, Any],
        known: Functions = FLOATS,
        unit: Callable[[str], Any] = si_factor,
    ) -> Any:
        return eval(code, known, {"values": values, "unit": unit})

    return value
