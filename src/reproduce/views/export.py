"""Exports of an item's records, through pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reproduce.judge.expected import reason
from reproduce.judge.ledger import Ledger
from reproduce.views import keys, words

if TYPE_CHECKING:
    import pandas as pd

FORMATS = ("csv", "json", "latex", "markdown")


def export(ledger: Ledger, key: str, form: str) -> str:
    """Write one item's records in a format that other programs read.

    Parameters
    ----------
    ledger : Ledger
        A ledger that holds the item.
    key : str
        The item.
    form : str
        csv and json carry every field at full precision; latex and markdown carry the table as
        a reader sees it.

    Returns
    -------
    str
        The text of the export.

    Raises
    ------
    ValueError
        If the format is unknown, or if the item has no printed cells.
    """
    if form not in FORMATS:
        raise ValueError(f"unknown format {form!r}: expected one of {', '.join(FORMATS)}")
    if not ledger.of(key):
        raise ValueError(f"{key} has no printed cells to export; try `reproduce figure {key}`")
    if form == "json":
        chosen = Ledger(
            records=ledger.of(key), tables=tuple(t for t in ledger.tables if t.key == key)
        )
        return chosen.model_dump_json(indent=2)
    if form == "csv":
        return full_frame(ledger, key).to_csv(index=False)
    shown = _shown_frame(ledger, key, ascii_units=form == "latex")
    if form == "markdown":
        return shown.to_markdown(index=False, disable_numparse=True)
    return shown.to_latex(
        index=False,
        escape=True,
        caption=f"{keys.title(key)} ({keys.place(key)} of {key.split('/')[0]})",
        label=f"tab:{key.replace('/', '-')}",
    )


def full_frame(ledger: Ledger, key: str) -> pd.DataFrame:
    """Return one row per cell of an item, with every field of the ledger and the reason."""
    import pandas as pd

    rows = []
    for record in ledger.of(key):
        row = record.model_dump()
        for name in ("flags", "equations", "seed", "interval"):
            row[name] = " ".join(map(str, row[name] or ()))
        row["readings"] = "; ".join(
            f"{reading.name}: {reading.computed!r} {reading.verdict}" for reading in record.readings
        )
        row["reason"] = reason(record.cell)
        rows.append(row)
    return pd.DataFrame(rows)


def _shown_frame(ledger: Ledger, key: str, *, ascii_units: bool) -> pd.DataFrame:
    """Lay out what a reader sees; a plain LaTeX document has no glyph for the signs of units."""
    import pandas as pd

    return pd.DataFrame(
        [
            {
                "cell": record.cell.partition("#")[2],
                "printed": record.printed,
                "computed": words.computed(record).replace("−", "-"),
                "unit": record.unit if ascii_units else words.unit(record),
                "verdict": record.verdict,
                "probability": words.probability(record).replace("\u00a0", " "),
            }
            for record in ledger.of(key)
        ],
        dtype=str,
    )
