"""What the book's pages call: one call shows a table, a figure, the score."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from importlib import metadata

import numpy as np
from markupsafe import Markup

from reproduce.judge.expected import erratum, reason
from reproduce.judge.ledger import Ledger, Record, TableRecord
from reproduce.judge.verdicts import VERDICTS
from reproduce.locate import papers
from reproduce.papers.catalogue import catalogue, drawings
from reproduce.papers.niu2024 import simulation_angles
from reproduce.printed.cells import PAPERS, Cell, PrintedTable, anchor, library
from reproduce.printed.given import given
from reproduce.version import __version__
from reproduce.views import cite, keys, numbers, record_text
from reproduce.views.build import item_ledger, whole_ledger
from reproduce.views.downloads import shipped as downloads_shipped
from reproduce.views.figures import declared, draw
from reproduce.views.grid import Box, Entry, Grid, folded
from reproduce.views.inline_svg import inline
from reproduce.views.record_text import filled
from reproduce.views.study import StudyTable

__all__ = [
    "Html",
    "angle_arrangements",
    "citation",
    "downloads",
    "figure",
    "score",
    "source",
    "study",
    "table",
    "verdict_legend",
    "versions",
]

DETAILS = (
    *("Cell", "Printed", "Computed", "Allowed or predicted", "Probability"),
    *("Share of tolerance", "Verdict", "Why"),
)


@dataclass(frozen=True)
class Html:
    """A piece of a page; notebooks show it as HTML."""

    text: str

    def _repr_html_(self) -> str:
        return numbers.powers_in_html(self.text)

    def __repr__(self) -> str:
        """Return nothing to read: the HTML is what counts."""
        return "<HTML>"


def table(key: str) -> Html:
    """Show a table or a group of quoted numbers: printed, computed, verdict, cell by cell."""
    printed, ledger = library()[keys.check_key(key)], item_ledger(key)
    parts = [_whole(printed, ledger).html]
    if joint := _joint_sentence(ledger.table(key)):
        parts.append(Markup('<p class="rp-joint">{}</p>').format(joint))
    if readings := _readings(printed.place, ledger.of(key)):
        shown = Markup("\n").join(grid.html for grid in readings)
        parts.append(folded("Readings of the text, side by side", shown))
    details = [_detail(record) for record in ledger.of(key) if record.role == "result"]
    if details:
        grid = Grid(f"Details of {printed.place}", DETAILS, details, kind="rp-small")
        parts.append(folded("How each cell was judged", grid.html))
    item = Markup('<div class="rp-item" id="{}">\n{}\n</div>')
    return Html(item.format(anchor(key), Markup("\n").join(parts)))


def _whole(printed: PrintedTable, ledger: Ledger) -> Grid:
    records = {record.cell: record for record in ledger.of(printed.key)}
    caption = Markup("<strong>{}.</strong> {}.").format(printed.place, printed.title)
    if len(printed.columns) <= 1:
        elsewhere = any(cell.place != printed.place for cell in printed.cells)
        head = ["Quantity", "Printed", "Computed", "Verdict", *(["Where"] if elsewhere else [])]
        anchors = [cell.anchor for cell in printed.cells]
        singles = [_single(cell, records[cell.address], elsewhere) for cell in printed.cells]
        return Grid(caption, head, singles, anchors=anchors)
    if any(record.role == "result" for record in records.values()):
        caption += " In each cell: printed, then computed, then the verdict."
    rows: list[list[Entry | Box]] = []
    for row in printed.rows:
        cells = [printed[f"{row.id}.{column.id}"] for column in printed.columns]
        rows.append([row.label, *(_cell(cell, records[cell.address]) for cell in cells)])
    return Grid(caption, ["", *(column.label for column in printed.columns)], rows)


def _single(cell: Cell, record: Record, elsewhere: bool) -> list[Entry | Box]:
    texts: list[Entry] = [_printed(cell), _computed(record), _verdict(record)]
    texts += [cell.place] if elsewhere else []
    return [cell.label, *(Box(text, kind=f"rp-cell rp-{record.verdict}") for text in texts)]


def _cell(cell: Cell, record: Record) -> Box:
    parts = [_printed(cell)]
    if cell.is_number:
        parts += [_computed(record), _verdict(record)]
    html = Markup("<br>").join(part for part in parts if part)
    return Box(html, cell.anchor, f"rp-cell rp-{record.verdict}")


def _printed(cell: Cell) -> Markup:
    sigma = Markup(' <span class="rp-sigma">{}σ</span>').format(cell.sigma) if cell.sigma else ""
    assumed = ""
    if cell.unit_assumed and cell.is_number:
        assumed = Markup(' <abbr title="{}">unit ours</abbr>').format(cell.unit_assumed)
    if cell.misprint:
        assumed += Markup(' <abbr title="{}">misprint?</abbr>').format(cell.misprint)
    return Markup('<span class="rp-printed">{}</span>{}{}').format(cell.shown, sigma, assumed)


def _computed(record: Record) -> Markup:
    text = record_text.computed(record)
    return Markup('<span class="rp-computed">{}</span>').format(text) if text else Markup("")


def _verdict(record: Record) -> Markup:
    text = reason(record.cell) or record.why
    marks = ", ".join(flag.replace("_", " ") for flag in _shown_flags(record))
    flags = Markup('<span class="rp-flag">{}</span>').format(marks) if marks else ""
    badge = Markup('<span class="rp-badge rp-badge-{0}" title="{1}">{0}</span>{2}')
    return badge.format(record.verdict, text, flags)


def _shown_flags(record: Record) -> list[str]:
    return [f for f in record.flags if f in {*record_text.WEAK, "stand_in"}]


def _detail(record: Record) -> list[Entry]:
    why: Entry = ". ".join(part for part in (record.why, reason(record.cell)) if part)
    if known := erratum(record.cell):
        link = Markup('{} <a href="../audit/errata.html#{}">Erratum</a>')
        why = link.format(why, known)
    return [
        _link(record.cell),
        record_text.cell_of(record).shown,
        record_text.computed(record, extra=1),
        record_text.interval(record),
        record_text.probability(record),
        "" if record.share is None else f"{record.share:.2f}",
        record.verdict,
        why,
    ]


def _link(address: str) -> Markup:
    link = Markup('<a href="#{}"><code>{}</code></a>')
    return link.format(anchor(address), address.partition("#")[2])


def _readings(place: str, records: tuple[Record, ...]) -> list[Grid]:
    """Lay out the readings of blocked cells, one table for cells that share their readings."""
    groups: dict[tuple[tuple[str, str], ...], list[Record]] = {}
    for record in records:
        if record.readings:
            names = tuple((reading.name, reading.place) for reading in record.readings)
            groups.setdefault(names, []).append(record)
    grids = []
    for number, (names, group) in enumerate(groups.items(), start=1):
        head = [Markup("{}<br><small>{}</small>").format(name, place) for name, place in names]
        cells = [
            Markup("{} {}").format(_link(record.cell), record_text.cell_of(record).shown)
            for record in group
        ]
        body = [[record_text.read(record, one) for one in record.readings] for record in group]
        if len(group) <= len(names):
            head, cells, body = cells, head, [list(row) for row in zip(*body, strict=True)]
        rows = [[label, *row] for label, row in zip(cells, body, strict=True)]
        grids.append(Grid(f"Readings of {place}, {number}", ["", *head], rows, kind="rp-small"))
    return grids


def _joint_sentence(joint: TableRecord | None) -> str:
    if joint is None:
        return ""
    subject = "The one predicted cell"
    if joint.cells > 1:
        subject = f"All {joint.cells} predicted cells together"
    return (
        f"{subject}: a table simulated whole is at least as "
        f"surprising with probability {record_text.joint_chance(joint)} "
        f"({joint.replicates:,} replicates). {joint.outside} of them lie outside the central "
        f"99 % of their prediction; {joint.expected_outside:.2g} would by chance."
    )


def figure(key: str, alternative: str, caption: str = "") -> Html:
    """Show a figure that follows the page's light or dark theme, with its caption below."""
    named = declared(key).named
    facts = {name: numbers.fact(quoted) for name, quoted in named().items()} if named else {}
    kind = "drawing" if key in drawings() else "figure"
    text = numbers.powers(filled(alternative, facts))
    below = numbers.powers(filled(caption, facts))
    return Html(inline(draw(key), f"{kind}-{anchor(key)}", text, below))


