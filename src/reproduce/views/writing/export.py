"""Exports of an item's records, or of any DataFrame, through pandas."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from reproduce.judge.expected import reason
from reproduce.judge.ledger import Ledger, Record
from reproduce.printed.cells import anchor, library
from reproduce.version import software
from reproduce.views import keys
from reproduce.views.writing import verdicts
from reproduce.views.writing.numbers import hyphen

if TYPE_CHECKING:
    import pandas as pd

FORMATS = ("csv", "json", "latex", "markdown")
# The endings of their files.
ENDINGS = {"csv": "csv", "json": "json", "latex": "tex", "markdown": "md"}


def export(ledger: Ledger, address: str, form: str) -> str:
    """Write the records of an item or a cell in a format that other programs read.

    JSON and CSV hold every field of each record; LaTeX and Markdown keep the table's own shape.
    """
    key, _, name = address.partition("#")
    records = tuple(r for r in ledger.of(key) if not name or r.cell == address)
    if form == "json":
        tables = tuple(t for t in ledger.tables if t.key == key and not name)
        return signed(Ledger(records=records, tables=tables)).model_dump_json(indent=2)
    if form == "csv":
        return full_frame(records).to_csv(index=False)
    caption = f"{keys.title(key)} ({keys.place(key)} of {key.split('/')[0]})"
    label = f"tab:{key.replace('/', '-')}"
    shaped = len(library()[key].columns) > 1 and not name
    make = _shaped_frame if shaped else _shown_frame
    shown = make(records, ascii_units=form == "latex")
    if form == "latex":
        caption += "; printed (computed, verdict)" if shaped else ""
        return shown.to_latex(index=False, escape=True, caption=caption, label=label)
    return export_frame(shown, form)


def table_files(key: str) -> dict[str, str]:
    """Return where the book carries the exports of a table: path below its root to format."""
    return {f"tables/{anchor(key)}.{ending}": form for form, ending in ENDINGS.items()}


def signed(ledger: Ledger) -> Ledger:
    """Return a ledger with the written reason of each verdict and what made it."""
    told = tuple(r.model_copy(update={"reason": reason(r.cell)}) for r in ledger.records)
    return ledger.model_copy(update={"records": told, "software": software()})


def export_frame(frame: pd.DataFrame, form: str) -> str:
    """Write any DataFrame as csv, json (a list of rows), latex or markdown."""
    if form not in FORMATS:
        raise ValueError(f"unknown format {form!r}: expected one of {', '.join(FORMATS)}")
    if form == "csv":
        return frame.to_csv(index=False)
    if form == "json":
        return frame.to_json(orient="records", indent=2, force_ascii=False)
    if form == "latex":
        return frame.to_latex(index=False)
    lines = [list(frame.columns), ["---"] * len(frame.columns), *frame.to_numpy().tolist()]
    cells = ((str(cell).replace("|", "\\|") for cell in line) for line in lines)
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def full_frame(records: tuple[Record, ...]) -> pd.DataFrame:
    """Return one row per cell, with every field of the ledger and the reason."""
    import pandas as pd

    rows = []
    for record in records:
        row = record.model_dump()
        for name in ("flags", "equations", "seed", "interval"):
            row[name] = " ".join(map(str, row[name] or ()))
        row["readings"] = "; ".join(
            f"{reading.name}: {reading.computed!r} {reading.verdict}" for reading in record.readings
        )
        rows.append(row | {"reason": reason(record.cell)})
    return pd.DataFrame(rows)


def _shown_frame(records: tuple[Record, ...], *, ascii_units: bool) -> pd.DataFrame:
    """Lay out what a reader sees; a plain LaTeX document has no glyph for the signs of units."""
    import pandas as pd

    rows = [
        {
            "cell": verdicts.name_of(record),
            "printed": record.printed,
            "computed": hyphen(verdicts.computed(record)),
            "unit": record.unit if ascii_units else verdicts.unit(record),
            "verdict": verdicts.qualified(record),
            "probability": verdicts.probability(record).replace("\u00a0", " "),
        }
        for record in records
    ]
    return pd.DataFrame(rows, dtype=str)


def _shaped_frame(records: tuple[Record, ...], *, ascii_units: bool) -> pd.DataFrame:
    """Lay out a table in the shape of the print; units stand where a row or a column shares one."""
    import pandas as pd

    table = library()[records[0].key]
    by_name = {verdicts.name_of(record): record for record in records}
    grid = [[by_name[f"{row.id}.{column.id}"] for column in table.columns] for row in table.rows]

    def named(label: str, line: Iterable[Record]) -> str:
        units = {one.unit if ascii_units else verdicts.unit(one) for one in line} - {"", "1"}
        return f"{label} ({units.pop()})" if len(units) == 1 else label

    heads, labels = [c.label for c in table.columns], [row.label for row in table.rows]
    if all(len({one.unit for one in row} - {""}) <= 1 for row in grid):
        labels = [named(*pair) for pair in zip(labels, grid, strict=True)]
    else:
        heads = [named(*pair) for pair in zip(heads, zip(*grid, strict=True), strict=True)]
    rows = [[label, *map(_shaped, row)] for label, row in zip(labels, grid, strict=True)]
    return pd.DataFrame(rows, columns=["", *heads], dtype=str)


def _shaped(record: Record) -> str:
    if record.role != "result":
        return record.printed
    told = (hyphen(verdicts.computed(record)), record.verdict, verdicts.flags(record.flags))
    return f"{record.printed} ({', '.join(filter(None, told))})"
