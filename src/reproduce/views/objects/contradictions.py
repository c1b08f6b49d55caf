"""What the printed numbers say of each other: the cross-examination in words, and the errata."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Iterator
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reproduce.audit.corrections import Correction
from reproduce.audit.errata import Erratum, register
from reproduce.audit.examine import Agreement, Examined
from reproduce.audit.report import Audit, Group, audit_table
from reproduce.audit.rounding import sheet
from reproduce.locate import data_folders
from reproduce.printed.cells import PAPERS, read
from reproduce.printed.units import si_factor, symbol
from reproduce.views.computed import paper_audit
from reproduce.views.keys import check_paper
from reproduce.views.objects.base import by_row
from reproduce.views.writing.display import Block, Display
from reproduce.views.writing.numbers import minus
from reproduce.views.writing.verdicts import quantity

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    *("SHOWN", "Contradictions", "correction", "errata_register"),
    *("sides", "too_many", "within_paper"),
]

SHOWN = 6
# With more equal corrections than this, a list of them says nothing.
_MANY = 12


class Contradictions(Display):
    """What the printed numbers of papers or of a table say of each other, and the errata.

    Parameters
    ----------
    paper : str, optional
        One paper; all by default.
    table, relations : path, optional
        A table of a reader's own in the form of ``data/README.md``, and what its numbers keep.
    """

    def __init__(
        self,
        paper: str | None = None,
        table: str | Path | None = None,
        relations: str | Path | None = None,
    ) -> None:
        if (table is None) != (relations is None) or (table is not None and paper is not None):
            raise ValueError("give a PAPER, or both table and relations, or nothing")
        self.paper = paper if paper is None else check_paper(paper)
        self._files = [Path(one) for one in (table, relations) if one is not None]

    @cached_property
    def audits(self) -> list[Audit]:
        """What the cross-examination found, an audit for each paper or table."""
        if not self._files:
            return [paper_audit(name) for name in PAPERS if self.paper in {None, name}]
        table, relations = self._files
        cells = sheet(read(table, table.stem).cells)
        text = relations.read_text(encoding="utf-8")
        try:
            return [audit_table(table.stem, cells, text)]
        except (LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
            raise ValueError(
                f"{relations}: does not follow the form of data/README.md, or cannot be computed: "
                f"{error!r}"
            ) from error

    def frame(self) -> pd.DataFrame:
        """Return the register: one row per entry, with what is printed and why it is there."""
        wanted = ["paper", "place", "printed", "problem", "conclusion", "status", "extraction"]
        rows = {
            one.id: [getattr(one, name) for name in wanted]
            for one in errata_register()
            if self.paper in {None, one.paper} and not self._files
        }
        return by_row(rows, wanted)

    def relations(self) -> pd.DataFrame:
        """Return every relation that the printed numbers should keep, and what became of it."""
        rows = {
            one.relation.name: [one.outcome, ", ".join(one.relation.addresses)]
            for audit in self.audits
            for one in audit.findings
        }
        return by_row(rows, ["outcome", "cells"])

    def as_json(self) -> list[dict[str, Any]]:
        """Return everything that was found, for other programs."""
        return [_plain(one) for one in self.audits]

    def blocks(self) -> Iterator[Block]:
        """Yield the audit line by line."""
        for line in (line for audit in self.audits for line in _lines(audit)):
            indent = " " * (len(line) - len(line.lstrip()) + 4)
            yield textwrap.fill(line, 80, subsequent_indent=indent, break_on_hyphens=False)


@cache
def errata_register() -> tuple[Erratum, ...]:
    """Return the register of errata of all papers, in the order of its files."""
    texts = [(one / "errata.toml").read_text(encoding="utf-8") for one in data_folders()]
    return tuple(one for text in texts for one in register(text))


def within_paper(address: str) -> str:
    """Return an address without its paper."""
    return address.partition("/")[2] or address


def sides(finding: Examined, audit: Audit) -> str:
    """Write both sides of a relation with the printed values inserted.

    A relation that shares a number which is not printed is not worked out with some value of it:
    what it asks of that number, by itself, is written instead.
    """
    relation, cells = finding.relation, audit.cells
    if unknown := relation.unknown:
        asked = audit.unknowns[unknown.name].by_relation.get(relation.name)
        if asked is None:
            return f"no {unknown.label} fits"
        low, high = (f"{end / si_factor(unknown.unit):.6g}" for end in asked)
        return f"asks for a {unknown.label} from {low} to {high} {symbol(unknown.unit)}"
    # In the unit of the result, or of a cell of the same unit throughout; else as it stands.
    units = {cells[a].unit for a in ([relation.result] if relation.result else relation.addresses)}
    unit = units.pop() if len(units) == 1 else "1"
    mark = symbol(unit)
    values = (finding.left / si_factor(unit), finding.right / si_factor(unit))
    texts = (minus(f"{value:.6g}") for value in values)
    return " against ".join(quantity(text, mark) for text in texts)


def _common(agreement: Agreement) -> str:
    """Write what the relations say of a number that is not printed."""
    label, mark = agreement.unknown.label, symbol(agreement.unknown.unit)
    factor = si_factor(agreement.unknown.unit)
    middles = [(low + high) / 2 / factor for low, high in agreement.by_relation.values()]
    if not middles:
        return f"{label}: no value fits"
    spread = f"{100 * agreement.spread:.2g}\u202f%"
    if len(agreement.members) == len(agreement.by_relation):
        low, high = (end / factor for end in agreement.common)
        middle, half = (low + high) / 2, (high - low) / 2
        return (
            f"{label}: {middle:.6g} ± {half:.2g} {mark} fits all {len(agreement.members)}; their "
            f"middles spread over {spread}"
        )
    return f"{label}: from {min(middles):.6g} to {max(middles):.6g} {mark}, a spread of {spread}"


def correction(found: Correction, paper: str) -> dict[str, Any]:
    """Return one correction in words; addresses are without the paper."""
    moved = "; ".join(found.moved)
    return {
        "slips": [slip.label.replace(f"{paper}/", "") for slip in found.slips],
        "kinds": [slip.kind for slip in found.slips],
        "size": found.cost,
        "lifts": list(found.lifted),
        "breaks": list(found.broken),
        "unknowns": [_common(agreement) for agreement in found.unknowns.values()],
        "conclusion": f"moves: no longer holds that {moved}" if moved else "stands",
    }


def too_many(group: Group) -> str:
    """Say so where so many slips would lift a contradiction that none of them is told apart."""
    whole = [c for c in group.corrections if c.restores_everything]
    least = [c for c in whole if c.cost == whole[0].cost]
    if len(least) <= _MANY:
        return ""
    return (
        f"{len(least)} different slips of the smallest size would lift this, "
        "so it does not tell which number is wrong"
    )


def _lines(audit: Audit) -> Iterator[str]:
    """Yield the audit of a paper or table, line by line, in plain text."""
    own = audit.tally(restating=False)
    yield (
        f"{audit.name}: {sum(own.values())} relations over {len(audit.examined)} of "
        f"{len(audit.cells)} numbers"
    )
    for outcome, count in own.items():
        yield f"  {count:4d} {'agree' if outcome.startswith('agree') else 'contradict'}" + (
            " only through rounding" if "rounding" in outcome else ""
        )
    if audit.restating:
        wrong = audit.tally(restating=True)["contradicts"]
        yield (
            f"  {len(audit.restating):4d} more restate computed cells and are counted with their "
            f"verdicts; {wrong} of them contradict"
        )
    if audit.supposed:
        yield f"  {len(audit.supposed):4d} more rest on suppositions of ours and are not counted"
    yield ""
    for group in audit.groups:
        yield from _group(group, audit)
    yield from _together(audit)
    for shown in audit.equations:
        found = "holds" if shown.holds else "fails as extracted"
        if shown.supposition:
            found += f", supposing that {shown.supposition}"
        yield f"equation {shown.place}: {found}: {shown.asked}"
        yield f"    {shown.meaning}: {shown.printed:.6g} as extracted, {shown.wanted:.6g} wanted"


def _group(group: Group, audit: Audit) -> Iterator[str]:
    for name in group.relations:
        finding = audit.finding(name)
        relation = finding.relation
        yield f"contradicts: {name}: {relation.formula.text}"
        yield f"    {sides(finding, audit)}   [{relation.source}]"
        origin = f"    declared as {relation.declared}" if relation.declared != name else ""
        if relation.restates:
            origin = f"{origin or '   '} restates {within_paper(relation.restates)}"
        if origin:
            yield origin
    for unknown in _unknowns_of(group, audit):
        yield f"    {unknown}"
    if not group.corrections:
        yield "    no slips of the pen within the search lift this"
    if remark := too_many(group):
        yield f"    {remark}"
        yield ""
        return
    for found in group.corrections[:SHOWN]:
        words = correction(found, audit.name)
        yield f"    correction of size {words['size']:g}: {'; '.join(words['slips'])}"
        broken = len(words["breaks"])
        breaks = f"{broken} relation{'s' if broken > 1 else ''}" if broken else "nothing"
        yield f"        breaks {breaks}; the conclusion {words['conclusion']}"
        for unknown in words["unknowns"]:
            yield f"        {unknown}"
    if (more := len(group.corrections) - SHOWN) > 0:
        yield f"    and {more} more (--json shows all)"
    yield ""


def _unknowns_of(group: Group, audit: Audit) -> Iterator[str]:
    """Write what the relations of a group say, each alone, of the unknowns that they share."""
    relations = [audit.finding(name).relation for name in group.relations]
    for name in dict.fromkeys(r.unknown.name for r in relations if r.unknown):
        agreement = audit.unknowns[name]
        own = {n: i for n, i in agreement.by_relation.items() if n in group.relations}
        yield _common(dataclasses.replace(agreement, by_relation=own, members=()))


def _together(audit: Audit) -> Iterator[str]:
    if audit.conflicts:
        least = audit.conflicts[0]
        yield (
            f"{len(audit.conflicts)} smallest sets of numbers that cannot all be right (--json "
            f"lists them), such as {', '.join(map(within_paper, least.cells))}"
        )
        yield ""
    wrong = {name for group in audit.groups for name in group.relations}
    for conflict in audit.conflicts:
        if not wrong & set(conflict.relations):
            yield f"hold one by one but not together: {', '.join(conflict.relations)}"
            yield f"    cells: {', '.join(map(within_paper, conflict.cells))}"


def _plain(audit: Audit) -> dict[str, Any]:
    """Return a whole audit as plain data."""
    equation = ("name", "place", "asked", "printed", "right", "wanted", "meaning", "holds")
    return {
        "name": audit.name,
        "outcomes": audit.tally(),
        "restate_computed_cells": len(audit.restating),
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
        "unknowns": [_common(agreement) for agreement in audit.unknowns.values()],
        "equations": [
            {name: getattr(shown, name) for name in (*equation, "supposition")}
            for shown in audit.equations
        ],
    }


def _relation(finding: Examined, audit: Audit) -> dict[str, Any]:
    relation, tolerance = finding.relation, finding.relation.tolerance
    plain = ("name", "declared", "source", "kind", "claim", "reading", "supposition", "restates")
    return {
        **{name: getattr(relation, name) for name in plain},
        "formula": relation.formula.text,
        "cells": {n: list(b) if isinstance(b, tuple) else b for n, b in relation.binding.items()},
        "tolerance": tolerance and f"{tolerance.text}: {tolerance.reason}",
        "outcome": finding.outcome,
        "sides": sides(finding, audit),
        "rounding_rules": sorted(finding.rules),
        "rescued_by": finding.rescued_by,
    }
