"""What the book's pages call: one call shows a table, a figure, the score."""

from __future__ import annotations

import functools
import platform
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup, escape

from reproduce.judge.expected import erratum, reason
from reproduce.judge.ledger import Ledger, Record, TableRecord
from reproduce.judge.verdicts import VERDICTS
from reproduce.locate import papers
from reproduce.papers.catalogue import catalogue
from reproduce.papers.niu2024 import simulation_angles
from reproduce.printed.cells import PAPERS, Cell, PrintedTable, anchor, library
from reproduce.printed.given import given
from reproduce.version import __version__
from reproduce.views import cite, keys, numbers, words
from reproduce.views.downloads import shipped as downloads_shipped
from reproduce.views.facts import filled, item_ledger, whole_ledger
from reproduce.views.figures import draw
from reproduce.views.inline_svg import inline
from reproduce.views.study import StudyTable


@dataclass(frozen=True)
class Html:
    """A piece of a page; notebooks show it as HTML."""

    text: str

    def _repr_html_(self) -> str:
        return numbers.powers_in_html(self.text)

    def __repr__(self) -> str:
        """Return nothing to read: the HTML is what counts."""
        return "<HTML>"


@functools.cache
def _templates() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("reproduce.views"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )


def table(key: str) -> Html:
    """Show a table or a group of quoted numbers: printed, computed, verdict, cell by cell."""
    printed, ledger = library()[keys.check_key(key)], item_ledger(key)
    single = len(printed.columns) <= 1
    heads, rows = _single(printed, ledger) if single else _grid(printed, ledger)
    text = (
        _templates()
        .get_template("table.html")
        .render(
            anchor=anchor(key),
            place=printed.place,
            title=printed.title,
            corner="Quantity" if single else "",
            legend=not single and any(record.role == "result" for record in ledger.of(key)),
            heads=heads,
            rows=rows,
            joint=_joint_sentence(ledger.table(key)),
            details=[_detail(record) for record in ledger.of(key) if record.role == "result"],
            readings=_readings(ledger.of(key)),
        )
    )
    return Html(text)


def _single(printed: PrintedTable, ledger: Ledger) -> tuple[list[str], list[dict[str, Any]]]:
    elsewhere = any(cell.place != printed.place for cell in printed.cells)
    heads = ["Printed", "Computed", "Verdict", *(["Where"] if elsewhere else [])]
    rows = []
    for cell, record in zip(printed.cells, ledger.of(printed.key), strict=True):
        columns = [_printed(cell), _computed(record), _verdict(record)]
        columns += [escape(cell.place)] if elsewhere else []
        cells = [{"html": html, "verdict": record.verdict, "anchor": ""} for html in columns]
        rows.append({"label": cell.label, "anchor": cell.anchor, "cells": cells})
    return heads, rows


def _grid(printed: PrintedTable, ledger: Ledger) -> tuple[list[str], list[dict[str, Any]]]:
    records = {record.cell: record for record in ledger.of(printed.key)}
    rows = []
    for row in printed.rows:
        cells = []
        for column in printed.columns:
            cell = printed[f"{row.id}.{column.id}"]
            record = records[cell.address]
            parts = [_printed(cell)]
            if cell.is_number:
                parts += [_computed(record), _verdict(record)]
            html = Markup("<br>").join(part for part in parts if part)
            cells.append({"html": html, "verdict": record.verdict, "anchor": cell.anchor})
        rows.append({"label": row.label, "anchor": "", "cells": cells})
    return [column.label for column in printed.columns], rows


def _printed(cell: Cell) -> Markup:
    sigma = Markup(' <span class="rp-sigma">{}σ</span>').format(cell.sigma) if cell.sigma else ""
    assumed = ""
    if cell.unit_assumed and cell.is_number:
        assumed = Markup(' <abbr title="{}">unit ours</abbr>').format(cell.unit_assumed)
    if cell.misprint:
        assumed += Markup(' <abbr title="{}">misprint?</abbr>').format(cell.misprint)
    return Markup('<span class="rp-printed">{}</span>{}{}').format(cell.shown, sigma, assumed)


def _computed(record: Record) -> Markup:
    text = words.computed(record)
    return Markup('<span class="rp-computed">{}</span>').format(text) if text else Markup("")


