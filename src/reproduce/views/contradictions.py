"""What the printed numbers say of each other: the cross-examination part by part, and the errata.

A part is rows for programs, and the columns that a reader sees of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from operator import itemgetter
from typing import Any

import pandas as pd
from markupsafe import Markup

from reproduce.audit.examine import Examined
from reproduce.audit.report import Audit, Erratum, audit_paper, register
from reproduce.judge.ledger import Record, frozen
from reproduce.locate import data_folders
from reproduce.printed.cells import PAPERS, anchor
from reproduce.printed.number import si_factor, symbol
from reproduce.version import __version__
from reproduce.views import verdicts
from reproduce.views.blocks import (
    Block,
    Blocks,
    Display,
    Entry,
    Fold,
    Grid,
    badge,
    grid,
    link,
)
from reproduce.views.computed import item_ledger
from reproduce.views.keys import check_paper
from reproduce.views.numbers import minus
from reproduce.views.verdicts import quantity

_Row = dict[str, Any]
_Columns = Mapping[str, Callable[[_Row], Entry]]

JOINT = "hold one by one, but not together"
_BADGES = {
    "agrees": "exact",
    "agrees only through rounding": "input",
    "agrees only within a tolerance": "input",
    "contradicts": "differs",
}
_RESCUES = {
    "truncation": "all numbers were cut off after their last digit",
    "ceiling": "all numbers were rounded upwards",
}
# From the gravest consequence to none.
_CONCLUSIONS = ("moves", "not supported as printed", "open", "stands")


@dataclass(frozen=True, repr=False)
class _Part(Blocks):
    """A part of the cross-examination: its rows, and what shows them."""

    rows: list[_Row]

    def frame(self) -> pd.DataFrame:
        """Return one row for each relation, set, equation or entry."""
        frame = pd.DataFrame(self.rows)
        return frame.set_index("name") if "name" in frame else frame


class Contradictions(Display):
    """What the printed numbers of papers say of each other, and the errata.

    Its parts are ``score``, ``relations``, ``sets`` (the sets of numbers that cannot all
    be right), ``equations`` (run as extracted), ``errata`` and ``suppositions`` (entries that
    suppose something): ``contradictions("chen2023")["relations"]``. Each shows itself and has a
    ``frame()``.

    Parameters
    ----------
    paper : str, optional
        One paper; all by default.
    """

    def __init__(self, paper: str | None = None) -> None:
        self.papers = PAPERS if paper is None else (check_paper(paper),)

    def __getitem__(self, name: str) -> _Part:
        """Return a part by its name."""
        if name not in _PARTS:
            raise KeyError(f"no part {name!r}: expected one of {', '.join(_PARTS)}")
        return _PARTS[name]([audit_paper(paper) for paper in self.papers])

    def frame(self) -> pd.DataFrame:
        """Return the register: one row per entry, with what is printed and why it is there."""
        return pd.concat([self[name].frame() for name in ("errata", "suppositions")])

    def as_json(self) -> dict[str, list[_Row]]:
        """Return everything that was found, for other programs: the rows of each part."""
        return {name: self[name].rows for name in _PARTS}

    def blocks(self) -> Iterator[Block]:
        """Yield every part."""
        for part in map(self.__getitem__, _PARTS):
            yield from part.blocks() if part.rows else ()


@cache
def errata_register() -> tuple[Erratum, ...]:
    """Return the register of errata of all papers, in the order of its files."""
    texts = [
        (one / "errata.toml").read_text(encoding="utf-8") for one in data_folders()
    ]
    return tuple(one for text in texts for one in register(text))


def _grid(caption: str, columns: _Columns, rows: Sequence[_Row], **looks: Any) -> Grid:
    return grid(
        caption, columns, rows, kind="rp-small rp-audit", words=len(columns), **looks
    )


def _folded(what: str, columns: _Columns, rows: Sequence[_Row], **looks: Any) -> Fold:
    return Fold(what, (_grid(what, columns, rows, **looks),), page=True)


def _score(audits: Sequence[Audit]) -> _Part:
    """Count how much of each paper was cross-examined, and what came of it."""
    rows = list(map(_counts, audits))
    shown = [
        [_code(name), *map(str, counts)] for name, *counts in map(dict.values, rows)
    ]
    heads = ["Paper", *list(rows[0])[1:]]
    return _Part((Grid("The cross-examination", heads, shown, kind="rp-score"),), rows)


def _counts(audit: Audit) -> _Row:
    own, again = (list(audit.tally(restating=x).values()) for x in (False, True))
    supposing = sum(bool(shown.supposition) for shown in audit.equations)
    agree, rounding, tolerance, contradict = own
    return {
        "name": audit.name,
        "Numbers": len(audit.cells),
        "Held against others": len(audit.examined),
        "Only bounded": len(audit.bounded),
        "Relations": sum(own),
        "Agree": agree,
        "Only through rounding": rounding,
        "Only within a tolerance": tolerance,
        "Contradict": contradict,
        "Restate computed cells": sum(again),
        "Contradict among these": again[-1],
        "Equations run": len(audit.equations) - supposing,
        "Fail as extracted": len(audit.failing),
        "Rest on suppositions of ours": len(audit.supposed) + supposing,
    }


def _relations(audits: Sequence[Audit]) -> _Part:
    """List all relations: first those that do not simply agree, then the others, folded."""
    rows = [_relation(finding, audit) for audit in audits for finding in audit.findings]
    shown: list[Block] = []
    for audit, kind in product(audits, _KINDS):
        some = [row for row in rows if (row["paper"], _kind(row)) == (audit.name, kind)]
        anchors = ["relation-{paper}-{name}".format_map(row) for row in some]
        what = f"The {len(some)} relations of {audit.name} that {kind}"
        folded = _folded(what, _RELATION, some, anchors=anchors)
        shown += folded.blocks if kind == _KINDS[0] else [folded]
    return _Part(tuple(shown), rows)


def _relation(finding: Examined, audit: Audit) -> _Row:
    """Return what is known of a relation."""
    relation, tolerance = finding.relation, finding.relation.tolerance
    plain = (
        "declared",
        "source",
        "kind",
        "claim",
        "reading",
        "supposition",
        "restates",
    )
    return {
        "name": relation.name,
        "paper": audit.name,
        "outcome": finding.outcome,
        "formula": relation.formula.text,
        "sides": _sides(finding, audit),
        "cells": list(relation.addresses),
        **{name: getattr(relation, name) for name in plain},
        "tolerance": f"{tolerance.text}: {tolerance.reason}" if tolerance else "",
        "rescued_by": finding.rescued_by,
    }


_KINDS = (
    "do not simply agree",
    "agree",
    "restate a computed cell, and agree",
    "rest on a supposition of ours",
)


def _kind(row: _Row) -> str:
    if row["supposition"]:
        return _KINDS[3]
    if row["outcome"] != "agrees":
        return _KINDS[0]
    return _KINDS[2] if row["restates"] else _KINDS[1]


def _outcome(row: _Row) -> Markup:
    rescue = _RESCUES.get(row["rescued_by"])
    flag = (
        Markup(' <span class="rp-flag">not if {}</span>').format(rescue)
        if rescue
        else ""
    )
    return badge(_BADGES[row["outcome"]], row["outcome"]) + flag


def _source(row: _Row) -> Markup:
    told = {"restates": row["restates"] and _cell_link(row["restates"])}
    told |= {"tolerance": row["tolerance"], "supposing that": row["supposition"]}
    parts = [Markup("{} {}").format(word, text) for word, text in told.items() if text]
    return Markup("; ").join([row["source"], *parts])


_DECLARED = Markup("<br><small>{declared}</small>")
_RELATION: _Columns = {
    "Relation": lambda row: (
        _code(row["name"])
        + _DECLARED.format_map(row) * (row["declared"] != row["name"])
    ),
    "What should hold": lambda row: _code(row["formula"]),
    "With the printed values": itemgetter("sides"),
    "Outcome": _outcome,
    "Source": _source,
}


def _sets(audits: Sequence[Audit]) -> _Part:
    """List the sets of cells that cannot all be right."""
    shown, rows = [], []
    for audit in audits:
        wrong = {f.relation.name for f in audit.read if f.outcome == "contradicts"}
        own: list[_Row] = [
            {
                "paper": audit.name,
                "cells": list(conflict.cells),
                "relations": list(conflict.relations),
                "only together": not wrong & set(conflict.relations),
            }
            for conflict in audit.conflicts
        ]
        what = f"All {len(own)} sets of {audit.name} that cannot all be right"
        shown.append(_folded(what, _SET, own))
        rows += own
    return _Part(tuple(shown), rows)


def _because(row: _Row) -> Markup:
    flag = Markup('<br><span class="rp-flag">{}</span>').format(JOINT)
    return _codes(row["relations"]) + (flag if row["only together"] else "")


_SET: _Columns = {
    "Size": lambda row: str(len(row["cells"])),
    "Numbers": lambda row: _codes(map(_within_paper, row["cells"])),
    "By the relations": _because,
}


def _equations(audits: Sequence[Audit]) -> _Part:
    """List the equations, run as extracted."""
    fields = (
        "name",
        "place",
        "asked",
        "printed",
        "right",
        "wanted",
        "meaning",
        "holds",
    )
    found = [one for audit in audits for one in audit.equations]
    rows = [
        {name: getattr(one, name) for name in (*fields, "supposition")} for one in found
    ]
    return _Part((_grid("Equations run as extracted", _EQUATION, rows),), rows)


_EQUATION: _Columns = {
    "Equation": itemgetter("place"),
    "What must hold": lambda row: (
        row["asked"]
        + f" (supposing that {row['supposition']})" * bool(row["supposition"])
    ),
    "What is shown": itemgetter("meaning"),
    "As extracted": lambda row: _digits(row["printed"]),
    "In the library": lambda row: _digits(row["right"]),
    "Wanted": lambda row: _digits(row["wanted"]),
}


def _errata(audits: Sequence[Audit], *, supposed: bool) -> _Part:
    """List entries of the register by consequence: a table, then each entry, folded."""
    by_paper = {audit.name: audit for audit in audits}
    chosen = [e for e in errata_register() if e.paper in by_paper]
    chosen = sorted(
        (e for e in chosen if bool(e.supposition) == supposed), key=_consequence
    )
    rows: list[_Row] = [
        {"name": e.id, **e.model_dump(exclude={"id"}), "results": _resting(e)}
        for e in chosen
    ]
    kind = "that suppose something" if supposed else "by consequence"
    table = _grid(f"The {len(rows)} errata {kind}.", _ERRATUM, rows)
    return _Part((table, *(_erratum(e, by_paper[e.paper]) for e in chosen)), rows)


_ERRATUM: _Columns = {
    "Where": Markup('<a href="#{name}">{paper}: {place}</a>').format_map,
    "Printed": itemgetter("printed"),
    "Results that rest on it": lambda row: str(len(row["results"]) or "none"),
    "The paper's conclusion": itemgetter("conclusion"),
    "Status": lambda row: (
        row["status"] + "; our text may be at fault" * row["extraction"]
    ),
}


def _consequence(entry: Erratum) -> tuple[int, int, bool]:
    """Order errata: what moves a conclusion, what many results rest on, faults of our text last."""
    return _CONCLUSIONS.index(entry.conclusion), -len(_resting(entry)), entry.extraction


def _resting(entry: Erratum) -> list[str]:
    """Return the cells whose verdict rests on an entry."""
    return [
        address
        for address, expected in frozen().items()
        if expected.erratum == entry.id
    ]


def _erratum(entry: Erratum, audit: Audit) -> Fold:
    fault = "Our text of the paper was extracted by machine; the fault may lie there."
    terms: dict[str, Entry] = {
        "Printed": entry.printed,
        "Evidence": _evidence(entry, audit),
        "Verdicts": _verdicts(entry),
        "What the library does": entry.library,
        "The paper's conclusion": f"{entry.conclusion}: {entry.because}",
        "Status": entry.status,
        "The authors' reply": verdicts.replied(entry.id),
        "Supposing that": entry.supposition,
        "Caution": fault if entry.extraction else "",
        "Cite as": f"Erratum {entry.id}, Pointing, reproduced, version {__version__}",
    }
    # The anchor stands inside the fold: a browser opens a fold around the place it is led to.
    table = Grid(
        entry.problem,
        ("Erratum", entry.id),
        [one for one in terms.items() if one[1]],
        entry.id,
        "rp-small rp-erratum",
        words=2,
    )
    return Fold(f"{entry.paper}: {entry.place}", (table,))


def _evidence(entry: Erratum, audit: Audit) -> Markup:
    """Write what the relations and equations behind an entry give, computed now."""
    pieces = [Markup("{}").format(entry.evidence)] if entry.evidence else []
    for finding in entry.findings(audit):
        name = finding.relation.name
        where = link(f"relation-{entry.paper}-{name}", _code(name))
        pieces.append(Markup("{}: {}").format(where, _sides(finding, audit)))
    for run in entry.demonstrations(audit):
        values = f"{_digits(run.printed)} as extracted, {_digits(run.wanted)} wanted"
        pieces.append(Markup("{}: {}: {}").format(run.place, run.meaning, values))
    return Markup("<br>").join(pieces)


def _verdicts(entry: Erratum) -> Markup:
    """Write the cells of the ledger whose verdict rests on an entry."""
    lines = []
    for address in _resting(entry):
        record = item_ledger(address.partition("#")[0]).cell(address)
        told = f"{verdicts.cell_of(record).shown} printed, {_judged(record)}"
        lines.append(Markup("{}: {}").format(_cell_link(address), told))
    return Markup("<br>").join(lines)


def _judged(record: Record) -> str:
    if record.verdict == "ambiguous" and record.readings:
        return f"agrees with {record.readings.agreeing} of {record.readings.count} readings"
    value = verdicts.computed(record, extra=1)
    return f"{quantity(value, verdicts.unit(record))} computed"


def _sides(finding: Examined, audit: Audit) -> str:
    """Write both sides of a relation with the printed values inserted.

    A relation that shares a number which is not printed is not worked out with some value of it:
    what it requires of that number, by itself, is written instead.
    """
    relation, cells = finding.relation, audit.cells
    if unknown := relation.unknown:
        asked = audit.unknowns[unknown.name].by_relation.get(relation.name)
        if asked is None:
            return f"no {unknown.label} fits"
        low, high = (f"{end / si_factor(unknown.unit):.6g}" for end in asked)
        return f"requires the {unknown.label} to lie from {low} to {high} {symbol(unknown.unit)}"
    # In the unit of the result, or of a cell of the same unit throughout; else as it stands.
    units = {
        cells[a].unit
        for a in ([relation.result] if relation.result else relation.addresses)
    }
    unit = units.pop() if len(units) == 1 else "1"
    values = (side / si_factor(unit) for side in (finding.left, finding.right))
    return " against ".join(
        quantity(minus(f"{value:.6g}"), symbol(unit)) for value in values
    )


def _within_paper(address: str) -> str:
    return address.partition("/")[2] or address


def _cell_link(number: str) -> Markup:
    """Link a computed number, a cell or a reading of it, to the cell."""
    address, _, reading = number.partition(" ")
    return link(anchor(address), _code(_within_paper(address))) + f" {reading}" * bool(
        reading
    )


def _digits(value: float) -> str:
    return minus(f"{0.0 if abs(value) < 1e-9 else value:.5g}")


def _code(text: str) -> Markup:
    return Markup("<code>{}</code>").format(text)


def _codes(texts: Iterable[str]) -> Markup:
    return Markup("<br>").join(map(_code, texts))


_PARTS: dict[str, Callable[[Sequence[Audit]], _Part]] = {
    "score": _score,
    "relations": _relations,
    "sets": _sets,
    "equations": _equations,
    "errata": lambda audits: _errata(audits, supposed=False),
    "suppositions": lambda audits: _errata(audits, supposed=True),
}
