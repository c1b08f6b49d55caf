"""A relation as one line of text, read once and evaluated on numbers, units or intervals.

A formula is a comparison between two expressions in named cells: ``motion = position - first``,
``abs(difference) <= bound``. Units are written ``u.arcsec``; a cell stands for its SI value.
"""

from __future__ import annotations

import ast
import copy
import functools
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from reproduce.printed.units import UNITS, si_factor

SIGNS: dict[type[ast.cmpop], str] = {ast.Eq: "=", ast.LtE: "<=", ast.GtE: ">="}
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
SINGLE = ("abs", "sqrt", "sin", "cos", "tan", "atan")
LISTS = ("mean", "rms", "sum", "min", "max", "count")
Arithmetic = Mapping[str, Callable[..., Any]]
Plain = Callable[[Mapping[str, Any]], Any]
FLOATS: Arithmetic = {
    "abs": abs,
    "min": min,
    "max": max,
    **{name: getattr(math, name) for name in ("sqrt", "sin", "cos", "tan", "atan")},
}


class FormulaError(ValueError):
    """A formula is not one that the audit can read; the message says what is expected."""


@dataclass(frozen=True)
class Formula:
    """A comparison between two expressions.

    Parameters
    ----------
    text : str
        The formula as written.
    left, right : ast.expr
        Its two sides.
    sign : str
        ``=``, ``<=`` or ``>=``.
    names : tuple of str
        The cells it names, in order of appearance.
    """

    text: str
    left: ast.expr
    right: ast.expr
    sign: str
    names: tuple[str, ...]

    @functools.cached_property
    def plain(self) -> tuple[Plain, Plain]:
        """The two sides as functions of plain values: what `evaluate` says, and quicker."""
        return _compiled(self.left), _compiled(self.right)

    @property
    def result(self) -> str | None:
        """The name on the left if it stands there alone in an equation, else None."""
        alone = isinstance(self.left, ast.Name) and self.sign == "="
        return self.left.id if alone and isinstance(self.left, ast.Name) else None


@functools.cache
def read(text: str) -> Formula:
    """Read a formula.

    Examples
    --------
    >>> read("motion = position - first").names
    ('motion', 'position', 'first')
    """
    try:
        tree = ast.parse(re.sub(r"(?<![<>=])=(?!=)", "==", text), mode="eval").body
    except SyntaxError as error:
        raise FormulaError(f"{text!r}: expected a formula such as 'a = b - c'") from error
    if not isinstance(tree, ast.Compare) or len(tree.ops) != 1 or type(tree.ops[0]) not in SIGNS:
        raise FormulaError(f"{text!r}: expected two expressions with one of = <= >= between them")
    names: dict[str, None] = {}
    for side in (tree.left, tree.comparators[0]):
        _check(side, text, names)
    sign = SIGNS[type(tree.ops[0])]
    return Formula(text, tree.left, tree.comparators[0], sign, tuple(names))


def _check(node: ast.expr, text: str, names: dict[str, None]) -> None:
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
        case ast.BinOp(left=one, op=op, right=two) if type(op) in _BINARY:
            _check(one, text, names)
            _check(two, text, names)
        case ast.Call(func=ast.Name(id=name), args=[*inner], keywords=[]) if (
            inner and name in SINGLE + LISTS
        ):
            for one in inner:
                _check(one, text, names)
        case _:
            raise FormulaError(
                f"{text!r}: cannot read {ast.unparse(node)!r}; expected names, numbers, "
                f"+ - * / **, units as u.mm, and {', '.join(SINGLE + LISTS)}"
            )


def evaluate(
    node: ast.expr,
    values: Mapping[str, Any],
    functions: Arithmetic = FLOATS,
    unit: Callable[[str], Any] = si_factor,
) -> Any:
    """Evaluate one side of a formula in any arithmetic.

    Examples
    --------
    >>> evaluate(read("a = b - 2 * c").right, {"b": 5.0, "c": 1.0})
    3.0
    """
    go = functools.partial(evaluate, values=values, functions=functions, unit=unit)
    match node:
        case ast.Constant(value=number):
            return number
        case ast.Attribute(attr=name):
            return unit(name)
        case ast.Name(id=name):
            return values[name]
        case ast.UnaryOp(operand=inner):
            return -go(inner)
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(value=power)):
            return go(base) ** power
        case ast.BinOp(left=one, op=op, right=two):
            return _BINARY[type(op)](go(one), go(two))
        case ast.Call(func=ast.Name(id=name), args=inner) if name in SINGLE:
            return functions[name](go(inner[0]))
        case ast.Call(func=ast.Name(id=name), args=inner):
            return _of_list(name, [go(one) for one in inner], functions)
    raise FormulaError(f"cannot evaluate {ast.unparse(node)!r}")


def _of_list(name: str, arguments: Sequence[Any], functions: Arithmetic) -> Any:
    entries = [x for entry in arguments for x in (entry if isinstance(entry, list) else [entry])]
    if name == "count":
        return len(entries)
    if name in {"min", "max"}:
        return functools.reduce(functions[name], entries)
    if name == "rms":
        return functions["sqrt"](_total([x * x for x in entries]) / len(entries))
    total = _total(entries)
    return total / len(entries) if name == "mean" else total


class _Looked(ast.NodeTransformer):
    """Turn names into values that are looked up, and units into numbers."""

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Look a value up, since a cell may be called as a function is."""
        return ast.Subscript(ast.Name("values", ast.Load()), ast.Constant(node.id), ast.Load())

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Put down the SI value of a unit."""
        return ast.Constant(si_factor(node.attr))

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Leave the name of a function alone."""
        return ast.Call(node.func, [self.visit(entry) for entry in node.args], [])


def _compiled(side: ast.expr) -> Plain:
    """Compile a side, of which `read` has seen that it is arithmetic with the known functions."""
    tree = ast.Expression(_Looked().visit(copy.deepcopy(side)))
    code = compile(ast.fix_missing_locations(tree), "<formula>", "eval")
    return lambda values: eval(code, _PLAIN, {"values": values})


_PLAIN = {
    "__builtins__": {},
    **{name: FLOATS[name] for name in SINGLE},
    **{name: (lambda *entries, name=name: _of_list(name, entries, FLOATS)) for name in LISTS},
}


def _total(entries: list[Any]) -> Any:
    return functools.reduce(operator.add, entries)
