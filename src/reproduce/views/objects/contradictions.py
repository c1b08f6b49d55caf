"""What the printed numbers say of each other: the cross-examination part by part, and the errata.

Each part is a DataFrame and the blocks that show it; `Contradictions` puts them together.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from reproduce.audit.corrections import Correction
from reproduce.audit.examine import Agreement, Examined
from reproduce.audit.report import Audit, Erratum, Group, register
from reproduce.judge.expected import frozen
from reproduce.judge.ledger import Record
from reproduce.locate import data_folders
from reproduce.papers.declare import words
from reproduce.papers.sketch import sized
from reproduce.printed.cells import PAPERS, anchor, find
from reproduce.printed.units import si_factor, symbol
from reproduce.version import __version__
from reproduce.views.computed import item_ledger, paper_audit
from reproduce.views.keys import check_paper
from reproduce.views.objects.base import by_row, text_of
from reproduce.views.objects.figure import pictured
from reproduce.views.writing.blocks import Block, Entry, Fold, Grid, Html, badge
from reproduce.views.writing.display import Blocks, Display
from reproduce.views.writing.figures import Picture
from reproduce.views.writing.numbers import minus
from reproduce.views.writing.page import folded
from reproduce.views.writing.verdicts import quantity

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

JOINT = "hold one by one, but not together"
SHOWN = 6  # corrections of a contradiction
# With more equal corrections than this, a list of them says nothing.
_MANY = 12
# As many cells as a picture can show legibly.
_MOST = 32
_BADGES = {
    "agrees": "exact",
    "agrees only through rounding": "input",
    "contradicts": "differs",
}
_RESCUES = {
    "truncation": "all numbers were cut off after their last digit",
    "ceiling": "all numbers were rounded upwards",
}
# From the gravest consequence to none.
_CONCLUSIONS = ("moves", "open", "stands")


@dataclass(frozen=True, repr=False)
class Part(Blocks):
    """A part of the cross-examination: its numbers, and what shows them."""

    numbers: pd.DataFrame

    def frame(self) -> pd.DataFrame:
        """Return the numbers: one row for each relation, set, correction, equation or entry."""
        return self.numbers.copy()


class Contradictions(Display):
    """What the printed numbers of papers say of each other, and the errata.

    Its parts are ``score``, ``relations``, ``sets`` (the smallest sets of numbers that cannot all
    be right), ``corrections`` (the slips of the pen that would lift a contradiction),
    ``equations`` (run as extracted), ``errata`` and ``suppositions`` (entries that suppose
    something):
    ``contradictions("chen2023")["relations"]``. Each shows itself and has a ``frame()``.

    Parameters
    ----------
    paper : str, optional
        One paper; all by default.
    """

    def __init__(self, paper: str | None = None) -> None:
        self.paper = paper if paper is None else check_paper(paper)

    @cached_property
    def audits(self) -> list[Audit]:
        """What the cross-examination found, an audit for each paper."""
        return [paper_audit(name) for name in PAPERS if self.paper in {None, name}]

    def __getitem__(self, name: str) -> Part:
        """Return a part by its name."""
        if name in _REGISTER:
            supposed = name == _REGISTER[1]
            entries = [one for one in errata_register() if bool(one.supposition) == supposed]
            return _errata([e for e in entries if self.paper in {None, e.paper}])
        if name not in _PARTS:
            expected = ", ".join((*_PARTS, *_REGISTER))
            raise KeyError(f"no part {name!r}: expected one of {expected}")
        return _PARTS[name](self.audits)

    def frame(self) -> pd.DataFrame:
        """Return the register: one row per entry, with what is printed and why it is there."""
        import pandas as pd

        return pd.concat([self[name].frame() for name in _REGISTER])

    def as_json(self) -> dict[str, list[dict[str, Any]]]:
        """Return everything that was found, for other programs: the rows of each part."""
        frames = {name: self[name].frame() for name in (*_PARTS, *_REGISTER)}
        return {
            name: json.loads(frame.reset_index(names="name").to_json(orient="records"))
            for name, frame in frames.items()
        }

    def blocks(self) -> Iterator[Block]:
        """Yield every part."""
        for name in (*_PARTS, *_REGISTER):
            part = self[name]
            if len(part.numbers):
                yield from part.blocks()

    def picture(self) -> Html:
        """Show relations against cells: a dot where a contradicting relation holds a cell."""
        (audit,) = self.audits
        return _picture(audit)


@cache
def errata_register() -> tuple[Erratum, ...]:
    """Return the register of errata of all papers, in the order of its files."""
    texts = [(one / "errata.toml").read_text(encoding="utf-8") for one in data_folders()]
    return tuple(one for text in texts for one in register(text))


def _score(audits: Sequence[Audit]) -> Part:
    """Count how much of each paper was cross-examined, and what came of it."""
    counted = {}
    for audit in audits:
        own, again = (list(audit.tally(restating=x).values()) for x in (False, True))
        supposing = sum(bool(shown.supposition) for shown in audit.equations)
        agree, rounding, contradict = own
        counted[audit.name] = {
            "Numbers": len(audit.cells),
            "Held against others": len(audit.examined),
            "Only bounded": len(audit.bounded),
            "Relations": sum(own),
            "Agree": agree,
            "Only through rounding": rounding,
            "Contradict": contradict,
            "Restate computed cells": sum(again),
            "Contradict among these": again[-1],
            "Equations run": len(audit.equations) - supposing,
            "Fail as extracted": len(audit.failing),
            "Rest on suppositions of ours": len(audit.supposed) + supposing,
        }
    rows = [[_code(name), *map(str, counts.values())] for name, counts in counted.items()]
    frame = by_row(counted)
    return Part((Grid("The cross-examination", ["Paper", *frame], rows, kind="rp-score"),), frame)


def _relations(audits: Sequence[Audit]) -> Part:
    """List all relations: first those that do not simply agree, then the others, folded."""
    shown: list[Block] = []
    for audit in audits:
        loud = [f for f in audit.read if f.outcome != "agrees"]
        quiet = [f for f in audit.read if f.outcome == "agrees"]
        what = f"Relations of {audit.name} that do not simply agree"
        shown += [_relations_grid(loud, audit, what)] if loud else []
        for findings, kind in (
            ([f for f in quiet if not f.relation.restates], "agree"),
            ([f for f in quiet if f.relation.restates], "restate a computed cell, and agree"),
            (audit.supposed, "rest on a supposition of ours"),
        ):
            table = _relations_grid(findings, audit, f"Relations that {kind}")
            shown.append(Fold(f"The {len(findings)} relations that {kind}", (table,), page=True))
    rows = {f.relation.name: _fields(f, audit) for audit in audits for f in audit.findings}
    return Part(tuple(shown), by_row(rows))


def _fields(finding: Examined, audit: Audit) -> dict[str, Any]:
    """Return what is known of a relation."""
    relation, tolerance = finding.relation, finding.relation.tolerance
    plain = ("declared", "source", "kind", "claim", "reading", "supposition", "restates")
    return {
        "outcome": finding.outcome,
        "formula": relation.formula.text,
        "sides": _sides(finding, audit),
        "cells": ", ".join(relation.addresses),
        **{name: getattr(relation, name) for name in plain},
        "tolerance": f"{tolerance.text}: {tolerance.reason}" if tolerance else "",
        "rescued_by": finding.rescued_by,
    }


def _relations_grid(findings: Sequence[Examined], audit: Audit, caption: str) -> Grid:
    heads = ("Relation", "What should hold", "With the printed values", "Outcome", "Source")
    rows = []
    for finding in findings:
        relation = finding.relation
        name = _code(relation.name)
        if relation.declared != relation.name:
            name += Markup("<br><small>{}</small>").format(relation.declared)
        source = [Markup("{}").format(relation.source)]
        if relation.restates:
            source.append(Markup("restates {}").format(_cell_link(relation.restates)))
        if relation.tolerance:
            source.append(Markup("tolerance {0.text}: {0.reason}").format(relation.tolerance))
        if relation.supposition:
            source.append(Markup("supposing that {}").format(relation.supposition))
        row = [name, _code(relation.formula.text), _sides(finding, audit), _badge(finding)]
        rows.append([*row, Markup("; ").join(source)])
    anchors = [_relation_anchor(audit.name, f.relation.name) for f in findings]
    return Grid(caption, heads, rows, kind="rp-small rp-audit", anchors=anchors, words=5)


def _badge(finding: Examined) -> Markup:
    rescue = _RESCUES.get(finding.rescued_by)
    flag = Markup(' <span class="rp-flag">not if {}</span>').format(rescue) if rescue else ""
    return badge(_BADGES[finding.outcome], finding.outcome) + flag


def _sets(audits: Sequence[Audit]) -> Part:
    """List the smallest sets of cells that cannot all be right."""
    grids, numbers = [], []
    for audit in audits:
        wrong = {f.relation.name for f in audit.read if f.outcome == "contradicts"}
        rows = []
        for conflict in audit.conflicts:
            because, together = _codes(conflict.relations), not wrong & set(conflict.relations)
            if together:
                because += Markup('<br><span class="rp-flag">{}</span>').format(JOINT)
            cells = _codes(map(_within_paper, conflict.cells))
            rows.append([str(len(conflict.cells)), cells, because])
            numbers.append(
                {
                    "paper": audit.name,
                    "cells": ", ".join(conflict.cells),
                    "relations": ", ".join(conflict.relations),
                    "only together": together,
                }
            )
        caption = "Smallest sets of numbers that cannot all be right"
        table = _small(("Size", "Numbers", "By the relations"), rows, caption)
        what = f"All {len(rows)} smallest sets of {audit.name} that cannot all be right"
        grids.append(Fold(what, (table,), page=True))
    return Part(tuple(grids), _rows(numbers))


def _corrections(audits: Sequence[Audit]) -> Part:
    """List the contradictions with the slips of the pen that would lift them."""
    heads = ("Contradiction", "Supposed slips", "Size", "Breaks", "The paper's conclusion", "Then")
    shown, numbers = [], []
    for audit in audits:
        rows = [row for group in audit.groups for row in _correction_rows(group, audit)]
        if rows:
            caption = f"Corrections of {audit.name}, by size of the slip"
            shown.append(_small(heads, rows, caption, whole=(1,)))
        numbers += [
            {"contradiction": ", ".join(group.relations)} | _correction(found, audit.name)
            for group in audit.groups
            for found in group.corrections
        ]
    return Part(tuple(shown), _rows(numbers))


def _correction_rows(group: Group, audit: Audit) -> list[list[Entry]]:
    name = _codes(group.relations)
    remark = _too_many(group)
    if remark or not group.corrections:
        return [[name, remark or "no slips within the search", *[""] * 4]]
    rows: list[list[Entry]] = []
    for found in group.corrections[:SHOWN]:
        words = _correction(found, audit.name)
        breaks = str(len(words["breaks"])) if words["breaks"] else "nothing"
        rest = (f"{words['size']:g}", breaks, words["conclusion"], "; ".join(words["unknowns"]))
        rows.append([name, _codes(words["slips"]), *rest])
        name = Markup("")
    return rows


def _correction(found: Correction, paper: str) -> dict[str, Any]:
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


def _too_many(group: Group) -> str:
    """Say so where so many slips would lift a contradiction that none of them is told apart."""
    whole = [c for c in group.corrections if c.restores_everything]
    least = [c for c in whole if c.cost == whole[0].cost]
    if len(least) <= _MANY:
        return ""
    return (
        f"{len(least)} different slips of the smallest size would lift this, "
        "so it does not tell which number is wrong"
    )


def _equations(audits: Sequence[Audit]) -> Part:
    """List the equations, run as extracted."""
    heads = ["Equation", "What must hold", "What is shown"]
    heads += ["As extracted", "In the library", "Wanted"]
    fields = ("place", "asked", "printed", "right", "wanted", "meaning", "holds", "supposition")
    rows, numbers = [], {}
    for shown in (one for audit in audits for one in audit.equations):
        values = map(_digits, (shown.printed, shown.right, shown.wanted))
        supposing = f" (supposing that {shown.supposition})" if shown.supposition else ""
        rows.append([shown.place, shown.asked + supposing, shown.meaning, *values])
        numbers[shown.name] = {name: getattr(shown, name) for name in fields}
    return Part((_small(heads, rows, "Equations run as extracted"),), by_row(numbers))


def _errata(chosen: list[Erratum]) -> Part:
    """List entries of the register by consequence: a table, then each entry, folded."""
    chosen = sorted(chosen, key=_consequence)
    heads = ("Where", "Printed", "Results that rest on it", "The paper's conclusion", "Status")
    rows = [
        [
            Markup('<a href="#{0.id}">{0.paper}: {0.place}</a>').format(entry),
            entry.printed,
            str(len(_resting(entry)) or "none"),
            entry.conclusion,
            entry.status + ("; our text may be at fault" if entry.extraction else ""),
        ]
        for entry in chosen
    ]
    supposed = any(entry.supposition for entry in chosen)
    kind = "that suppose something" if supposed else "by consequence"
    wanted = ["paper", "place", "printed", "problem", "conclusion", "status", "extraction"]
    frame = by_row({e.id: [getattr(e, name) for name in wanted] for e in chosen}, wanted)
    table = _small(heads, rows, f"The {len(rows)} errata {kind}.")
    return Part((table, *map(_erratum, chosen)), frame)


_PARTS: dict[str, Callable[[Sequence[Audit]], Part]] = {
    "score": _score,
    "relations": _relations,
    "sets": _sets,
    "corrections": _corrections,
    "equations": _equations,
}
_REGISTER = ("errata", "suppositions")


def _consequence(entry: Erratum) -> tuple[int, int, bool]:
    """Order errata: what moves a conclusion, what many results rest on, faults of our text last."""
    return _CONCLUSIONS.index(entry.conclusion), -len(_resting(entry)), entry.extraction


def _resting(entry: Erratum) -> list[str]:
    """Return the cells whose verdict rests on an entry."""
    return [address for address, expected in frozen().items() if expected.erratum == entry.id]


def _erratum(entry: Erratum) -> Fold:
    fault = "Our text of the paper was extracted by machine; the fault may lie there."
    terms: dict[str, Entry] = {
        "Printed": entry.printed,
        "Problem": entry.problem,
        "Evidence": _evidence(entry, paper_audit(entry.paper)),
        "Verdicts": _verdicts(entry),
        "What the library does": entry.library,
        "The paper's conclusion": f"{entry.conclusion}: {entry.because}",
        "Status": entry.status,
        "Supposing that": entry.supposition,
        "Caution": fault if entry.extraction else "",
        "Cite as": Markup(
            "Erratum <code>{}</code>, <em>Pointing, reproduced</em>, version {}"
        ).format(entry.id, __version__),
    }
    items = Markup("").join(
        Markup("<dt>{}</dt><dd>{}</dd>").format(term, text) for term, text in terms.items() if text
    )
    # The anchor stands inside the fold: a browser opens a fold around the place it is led to.
    section = Markup('<section class="rp-erratum" id="{}"><dl>{}</dl></section>')
    title = f"{entry.paper}: {entry.place}"
    return Fold(title, (Html(section.format(entry.id, items), f"    {entry.problem}"),))


def _evidence(entry: Erratum, audit: Audit) -> Markup:
    """Write what the relations and equations behind an entry give, computed now."""
    pieces = [Markup("{}").format(entry.evidence)] if entry.evidence else []
    findings = entry.findings(audit)
    link = Markup('<a href="#{}"><code>{}</code></a>: {}')
    for finding in findings:
        name = finding.relation.name
        pieces.append(
            link.format(_relation_anchor(entry.paper, name), name, _sides(finding, audit))
        )
    related = [finding.relation for finding in findings]
    if origins := dict.fromkeys(r.declared for r in related if r.declared != r.name):
        codes = Markup(", ").join(map(_code, origins))
        pieces.append(Markup("<small>declared as {}</small>").format(codes))
    for run in entry.demonstrations(audit):
        values = f"{_digits(run.printed)} as extracted, {_digits(run.wanted)} wanted"
        pieces.append(Markup("{}: {}: {}").format(run.place, run.meaning, values))
    return Markup("<br>").join(pieces)


def _verdicts(entry: Erratum) -> Markup:
    """Write the cells of the ledger whose verdict rests on an entry."""
    resting = _resting(entry)
    if not resting:
        return Markup("")
    records = {
        r.cell: r for r in item_ledger(*sorted({a.partition("#")[0] for a in resting})).records
    }
    return Markup("<br>").join(
        Markup("{}: {} printed, {}").format(
            _cell_link(a), minus(records[a].printed), _outcome(records[a])
        )
        for a in resting
    )


def _outcome(record: Record) -> str:
    if record.readings:
        agreeing = sum(reading.agrees for reading in record.readings)
        return f"blocked: agrees with {agreeing} of {len(record.readings)} readings"
    return f"{_digits(record.computed or 0.0)} computed"


def _sides(finding: Examined, audit: Audit) -> str:
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


def _picture(audit: Audit) -> Html:
    counts = audit.blamed()
    cells = sorted(counts, key=lambda address: (-counts[address], list(audit.cells).index(address)))
    cells = cells[:_MOST]
    every = [f.relation for f in audit.read if f.outcome == "contradicts"]
    wrong = [relation for relation in every if set(cells) & set(relation.addresses)]
    others = len(every) - len(wrong)
    dots = {
        x: [y for y, cell in enumerate(cells) if cell in relation.addresses]
        for x, relation in enumerate(wrong, start=1)
    }
    numbers = _rows(
        {"cell": cell, "smallest sets": counts[cell], "relation": relation.name}
        for cell in cells
        for relation in wrong
        if cell in relation.addresses
    )
    bars = {_named(cell): counts[cell] for cell in cells}
    drawn = Picture(f"audit-{audit.name}", lambda figure: _draw(figure, dots, bars), numbers)
    link = Markup('<li><a href="#{}"><code>{}</code></a>: {}</li>')
    listed = Markup("").join(
        link.format(_relation_anchor(audit.name, one.name), one.name, one.source) for one in wrong
    )
    more = f" {others} more hold none of these numbers." if others else ""
    key = folded(f"The relations by their number.{more}", Markup("<ol>{}</ol>").format(listed))
    text = words(f"{audit.name}/contradictions").figure
    shown = pictured(drawn, text.alternative, text.caption, text_of(_draw))
    return Html(Markup(shown.text) + key)


def _draw(figure: Figure, dots: Mapping[int, list[int]], bars: Mapping[str, int]) -> None:
    """Draw a column of dots for each relation, and a bar for each cell."""
    narrow = sized(figure, 6.8, 1.6 + 0.2 * len(bars), 1.8 + 0.39 * len(bars))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(2, 1))
    for x, rows in dots.items():
        left.plot([x] * len(rows), rows, "-o", markersize=4, linewidth=0.8, color="C1")
    labels = [textwrap.fill(name, 20) if narrow else name for name in bars]
    left.set_yticks(range(len(bars)), labels, fontsize=8)
    left.set_xticks(list(dots))
    left.set_ylim(len(bars) - 0.5, -0.5)
    left.set_title("relation", loc="left")
    left.xaxis.tick_top()
    right.barh(range(len(bars)), list(bars.values()), color="C0")
    right.set_title("in how\nmany sets", loc="left")


def _named(address: str) -> str:
    """Return what a cell is, and the table that prints it, in words."""
    (cell,) = find(address)
    place = cell.place.partition(",")[0]
    return f"{cell.label}, {place[0].lower() if place == 'Text' else place[0]}{place[1:]}"


def _within_paper(address: str) -> str:
    return address.partition("/")[2] or address


def _relation_anchor(paper: str, name: str) -> str:
    return f"relation-{paper}-{name}"


def _cell_link(number: str) -> Markup:
    """Link a computed number, a cell or a reading of it, to the cell."""
    address, _, reading = number.partition(" ")
    link = Markup('<a href="#{}">{}</a>').format(anchor(address), _code(_within_paper(address)))
    return link + (f" {reading}" if reading else "")


def _digits(value: float) -> str:
    return minus(f"{0.0 if abs(value) < 1e-9 else value:.5g}")


def _code(text: str) -> Markup:
    return Markup("<code>{}</code>").format(text)


def _codes(texts: Iterable[str]) -> Markup:
    return Markup("<br>").join(map(_code, texts))


def _rows(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(list(rows))


def _small(
    heads: Sequence[Entry],
    rows: Sequence[Sequence[Entry]],
    caption: str,
    whole: tuple[int, ...] = (),
) -> Grid:
    kind = "rp-small rp-audit"
    return Grid(caption, heads, rows, kind=kind, words=len(heads), whole=whole)
