"""The audit in the terminal: what contradicts, what cannot all be right, what would mend it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

from reproduce.audit.report import Audit, Group
from reproduce.views import audit_words as words


def lines(audit: Audit) -> Iterator[str]:
    """Yield the audit of a paper or table, line by line, in plain text."""
    tally = audit.tally()
    yield (
        f"{audit.name}: {len(audit.read)} relations over {len(audit.examined)} of "
        f"{len(audit.cells)} numbers"
    )
    for outcome, count in tally.items():
        yield f"  {count:4d} {'agree' if outcome.startswith('agree') else 'contradict'}" + (
            " only through rounding" if "rounding" in outcome else ""
        )
    if audit.supposed:
        yield f"  {len(audit.supposed):4d} more rest on suppositions of ours and are not counted"
    yield ""
    for group in audit.groups:
        yield from _group(group, audit)
    yield from _together(audit)
    yield from _equations(audit)


def wrapped(line: str, width: int) -> str:
    """Break a line at the width of the terminal, what follows indented below it."""
    indent = " " * (len(line) - len(line.lstrip()) + 4)
    return textwrap.fill(line, width, subsequent_indent=indent, break_on_hyphens=False)


def _group(group: Group, audit: Audit) -> Iterator[str]:
    for name in group.relations:
        finding = audit.finding(name)
        relation = finding.relation
        yield f"contradicts: {name}: {relation.formula.text}"
        yield f"    {words.sides(finding, audit)}   [{relation.source}]"
    for unknown in words.unknowns_of(group, audit):
        yield f"    {unknown}"
    if not group.corrections:
        yield "    no slips of the pen within the search lift this"
    if words.too_many(group):
        yield f"    {words.too_many(group)}"
        yield ""
        return
    for found in group.corrections[: words.SHOWN]:
        told = words.correction(found, audit.name)
        yield f"    correction of size {told['size']:g}: {'; '.join(told['slips'])}"
        broken = len(told["breaks"])
        breaks = f"{broken} relation{'s' if broken > 1 else ''}" if broken else "nothing"
        yield f"        breaks {breaks}; the conclusion {told['conclusion']}"
        for unknown in told["unknowns"]:
            yield f"        {unknown}"
    if (more := len(group.corrections) - words.SHOWN) > 0:
        yield f"    and {more} more (--json shows all)"
    yield ""


def _together(audit: Audit) -> Iterator[str]:
    if audit.conflicts:
        least = audit.conflicts[0]
        yield (
            f"{len(audit.conflicts)} smallest sets of numbers that cannot all be right (--json "
            f"lists them), such as {', '.join(words.short(address) for address in least.cells)}"
        )
        yield ""
    wrong = {name for group in audit.groups for name in group.relations}
    for conflict in audit.conflicts:
        if not wrong & set(conflict.relations):
            yield f"hold one by one but not together: {', '.join(conflict.relations)}"
            yield f"    cells: {', '.join(words.short(address) for address in conflict.cells)}"


def _equations(audit: Audit) -> Iterator[str]:
    for shown in audit.equations:
        verdict = "holds" if shown.holds else "fails as extracted"
        if shown.supposition:
            verdict += f", supposing that {shown.supposition}"
        yield f"equation {shown.place}: {verdict}: {shown.asked}"
        yield f"    {shown.meaning}: {shown.printed:.6g} as extracted, {shown.wanted:.6g} wanted"
