"""Write stored studies: arrays or a table, with a note on their origin.

`reproduce.store.studies` reads the files that this module writes.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from reproduce.store import studies
from reproduce.store.studies import Note, digest


def write(name: str, arrays: Mapping[str, Any], note: Note) -> None:
    """Store arrays and their note; equal arrays give an equal file."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    content = buffer.getvalue()
    _write_note(name, {**note, "sha256": digest(content)})
    (studies.folder() / f"{name}.npz").write_bytes(content)


def write_table(name: str, table: pd.DataFrame, note: Mapping[str, Any]) -> None:
    """Store a table with its note, in one file."""
    rows = table.to_numpy(object).tolist()
    body = "".join(f"    [{', '.join(map(_toml, row))}],\n" for row in rows)
    head = {**note, "sha256": digest(body.encode()), "columns": list(table.columns)}
    _write_note(name, head, f"rows = [\n{body}]\n")


def _write_note(name: str, note: Mapping[str, Any], rest: str = "") -> None:
    if "command" not in note:
        raise ValueError(f"{name}: expected a note with a command; add it")
    lines = (
        f"{json.dumps(key) if '.' in key else key} = {_toml(value)}\n"
        for key, value in note.items()
    )
    path = studies.folder() / f"{name}.toml"
    path.write_text("".join(lines) + rest, encoding="utf-8")


def _toml(value: Any) -> str:
    """Return a value as TOML, which agrees with JSON except for nan."""
    return "nan" if value != value else json.dumps(value, ensure_ascii=False)
