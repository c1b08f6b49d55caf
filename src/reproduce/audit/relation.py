"""Relations that printed numbers should keep, declared in a TOML text, one line each.

The text has three parts: ``[unknown]`` names numbers that are not printed, ``[tolerance]`` names
departures with their reasons, and ``[relations]`` holds topics, each a list of lines. ``cells``
binds the names of the formula to addresses, ``"a=table-1#x.y b=table-1#x.*"``. ``each`` gives
values to placeholders in braces, and a key such as ``"i,j"`` gives them together:
``motion-{state}-{axis}`` is the declaration of ``motion-4-y``, as every view says.

A formula is a comparison between two expressions in named cells: ``motion = position - first``,
``abs(difference) <= bound``. Units are written ``u.arcsec``; a cell stands for its SI value.
"""

from __future__ import annotations

import fnmatch
import functools
import importlib.resources
import itertools
import math
import operator
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any, Literal, get_args

from reproduce.printed.cells import Cell
from reproduce.printed.number import UNITS, Interval, si_factor

# Address to printed number.
Sheet = Mapping[str, Cell]
_RelationKind = Literal[
    "equation",
    "definition",
    "arithmetic",
    "statistics",
    "geometry",
    "repeat",
    "order",
    "print",
]
# Which of two independent readings of a paper found a relation; "merging" if neither did, and the
# comparison of their lists or a later reader who knew them found it; "third" if a later reader, who
# knew neither list, was the first to find it; empty where nobody counts.
Finder = Literal["", "first", "second", "both", "merging", "third"]
_SI = SimpleNamespace(**{unit: si_factor(unit) for unit in UNITS})


def functions(known: Mapping[str, Callable[..., Any]]) -> dict[str, Any]:
    """Return what formulas may call in some arithmetic; those of several numbers take lists too."""

    def flat(parts: tuple[Any, ...]) -> list[Any]:
        return [
            x for part in parts for x in (part if isinstance(part, list) else [part])
        ]

    def mean(*parts: Any) -> Any:
        return functools.reduce(operator.add, flat(parts)) / len(flat(parts))

    return {
        **known,
        "count": lambda *parts: len(flat(parts)),
        "sum": lambda *parts: functools.reduce(operator.add, flat(parts)),
        "mean": mean,
        "rms": lambda *parts: known["sqrt"](mean([x**2 for x in flat(parts)])),
        "min": lambda *parts: functools.reduce(known["min"], flat(parts)),
        "max": lambda *parts: functools.reduce(known["max"], flat(parts)),
    }


_PLAIN: dict[str, Callable[..., Any]] = {"abs": abs, "min": min, "max": max}
_PLAIN |= {name: getattr(math, name) for name in ("sqrt", "sin", "tan", "atan")}
_FLOATS = functions(_PLAIN)
# An absolute value is below a limit if the value and its negative are.
_SIGNED = [functions(_PLAIN | {"abs": sign}) for sign in (operator.pos, operator.neg)]


class Formula:
    """A comparison between two expressions, of the form ``left = right``, ``<=`` or ``>=``.

    `result` is the name that stands alone on the left of an equation, empty if none does; `bare`
    tells whether both sides are nothing but a name, `absolute` whether the left side is an absolute
    value with a limit.

    Examples
    --------
    >>> formula = Formula("motion = 2 * position - first")
    >>> formula.result, list(formula.values({"motion": 9.0, "position": 5.0, "first": 1.0}))
    ('motion', [9.0, 9.0])
    """

    def __init__(self, text: str) -> None:
        left, self.sign, right = re.split(r"\s*([<>]?=)\s*", text)
        self.text = text
        self._sides = [compile(side, "<formula>", "eval") for side in (left, right)]
        self.result = left if left.isidentifier() and self.sign == "=" else ""
        self.bare = left.isidentifier() and right.isidentifier()
        self.absolute = left.startswith("abs(") and self.sign == "<="

    def __reduce__(self) -> tuple[type[Formula], tuple[str]]:
        """Keep the text alone, from which it can be read again."""
        return Formula, (self.text,)

    @property
    def names(self) -> set[str]:
        """The names of its cells, of its functions and of its units."""
        return {name for side in self._sides for name in side.co_names}

    def values(
        self,
        values: Mapping[str, Any],
        known: Mapping[str, Any] = _FLOATS,
        units: Any = _SI,
    ) -> Iterator[Any]:
        """Yield both sides for what the names stand for, in some arithmetic."""
        scope = {"u": units, **known, **values}
        for side in self._sides:
            yield eval(side, {"__builtins__": {}}, scope)


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
class _Tolerance:
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
        return (
            f"{self.size:.3g} {self.unit}" if self.unit else f"{100 * self.size:.3g} %"
        )


