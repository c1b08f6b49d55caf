"""Relations between printed numbers, declared in a TOML file with one line each.

The file has three parts: ``[unknown]`` contains numbers that are not printed, ``[tolerance]``
contains allowed differences with their reasons, and ``[relations]`` contains topics, each a list of
lines. ``cells`` binds the names of the formula to addresses, ``"a=table-1#x.y b=table-1#x.*"``.
``each`` gives values to placeholders in braces, and a key such as ``"i,j"`` gives two values
together, ``["1,2", "2,3"]``: ``motion-{state}-{axis}`` is the declaration of ``motion-4-y``.

A formula compares two expressions in named cells: ``motion = position - first``,
``abs(difference) <= bound``. Units are written ``u.arcsec``. A cell has its value in SI units.
"""

from __future__ import annotations

import fnmatch
import itertools
import math
import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from reproduce.printed.cells import PrintedCell
from reproduce.printed.number import UNITS, Interval, si_factor

# Address to printed number.
Sheet = Mapping[str, PrintedCell]
# The independent reading of the paper that found a relation: "first", "second" or "both", "merging"
# for the comparison of their lists or a later reader who knew them, "third" for a later reader who
# knew no list; empty for a relation that is not counted.
Finder = Literal["", "first", "second", "both", "merging", "third"]


def _of_all(function: Callable[[Any], Any]) -> Callable[..., float]:
    """Return a function of several numbers and lists of numbers."""
    return lambda *parts: float(function(np.hstack(parts)))


# The names that a formula may contain, besides its cells.
_SCOPE: dict[str, Any] = {
    "u": SimpleNamespace(**{unit: si_factor(unit) for unit in UNITS}),
    "abs": abs,
    **{name: getattr(math, name) for name in ("sqrt", "sin", "tan", "atan")},
    **{name: _of_all(getattr(np, name)) for name in ("sum", "mean", "min", "max")},
    "count": _of_all(np.size),
    "rms": _of_all(lambda numbers: np.sqrt(np.mean(numbers**2))),
}


class Formula:
    """A comparison between two expressions, of the form ``left = right``, ``<=`` or ``>=``.

    `result` is the name that is the whole left side of an equation, or empty. `bare` is true if
    its right side is a name too. `names` are those of its cells, functions and units.

    Examples
    --------
    >>> formula = Formula("motion = 2 * position - first")
    >>> formula.result, formula.values({"motion": 9.0, "position": 5.0, "first": 1.0})[:2]
    ('motion', [9.0, 9.0])
    """

    def __init__(self, text: str) -> None:
        left, self.sign, right = re.split(r"\s*([<>]?=)\s*", text)
        self.text = text
        self.result = left if left.isidentifier() and self.sign == "=" else ""
        self.bare = self.result != "" and right.isidentifier()
        terms = [left]
        if left.startswith("abs(") and self.sign == "<=":
            # An absolute value is below a limit if the value and its negative are.
            terms = [left.replace("abs(", sign, 1) for sign in ("(", "-(")]
        self._codes = [
            compile(side, "<formula>", "eval") for side in (left, right, *terms)
        ]
        self.names = {name for code in self._codes for name in code.co_names}

    def values(self, scope: Mapping[str, Any]) -> list[Any]:
        """Return both sides, then the left sides that must all be below a limit.

        Parameters
        ----------
        scope : mapping
            Values of the cells by name, and other functions or units.

        Returns
        -------
        list of float
            Values in SI units.
        """
        scope = {"__builtins__": {}, **_SCOPE, **scope}
        return [eval(code, scope) for code in self._codes]


