"""Relations that printed numbers should keep, declared in a TOML text, one line each.

The text has three parts: ``[unknown]`` names numbers that are not printed, ``[tolerance]`` names
departures with their reasons, and ``[relations]`` holds topics, each a list of
``{ name, formula, cells, source, kind, each, unknown, tolerance, claim, reading, supposition,
restates }``. ``cells`` binds the names of the formula to addresses, ``"a=table-1#x.y
b=table-1#x.*"``. ``each`` gives values to placeholders in braces, and a key such as ``"i,j"`` gives
them together: ``motion-{state}-{axis}`` is the declaration of ``motion-4-y``, as every view says.
"""

from __future__ import annotations

import fnmatch
import importlib.resources
import itertools
import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Literal, get_args

import numpy as np

from reproduce.audit.formula import Formula, FormulaError, Side, functions, read
from reproduce.audit.rounding import Sheet
from reproduce.printed.number import Interval
from reproduce.printed.units import UNITS, si_factor

RelationKind = Literal[
    "equation", "definition", "arithmetic", "statistics", "geometry", "repeat", "order", "print"
]
# Which of two independent readings of a paper found a relation; "merging" if neither did, and it
# was seen when their lists were laid side by side; "third" if a later one, which knew neither list,
# was the first to find it; empty where nobody counts.
Finder = Literal["", "first", "second", "both", "merging", "third"]
_NEEDED = {"name", "formula", "cells", "source", "kind"}
_KNOWN = _NEEDED | {"each", "unknown", "tolerance", "claim", "reading", "supposition", "restates"}


@dataclass(frozen=True)
class Unknown:
    """A number that is not printed, but that several relations share; `low`, `high` in `unit`."""

    name: str
    unit: str
    low: float
    high: float
    label: str

    @property
    def domain(self) -> Interval:
        """Where it may lie, in SI."""
        factor = si_factor(self.unit)
        return self.low * factor, self.high * factor


@dataclass(frozen=True)
class Tolerance:
    """How far two sides may lie apart beyond rounding, and why.

    The size is relative to the right side or, with a unit, absolute in that unit.
    """

    size: float
    reason: str
    unit: str | None = None

    @property
    def si(self) -> float:
        """The size in SI if it is absolute, else the share of the right side."""
        return self.size * si_factor(self.unit) if self.unit else self.size

    @property
    def text(self) -> str:
        """The size as a reader sees it."""
        return f"{self.size:.3g} {self.unit}" if self.unit else f"{100 * self.size:.3g} %"


@dataclass(frozen=True, eq=False)  # compared by identity, so that work on it can be cached
class Relation:
    """An equation or inequality between printed cells.

    In one of kind ``print`` the names of the formula stand for the unit of the last printed digit.
    """

    name: str
    # The name of its declaration, with the placeholders.
    declared: str
    formula: Formula
    # The address (or, for a list, the addresses) behind each name of the formula.
    binding: Mapping[str, str | tuple[str, ...]]
    # Where the paper says so: an equation, a definition, geometry.
    source: str
    kind: RelationKind
    unknown: Unknown | None = None
    tolerance: Tolerance | None = None
    # The paper's conclusion that rests on it.
    claim: str | None = None
    reading: Finder = ""
    # What it supposes that the paper does not say. Such a relation is counted apart, and no
    # contradiction of the paper follows from it.
    supposition: str = ""
    # The number that the library computes by a function of its own, a cell or one reading of it.
    # Such a relation is a second entry of that computation, and no further evidence.
    restates: str = ""

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
        exact = self.formula.sign == "=" and self.tolerance is None and self.unknown is None
        return exact and self.formula.bare

    @cached_property
    def addresses(self) -> tuple[str, ...]:
        """The cells of the relation, each once."""
        bound = (a if isinstance(a, tuple) else (a,) for a in self.binding.values())
        return tuple(dict.fromkeys(itertools.chain.from_iterable(bound)))

    @cached_property
    def variables(self) -> tuple[str, ...]:
        """The cells of the relation, and its unknown if it has one."""
        return (*self.addresses, *([self.unknown.name] if self.unknown else []))

    @property
    def result(self) -> str | None:
        """The cell that the right side computes, if the formula is solved for one."""
        bound = self.binding.get(self.formula.result)
        return bound if isinstance(bound, str) else None

    def values(self, by_address: Mapping[str, Any], unknown: Any = None) -> dict[str, Any]:
        """Return what the names of the formula stand for."""
        found: dict[str, Any] = {
            name: [by_address[a] for a in bound] if isinstance(bound, tuple) else by_address[bound]
            for name, bound in self.binding.items()
        }
        return found if self.unknown is None else {**found, self.unknown.name: unknown}

    def sides(self, by_address: Mapping[str, float], unknown: float = 0.0) -> tuple[float, float]:
        """Return both sides at given values of the cells, in SI; NaN where one has none."""
        values = self.values(by_address, unknown)
        return _number(self.formula.left, values), _number(self.formula.right, values)

    def missed_by(self, left: float, right: float) -> float:
        """Return by how much two sides miss the relation; at most zero where they keep it."""
        missed = {"=": abs(left - right), "<=": left - right, ">=": right - left}
        return missed[self.formula.sign]


