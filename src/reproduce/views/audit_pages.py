"""What the book's audit pages call: one call shows the score, the relations, the errata."""

from __future__ import annotations

import functools
from collections.abc import Iterable

from markupsafe import Markup

from reproduce.audit.errata import Erratum, register
from reproduce.audit.examine import Finding
from reproduce.audit.report import Audit, Group, audit_paper
from reproduce.judge.expected import frozen
from reproduce.judge.ledger import Record, build
from reproduce.locate import data_folder
from reproduce.printed.cells import PAPERS
from reproduce.version import __version__
from reproduce.views import audit_words as words
from reproduce.views.pages import Html

_BADGES = {
    "agrees": "exact",
    "agrees only through rounding": "input",
    "contradicts": "differs",
}
JOINT = "hold one by one, but not together"
_RESCUES = {
    "truncation": "all numbers were cut off after their last digit",
    "ceiling": "all numbers were rounded upwards",
}


@functools.cache
def errata_register() -> tuple[Erratum, ...]:
    """Return the register of errata, in the order of its file."""
    path = data_folder() / "errata.toml"
    return tuple(register(path.read_text(encoding="utf-8")))


def score() -> Html:
    """Show how much of each paper was cross-examined, and what came of it."""
    heads = ["Paper", "Numbers", "Held against others", "Only bounded", "Relations", "Agree"]
    heads += ["Only through rounding"]
    heads += ["Contradict", "Equations run", "Fail as extracted", "Rest on suppositions of ours"]
    rows = []
    for audit in map(audit_paper, PAPERS):
        ours = sum(bool(shown.supposition) for shown in audit.equations)
        counts = [len(audit.cells), len(audit.examined), len(audit.bounded), len(audit.read)]
        counts += [*audit.tally().values(), len(audit.equations) - ours, len(audit.failing)]
        counts.append(len(audit.supposed) + ours)
        rows.append([_code(audit.name), *(Markup("{}").format(count) for count in counts)])
    return Html(
        html_table(heads, rows, "The cross-examination of both papers", "rp-table rp-score")
    )


def relations(paper: str) -> Html:
    """Show all relations of a paper: first those that contradict, then the others."""
    audit = audit_paper(paper)
    loud = [f for f in audit.read if f.outcome != "agrees"]
    quiet = [f for f in audit.read if f.outcome == "agrees"]
    shown = _relations_table(loud, audit, "Relations that do not simply agree")
    for findings, what in ((quiet, "agree"), (audit.supposed, "rest on a supposition of ours")):
        caption = f"Relations that {what}"
        shown += Markup(
            '<details class="rp-fold"><summary>The {} relations that {}</summary>{}</details>'
        ).format(len(findings), what, _relations_table(findings, audit, caption))
    return Html(shown)


def _relations_table(findings: Iterable[Finding], audit: Audit, caption: str) -> Markup:
    heads = ("Relation", "What should hold", "With the printed values", "Outcome", "Source")
    rows = []
    for finding in findings:
        relation = finding.relation
        source = Markup("{}").format(relation.source)
        if relation.tolerance:
            told = f"{relation.tolerance.text}: {relation.tolerance.reason}"
            source += Markup("; tolerance {}").format(told)
        if relation.supposition:
            source += Markup("; supposing that {}").format(relation.supposition)
        row = [_code(relation.name), _code(relation.formula.text)]
        row += [Markup("{}").format(words.sides(finding, audit)), _badge(finding)]
        rows.append([*row, source])
    anchors = [relation_anchor(audit.name, f.relation.name) for f in findings]
    return html_table(heads, rows, caption, "rp-table rp-small rp-audit", anchors)


def relation_anchor(paper: str, name: str) -> str:
    """Return the anchor of a relation in the book."""
    return f"relation-{paper}-{name}"


def _badge(finding: Finding) -> Markup:
    badge = Markup('<span class="rp-badge rp-badge-{}">{}</span>')
    told = badge.format(_BADGES[finding.outcome], finding.outcome)
    if finding.rescued_by:
        told += Markup(' <span class="rp-flag">not if {}</span>').format(
            _RESCUES[finding.rescued_by]
        )
    return told