def study(name: str) -> StudyTable:
    """Show a table of our own results that no paper prints."""
    return StudyTable(name)


def score(paper: str | None = None) -> Html:
    """Show the number of cells by verdict."""
    ledger = whole_ledger()
    groups: dict[str, tuple[Record, ...]] = {}
    if paper is None:
        for name in PAPERS:
            groups[name] = tuple(r for r in ledger.records if r.key.startswith(f"{name}/"))
        groups["both"] = ledger.records
    else:
        for item in catalogue().values():
            if item.paper == paper and ledger.of(item.key):
                groups[item.key.partition("/")[2]] = ledger.of(item.key)
    badge = Markup('<span class="rp-badge rp-badge-{0}">{0}</span>')
    flag = Markup('<abbr title="among the exact and consistent cells: {}">{}</abbr>')
    head = ["", *map(badge.format, VERDICTS), "cells"]
    head += [
        flag.format(record_text.FLAG_MEANINGS[one], one.replace("_", " "))
        for one in record_text.WEAK
    ]
    rows = []
    for name, records in groups.items():
        tally, weak = record_text.tally(records), record_text.weak(records)
        counts = (*tally.values(), len(records), *weak.values())
        label = Markup("<code>{}</code>").format(name)
        rows.append([label, *(str(count) if count else "·" for count in counts)])
    return Html(Grid("Cells by verdict.", head, rows, kind="rp-score").html)


