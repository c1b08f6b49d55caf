"""How the audit's findings are written, the same in the terminal, the book and in JSON."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from reproduce.audit.corrections import Correction
from reproduce.audit.equations import Demonstration
from reproduce.audit.examine import Finding, Fixed
from reproduce.audit.quantity import Quantity, sheet
from reproduce.audit.report import Audit, Group, audit_paper, audit_table
from reproduce.printed.cells import PAPERS, read
from reproduce.printed.units import si_factor, symbol

SHOWN = 6
# With more equal corrections than this, a list of them says nothing.
MANY = 12


def audits(
    paper: str | None, table: Path | None = None, relations: Path | None = None
) -> list[Audit]:
    """Audit one paper, both, or a table of the reader's own.

    One for each paper or table.
    """
    if table is not None and relations is not None:
        cells = sheet(read(table, table.stem).cells)
        text = relations.read_text(encoding="utf-8")
        try:
            return [audit_table(table.stem, cells, text)]
        except (LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
            raise ValueError(
                f"{relations}: does not follow the form of data/README.md, or cannot be computed: "
                f"{error!r}"
            ) from error
    return [audit_paper(name) for name in PAPERS if paper in {None, name}]


def short(address: str) -> str:
    """Return an address without its paper."""
    return address.partition("/")[2] or address


def told(text: str, paper: str) -> str:
    """Return a text about cells without the paper's name before every address."""
    return text.replace(f"{paper}/", "")


def number(printed: Quantity) -> str:
    """Write a printed number with its unit."""
    unit = symbol(printed.unit)
    gap = "" if unit in {"", "°", "″"} else "\u202f"
    return f"{printed.number.text.replace('-', '−')}{gap}{unit}"


def sides(finding: Finding, audit: Audit) -> str:
    """Write both sides of a relation with the printed values inserted.

    A relation that shares a number which is not printed is not worked out with some value of it:
    what it asks of that number, by itself, is written instead.
    """
    relation, cells = finding.relation, audit.cells
    if relation.unknown is not None:
        ends = audit.unknowns[relation.unknown.name].by_relation.get(relation.name)
        if ends is None:
            return f"no {relation.unknown.label} fits"
        low, high = (f"{end / si_factor(relation.unknown.unit):.6g}" for end in ends)
        return f"asks for a {relation.unknown.label} from {low} to {high} " + symbol(
            relation.unknown.unit
        )
    # In the unit of the result, or of a cell of the same unit throughout; else as it stands.
    units = {cells[address].unit for address in relation.addresses}
    unit = (
        cells[relation.result].unit if relation.result else units.pop() if len(units) == 1 else ""
    )
    factor = si_factor(unit) if unit else 1.0
    mark = symbol(unit) if unit else ""
    gap = "" if mark in {"", "°", "″"} else "\u202f"
    left, right = (f"{value / factor:.6g}".replace("-", "−") for value in finding.sides)
    return f"{left}{gap}{mark} against {right}{gap}{mark}"


def common(fixed: Fixed) -> str:
    """Write what the relations say of a number that is not printed."""
    factor = si_factor(fixed.unknown.unit)
    ends = [(low + high) / 2 / factor for low, high in fixed.by_relation.values()]
    if not ends:
        return f"{fixed.unknown.label}: no value fits"
    spread = f"{100 * fixed.spread:.2g}\u202f%"
    if len(fixed.members) == len(fixed.by_relation):
        low, high = (end / factor for end in fixed.common)
        middle, half = (low + high) / 2, (high - low) / 2
        return (
            f"{fixed.unknown.label}: {middle:.6g} ± {half:.2g} {symbol(fixed.unknown.unit)} "
            f"fits all {len(fixed.members)}; their middles spread over {spread}"
        )
    return (
        f"{fixed.unknown.label}: from {min(ends):.6g} to {max(ends):.6g} "
        f"{symbol(fixed.unknown.unit)}, a spread of {spread}"
    )


def correction(found: Correction, paper: str) -> dict[str, Any]:
    """Write one correction."""
    moved = "; ".join(found.moved)
    return {
        "slips": [told(slip.told, paper) for slip in found.slips],
        "kinds": [slip.kind for slip in found.slips],
        "size": found.cost,
        "lifts": list(found.lifted),
        "breaks": list(found.broken),
        "unknowns": [common(fixed) for fixed in found.unknowns.values()],
        "conclusion": f"moves: no longer holds that {moved}" if moved else "stands",
    }


def unknowns_of(group: Group, audit: Audit) -> list[str]:
    """Write what the relations of a group say, each alone, of the unknowns that they share."""
    relations = [audit.finding(name).relation for name in group.relations]
    names = dict.fromkeys(r.unknown.name for r in relations if r.unknown)
    told = []
    for fixed in (audit.unknowns[name] for name in names):
        ours = {n: i for n, i in fixed.by_relation.items() if n in group.relations}
        told.append(common(dataclasses.replace(fixed, by_relation=ours, members=())))
    return told


def too_many(group: Group) -> str:
    """Say so where so many slips would lift a contradiction that none of them is told apart."""
    whole = [c for c in group.corrections if c.restores_everything]
    least = [c for c in whole if c.cost == whole[0].cost]
    if len(least) <= MANY:
        return ""
    return (
        f"{len(least)} different slips of the smallest size would lift this, "
        "so it does not tell which number is wrong"
    )


def as_json(audit: Audit) -> dict[str, Any]:
    """Return a whole audit as plain data."""
    return {
        "name": audit.name,
        "outcomes": audit.tally(),
        "rest_on_suppositions": len(audit.supposed),
        "cells": len(audit.cells),
        "cells_examined": len(audit.examined),
        "cells_only_bounded": len(audit.bounded),
        "rounding_votes": audit.votes,
        "relations": [_relation(finding, audit) for finding in audit.findings],
        "conflicts": [
            {"cells": list(c.cells), "relations": list(c.relations)} for c in audit.conflicts
        ],
        "contradictions": [
            {
                "relations": list(group.relations),
                "corrections": [correction(c, audit.name) for c in group.corrections],
            }
            for group in audit.groups
        ],
        "unknowns": [common(fixed) for fixed in audit.unknowns.values()],
        "equations": [_equation(shown) for shown in audit.equations],
    }


def _equation(shown: Demonstration) -> dict[str, Any]:
    names = ["name", "place", "asked", "printed", "right", "wanted", "meaning", "holds"]
    names.append("supposition")
    return {name: getattr(shown, name) for name in names}


def _relation(finding: Finding, audit: Audit) -> dict[str, Any]:
    relation = finding.relation
    return {
        "name": relation.name,
        "formula": relation.formula.text,
        "cells": {n: list(b) if isinstance(b, tuple) else b for n, b in relation.binding.items()},
        "source": relation.source,
        "kind": relation.kind,
        "tolerance": relation.tolerance
        and f"{relation.tolerance.text}: {relation.tolerance.reason}",
        "claim": relation.claim,
        "reading": relation.reading,
        "supposition": relation.supposition,
        "outcome": finding.outcome,
        "sides": sides(finding, audit),
        "rounding_rules": sorted(finding.rules),
        "rescued_by": finding.rescued_by,
    }
