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
from typing import Any

from reproduce.printed.units import UNITS, si_factor

_SIGNS: dict[type[ast.cmpop], str] = {ast.Eq: "=", ast.LtE: "<=", ast.GtE: ">="}
_OPERATORS: dict[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
}
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
    match name:
        case "count":
            return len(entries)
        case "min" | "max":
            return functools.reduce(known[name], entries)
        case "rms":
            mean = functools.partial(_of_list, "mean", known)
            return known["sqrt"](mean([x * x for x in entries]))
    total = functools.reduce(operator.add, entries)
    return total / len(entries) if name == "mean" else total


FLOATS = functions(
    {"abs": abs, "min": min, "max": max, **{n: getattr(math, n) for n in _OF_ONE[1:]}}
)


# One side of a formula: its value for what its names, functions and units stand for, in any
# arithmetic; by default in floats.
Side = Callable[..., Any]


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
    left, right = tree.left, tree.comparators[0]
    names: dict[str, None] = {}
    sides = [_compiled(_checked(side, text, names)) for side in (left, right)]
    sign = _SIGNS[type(tree.ops[0])]
    result = left.id if isinstance(left, ast.Name) and sign == "=" else ""
    bare = isinstance(left, ast.Name) and isinstance(right, ast.Name)
    return Formula(text, sides[0], sides[1], sign, tuple(names), result, bare)


def _checked(node: ast.expr, text: str, names: dict[str, None]) -> str:
    """Write out arithmetic with the known functions, names and units looked up; refuse all else."""

    def inner(part: ast.expr) -> str:
        return _checked(part, text, names)

    match node:
        case ast.Constant(value=int() | float() as number):
            return repr(float(number))  # whole ones would grow without end in 9 ** 99999999
        case ast.Attribute(value=ast.Name(id="u"), attr=unit) if unit in UNITS:
            return f"unit({unit!r})"
        case ast.Name(id=name):
            names.setdefault(name)
            return f"values[{name!r}]"  # looked up, since a cell may be called as a function is
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return f"(-{inner(operand)})"
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(value=int() as exponent)):
            return f"({inner(base)} ** {exponent})"
        case ast.BinOp(left=one, op=operation, right=two) if type(operation) in _OPERATORS:
            return f"({inner(one)} {_OPERATORS[type(operation)]} {inner(two)})"
        case ast.Call(func=ast.Name(id=name), args=[*parts], keywords=[]) if (
            parts and name in _OF_ONE + _OF_LISTS
        ):
            return f"{name}({', '.join(map(inner, parts))})"
    raise FormulaError(
        f"{text!r}: cannot read {ast.unparse(node)!r}; expected names, numbers, "
        f"+ - * / **, units as u.mm, and {', '.join(_OF_ONE + _OF_LISTS)}"
    )


def _compiled(side: str) -> Side:
    code = compile(side, "<formula>", "eval")

    def value(
        values: Mapping[str, Any],
        known: Functions = FLOATS,
        unit: Callable[[str], Any] = si_factor,
    ) -> Any:
        return eval(code, known, {"values": values, "unit": unit})

    return value