def _number(side: Side, values: Mapping[str, Any]) -> float:
    try:
        return float(side(values))
    except (ArithmeticError, ValueError):  # a division by zero, a root of a negative number
        return math.nan


def relations_of(paper: str, cells: Sheet) -> list[Relation]:
    """Return the relations that the printed numbers of a paper should keep, as declared.

    None of a paper without a file of relations. A test holds their dimensions; doing so each time
    would take longer than to judge them.
    """
    file = importlib.resources.files("reproduce.audit") / "relations" / f"{paper}.toml"
    text = file.read_text(encoding="utf-8") if file.is_file() else "relations = {}"
    return declared(text, cells, f"{paper}/", dimensions=False)


def declared(
    text: str, cells: Sheet, prefix: str = "", *, dimensions: bool = True
) -> list[Relation]:
    """Read relations from a TOML text, in order of declaration.

    Their dimensions are checked unless it is said that they are known to fit.

    Examples
    --------
    >>> from reproduce.audit.rounding import printed_cell
    >>> table = {a: printed_cell(a, text) for a, text in {"t#1.a": "2", "t#1.b": "3"}.items()}
    >>> line = '{ name = "less", formula = "a <= b", cells = "a=t#1.a b=t#1.b", kind = "order",'
    >>> text = "[relations]\\nall = [" + line + ' source = "by nature" }]'
    >>> [relation.name for relation in declared(text, table)]
    ['less']
    """
    content = tomllib.loads(text)
    unknowns = {n: Unknown(n, **given) for n, given in content.get("unknown", {}).items()}
    tolerances = {n: Tolerance(**given) for n, given in content.get("tolerance", {}).items()}
    relations: dict[str, Relation] = {}
    for line in itertools.chain.from_iterable(content["relations"].values()):
        _refuse_line(line, unknowns, tolerances)
        for place in _places(line.get("each", {})):
            made = _relation(line, place, cells, prefix, unknowns, tolerances)
            _refuse(made)
            if dimensions:
                _refuse_mixed(made, cells)
            if made.name in relations:
                raise FormulaError(
                    f"{made.name!r} is declared twice; give each its own name, and put every "
                    "placeholder of each = {...} into it"
                )
            relations[made.name] = made
    return list(relations.values())


