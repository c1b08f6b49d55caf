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
import importlib.resources
import itertools
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from reproduce.printed.cells import PrintedCell
from reproduce.printed.number import UNITS, Interval, si_factor

# Address to printed number.
Sheet = Mapping[str, PrintedCell]
# Which of two independent readings of a paper found a relation; "merging" if neither did, and the
# comparison of their lists or a later reader who knew them found it; "third" if a later reader, who
# knew neither list, was the first to find it; empty without a count.
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

    `result` is the name that stands alone on the left of an equation, empty if none does; `bare`
    tells whether both sides are nothing but a name.

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
        self.bare = left.isidentifier() and right.isidentifier()
        terms = [left]
        if left.startswith("abs(") and self.sign == "<=":
            # An absolute value is below a limit if the value and its negative are.
            terms = [left.replace("abs(", sign) for sign in ("(", "-(")]
        self._codes = [
            compile(side, "<formula>", "eval") for side in (left, right, *terms)
        ]

    @property
    def names(self) -> set[str]:
        """The names of its cells, of its functions and of its units."""
        return {name for side in self._codes for name in side.co_names}

    def values(self, scope: Mapping[str, Any]) -> list[Any]:
        """Return both sides, then the left sides of which all must be below a limit.

        `scope` contains the values of the cells by name, and other functions or units.
        """
        scope = {"__builtins__": {}, **_SCOPE, **scope}
        return [eval(code, scope) for code in self._codes]