class _Declared(BaseModel):
    """Base of the declared objects."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


class _Unknown(_Declared):
    """A number of several relations that is not printed; `low` and `high` are in `unit`."""

    name: str
    unit: str
    low: float
    high: float
    label: str

    @property
    def domain(self) -> Interval:
        """Interval of its values, in SI units."""
        factor = si_factor(self.unit)
        return self.low * factor, self.high * factor


class _Tolerance(_Declared):
    """Allowed difference between two sides beyond rounding, and the reason.

    The size is relative to the right side or, with a unit, absolute in that unit.
    """

    name: str
    size: float
    reason: str
    unit: str = ""

    def of(self, right: float) -> float:
        """Return the allowed difference from a right side, in SI units."""
        return self.size * (si_factor(self.unit) if self.unit else right)

    def __str__(self) -> str:
        """Return the size with its unit, or in per cent, and the reason."""
        size, unit = (self.size, self.unit) if self.unit else (100 * self.size, "%")
        return f"{size:.3g} {unit}: {self.reason}"


class Relation(_Declared):
    """An equation or inequality between printed cells.

    - `name`: name of the relation.
    - `formula`: comparison. If the kind is ``print``, its names stand for the unit of the last
      printed digit.
    - `binding`: name in the formula to an address, or to the addresses of a list of numbers.
    - `source`: passage of the paper: an equation, a definition, or geometry.
    - `kind`: kind of evidence.
    - `unknown`, `tolerance`: number that is not printed, and allowed difference.
    - `restates`: cell that the package computes by another function, with its reading. Such a
      relation is a second entry of this computation, and no further evidence.
    - `claim`: conclusion of the paper that depends on it.
    - `found_by`: reading of the paper that found it.
    - `assumption`: assumption that the paper does not state. Such a relation is counted
      separately, and is no evidence of a contradiction in the paper.
    """

    name: str
    formula: Formula
    binding: Mapping[str, list[str]]
    source: str
    kind: Literal[
        "equation",
        "definition",
        "arithmetic",
        "statistics",
        "geometry",
        "repeat",
        "order",
        "print",
    ]
    unknown: _Unknown | None = None
    tolerance: _Tolerance | None = None
    restates: str = ""
    claim: str | None = None
    found_by: Finder = ""
    assumption: str = ""

    @property
    def repeats(self) -> bool:
        """Whether it states that one number is printed twice.

        For any rounding rule, one number has the same printed digits each time. Two printed numbers
        that differ in the last digit have a tie in common, which rounds to only one of them.
        """
        exact = self.tolerance is None and self.unknown is None
        return exact and self.formula.bare

    @property
    def addresses(self) -> list[str]:
        """The addresses of its cells, each once."""
        return list(dict.fromkeys(itertools.chain(*self.binding.values())))

    @property
    def result(self) -> str | None:
        """The cell that the right side computes, if the formula is solved for one."""
        bound = self.binding.get(self.formula.result, ())
        return bound[0] if len(bound) == 1 else None

    def values(
        self, by_address: Mapping[str, float], unknown: float = 0.0
    ) -> list[float]:
        """Return the values of the formula in SI units; NaN where it is not defined."""
        scope: dict[str, Any] = {self.unknown.name: unknown} if self.unknown else {}
        for name, bound in self.binding.items():
            values = [by_address[address] for address in bound]
            scope[name] = values if len(values) > 1 else values[0]
        try:
            return self.formula.values(scope)
        except (ArithmeticError, ValueError):  # such as a root of a negative number
            return [math.nan] * 3


def declarations(paper: str) -> dict[str, Any]:
    """Return the declared relations and equations of a paper; empty without a file."""
    file = Path(__file__).parent / "relations" / f"{paper}.toml"
    return tomllib.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def declared(
    content: Mapping[str, Any], cells: Sheet, prefix: str = ""
) -> list[Relation]:
    """Return relations in the order of their declaration.

    Parameters
    ----------
    content : mapping
        Parsed declarations.
    cells : mapping
        Printed numbers by address.
    prefix : str
        Prefix of the addresses in the declarations, such as ``niu2024/``.

    Returns
    -------
    list of Relation
        Relations with their cells and their formula.

    Raises
    ------
    ValueError
        If a line has an unknown entry, two lines have one name, or the names of a formula are not
        those of its cells.
    """
    relations: dict[str, Relation] = {}
    for line in itertools.chain(*content.get("relations", {}).values()):
        named = {
            part: {"name": line[part], **content[part][line[part]]}
            for part in ("unknown", "tolerance")
            if part in line
        }
        each = line.get("each", {})
        names = ",".join(each).split(",")
        for chosen in itertools.product(*each.values()):
            values = zip(names, ",".join(chosen).split(","), strict=True)
            relation = _relation(line | named, dict(values), cells, prefix)
            if relation.name in relations:
                raise ValueError(
                    f"{relation.name}: expected a name that is not declared twice. Rename it"
                )
            relations[relation.name] = relation
    return list(relations.values())


def _relation(
    line: Mapping[str, Any], values: Mapping[str, str], cells: Sheet, prefix: str
) -> Relation:
    """Return the relation of a line with values of its placeholders."""
    fields = {
        key: value.format(**values) if isinstance(value, str) else value
        for key, value in line.items()
        if key != "each"
    }
    pairs = (pair.split("=", 1) for pair in fields.pop("cells").split())
    if "restates" in line:
        fields["restates"] = prefix + fields["restates"]
    fields |= {
        "name": re.sub(r"[^a-zA-Z0-9]+", "-", fields["name"]).strip("-"),
        "formula": Formula(fields["formula"]),
        "binding": {name: _bound(prefix + to, cells) for name, to in pairs},
    }
    relation = Relation.model_validate(fields)
    names, known = set(relation.binding), _SCOPE.keys() | UNITS.keys()
    if relation.unknown:
        names.add(relation.unknown.name)
    if strays := names ^ (relation.formula.names - (known - names)):
        raise ValueError(
            f"{relation.name}: expected names with one cell each, got {strays}. Bind them"
        )
    if relation.restates and relation.restates.partition(" (")[0] != relation.result:
        raise ValueError(
            f"{relation.name}: expected a formula solved for {relation.restates}, got "
            f"{relation.formula.text}. Solve it"
        )
    return relation


def _bound(pattern: str, cells: Sheet) -> list[str]:
    """Return the addresses behind a name of a formula."""
    matches = fnmatch.filter(cells, pattern)
    if not matches:
        raise ValueError(
            f"cells: expected an address, got {pattern!r}, which matches no printed number. "
            "Check it"
        )
    return matches