def smallest_sets(paper: str) -> Html:
    """Show the smallest sets of cells that cannot all be right."""
    rows = []
    audit = audit_paper(paper)
    wrong = {f.relation.name for f in audit.read if f.outcome == "contradicts"}
    for conflict in audit.conflicts:
        sets = Markup("<br>").join(_code(words.short(address)) for address in conflict.cells)
        because = Markup("<br>").join(_code(name) for name in conflict.relations)
        if not wrong & set(conflict.relations):
            because += Markup('<br><span class="rp-flag">{}</span>').format(JOINT)
        rows.append([Markup("{}").format(len(conflict.cells)), sets, because])
    caption = "Smallest sets of numbers that cannot all be right"
    heads = ("Size", "Numbers", "By the relations")
    told = html_table(heads, rows, caption, "rp-table rp-small rp-audit")
    folded = Markup('<details class="rp-fold"><summary>All {} sets</summary>{}</details>')
    return Html(folded.format(len(rows), told))


def corrections(paper: str) -> Html:
    """Show the contradictions of a paper with the slips of the pen that would lift them."""
    audit = audit_paper(paper)
    heads = ("Contradiction", "Supposed slips", "Size", "Breaks", "The paper's conclusion", "Then")
    rows = [row for group in audit.groups for row in _correction_rows(group, audit)]
    return Html(
        html_table(heads, rows, "Corrections, by size of the slip", "rp-table rp-small rp-audit")
    )


def _correction_rows(group: Group, audit: Audit) -> list[list[Markup]]:
    name = Markup("<br>").join(_code(name) for name in group.relations)
    blank = [Markup("")] * 4
    if not group.corrections:
        return [[name, Markup("no slips within the search"), *blank]]
    if said := words.too_many(group):
        return [[name, Markup("{}").format(said), *blank]]
    rows = []
    for found in group.corrections[: words.SHOWN]:
        told = words.correction(found, audit.name)
        breaks = str(len(told["breaks"])) if told["breaks"] else "nothing"
        texts = (f"{told['size']:g}", breaks, told["conclusion"], "; ".join(told["unknowns"]))
        slips = Markup("<br>").join(_code(slip) for slip in told["slips"])
        rows.append([name, slips, *(Markup("{}").format(text) for text in texts)])
        name = Markup("")
    return rows


def equations(paper: str) -> Html:
    """Show the equations of a paper, run as extracted."""
    heads = (
        "Equation",
        "What must hold",
        "What is shown",
        "As extracted",
        "In the library",
        "Wanted",
    )
    rows = []
    for shown in audit_paper(paper).equations:
        values = (shown.printed, shown.right, shown.wanted)
        asked = shown.asked
        if shown.supposition:
            asked += f" (supposing that {shown.supposition})"
        texts = [shown.place, asked, shown.meaning]
        texts += [_digits(value) for value in values]
        rows.append([Markup("{}").format(text) for text in texts])
    return Html(html_table(heads, rows, "Equations run as extracted", "rp-table rp-small rp-audit"))


def _digits(value: float) -> str:
    return f"{0.0 if abs(value) < 1e-9 else value:.5g}".replace("-", "−")


def errata(supposed: bool = False) -> Html:
    """Show the register of errata, each entry with its own anchor and citation."""
    chosen = [entry for entry in errata_register() if bool(entry.supposition) == supposed]
    return Html(Markup("").join(_erratum(entry) for entry in chosen))


def _evidence(entry: Erratum, audit: Audit) -> Markup:
    """Write what the relations and equations behind an entry give, computed now."""
    related = [
        Markup('<a href="relations.html#{}"><code>{}</code></a>: {}').format(
            relation_anchor(entry.paper, found.relation.name),
            found.relation.name,
            words.sides(found, audit),
        )
        for found in entry.findings(audit)
    ]
    shown = [
        Markup("{}: {}: {} as extracted, {} wanted").format(
            run.place, run.meaning, _digits(run.printed), _digits(run.wanted)
        )
        for run in entry.demonstrations(audit)
    ]
    words_said = [Markup("{}").format(entry.evidence)] if entry.evidence else []
    return Markup("<br>").join(words_said + related + shown)


def _verdicts(entry: Erratum) -> Markup:
    """Write the cells of the ledger whose verdict rests on an entry."""
    resting = [a for a, expected in frozen().items() if expected.erratum == entry.id]
    if not resting:
        return Markup("")
    records = {r.cell: r for r in build(sorted({a.partition("#")[0] for a in resting})).records}
    return Markup("<br>").join(
        Markup("{}: {} printed, {}").format(
            _code(words.short(a)), records[a].printed, _outcome(records[a])
        )
        for a in resting
    )


