"""Relations declared in a TOML text, one line each.

The text has three parts: ``[unknown]`` names numbers that are not printed, ``[tolerance]`` names
departures with their reasons, and ``[relations]`` holds topics, each a list of
``{ name, formula, cells, source, kind, each, unknown, tolerance, claim, reading, supposition }``.
``supposition`` is what a relation supposes that the paper does not say. ``cells`` binds the names
of the formula to addresses, ``"a=table-1#x.y b=table-1#x.*"``; ``each`` gives values to the
placeholders in braces, and a key such as ``"i,j"`` gives them together.
"""

from __future__ import annotations

import importlib.resources
import itertools
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from reproduce.audit.formula import FormulaError
from reproduce.audit.quantity import Sheet
from reproduce.audit.relation import Book, Relation, Tolerance, Unknown

_KEYS = {"name", "formula", "cells", "source", "kind", "each"}
_KEYS |= {"unknown", "tolerance", "claim", "reading", "supposition"}


def relations_of(paper: str, cells: Sheet) -> list[Relation]:
    """Return the relations that the printed numbers of a paper should keep.

    In order of declaration; none of a paper without a file of relations.
    """
    text = importlib.resources.files("reproduce.audit") / "relations" / f"{paper}.toml"
    if not text.is_file():
        return []
    return declared(text.read_text(encoding="utf-8"), cells, f"{paper}/")


def declared(text: str, cells: Sheet, prefix: str = "") -> list[Relation]:
    """Read relations from a TOML text.

    In order of declaration.

    Examples
    --------
    >>> from reproduce.audit.quantity import quantity
    >>> table = {f"t#1.{n}": quantity(f"t#1.{n}", v) for n, v in {"a": "2", "b": "3"}.items()}
    >>> line = '{ name = "less", formula = "a <= b", cells = "a=t#1.a b=t#1.b", kind = "order",'
    >>> text = "[relations]\\nall = [" + line + ' source = "by nature" }]'
    >>> [relation.name for relation in declared(text, table)]
    ['less']
    """
    content = tomllib.loads(text)
    unknowns = {n: Unknown(n, **given) for n, given in content.get("unknown", {}).items()}
    tolerances = {n: Tolerance(**given) for n, given in content.get("tolerance", {}).items()}
    book = Book(cells)
    for line in itertools.chain.from_iterable(content["relations"].values()):
        _refuse(line, unknowns, tolerances)
        for place in _places(line.get("each", {})):
            bound = dict(pair.split("=", 1) for pair in line["cells"].format(**place).split())
            book.relate(
                "-".join([line["name"], *_marks(place)]),
                line["formula"].format(**place),
                line["source"],
                line["kind"],
                {name: prefix + where for name, where in bound.items()},
                unknown=unknowns.get(line.get("unknown", "")),
                within=tolerances.get(line.get("tolerance", "")),
                claim=line.get("claim"),
                reading=line.get("reading", ""),
                line=line["name"],
                supposition=line.get("supposition", ""),
            )
    return book.relations


def _refuse(line: Mapping[str, Any], unknowns: Mapping[str, Any], known: Mapping[str, Any]) -> None:
    name = line.get("name", "?")
    if stray := set(line) - _KEYS:
        raise FormulaError(f"relation {name!r}: unknown keys {sorted(stray)}; known: {_KEYS}")
    if missing := {"name", "formula", "cells", "source", "kind"} - set(line):
        raise FormulaError(f"relation {name!r}: missing {sorted(missing)}")
    for key, named in (("unknown", unknowns), ("tolerance", known)):
        if key in line and line[key] not in named:
            raise FormulaError(f"relation {name!r}: no {key} called {line[key]!r}")


def _places(each: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """Yield every combination of the placeholders' values."""
    axes = []
    for keys, values in each.items():
        together = keys.split(",")
        rows = [row if len(together) > 1 else [row] for row in values]
        axes.append([dict(zip(together, row, strict=True)) for row in rows])
    for chosen in itertools.product(*axes):
        yield {key: value for part in chosen for key, value in part.items()}


def _marks(place: Mapping[str, str]) -> list[str]:
    """Turn the values of the placeholders into the tail of a relation's name."""
    words = ("".join(c if c.isalnum() else "-" for c in value) for value in place.values())
    return [mark for word in words if (mark := word.strip("-"))]
