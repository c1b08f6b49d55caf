"""Results of slow studies: arrays or a table, with a note on their computation.

A study called `name` is `data/studies/name.npz` and `data/studies/name.toml`. The note contains the
command, the seed, the versions of the packages, and the SHA-256 of the file of the arrays. Other
arrays raise an error. A study of one table is stored in its note, row by row, with the same check.
"""

from __future__ import annotations

import hashlib
import io
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reproduce.locate import data_folder

if TYPE_CHECKING:
    import pandas as pd

Note = Mapping[str, str | int | float]


# Arrays by name, and their note.
StoredStudy = tuple[dict[str, NDArray[Any]], Note]


def folder() -> Path:
    """Return the folder of the studies of the project."""
    return data_folder() / "studies"


def read(name: str) -> StoredStudy:
    """Return a stored study after checking its arrays against its note."""
    content = _file(f"{name}.npz")
    note = _note(name, _file(f"{name}.toml"), content)
    with np.load(io.BytesIO(content), allow_pickle=False) as packed:
        return dict(packed), note


def table(name: str) -> pd.DataFrame:
    """Return a stored table after checking its rows against its note."""
    import pandas as pd

    text = _file(f"{name}.toml")
    rows = text.partition(b"\nrows = [\n")[2].removesuffix(b"]\n")
    note = _note(name, text, rows)
    frame = pd.DataFrame(note.pop("rows"), columns=note.pop("columns"))
    frame.attrs.update(note)
    return frame


def _file(name: str) -> bytes:
    try:
        return (folder() / name).read_bytes()
    except FileNotFoundError as error:
        raise ValueError(
            f"{name}: expected a file {error.filename}, got no file. Run its command"
        ) from error


def _note(name: str, text: bytes, content: bytes) -> dict[str, Any]:
    """Return the note of a study; raise `ValueError` if its content is another one."""
    note = tomllib.loads(text.decode())
    expected, actual = note.get("sha256"), digest(content)
    if actual != expected:
        raise ValueError(
            f"{name}: expected the SHA-256 {expected}, got {actual}. "
            f"Run again: {note.get('command')}"
        )
    return note


def digest(content: bytes) -> str:
    """Return the SHA-256 of arrays, or of the rows of a table, as in their note."""
    return hashlib.sha256(content).hexdigest()