@dataclass(
    frozen=True, eq=False
)  # compared by identity, so that work on it can be cached
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
    kind: _RelationKind
    unknown: Unknown | None
    tolerance: _Tolerance | None
    # The number that the library computes by a function of its own, a cell or one reading of it.
    # Such a relation is a second entry of that computation, and no further evidence.
    restates: str
    # The paper's conclusion that rests on it.
    claim: str | None = None
    reading: Finder = ""
    # What it supposes that the paper does not say. Such a relation is counted apart, and no
    # contradiction of the paper follows from it.
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
        exact = (
            self.formula.sign == "=" and self.tolerance is None and self.unknown is None
        )
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

    def values(
        self, by_address: Mapping[str, Any], unknown: Any = None
    ) -> dict[str, Any]:
        """Return what the names of the formula stand for."""
        found: dict[str, Any] = {
            name: [by_address[a] for a in bound]
            if isinstance(bound, tuple)
            else by_address[bound]
            for name, bound in self.binding.items()
        }
        return found if self.unknown is None else {**found, self.unknown.name: unknown}

    def signed(self, by_address: Mapping[str, float], unknown: float) -> list[float]:
        """Return the left side in SI; also its negative if it is an absolute value with a limit."""
        known = _SIGNED if self.formula.absolute else [_FLOATS]
        return [self.sides(by_address, unknown, one)[0] for one in known]

    def sides(
        self,
        by_address: Mapping[str, float],
        unknown: float = 0.0,
        known: Mapping[str, Any] = _FLOATS,
    ) -> tuple[float, float]:
        """Return both sides at given values of the cells, in SI; NaN if they have none."""
        try:
            left, right = self.formula.values(self.values(by_address, unknown), known)
        except (
            ArithmeticError,
            ValueError,
        ):  # a division by zero, a root of a negative number
            return math.nan, math.nan
        return float(left), float(right)

    def missed_by(self, left: float, right: float) -> float:
        """Return by how much two sides miss the relation; at most zero where they keep it."""
        missed = {"=": abs(left - right), "<=": left - right, ">=": right - left}
        return missed[self.formula.sign]


def declarations(paper: str) -> dict[str, Any]:
    """Return what is declared of a paper: relations, equations; nothing of one without a file."""
    file = importlib.resources.files("reproduce.audit") / "relations" / f"{paper}.toml"
    return tomllib.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def declared(
    content: Mapping[str, Any], cells: Sheet, prefix: str = ""
) -> list[Relation]:
    """Return relations in order of declaration."""
    named: dict[str | None, Any] = {
        name: kind(**{"name": name, **given} if kind is Unknown else given)
        for part, kind in (("unknown", Unknown), ("tolerance", _Tolerance))
        for name, given in content.get(part, {}).items()
    }
    relations: dict[str, Relation] = {}
    for line in itertools.chain.from_iterable(content.get("relations", {}).values()):
        for place in _places(line.get("each", {})):
            made = _relation(line, place, cells, prefix, {None: None, **named})
            if made.name in relations:
                raise ValueError(
                    f"{made.name!r} is declared twice; give each its own name"
                )
            relations[made.name] = made
    return list(relations.values())


def _relation(
    line: Mapping[str, Any],
    place: Mapping[str, str],
    cells: Sheet,
    prefix: str,
    named: Mapping[str | None, Any],
) -> Relation:
    own = {name: text for name, text in line.items() if name not in {"cells", "each"}}
    marks = {
        key: re.sub(r"[^a-zA-Z0-9]", "-", value).strip("-")
        for key, value in place.items()
    }
    formula, restates = Formula(own["formula"].format(**place)), own.get("restates", "")
    pairs = (pair.split("=", 1) for pair in line["cells"].format(**place).split())
    bound = {name: _bound(prefix + where, cells) for name, where in pairs}
    restates = restates and prefix + restates.format(**place)
    known = set(bound) | {own.get("unknown")} - {None}
    if strays := known - formula.names or formula.names - known - {
        "u",
        *_FLOATS,
        *UNITS,
    }:
        raise ValueError(f"{own['name']!r}: bound or named only once: {strays}")
    if restates and restates.partition(" (")[0] != bound.get(formula.result):
        raise ValueError(f"{own['name']!r}: the formula is not solved for {restates!r}")
    if own["kind"] not in get_args(_RelationKind) or own.get(
        "reading", ""
    ) not in get_args(Finder):
        raise ValueError(f"{own['name']!r}: unknown kind or reading")
    return Relation(
        **own
        | {
            "name": re.sub("-+", "-", own["name"].format(**marks)).strip("-"),
            "declared": own["name"],
            "formula": formula,
            "binding": bound,
            "unknown": named[own.get("unknown")],
            "tolerance": named[own.get("tolerance")],
            "restates": restates,
        }
    )


def _bound(where: str, cells: Sheet) -> str | tuple[str, ...]:
    """Return the address, or for a pattern the addresses, behind a name of a formula."""
    found = tuple(address for address in cells if fnmatch.fnmatchcase(address, where))
    if not found:
        raise ValueError(f"no printed number matches {where!r}; check the address")
    return found if any(sign in where for sign in "*?[") else found[0]


def _places(each: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """Yield every combination of the placeholders' values."""
    for chosen in itertools.product(*each.values()):
        place: dict[str, str] = {}
        for keys, value in zip(each, chosen, strict=True):
            values = value if "," in keys else [value]
            place |= zip(keys.split(","), values, strict=True)
        yield place