class _Declared(BaseModel):
    """Base of what the text declares."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


class Unknown(_Declared):
    """A number that is not printed, but that several relations share; `low`, `high` in `unit`."""

    name: str
    unit: str
    low: float
    high: float
    label: str

    @property
    def domain(self) -> Interval:
        """Interval of its values, in SI."""
        factor = si_factor(self.unit)
        return self.low * factor, self.high * factor


class Tolerance(_Declared):
    """Allowed difference between two sides beyond rounding, and the reason.

    The size is relative to the right side or, with a unit, absolute in that unit.
    """

    size: float
    reason: str
    unit: str | None = None

    def of(self, right: float) -> float:
        """Return the allowed difference from a right side, in SI."""
        return self.size * (si_factor(self.unit) if self.unit else right)

    @property
    def text(self) -> str:
        """The size as a reader sees it."""
        if self.unit:
            return f"{self.size:.3g} {self.unit}"
        return f"{100 * self.size:.3g} %"


class Relation(_Declared):
    """An equation or inequality between printed cells.

    In one of kind ``print`` the names of the formula stand for the unit of the last printed digit.
    """

    name: str
    # The name of its declaration, with the placeholders.
    declared: str
    formula: Formula
    # The address (or, for a list, the addresses) behind each name of the formula.
    binding: Mapping[str, str | tuple[str, ...]]
    # Source in the paper: an equation, a definition, geometry.
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
    unknown: Unknown | None = None
    tolerance: Tolerance | None = None
    # The number that the package computes by another function, a cell or one reading of it.
    # Such a relation is a second entry of that computation, and no further evidence.
    restates: str = ""
    # The paper's conclusion that rests on it.
    claim: str | None = None
    reading: Finder = ""
    # An assumption that the paper does not state. Such a relation is counted apart, and no
    # contradiction of the paper follows from it.
    assumption: str = ""

    @property
    def compares(self) -> bool:
        """Whether it compares the value of a printed number with another one."""
        shared = len(self.addresses) > 1 or self.unknown is not None
        return shared and self.kind != "print"

    @property
    def repeats(self) -> bool:
        """Whether it says that one number is printed twice.

        Whatever the rounding rule, one number prints the same digits each time. Two prints that
        differ in the last digit touch at a tie that rounds to one of them, never to both.
        """
        exact = self.tolerance is None and self.unknown is None
        return exact and self.formula.bare and self.formula.sign == "="

    @property
    def addresses(self) -> tuple[str, ...]:
        """The cells of the relation, each once."""
        bound = ([a] if isinstance(a, str) else a for a in self.binding.values())
        return tuple(dict.fromkeys(itertools.chain.from_iterable(bound)))

    @property
    def result(self) -> str | None:
        """The cell that the right side computes, if the formula is solved for one."""
        bound = self.binding.get(self.formula.result)
        return bound if isinstance(bound, str) else None

    def scope(
        self, by_address: Mapping[str, Any], unknown: Any = None
    ) -> dict[str, Any]:
        """Return the values of the names of the formula."""
        named = {self.unknown.name: unknown} if self.unknown else {}
        return named | {
            name: by_address[bound]
            if isinstance(bound, str)
            else [by_address[address] for address in bound]
            for name, bound in self.binding.items()
        }

    def values(
        self, by_address: Mapping[str, float], unknown: float = 0.0
    ) -> list[float]:
        """Return the values of the formula in SI; NaN if it has none at these numbers."""
        try:
            return self.formula.values(self.scope(by_address, unknown))
        except (ArithmeticError, ValueError):  # such as a root of a negative number
            return [math.nan] * 3

    def missed_by(self, left: float, right: float) -> float:
        """Return the distance of two sides from the relation; at most zero if they keep it."""
        missed = {"=": abs(left - right), "<=": left - right, ">=": right - left}
        return missed[self.formula.sign]


def declarations(paper: str) -> dict[str, Any]:
    """Return the declarations of a paper: relations, equations; nothing of one without a file."""
    file = (
        importlib.resources.files("reproduce.consistency")
        / "relations"
        / f"{paper}.toml"
    )
    return tomllib.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def declared(
    content: Mapping[str, Any], cells: Sheet, prefix: str = ""
) -> list[Relation]:
    """Return relations in order of declaration.

    Raises
    ------
    ValueError
        If a line has an unknown entry, two lines have one name, or the names of a formula are not
        those of its cells.
    """
    parts: dict[str, Any] = {
        "unknown": {
            name: Unknown(name=name, **fields)
            for name, fields in content.get("unknown", {}).items()
        },
        "tolerance": {
            name: Tolerance(**fields)
            for name, fields in content.get("tolerance", {}).items()
        },
    }
    relations: dict[str, Relation] = {}
    lines = itertools.chain.from_iterable(content.get("relations", {}).values())
    for line in lines:
        named = {part: own[line[part]] for part, own in parts.items() if part in line}
        for place in _places(line.get("each", {})):
            made = _relation(line | named, place, cells, prefix)
            if made.name in relations:
                raise ValueError(
                    f"{made.name}: expected a name that is not declared twice"
                )
            relations[made.name] = made
    return list(relations.values())


def _relation(
    line: Mapping[str, Any], place: Mapping[str, str], cells: Sheet, prefix: str
) -> Relation:
    """Return the relation of a line at one place."""
    fields = {
        name: value for name, value in line.items() if name not in {"cells", "each"}
    }
    marks = {
        key: re.sub(r"[^a-zA-Z0-9]", "-", value).strip("-")
        for key, value in place.items()
    }
    pairs = (pair.split("=", 1) for pair in line["cells"].format(**place).split())
    if restates := fields.get("restates", ""):
        fields["restates"] = prefix + restates.format(**place)
    made = Relation.model_validate(
        fields
        | {
            "name": re.sub("-+", "-", line["name"].format(**marks)).strip("-"),
            "declared": line["name"],
            "formula": Formula(line["formula"].format(**place)),
            "binding": {name: _bound(prefix + to, cells) for name, to in pairs},
        }
    )
    names, known = set(made.scope(cells)), _SCOPE.keys() | UNITS.keys()
    if strays := names ^ (made.formula.names - (known - names)):
        raise ValueError(
            f"{made.name}: expected names with one cell each, got {strays}"
        )
    if restates and made.restates.partition(" (")[0] != made.result:
        raise ValueError(f"{made.name}: expected a formula solved for {made.restates}")
    return made


def _bound(pattern: str, cells: Sheet) -> str | tuple[str, ...]:
    """Return the address, or for a pattern the addresses, behind a name of a formula."""
    found = tuple(address for address in cells if fnmatch.fnmatchcase(address, pattern))
    if not found:
        raise ValueError(f"no printed number matches {pattern!r}; check the address")
    return found if set("*?[") & set(pattern) else found[0]


def _places(each: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """Yield every combination of the placeholders' values."""
    for chosen in itertools.product(*each.values()):
        place: dict[str, str] = {}
        for keys, value in zip(each, chosen, strict=True):
            place |= zip(
                keys.split(","), value if "," in keys else [value], strict=True
            )
        yield place