def verdict_legend() -> Html:
    """Show what the verdict words mean."""
    term = Markup('<dt><span class="rp-badge rp-badge-{0}">{0}</span></dt><dd>{1}</dd>')
    terms = Markup("\n").join(
        term.format(verdict, record_text.MEANINGS[verdict]) for verdict in VERDICTS
    )
    return Html(Markup('<dl class="rp-legend">\n{}\n</dl>').format(terms))


def citation(key: str) -> Html:
    """Show how to cite a reproduced item, in words."""
    entries = cite.citation(keys.check_key(key), "text").splitlines()
    items = Markup("").join(Markup("<li>{}</li>").format(entry) for entry in entries)
    return Html(Markup('<ul class="rp-citation">{}</ul>').format(items))


def source(key: str) -> Html:
    """Show the file of printed numbers of an item."""
    folder = papers()[keys.check_key(key).partition("/")[0]]
    path = folder / "printed" / f"{key}.toml"
    return Html(Markup('<pre class="rp-source">{}</pre>').format(path.read_text(encoding="utf-8")))


def downloads() -> Html:
    """Show links to the ledger, its schema and every item's table, as shipped beside the pages."""
    link = Markup('<li><a href="{0}" download><code>{0}</code></a>: {1}</li>')
    items = [link.format(name, what) for name, what in downloads_shipped().items()]
    return Html(Markup('<ul class="rp-downloads">{}</ul>').format(Markup("").join(items)))


def versions() -> Html:
    """Show what the book was built with."""
    names = ("numpy", "scipy", "matplotlib", "pandas", "emcee", "jupyter-book")
    rows = {"Python": platform.python_version(), "reproduce-pointing": __version__}
    rows |= {name: metadata.version(name) for name in names}
    return Html(Grid("What the book was built with.", ("", "version"), list(rows.items())).html)


def angle_arrangements() -> Html:
    """Show every arrangement of rotation angles that has the count niu2024 prints."""
    door = given(simulation_angles.READS)
    used = simulation_angles.literal(door).name
    half = np.degrees(simulation_angles.half_ranges(door)).round(3).tolist()
    found = simulation_angles.candidates(door)
    rows = []
    for one in found:
        choices = Markup("; ").join((one.lattice, one.offset, one.window))
        if one.name == used:
            choices += Markup("<br><strong>in use</strong>")
        zero = "yes" if np.isclose(one.angles, 0).all(axis=-1).any() else "no"
        rows.append([_picture(np.degrees(one.angles).round(3).tolist(), half), choices, zero])
    caption = f"The {len(found)} arrangements with exactly {len(found[0].angles)} angles."
    head = ("Angles", "Lattice, offset, outline", "Zero position")
    return Html(Grid(caption, head, rows).html)


def _picture(angles: list[list[float]], half: list[float]) -> Markup:
    """Draw angles within the printed range, to its scale."""
    wide, high = half
    box = Markup('<rect x="{}" y="{}" width="{}" height="{}" {}/>').format(
        -wide,
        -high,
        2 * wide,
        2 * high,
        Markup('fill="none" stroke="currentColor" stroke-width="0.08" opacity="0.5"'),
    )
    dot = Markup('<circle cx="{}" cy="{}" r="0.2" fill="currentColor"/>')
    dots = Markup("").join(dot.format(x, -y) for x, y in angles)
    view = f"{-wide - 0.4} {-high - 0.4} {2 * wide + 0.8} {2 * high + 0.8}"
    svg = Markup('<svg viewBox="{}" width="128" aria-hidden="true">{}{}</svg>')
    return svg.format(view, box, dots)
