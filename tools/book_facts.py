"""The facts: every number in a sentence of the book, by name; and the files next to the pages.

A printed cell has a fact for each property (``niu2024/table-3#scale.red computed``). An item, a
paper and ``all`` have counts (``niu2024/table-3 differs``). A study has results
(``niu2024/readings#best-joint``), and a posterior moments (``posterior/registration#noise-mean``).
The verdicts have named constants (``constant#central``). A page collects numbers of its cells in a
series ``quoted`` (``instruments/three-detectors#period``).
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import duckdb
import pandas as pd
from markupsafe import Markup
from pydantic import BaseModel, Field

import page_cells
from pack_book import write_zip
from reproduce.consistency.report import Erratum, audit_paper
from reproduce.judge import verdicts as judging
from reproduce.judge.ledger import Record, expected
from reproduce.judge.readings import evaluate
from reproduce.locate import data_folder
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import (
    Column,
    computation_for,
    computations,
    item_text,
    study,
)
from reproduce.printed.cells import PAPERS, library
from reproduce.printed.inputs import load_inputs
from reproduce.printed.number import NOMINAL_FRACTION, minus, powers, quantity
from reproduce.store import studies as stored
from reproduce.store.files import write_text
from reproduce.version import ADDRESS
from reproduce.views import _computed as computed
from reproduce.views import _numbers as numbers
from reproduce.views import _verdicts as verdicts
from reproduce.views._blocks import LOOKS, rendered
from reproduce.views._computed import whole_ledger
from reproduce.views._export import export_frame, provenance_of, table_files
from reproduce.views._reports import FORMS, report
from reproduce.views._study import StudyTable
from reproduce.views._verdicts import counts, facts_of
from reproduce.views.citations import in_words, recomputed
from reproduce.views.consistency import ConsistencyAudit, errata_register
from reproduce.views.contents import Contents
from reproduce.views.figure import Figure
from reproduce.views.table import Cell, Table

# Formats of a citation that a card copies.
CITATIONS = {
    "citation": "text",
    "BibTeX": "bibtex",
    "RIS": "ris",
    "sentence": "sentence",
}
# Counts of the audit by name.
_AUDITED = {
    "relations": "Relations",
    "agreeing": "Agree",
    "rounding": "Only through rounding",
    "tolerance": "Only within a tolerance",
    "contradicting": "Contradict",
    "restating-contradicting": "Contradict among these",
}
_OPEN = {"differs", "ambiguous", "unpublished"}
# Start of the series that collects the numbers of a page.
QUOTED = "quoted = pd.Series("


def of_pages(pages: Iterable[Path]) -> dict[str, str]:
    """Run the pages with a series ``quoted``, and return its numbers by name."""
    found: dict[str, str] = {}
    for page in pages:
        if any(QUOTED in source for source in page_cells.cells(page)):
            address = page.relative_to(page_cells.BOOK).with_suffix("").as_posix()
            quoted = page_cells.execute(page)[1]["quoted"]
            found |= {
                f"{address}#{name}": _written(text) for name, text in quoted.items()
            }
    return found


def _written(text: str) -> str:
    """Return a number with a minus sign, and with a non-breaking space before its unit.

    >>> _written("-0.02 px")
    '−0.02\u202fpx'
    """
    return minus(text).replace(" ", "\u202f")


def of_posteriors(names: Iterable[str]) -> dict[str, str]:
    """Sample posteriors and compute their facts."""
    return {
        f"posterior/{name}#{label}": powers(text)
        for name in names
        for label, text in _of_posterior(name).items()
    }


def unsampled() -> dict[str, str]:
    """Compute the facts of ledger, studies, audit and pages."""
    causes = Counter(
        expected(r.cell).erratum for r in whole_ledger().records if r.verdict in _OPEN
    )
    found = of_ledger() | of_pages(page_cells.notebooks())
    found |= {
        f"erratum/{name} cells": str(count) for name, count in causes.items() if name
    }
    found |= {f"verdict/{word}": look["meaning"] for word, look in LOOKS.items()}
    groups = {key: _texts_of_study(key) for key in catalogue("studies")}
    groups["constant"] = _of_constants()
    groups["audit"], groups["evidence"] = _of_audits(), _of_evidence()
    for group, texts in groups.items():
        found |= {f"{group}#{name}": text for name, text in texts.items()}
    return {name: powers(text) for name, text in found.items() if text}


def of_ledger() -> dict[str, str]:
    """Compute the facts of all cells, of all items, of the papers and of ``all``."""
    records, found = whole_ledger().records, {}
    for name in ("all", *PAPERS):
        chosen = [r for r in records if name in {"all", r.paper}]
        counted = {
            "cells": chosen,
            "numbers": [r for r in chosen if r.printed_cell.is_number],
            "unsettled": [r for r in chosen if r.verdict in _OPEN],
        }
        lengths = {what: str(len(part)) for what, part in counted.items()}
        found[name] = counts(chosen) | lengths
    found |= {key: facts_of(key) for key in library()}
    for record in records:
        found[record.cell] = facts_of(record.cell) | dict(_of_cell(record))
    return {
        f"{name} {what}": text
        for name, texts in found.items()
        for what, text in texts.items()
    }


def _of_cell(record: Record) -> Iterator[tuple[str, str]]:
    """Yield the facts of a cell; ``if-OPTION-ALTERNATIVE`` is its value in another reading."""
    shown, summary = verdicts.texts(record), record.readings
    yield "verdict", record.verdict
    yield "probability", str(shown["probability"])
    made = computation_for(record.cell)
    if not (summary and made):
        return
    yield "readings", str(summary.count)
    yield "agreeing", str(summary.agreeing)
    others = {"closest-computed": summary.closest}
    found = evaluate(made).cells[record.printed_cell.name]
    for choices, reading in zip(made.readings, found, strict=True):
        changed = choices.items() - made.literal.items()
        if len(changed) == 1:
            others["-".join(("if", *changed.pop()))] = reading
    for name, reading in others.items():
        other = record.model_copy(update=dict(reading))
        yield name, quantity(verdicts.computed(other), other.printed_cell.symbol)


def of_study(key: str) -> dict[str, Any]:
    """Return the facts of a supplementary table: of its rows, or computed by `named`."""
    declared, frame = study(key), StudyTable(key).frame()
    facts = declared.text.facts
    values = dict(declared.named(load_inputs(declared.inputs)))
    for name, fact in facts.items():
        if fact.column:
            chosen = (frame[[*fact.rows]] == pd.Series(fact.rows)).all(axis=1)
            values[name] = frame.loc[chosen, fact.column].agg(fact.take)
    if values.keys() != facts.keys():
        raise ValueError(f"{key}: expected the facts {[*facts]}, got {[*values]}")
    return values


def _texts_of_study(key: str) -> dict[str, str]:
    values = of_study(key)
    return {
        name: quantity(
            numbers.entry(values[name], Column(name=name, form=fact.form)), fact.unit
        )
        for name, fact in item_text(key).facts.items()
    }


def _of_constants() -> dict[str, str]:
    """Return the named constants of the verdicts: levels and tolerances."""
    percent = {
        "central": judging.CENTRAL,
        "outside": judging.OUTSIDE,
        "nominal": NOMINAL_FRACTION,
        "wide": judging._WIDE_TOLERANCE,
    }
    return {name: f"{100 * value:.0f}\u202f%" for name, value in percent.items()}


def _of_evidence() -> dict[str, str]:
    """Return the counts of the studies of the audit, and the size of the archive, by name."""
    planted = stored.table("planted-slips")
    seen = planted["relation"] | planted["verdict"]
    found = {
        "planted": str(len(planted)),
        "seen": f"{100 * seen.mean():.0f}\u202f%",
    }
    lines = stored.table("two-readings").set_index("what").loc["lines"]
    found |= {f"lines-{what}": f"{lines[what]:.1f}" for what in ("missed", "error")}
    for row in stored.table("withdrawn").itertuples():
        found[f"{row.what}-listed"] = str(row.listed)
        found[f"{row.what}-withdrawn"] = str(row.withdrawn)
    (taken,) = stored.table("installed").itertuples()
    return found | {
        "notebooks-packages": str(taken.packages),
        "notebooks-size": f"{taken.megabytes}\u202fMB",
        "notebooks-minutes": f"{taken.minutes}\u202fmin",
    }


def _of_posterior(name: str) -> dict[str, str]:
    """Return the numbers of a posterior, by name.

    ``shift-x`` (mean ± sd) and ``shift-x-mean`` (-sd, -low, -high) of each parameter and
    consequence, and ``sbc-...`` of the stored calibration.
    """
    from reproduce.views.posterior import Posterior, book_posterior, interval, spread

    found, texts = book_posterior(name), {}
    for row in found.summaries:
        label = row.name.replace(" ", "-").replace(",", "")
        unit = "" if row.unit == "1" else row.unit
        texts[label] = quantity(interval(row)[0], unit)
        for what, text in zip(("mean", "sd", "low", "high"), spread(row), strict=True):
            texts[f"{label}-{what}"] = quantity(minus(text), unit)
    for label, value in Posterior(name).truth.items():
        row = next(row for row in found.rows if row.name == label)
        texts[f"{label}-off"] = f"{abs(row.mean - value) / row.deviation:.1f}"
    return texts | dict(_of_calibration(name))


def _of_calibration(name: str) -> Iterator[tuple[str, str]]:
    rows = stored.table("calibrations").query("posterior == @name")
    if rows.empty:
        return
    yield "sbc-replicates", f"{rows['replicates'].iloc[0]:,}"
    yield "sbc-failed", str(rows["failed"].iloc[0])
    yield "sbc-least-p", f"{rows['even'].min():.2g}"
    yield "sbc-quantities", str(len(rows))
    for estimate, share in rows.set_index("quantity")["published_95"].dropna().items():
        yield f"sbc-{estimate}-published", f"{100 * share:.0f}\u202f%"


def _of_audits() -> dict[str, str]:
    """Return the counts of the audit of all papers, by name.

    ``relations``, ``agreeing``, ``rounding``, ``tolerance`` and ``contradicting`` count relations
    that do not restate computed cells, ``restating-contradicting`` the others, and ``supposed``
    those with an assumption. ``errata`` includes ``errata-standing`` (the conclusion stands) and
    ``errata-extraction``; ``errata-supposed`` are separate.
    """
    counts: Counter[str] = Counter()
    for audit in map(audit_paper, PAPERS):
        counts.update({label: audit.score[name] for label, name in _AUDITED.items()})
        counts["supposed"] += sum(bool(f.relation.assumption) for f in audit.findings)
    for entry in errata_register():
        counts["errata-supposed" if entry.assumption else "errata"] += 1
        if not entry.assumption:
            counts["errata-standing"] += entry.conclusion == "stands"
            counts["errata-extraction"] += entry.extraction
    return {label: str(count) for label, count in counts.items()}


def write_facts(path: Path) -> None:
    """Write all facts to a JSON file."""
    from reproduce.papers.posteriors import posteriors

    found = unsampled() | of_posteriors(posteriors())
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(found, ensure_ascii=False, indent=0)
    write_text(path, text + "\n")


def card(cell: Cell, place: str) -> str:
    """Return the card of a cell: verdict and result, a menu to cite it, and all properties."""
    record, printed = cell.record, cell.record.printed_cell
    reason = re.split(r"(?<=\.) (?=[A-Z])", str(verdicts.texts(record)["why"]))[0]
    copied = {name: cell.cite(form) for name, form in CITATIONS.items()}
    return rendered(
        "card",
        cell=cell,
        record=record,
        place=f"{ADDRESS}/goto.html#{place}" if ADDRESS else f"#{place}",
        words=f"{in_words(printed)} ({record.key})",
        sigma=printed.sigma,
        recomputed=recomputed(record),
        sentence=Markup(reason),
        reply=record.reply,
        copied=copied | {"code": cell.rerun_code},
        properties=Markup(cell._repr_html_()),
    )


def write_cards(path: Path) -> None:
    """Write the cards of the printed cells, by anchor."""
    cells = [cell for table in library().values() for cell in table.cells]
    cards = {cell.anchor: card(Cell(cell), cell.anchor) for cell in cells}
    path.write_text(json.dumps(cards, ensure_ascii=False), encoding="utf-8")


class ListedErratum(Erratum):
    """An entry of the register, with the printed cells whose verdict depends on it."""

    results: list[str] = Field(
        description="addresses of the cells whose verdict depends on it"
    )


class Register(BaseModel):
    """The register of errata: contradictions of the audit, with their reasons.

    An entry is a difference, not a fault, and makes no statement on the intention of the authors.
    """

    software: str = Field(description="what made the file: name, version, day, commit")
    citation: str = Field(description="how to cite it, and the papers")
    errata: list[ListedErratum]


def register() -> Register:
    """Return the register of errata with its provenance."""
    rows = ConsistencyAudit().frame().reset_index(names="id").to_dict("records")
    whole = {**provenance_of(), "errata": rows}
    return Register.model_validate(whole)


def write_whole(folder: Path) -> None:
    """Write all printed cells, all readings and all errata as CSV and Parquet."""
    about = provenance_of()
    errata = pd.DataFrame([one.model_dump() for one in register().errata])
    for name in ("relations", "equations", "results"):
        errata[name] = errata[name].map(" ".join)
    frames = {
        "ledger": Contents().cells(),
        "errata": errata,
        "readings": readings_frame(),
    }
    for name, frame in frames.items():
        text = export_frame(frame, "csv", about)
        (folder / f"{name}.csv").write_text(text, encoding="utf-8")
        write_parquet(frame, folder / f"{name}.parquet", about)


def readings_frame() -> pd.DataFrame:
    """Return every reading of every cell that has several."""
    evaluations = [evaluate(one) for key in catalogue() for one in computations(key)]
    return pd.DataFrame(
        {
            "cell": f"{evaluation.computation.key}#{name}",
            "choices": verdicts.choices_text(one.choices),
            "verdict": one.verdict,
            "computed": one.computed,
            "low": one.interval[0],
            "high": one.interval[1],
            "probability": one.probability,
        }
        for evaluation in evaluations
        for name in evaluation.cells
        if len(readings := evaluation.distinct(name)) > 1
        for one in readings
    )


def write_parquet(frame: pd.DataFrame, path: Path, about: Mapping[str, str]) -> None:
    """Write a DataFrame as Parquet, with its provenance as metadata of the file."""

    def quoted(text: str) -> str:
        return "'{}'".format(text.replace("'", "''"))

    metadata = ", ".join(f"{name}: {quoted(text)}" for name, text in about.items())
    with duckdb.connect() as base:
        base.register("rows", frame)
        base.execute(
            f"COPY rows TO {quoted(str(path))} (FORMAT parquet, KV_METADATA {{{metadata}}})"
        )


def write_figure(key: str, root: Path) -> None:
    """Write the images and the data of a figure below the root of the book."""
    shown = Figure(key)
    shown.vectors()
    (root / "figures").mkdir(parents=True, exist_ok=True)
    *images, table = (root / name for name in shown.files)
    write_text(table, shown.export("csv"))
    for path in images:
        shown.save(path)


def write_tables(folder: Path) -> None:
    """Write the ledger, the errata and every table in all forms, and the reports on each paper."""
    whole = computed.whole_ledger()
    texts = {
        "ledger.json": whole.model_copy(update=provenance_of()).model_dump_json(
            indent=2
        ),
        "ledger.schema.json": (data_folder() / "ledger.schema.json").read_text(
            encoding="utf-8"
        ),
        "errata.json": register().model_dump_json(indent=2),
        "errata.schema.json": json.dumps(Register.model_json_schema(), indent=2),
    }
    referee = Path(__file__).with_name("verify_ledger.py")
    texts[referee.name] = referee.read_text(encoding="utf-8")
    for table in (*map(Table, library()), *map(StudyTable, catalogue("studies"))):
        forms = table_files(table.key).items()
        texts |= {path: table.export(form) for path, form in forms}
    (folder / "tables").mkdir(parents=True, exist_ok=True)
    write_whole(folder)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    for paper in PAPERS:
        files = {n: t for form in FORMS for n, t in report(paper, form).items()}
        start = f"tables/{paper}-"
        files |= {name: text for name, text in texts.items() if name.startswith(start)}
        inside = ((name, text.encode()) for name, text in files.items())
        write_zip(folder / f"{paper}-reports.zip", f"{paper}-reports", inside)