def _relation(
    line: Mapping[str, Any],
    place: Mapping[str, str],
    cells: Sheet,
    prefix: str,
    unknowns: Mapping[str, Unknown],
    tolerances: Mapping[str, Tolerance],
) -> Relation:
    marks = {key: re.sub(r"[^a-zA-Z0-9]", "-", value).strip("-") for key, value in place.items()}
    bound = dict(pair.split("=", 1) for pair in line["cells"].format(**place).split())
    restates = line.get("restates", "").format(**place)
    return Relation(
        name=re.sub("-+", "-", line["name"].format(**marks)).strip("-"),
        declared=line["name"],
        formula=read(line["formula"].format(**place)),
        binding={name: _bound(prefix + where, cells) for name, where in bound.items()},
        source=line["source"],
        kind=line["kind"],
        unknown=unknowns.get(line.get("unknown", "")),
        tolerance=tolerances.get(line.get("tolerance", "")),
        claim=line.get("claim"),
        reading=line.get("reading", ""),
        supposition=line.get("supposition", ""),
        restates=restates and prefix + restates,
    )


def _bound(where: str, cells: Sheet) -> str | tuple[str, ...]:
    """Return the address, or for a pattern the addresses, behind a name of a formula."""
    if not any(sign in where for sign in "*?["):
        if where not in cells:
            raise FormulaError(f"no printed number at {where!r}; check the address")
        return where
    found = tuple(address for address in cells if fnmatch.fnmatchcase(address, where))
    if not found:
        raise FormulaError(f"no printed number matches {where!r}; check the address")
    return found


def _places(each: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """Yield every combination of the placeholders' values."""
    axes = []
    for keys, values in each.items():
        together = keys.split(",")
        rows = [row if len(together) > 1 else [row] for row in values]
        axes.append([dict(zip(together, row, strict=True)) for row in rows])
    for chosen in itertools.product(*axes):
        yield {key: value for part in chosen for key, value in part.items()}


def _refuse_line(
    line: Mapping[str, Any], unknowns: Mapping[str, Unknown], tolerances: Mapping[str, Tolerance]
) -> None:
    """Raise a FormulaError if the keys of a line, or their choice of words, are not known ones."""
    name = line.get("name", "?")
    if stray := set(line) - _KNOWN:
        raise FormulaError(f"relation {name!r}: unknown keys {sorted(stray)}; known: {_KNOWN}")
    if missing := _NEEDED - set(line):
        raise FormulaError(f"relation {name!r}: missing {sorted(missing)}")
    for key, named in (("unknown", unknowns), ("tolerance", tolerances)):
        if key in line and line[key] not in named:
            raise FormulaError(f"relation {name!r}: no {key} called {line[key]!r}")
    for key, words in (("kind", get_args(RelationKind)), ("reading", get_args(Finder))):
        if line.get(key, words[0]) not in words:
            raise FormulaError(f"{name!r}: unknown {key} {line[key]!r}; expected one of {words}")


def _refuse(relation: Relation) -> None:
    """Raise a FormulaError if a relation's names or restated cell do not fit."""
    formula = relation.formula
    known = set(relation.binding) | ({relation.unknown.name} if relation.unknown else set())
    if stray := known ^ set(formula.names):
        raise FormulaError(f"{formula.text!r}: bound or named only once: {stray}")
    if relation.restates and relation.restates.partition(" (")[0] != relation.result:
        raise FormulaError(
            f"{relation.name!r}: restates {relation.restates!r}, but the formula is solved for "
            f"{relation.result!r}"
        )


def _refuse_mixed(relation: Relation, cells: Sheet) -> None:
    """Raise a FormulaError if the dimensions of a relation's sides do not fit."""
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
        return registry.Quantity(np.float64(1.0), UNITS[unit][0])

    trigonometry = {"sin": np.sin, "cos": np.cos, "tan": np.tan, "atan": np.arctan}
    physical = functions({"abs": abs, "min": min, "max": max, "sqrt": np.sqrt, **trigonometry})
    values = {n: of(u) if isinstance(u, str) else [of(one) for one in u] for n, u in units}
    try:
        with np.errstate(all="ignore"):  # ones may cancel, and only the dimension counts
            left, right = (
                registry.Quantity(side(values, physical, of))
                for side in (formula.left, formula.right)
            )
    except pint.DimensionalityError as error:
        return str(error)
    if left.dimensionality == right.dimensionality:
        return ""
    return f"the left side is {left.dimensionality}, the right side {right.dimensionality}"
