"""What the book's audit pages call: one call shows the score, the relations, the errata."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import pandas as pd
from markupsafe import Markup

from reproduce.audit.errata import Erratum
from reproduce.audit.examine import Examined
from reproduce.audit.report import Audit, Group
from reproduce.judge.expected import frozen
from reproduce.judge.ledger import Record
from reproduce.papers.sketch import sized
from reproduce.printed.cells import PAPERS, anchor, find
from reproduce.version import __version__
from reproduce.views.computed import item_ledger, paper_audit
from reproduce.views.objects import contradictions
from reproduce.views.objects.base import text_of
from reproduce.views.objects.contradictions import errata_register, within_paper
from reproduce.views.objects.figure import pictured
from reproduce.views.writing.display import Grid, Html, folded
from reproduce.views.writing.figures import Picture
from reproduce.views.writing.numbers import minus

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    *("JOINT", "audit_facts", "corrections", "equations", "errata"),
    *("picture", "relations", "score", "smallest_sets"),
]

JOINT = "hold one by one, but not together"
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
# As many cells as a picture can show legibly.
_MOST = 32


def score() -> Html:
    """Show how much of each paper was cross-examined, and what came of it."""
    heads = ["Paper", "Numbers", "Held against others", "Only bounded", "Relations", "Agree"]
    heads += ["Only through rounding", "Contradict"]
    heads += ["Restate computed cells", "Contradict among these"]
    heads += ["Equations run", "Fail as extracted", "Rest on suppositions of ours"]
    rows = []
    for audit in map(paper_audit, PAPERS):
        own, again = (list(audit.tally(restating=x).values()) for x in (False, True))
        supposing = sum(bool(shown.supposition) for shown in audit.equations)
        counts = [len(audit.cells), len(audit.examined), len(audit.bounded), sum(own), *own]
        counts += [sum(again), again[-1], len(audit.equations) - supposing, len(audit.failing)]
        counts.append(len(audit.supposed) + supposing)
        rows.append([_code(audit.name), *map(str, counts)])
    return Html(_table(heads, rows, "The cross-examination of both papers", "rp-score"))


def relations(paper: str) -> Html:
    """Show all relations of a paper: first those that do not simply agree, then the others."""
    audit = paper_audit(paper)
    loud = [f for f in audit.read if f.outcome != "agrees"]
    quiet = [f for f in audit.read if f.outcome == "agrees"]
    shown = _relations_table(loud, audit, "Relations that do not simply agree")
    for findings, what in (
        ([f for f in quiet if not f.relation.restates], "agree"),
        ([f for f in quiet if f.relation.restates], "restate a computed cell, and agree"),
        (audit.supposed, "rest on a supposition of ours"),
    ):
        table = _relations_table(findings, audit, f"Relations that {what}")
        shown += folded(f"The {len(findings)} relations that {what}", table)
    return Html(shown)


def _relations_table(findings: Sequence[Examined], audit: Audit, caption: str) -> Markup:
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
        values = contradictions.sides(finding, audit)
        row = [name, _code(relation.formula.text), values, _badge(finding)]
        rows.append([*row, Markup("; ").join(source)])
    anchors = [relation_anchor(audit.name, f.relation.name) for f in findings]
    return _table(heads, rows, caption, anchors=anchors)


def relation_anchor(paper: str, name: str) -> str:
    """Return the anchor of a relation in the book."""
    return f"relation-{paper}-{name}"


def _cell_link(number: str) -> Markup:
    """Link a computed number, a cell or a reading of it, to the cell."""
    address, _, reading = number.partition(" ")
    link = Markup('<a href="#{}">{}</a>').format(anchor(address), _code(within_paper(address)))
    return link + (f" {reading}" if reading else "")


def _badge(finding: Examined) -> Markup:
    badge = Markup('<span class="rp-badge rp-badge-{}">{}</span>').format(
        _BADGES[finding.outcome], finding.outcome
    )
    if rescue := _RESCUES.get(finding.rescued_by):
        badge += Markup(' <span class="rp-flag">not if {}</span>').format(rescue)
    return badge


def smallest_sets(paper: str) -> Html:
    """Show the smallest sets of cells that cannot all be right."""
    rows = []
    audit = paper_audit(paper)
    wrong = {f.relation.name for f in audit.read if f.outcome == "contradicts"}
    for conflict in audit.conflicts:
        because = _codes(conflict.relations)
        if not wrong & set(conflict.relations):
            because += Markup('<br><span class="rp-flag">{}</span>').format(JOINT)
        cells = _codes(map(within_paper, conflict.cells))
        rows.append([str(len(conflict.cells)), cells, because])
    caption = "Smallest sets of numbers that cannot all be right"
    table = _table(("Size", "Numbers", "By the relations"), rows, caption)
    return Html(folded(f"All {len(rows)} sets", table))


def corrections(paper: str) -> Html:
    """Show the contradictions of a paper with the slips of the pen that would lift them."""
    audit = paper_audit(paper)
    heads = ("Contradiction", "Supposed slips", "Size", "Breaks", "The paper's conclusion", "Then")
    rows = [row for group in audit.groups for row in _correction_rows(group, audit)]
    return Html(_table(heads, rows, "Corrections, by size of the slip"))


def _correction_rows(group: Group, audit: Audit) -> list[list[str]]:
    name = _codes(group.relations)
    remark = contradictions.too_many(group)
    if remark or not group.corrections:
        return [[name, remark or "no slips within the search", *[""] * 4]]
    rows = []
    for found in group.corrections[: contradictions.SHOWN]:
        words = contradictions.correction(found, audit.name)
        breaks = str(len(words["breaks"])) if words["breaks"] else "nothing"
        rest = (f"{words['size']:g}", breaks, words["conclusion"], "; ".join(words["unknowns"]))
        rows.append([name, _codes(words["slips"]), *rest])
        name = Markup("")
    return rows


def equations(paper: str) -> Html:
    """Show the equations of a paper, run as extracted."""
    heads = ["Equation", "What must hold", "What is shown"]
    heads += ["As extracted", "In the library", "Wanted"]
    rows = []
    for shown in paper_audit(paper).equations:
        values = map(_digits, (shown.printed, shown.right, shown.wanted))
        supposing = f" (supposing that {shown.supposition})" if shown.supposition else ""
        rows.append([shown.place, shown.asked + supposing, shown.meaning, *values])
    return Html(_table(heads, rows, "Equations run as extracted"))


def errata(supposed: bool = False) -> Html:
    """Show the register of errata by consequence: a table, then each entry, folded."""
    chosen = [entry for entry in errata_register() if bool(entry.supposition) == supposed]
    chosen.sort(key=_consequence)
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
    kind = "that suppose something" if supposed else "by consequence"
    table = _table(heads, rows, f"The {len(rows)} errata {kind}.")
    return Html(table + Markup("").join(map(_erratum, chosen)))


def _consequence(entry: Erratum) -> tuple[int, int, bool]:
    """Order errata: what moves a conclusion, what many results rest on, faults of our text last."""
    return _CONCLUSIONS.index(entry.conclusion), -len(_resting(entry)), entry.extraction


def _resting(entry: Erratum) -> list[str]:
    """Return the cells whose verdict rests on an entry."""
    return [address for address, expected in frozen().items() if expected.erratum == entry.id]


def _erratum(entry: Erratum) -> Markup:
    fault = "Our text of the paper was extracted by machine; the fault may lie there."
    version = __version__
    terms = {
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
        ).format(entry.id, version),
    }
    items = Markup("").join(
        Markup("<dt>{}</dt><dd>{}</dd>").format(term, text) for term, text in terms.items() if text
    )
    # The anchor stands inside the fold: a browser opens a fold around the place it is led to.
    section = Markup('<section class="rp-erratum" id="{}"><dl>{}</dl></section>')
    return folded(f"{entry.paper}: {entry.place}", section.format(entry.id, items))


def _evidence(entry: Erratum, audit: Audit) -> Markup:
    """Write what the relations and equations behind an entry give, computed now."""
    pieces = [Markup("{}").format(entry.evidence)] if entry.evidence else []
    findings = entry.findings(audit)
    for finding in findings:
        relation = finding.relation
        pieces.append(
            Markup('<a href="#{}"><code>{}</code></a>: {}').format(
                relation_anchor(entry.paper, relation.name),
                relation.name,
                contradictions.sides(finding, audit),
            )
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


def picture(paper: str, alternative: str, caption: str) -> Html:
    """Show relations against cells: a dot where a contradicting relation holds a blamed cell."""
    audit = paper_audit(paper)
    counts = audit.blamed()
    cells = sorted(counts, key=lambda address: (-counts[address], list(audit.cells).index(address)))
    cells = cells[:_MOST]
    every = [f.relation for f in audit.read if f.outcome == "contradicts"]
    wrong = [relation for relation in every if set(cells) & set(relation.addresses)]
    others = len(every) - len(wrong)
    names = [_named(cell) for cell in cells]

    def paint(figure: Figure) -> None:
        narrow = sized(figure, 6.8, 1.6 + 0.2 * len(cells), 1.8 + 0.39 * len(cells))
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(2, 1))
        for x, relation in enumerate(wrong, start=1):
            rows = [y for y, cell in enumerate(cells) if cell in relation.addresses]
            left.plot([x] * len(rows), rows, "-o", markersize=4, linewidth=0.8, color="C1")
        labels = [textwrap.fill(name, 20) if narrow else name for name in names]
        left.set_yticks(range(len(cells)), labels, fontsize=8)
        left.set_xticks(range(1, len(wrong) + 1))
        left.set_ylim(len(cells) - 0.5, -0.5)
        left.set_title("relation", loc="left")
        left.xaxis.tick_top()
        right.barh(range(len(cells)), [counts[cell] for cell in cells], color="C0")
        right.set_title("in how\nmany sets", loc="left")

    numbers = pd.DataFrame(
        {"cell": address, "smallest sets": counts[address], "relation": relation.name}
        for address in cells
        for relation in wrong
        if address in relation.addresses
    )
    drawn = Picture(f"audit-{paper}", paint, numbers)
    link = Markup('<li><a href="#{}"><code>{}</code></a>: {}</li>')
    listed = Markup("").join(
        link.format(relation_anchor(paper, one.name), one.name, one.source) for one in wrong
    )
    more = f" {others} more hold none of these numbers." if others else ""
    key = folded(
        f"The relations by their number.{more}", Markup("<ol>{}</ol>").format(listed), opened=False
    )
    shown = pictured(drawn, alternative, caption, text_of(picture))
    return Html(Markup(shown.text) + key)


def _named(address: str) -> str:
    """Return what a cell is, and the table that prints it, in words."""
    (cell,) = find(address)
    place = cell.place.partition(",")[0]
    return f"{cell.label}, {place[0].lower() if place == 'Text' else place[0]}{place[1:]}"


def audit_facts() -> dict[str, str]:
    """Return what sentences may say of the audit: label to text.

    ``PAPER-relations``, ``-agreeing``, ``-rounding``, ``-contradicting`` (without those that
    restate computed cells), ``-restating`` and ``-restating-contradicting`` (those alone),
    ``-examined``, ``-numbers``, ``-groups`` (contradictions that belong together), ``-supposed``
    (relations that rest on a supposition of ours, in none of the other counts); the same of both
    papers without the paper's name; ``errata``, among them ``errata-standing`` (the paper's
    conclusion stands) and ``errata-extraction``; ``errata-supposed`` apart, of which
    ``errata-supposed-standing``.
    """
    counts: dict[str, int] = {}
    audits = [paper_audit(paper) for paper in PAPERS]
    for start, group in [*((f"{a.name}-", [a]) for a in audits), ("", audits)]:
        for audit in group:
            own, again = audit.tally(restating=False), audit.tally(restating=True)
            found = dict(zip(("agreeing", "rounding", "contradicting"), own.values(), strict=True))
            found |= {
                "relations": sum(own.values()),
                "restating": len(audit.restating),
                "restating-contradicting": again["contradicts"],
                "examined": len(audit.examined),
                "numbers": len(audit.cells),
                "groups": len(audit.groups),
                "supposed": len(audit.supposed),
            }
            for name, count in found.items():
                counts[start + name] = counts.get(start + name, 0) + count
    read = [entry for entry in errata_register() if not entry.supposition]
    counts["errata"] = len(read)
    counts["errata-standing"] = sum(entry.conclusion == "stands" for entry in read)
    counts["errata-extraction"] = sum(entry.extraction for entry in read)
    supposed = [entry for entry in errata_register() if entry.supposition]
    counts["errata-supposed"] = len(supposed)
    counts["errata-supposed-standing"] = sum(one.conclusion == "stands" for one in supposed)
    return {label: str(count) for label, count in counts.items()}


def _digits(value: float) -> str:
    return minus(f"{0.0 if abs(value) < 1e-9 else value:.5g}")


def _code(text: str) -> Markup:
    return Markup("<code>{}</code>").format(text)


def _codes(texts: Iterable[str]) -> Markup:
    return Markup("<br>").join(map(_code, texts))


def _table(
    heads: Sequence[str],
    rows: Iterable[Sequence[str]],
    caption: str,
    kind: str = "rp-small rp-audit",
    anchors: Sequence[str] = (),
) -> Markup:
    return Grid(caption, heads, tuple(rows), kind=kind, anchors=anchors).html