def _verdict(record: Record) -> Markup:
    text = reason(record.cell) or record.why
    marks = ", ".join(flag.replace("_", " ") for flag in _shown_flags(record))
    flags = Markup('<span class="rp-flag">{}</span>').format(marks) if marks else ""
    badge = Markup('<span class="rp-badge rp-badge-{0}" title="{1}">{0}</span>{2}')
    return badge.format(record.verdict, text, flags)


def _shown_flags(record: Record) -> list[str]:
    return [f for f in record.flags if f in {*words.WEAK, "stand_in"}]


def _detail(record: Record) -> dict[str, str]:
    why = ". ".join(part for part in (record.why, reason(record.cell)) if part)
    return {
        "anchor": anchor(record.cell),
        "name": record.cell.partition("#")[2],
        "printed": words.cell_of(record).shown,
        "computed": words.computed(record, extra=1),
        "interval": words.interval(record),
        "probability": words.probability(record),
        "share": "" if record.share is None else f"{record.share:.2f}",
        "verdict": record.verdict,
        "why": why,
        "erratum": erratum(record.cell),
    }


def _readings(records: tuple[Record, ...]) -> list[dict[str, Any]]:
    """Lay out the readings of blocked cells, one table for cells that share their readings."""
    groups: dict[tuple[tuple[str, str], ...], list[Record]] = {}
    for record in records:
        if record.readings:
            names = tuple((reading.name, reading.place) for reading in record.readings)
            groups.setdefault(names, []).append(record)
    tables = []
    for names, group in groups.items():
        ways = [Markup("{}<br><small>{}</small>").format(name, place) for name, place in names]
        cells = [
            Markup('<a href="#{}"><code>{}</code></a> {}').format(
                anchor(record.cell), record.cell.partition("#")[2], words.cell_of(record).shown
            )
            for record in group
        ]
        grid = [[words.read(record, one) for one in record.readings] for record in group]
        if len(group) <= len(names):
            ways, cells, grid = cells, ways, [list(row) for row in zip(*grid, strict=True)]
        rows = [{"label": label, "cells": row} for label, row in zip(cells, grid, strict=True)]
        tables.append({"heads": ways, "rows": rows})
    return tables


def _joint_sentence(joint: TableRecord | None) -> str:
    if joint is None:
        return ""
    subject = "The one predicted cell"
    if joint.cells > 1:
        subject = f"All {joint.cells} predicted cells together"
    return (
        f"{subject}: a table simulated whole is at least as "
        f"surprising with probability {words.joint_chance(joint)} "
        f"({joint.replicates:,} replicates). {joint.outside} of them lie outside the central "
        f"99 % of their prediction; {joint.expected_outside:.2g} would by chance."
    )


def figure(key: str, alternative: str) -> Html:
    """Show a figure that follows the page's light or dark theme."""
    return Html(inline(draw(key), f"figure-{anchor(key)}", numbers.powers(filled(alternative))))


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
    template = _templates().get_template("score.html")
    return Html(template.render(rows=_score_rows(groups), meanings=words.FLAG_MEANINGS))


def _score_rows(groups: dict[str, tuple[Record, ...]]) -> list[dict[str, Any]]:
    rows = []
    for name, records in groups.items():
        tally = words.tally(records)
        weak = words.weak(records)
        rows.append({"name": name, "counts": tally, "weak": weak, "sum": len(records)})
    return rows


def verdict_legend() -> Html:
    """Show what the verdict words mean."""
    meanings = [(verdict, words.MEANINGS[verdict]) for verdict in VERDICTS]
    return Html(_templates().get_template("legend.html").render(meanings=meanings))


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
    line = Markup('<tr><th scope="row">{}</th><td>{}</td></tr>')
    body = Markup("").join(line.format(name, version) for name, version in rows.items())
    return Html(Markup('<table class="rp-table">{}</table>').format(body))


def angle_arrangements() -> Html:
    """Show every arrangement of rotation angles that has the count niu2024 prints."""
    door = given(simulation_angles.READS)
    used = simulation_angles.literal(door).name
    rows = [
        {
            "picture": np.degrees(found.angles).round(3).tolist(),
            "choices": (found.lattice, found.offset, found.window),
            "zero": "yes" if np.isclose(found.angles, 0).all(axis=-1).any() else "no",
            "used": found.name == used,
        }
        for found in simulation_angles.candidates(door)
    ]
    half = np.degrees(simulation_angles.half_ranges(door)).round(3).tolist()
    return Html(_templates().get_template("arrangements.html").render(rows=rows, half=half))
