"""Results of slow studies: arrays or a table, beside a note that says how they came about.

A study called `name` is `data/studies/name.npz` and `data/studies/name.toml`. The note holds the
command that redoes it, its seed, the versions it was run with, and the SHA-256 of the arrays'
file: a study whose arrays are not those of its note is refused. A study that is one table stands in
its note, row by row, under the same rule.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import tomllib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reproduce.locate import data_folder

if TYPE_CHECKING:
    import pandas as pd

Note = Mapping[str, str | int | float]


class StudyError(ValueError):
    """A stored study is missing, damaged or not the one that its note describes."""


@dataclass(frozen=True)
class Study:
    """A stored study.

    Attributes
    ----------
    name : str
        What its files are called.
    arrays : dict
        Arrays by name.
    note : dict
        How they came about.
    """

    name: str
    arrays: dict[str, NDArray[Any]]
    note: Note


def _folder() -> Path:
    """Return where the studies of the project lie."""
    return data_folder() / "studies"


def write(
    name: str, arrays: Mapping[str, NDArray[Any]], note: Note, where: Path | None = None
) -> None:
    """Store a study."""
    if missing := {"command", "seed", "versions"} - set(note):
        raise StudyError(f"{name}: the note lacks {', '.join(sorted(missing))}; add it")
    content = _packed(arrays)
    lines = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in note.items()]
    lines.append(f'sha256 = "{hashlib.sha256(content).hexdigest()}"')
    target = where or _folder()
    target.mkdir(parents=True, exist_ok=True)
    (target / f"{name}.npz").write_bytes(content)
    (target / f"{name}.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def read(name: str, where: Path | None = None) -> Study:
    """Return a stored study after checking that its arrays are those of its note."""
    source = where or _folder()
    try:
        content = (source / f"{name}.npz").read_bytes()
        note = tomllib.loads((source / f"{name}.toml").read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise StudyError(f"{name}: no such study in {source} ({error.filename})") from error
    found = hashlib.sha256(content).hexdigest()
    if found != note.get("sha256"):
        raise StudyError(
            f"{name}: expected arrays with the SHA-256 {note.get('sha256')}, got {found}; "
            f"run again: {note.get('command')}"
        )
    with np.load(io.BytesIO(content), allow_pickle=False) as packed:
        return Study(name, {key: packed[key] for key in packed.files}, note)


def write_table(
    name: str, table: pd.DataFrame, note: Mapping[str, Any], where: Path | None = None
) -> None:
    """Store a study that is a table; entries of the note that are tables come last."""
    if "command" not in note:
        raise StudyError(f"{name}: the note lacks command; add it")
    rows = table.to_numpy(object).tolist()
    body = "".join(f"    [{', '.join(map(_written, row))}],\n" for row in rows)
    head = {key: value for key, value in note.items() if not isinstance(value, dict)}
    head |= {"sha256": _digest(body), "columns": list(table.columns)}
    lines = [f"{key} = {_written(value)}\n" for key, value in head.items()]
    lines.append(f"rows = [\n{body}]\n")
    for key, value in note.items():
        if isinstance(value, dict):
            lines += [f"\n[{key}]\n", *(f'"{k}" = {_written(v)}\n' for k, v in value.items())]
    ((where or _folder()) / f"{name}.toml").write_text("".join(lines), encoding="utf-8")


def table(name: str, where: Path | None = None) -> pd.DataFrame:
    """Return a stored table after checking that it is the one of its note."""
    import pandas as pd

    path = (where or _folder()) / f"{name}.toml"
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise StudyError(f"{name}: no such study in {path.parent}") from error
    note = tomllib.loads(text)
    body = re.search(r"^rows = \[\n(.*?)^\]$", text, flags=re.DOTALL | re.MULTILINE)
    if body is None or _digest(body.group(1)) != note.get("sha256"):
        raise StudyError(f"{name}: the rows were changed by hand; run again: {note.get('command')}")
    frame = pd.DataFrame(note.pop("rows"), columns=note.pop("columns"))
    frame.attrs.update(note)
    return frame


def _written(value: Any) -> str:
    """Write a value as TOML, which agrees with JSON in all that a study holds but nan."""
    return "nan" if value != value else json.dumps(value, ensure_ascii=False)


def _digest(rows: str) -> str:
    return hashlib.sha256(rows.encode()).hexdigest()


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
