"""Consistency of the printed numbers of a paper, part by part, and the errata."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from typing import Any

import pandas as pd

from reproduce.consistency.examine import RelationResult
from reproduce.consistency.report import Audit, Erratum, audit_paper
from reproduce.judge.ledger import entries, frozen, record_of
from reproduce.papers.declare import Column
from reproduce.printed.number import minus, quantity, si_factor, symbol
from reproduce.views import _numbers as numbers
from reproduce.views import _verdicts as verdicts
from reproduce.views._blocks import (
    Block,
    Blocks,
    Display,
    Grid,
    Html,
    code,
    fold,
    rendered,
)
from reproduce.views._keys import check_choice, chosen_papers

_Row = dict[Any, Any]
# Format of both sides of an equation. Smaller numbers are rounding noise.
_STYLE = Column(name="Value", form=".5g", zero=1e-9)

# Conclusions on the paper, in decreasing order of the consequence.
_CONCLUSIONS = ("moves", "not supported as printed", "open", "stands")
_GROUPS = (
    "do not simply agree",
    "agree",
    "restate a computed cell, and agree",
    "depend on an assumption",
)


@dataclass(frozen=True, repr=False)
class _Part(Blocks):
    """A part of the audit: its records, and the blocks that show them."""

    rows: list[_Row]

    def frame(self) -> pd.DataFrame:
        """Return one row for each relation, equation or entry."""
        frame = pd.DataFrame(self.rows)
        return frame.set_index("name") if "name" in frame else frame


class ConsistencyAudit(Display):
    """The audit of the printed numbers of papers, and the errata.

    Its parts are ``score``, ``differences`` (between printed and computed numbers), ``relations``,
    ``equations`` (run as extracted), ``errata`` and ``assumptions`` (entries that suppose
    something): ``audit("chen2023")["relations"]``. Each shows itself and has a ``frame()``.

    Parameters
    ----------
    paper : str, optional
        Name such as ``chen2023``. Default: all papers.

    Raises
    ------
    ValueError
        If the paper is unknown.
    """

    def __init__(self, paper: str | None = None) -> None:
        self.papers = chosen_papers(paper)

    def __getitem__(self, name: str) -> _Part:
        """Return a part by its name."""
        part = _PARTS[check_choice("part", name, _PARTS)]
        return part([audit_paper(paper) for paper in self.papers])

    def frame(self) -> pd.DataFrame:
        """Return the register: one row per entry."""
        return pd.concat([self[name].frame() for name in ("errata", "assumptions")])

    def as_json(self) -> dict[str, list[_Row]]:
        """Return the rows of each part."""
        return {name: self[name].rows for name in _PARTS}

    def blocks(self) -> list[_Part]:
        """Return every part with rows."""
        return [part for part in map(self.__getitem__, _PARTS) if part.rows]


audit = ConsistencyAudit  # the name of the public API


@cache
def errata_register() -> tuple[Erratum, ...]:
    """Return the register of errata of all papers, in the order of its files."""
    return tuple(map(Erratum.model_validate, entries("errata.toml", "erratum")))


def _table(part: str, caption: str, columns: Iterable[str], rows: list[_Row]) -> Html:
    """Return the table of a part: its template for a page, columns for a terminal."""
    page = rendered(
        part,
        caption=caption,
        rows=rows,
        entry=numbers.entry,
        style=_STYLE,
        replied=verdicts.replied,
    )
    return Html(page, Grid.of(caption, columns, rows))


def _score(audits: Sequence[Audit]) -> _Part:
    """Count the checked numbers, relations and equations of each paper."""
    rows: list[_Row] = [{"name": audit.name, **audit.score} for audit in audits]
    shown = [{"Paper": code(audit.name), **audit.score} for audit in audits]
    caption = "The consistency checks"
    return _Part((Grid.of(caption, shown[0], shown, kind="rp-score"),), rows)


def _relations(audits: Sequence[Audit]) -> _Part:
    """List the relations that do not simply agree, and the others in folds."""
    rows = [_relation(finding, audit) for audit in audits for finding in audit.findings]
    blocks: list[Block] = []
    for audit, group in product(audits, _GROUPS):
        group_rows = [r for r in rows if (r["paper"], _group(r)) == (audit.name, group)]
        caption = f"The {len(group_rows)} relations of {audit.name} that {group}"
        table = _table(
            "relations",
            caption,
            ("name", "formula", "sides", "outcome", "source"),
            group_rows,
        )
        if group != _GROUPS[0]:
            table = fold(caption, Html(table.markup))
        blocks.append(table)
    return _Part(tuple(blocks), rows)


def _relation(finding: RelationResult, audit: Audit) -> _Row:
    """Return the record of a relation."""
    relation = finding.relation
    fields = "source kind claim found_by assumption restates".split()
    return {
        "name": relation.name,
        "paper": audit.name,
        "outcome": finding.outcome,
        "formula": relation.formula.text,
        "sides": _sides(finding, audit),
        "cells": relation.addresses,
        **{name: getattr(relation, name) for name in fields},
        "tolerance": str(relation.tolerance or ""),
        "rescued_by": finding.rescued_by,
    }


def _group(row: _Row) -> str:
    if row["assumption"]:
        return _GROUPS[3]
    if row["outcome"] != "agrees":
        return _GROUPS[0]
    return _GROUPS[2] if row["restates"] else _GROUPS[1]


def _equations(audits: Sequence[Audit]) -> _Part:
    """List the equations, run as extracted."""
    rows = [
        asdict(equation) | {"holds": equation.holds}
        for audit in audits
        for equation in audit.equations
    ]
    sides = ("printed", "right", "wanted")
    shown = [
        row | {side: numbers.entry(row[side], _STYLE) for side in sides} for row in rows
    ]
    table = _table(
        "equations",
        "Equations run as extracted",
        ("place", "asked", "meaning", *sides),
        shown,
    )
    return _Part((table,), rows)


def _errata(audits: Sequence[Audit], *, supposed: bool) -> _Part:
    """List entries of the register by consequence."""
    rows = list[_Row]()
    evidence = dict[str, _Row]()
    for entry in errata_register():
        for audit in audits:
            if entry.paper == audit.name and bool(entry.assumption) == supposed:
                cells = [a for a, one in frozen().items() if one.erratum == entry.id]
                rows.append(
                    {
                        "name": entry.id,
                        **entry.model_dump(exclude={"id"}),
                        "results": cells,
                    }
                )
                evidence[entry.id] = {
                    "sides": {
                        finding.relation.name: _sides(finding, audit)
                        for finding in entry.findings(audit)
                    },
                    "runs": [e for e in audit.equations if e.name in entry.equations],
                    "verdicts": {cell: _judged(cell) for cell in cells},
                }
    # By conclusion; then those with most results, and those without a fault of our text.
    rows.sort(
        key=lambda row: (
            _CONCLUSIONS.index(row["conclusion"]),
            -len(row["results"]),
            row["extraction"],
        )
    )
    kind = "that suppose something" if supposed else "by consequence"
    columns = (
        "name place problem printed sides verdicts library conclusion status reply"
    )
    table = _table(
        "errata",
        f"The {len(rows)} errata {kind}.",
        columns.split(),
        [row | evidence[row["name"]] for row in rows],
    )
    return _Part((table,), rows)


def _judged(address: str) -> str:
    """Return the printed value of a cell and the computed value."""
    record = record_of(address)
    shown = verdicts.texts(record)
    text = "{printed} printed, {computed} computed"
    if record.verdict == "ambiguous":
        text = "{printed} printed, agrees with {readings that agree} readings"
    return text.format_map(shown)


def _sides(finding: RelationResult, audit: Audit) -> str:
    """Return both sides of a relation with the printed values.

    If a relation contains a number that is not printed, return the values that it requires.
    """
    relation = finding.relation
    cells = audit.cells
    if unknown := relation.unknown:
        if finding.allowed is None:
            return f"no {unknown.label} fits"
        low, high = (f"{end / si_factor(unknown.unit):.6g}" for end in finding.allowed)
        return f"requires the {unknown.label} to lie from {low} to {high} {symbol(unknown.unit)}"
    # The unit of the result, or of all cells if they have one unit.
    shown = [relation.result] if relation.result else relation.addresses
    units = {cells[address].unit for address in shown}
    unit = units.pop() if len(units) == 1 else "1"
    return " against ".join(
        quantity(minus(f"{side / si_factor(unit):.6g}"), symbol(unit))
        for side in (finding.left, finding.right)
    )


def _differences(audits: Sequence[Audit]) -> _Part:
    """Show the distances between printed and computed numbers."""
    from reproduce.views import _differences as differences  # it loads the figures

    found = differences.distances([audit.name for audit in audits])
    rows = found.to_dict("records")
    words = Grid.of(
        "Distances of numbers that differ, in units of the largest distance that agrees",
        ("paper", "number", "distance"),
        [row for row in rows if not row["agrees"]],
        digits=2,
    )
    graph = differences.differences_block(found)
    return _Part((Html(graph.markup, words),), rows)


_PARTS: dict[str, Callable[[Sequence[Audit]], _Part]] = {
    "score": _score,
    "differences": _differences,
    "relations": _relations,
    "equations": _equations,
    "errata": lambda audits: _errata(audits, supposed=False),
    "assumptions": lambda audits: _errata(audits, supposed=True),
}
