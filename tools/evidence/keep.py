"""Keeping a study: its arrays or its table, beside a note that says how they came about.

`reproduce.store.studies` reads what is kept here.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reproduce.store.studies import Note, StudyError, digest, folder


def write(
    name: str, arrays: Mapping[str, NDArray[Any]], note: Note, where: Path | None = None
) -> None:
    """Store a study."""
    if missing := {"command", "seed", "versions"} - set(note):
        raise StudyError(f"{name}: the note lacks {', '.join(sorted(missing))}; add it")
    content = _packed(arrays)
    lines = [
        f"{json.dumps(key) if '.' in key else key} = {json.dumps(value, ensure_ascii=False)}"
        for key, value in note.items()
    ]
    lines.append(f'sha256 = "{hashlib.sha256(content).hexdigest()}"')
    target = where or folder()
    target.mkdir(parents=True, exist_ok=True)
    (target / f"{name}.npz").write_bytes(content)
    (target / f"{name}.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_table(
    name: str, table: pd.DataFrame, note: Mapping[str, Any], where: Path | None = None
) -> None:
    """Store a study that is a table; entries of the note that are tables come last."""
    if "command" not in note:
        raise StudyError(f"{name}: the note lacks command; add it")
    rows = table.to_numpy(object).tolist()
    body = "".join(f"    [{', '.join(map(_written, row))}],\n" for row in rows)
    head = {key: value for key, value in note.items() if not isinstance(value, dict)}
    head |= {"sha256": digest(body), "columns": list(table.columns)}
    lines = [f"{key} = {_written(value)}\n" for key, value in head.items()]
    lines.append(f"rows = [\n{body}]\n")
    for key, value in note.items():
        if isinstance(value, dict):
            lines += [
                f"\n[{key}]\n",
                *(f'"{k}" = {_written(v)}\n' for k, v in value.items()),
            ]
    ((where or folder()) / f"{name}.toml").write_text("".join(lines), encoding="utf-8")


def _written(value: Any) -> str:
    """Write a value as TOML, which agrees with JSON in all that a study holds but nan."""
    return "nan" if value != value else json.dumps(value, ensure_ascii=False)


def _packed(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return the arrays as one file; NumPy's own writer would put today's date into it."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for key, array in arrays.items():
            one = io.BytesIO()
            np.save(one, np.asarray(array), allow_pickle=False)
            entry = zipfile.ZipInfo(f"{key}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, one.getvalue())
    return buffer.getvalue()
