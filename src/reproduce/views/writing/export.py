"""Exports of an item's records, or of any DataFrame, through pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reproduce.judge.expected import reason
from reproduce.judge.ledger import Ledger, Record
from reproduce.views import keys
from reproduce.views.writing import verdicts

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["FORMATS", "export", "export_frame", "full_frame"]

FORMATS = ("csv", "json", "latex", "markdown")


def export(ledger: Ledger, address: str, form: str) -> str:
    """Write the records of an item or a cell in a format that other programs read."""
    key, _, name = address.partition("#")
    records = tuple(r for r in ledger.of(key) if not name or r.cell == address)
    if form == "json":
        tables = tuple(t for t in ledger.tables if t.key == key and not name)
        return Ledger(records=records, tables=tables).model_dump_json(indent=2)
    if form == "csv":
        return full_frame(records).to_csv(index=False)
    caption = f"{keys.title(key)} ({keys.place(key)} of {key.split('/')[0]})"
    label = f"tab:{key.replace('/', '-')}"
    shown = _shown_frame(records, ascii_units=form == "latex")
    if form == "latex":
        return shown.to_latex(index=False, escape=True, caption=caption, label=label)
    return export_frame(shown, form)


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
            "computed": verdicts.computed(record).replace("−", "-"),
            "unit": record.unit if ascii_units else verdicts.unit(record),
            "verdict": verdicts.qualified(record),
            "probability": verdicts.probability(record).replace("\u00a0", " "),
        }
        for record in records
    ]
    return pd.DataFrame(rows, dtype=str)