def _outcome(record: Record) -> str:
    if record.readings:
        agreeing = sum(reading.agrees for reading in record.readings)
        return f"blocked: agrees with {agreeing} of {len(record.readings)} readings"
    return f"{_digits(record.computed or 0.0)} computed"


def _erratum(entry: Erratum) -> Markup:
    fault = "Our text of the paper was extracted by machine; the fault may lie there."
    terms = {
        "Printed": Markup("{}").format(entry.printed),
        "Problem": Markup("{}").format(entry.problem),
        "Evidence": _evidence(entry, audit_paper(entry.paper)),
        "Verdicts": _verdicts(entry),
        "What the library does": Markup("{}").format(entry.library),
        "The paper's conclusion": Markup("{}: {}").format(entry.conclusion, entry.because),
        "Status": Markup("{}").format(entry.status),
        "Supposing that": Markup("{}").format(entry.supposition),
        "Caution": Markup("{}").format(fault if entry.extraction else ""),
        "Cite as": Markup(
            "Erratum <code>{}</code>, <em>Pointing, reproduced</em>, version {}"
        ).format(entry.id, __version__),
    }
    items = Markup("").join(
        Markup("<dt>{}</dt><dd>{}</dd>").format(term, text) for term, text in terms.items() if text
    )
    head = Markup('<section class="rp-erratum" id="{0}"><p><strong>{1}: {2}</strong></p>')
    return head.format(entry.id, entry.paper, entry.place) + Markup("<dl>{}</dl></section>").format(
        items
    )


def sayings() -> dict[str, str]:
    """Return what sentences may say of the audit: label to text.

    ``PAPER-relations``, ``-agreeing``, ``-rounding``, ``-contradicting``, ``-examined``,
    ``-numbers``, ``-groups`` (contradictions that belong together), ``-supposed`` (relations that
    rest on a supposition of ours, in none of the other counts); the same of both papers without the
    paper's name; ``errata``, ``errata-extraction`` among them, ``errata-supposed`` apart.
    """
    counts: dict[str, int] = {}
    audits = [audit_paper(paper) for paper in PAPERS]
    for start, group in [*((f"{a.name}-", [a]) for a in audits), ("", audits)]:
        tallies = [list(audit.tally().values()) for audit in group]
        sums = [sum(column) for column in zip(*tallies, strict=True)]
        outcomes = ("agreeing", "rounding", "contradicting")
        counts |= {f"{start}{name}": n for name, n in zip(outcomes, sums, strict=True)}
        counts[f"{start}relations"] = sum(sums)
        counts[f"{start}examined"] = sum(len(audit.examined) for audit in group)
        counts[f"{start}numbers"] = sum(len(audit.cells) for audit in group)
        counts[f"{start}groups"] = sum(len(audit.groups) for audit in group)
        counts[f"{start}supposed"] = sum(len(audit.supposed) for audit in group)
    told = [entry for entry in errata_register() if not entry.supposition]
    counts["errata"] = len(told)
    counts["errata-extraction"] = sum(entry.extraction for entry in told)
    counts["errata-supposed"] = len(errata_register()) - len(told)
    return {label: str(count) for label, count in counts.items()}


def _code(text: str) -> Markup:
    return Markup("<code>{}</code>").format(text)


def html_table(
    heads: Iterable[str],
    rows: Iterable[Iterable[Markup]],
    caption: str,
    style: str,
    anchors: Iterable[str] = (),
) -> Markup:
    marks = [*anchors]
    head = Markup("").join(Markup('<th scope="col">{}</th>').format(text) for text in heads)
    body = Markup("")
    for position, row in enumerate(rows):
        first, *rest = row
        mark = Markup(' id="{}"').format(marks[position]) if marks else ""
        cells = Markup("").join(Markup("<td>{}</td>").format(cell) for cell in rest)
        body += Markup('<tr{}><th scope="row">{}</th>{}</tr>').format(mark, first, cells)
    whole = Markup(
        '<div class="rp-scroll" tabindex="0" role="region" aria-label="{0}"><table class="{1}">'
        "<caption>{0}</caption><thead><tr>{2}</tr></thead><tbody>{3}</tbody></table></div>"
    )
    return whole.format(caption, style, head, body)
