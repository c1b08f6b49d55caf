"""Exports of tables and of the ledger with their provenance."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Mapping
from textwrap import indent
from typing import TYPE_CHECKING

from reproduce.judge.ledger import Record
from reproduce.papers.declare import computations
from reproduce.printed.cells import anchor
from reproduce.version import software
from reproduce.views import _verdicts as verdicts
from reproduce.views._blocks import entry_text, written
from reproduce.views._keys import check_choice
from reproduce.views._tex import in_tex
from reproduce.views.citations import cite

if TYPE_CHECKING:
    import pandas as pd

# Formats and the endings of their files.
FORMATS = {"csv": "csv", "json": "json", "latex": "tex", "markdown": "md"}
# In LaTeX, longer texts have several lines, and numbers have the digits that errors may need.
_SENTENCE_CHARACTERS, _DIGITS = 30, 12


def table_files(key: str) -> dict[str, str]:
    """Return the exports of a table: path below the root of the book to format."""
    path = f"tables/{anchor(key)}"
    found = {f"{path}.{ending}": form for form, ending in FORMATS.items()}
    if any(made.replicates for made in computations(key)):
        found[f"{path}-covariance.csv"] = "covariance"
    return found


def provenance_of(cited: str = "", setting: str = "") -> dict[str, str]:
    """Return the provenance of an export: software, citation (of all by default), changes."""
    return {
        "software": software(),
        "citation": cited or cite("all", "text"),
        **({"setting": setting} if setting else {}),
    }


def export_frame(
    frame: pd.DataFrame,
    form: str,
    provenance: Mapping[str, str],
    address: str = "",
    caption: str = "",
    legend: str = "",
) -> str:
    """Write any DataFrame as csv, json, latex or markdown.

    The names of the rows are columns if their index has a name. The provenance is a comment before
    the rows; in JSON it is next to the rows, and an infinite number is the text ``inf``. In LaTeX
    the table of an address has a caption with citations. A legend is below it, also in Markdown.
    """
    check_choice("format", form, FORMATS)
    if any(frame.index.names):
        frame = frame.reset_index()
    comment = "".join(f"{name}: {text}\n" for name, text in provenance.items())
    if form == "csv":
        # Words are quoted, since an address contains the sign of a comment.
        return indent(comment, "# ") + str(
            frame.to_csv(index=False, quoting=csv.QUOTE_NONNUMERIC)
        )
    objects = frame.astype(object).where(frame.notna(), None)
    if form == "json":
        rows = objects.replace({math.inf: "inf", -math.inf: "-inf"}).to_dict("records")
        return json.dumps({**provenance, "rows": rows}, indent=2, ensure_ascii=False)
    lines = [[*frame.columns], *objects.fillna("").to_numpy().tolist()]
    texts = {"caption": caption, "legend": legend, "comment": comment}
    if form == "markdown":
        return written("table.md", lines=lines, **texts)
    lines = [[entry_text(entry, _DIGITS) for entry in line] for line in lines]
    columns = [
        rf">{{\raggedright\arraybackslash}}p{{{2 / (1 + len(lines[0])):.2f}\linewidth}}"
        if max(map(len, column)) > _SENTENCE_CHARACTERS
        else "lr"[any(text.strip("−")[:1].isdigit() for text in column)]
        for _, *column in zip(*lines, strict=True)
    ]
    whole = written(
        "table.tex", lines=lines, columns=columns, address=address, cite=cite, **texts
    )
    return in_tex(whole)


def full_frame(records: Iterable[Record]) -> pd.DataFrame:
    """Return one row per cell, with every field of the ledger.

    Lists are words with blanks between them. An interval is two columns.
    """
    import pandas as pd

    rows = []
    for record in records:
        found = record.readings
        closest = found and found.closest
        row = record.model_dump(exclude={"readings"}) | {
            "readings": found and found.count,
            "agreeing": found and found.agreeing,
            "agrees_if": found and verdicts.deciding(found),
            "closest": closest and verdicts.choices_text(closest.choices),
            "closest_computed": closest and closest.computed,
            "closest_probability": closest and closest.probability,
        }
        for name in ("stands_for", "interval"):
            row[f"{name}_low"], row[f"{name}_high"] = row.pop(name) or (None, None)
        for name in ("flags", "equations", "seed", "inputs"):
            row[name] = " ".join(map(str, row[name] or ()))
        rows.append(row)
    return pd.DataFrame(rows)
