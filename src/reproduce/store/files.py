"""Output files: checked before a computation, and replaced after they are complete."""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

# Types of the name of a file.
FilePath = str | Path

# Endings of the files of figures, and of the draws of a posterior.
FIGURES, DRAWS = (".svg", ".pdf", ".png"), (".csv", ".nc")


def check_target(path: FilePath, endings: Collection[str], name: str = "path") -> Path:
    """Return `path`, or raise an error if no file with one of `endings` can be written there.

    Errors use `name` for the argument.
    """
    if not isinstance(path, FilePath):
        raise TypeError(f"{name}: expected the path of a file, got {path!r}")
    path = Path(path)
    folder = path.parent
    if path.suffix.lower() not in endings:
        expected = (
            f"one of the endings {', '.join(endings)}, got {path}. Change the ending"
        )
    elif path.is_dir():
        expected = f"a file, got the folder {path}. Add the name of a file"
    elif not folder.is_dir():
        expected = f"a file in an existing folder, got {path}. Create the folder"
    elif not os.access(folder, os.W_OK):
        expected = f"a file in a writable folder, got {path}. Choose another folder"
    else:
        return path
    raise ValueError(f"{name}: expected {expected}")


@contextmanager
def replacing(path: FilePath) -> Iterator[Path]:
    """Yield a temporary path, whose file replaces `path` if the block ends without an error."""
    path = Path(path).resolve()
    with TemporaryDirectory(prefix=".reproduce-", dir=path.parent) as folder:
        part = Path(folder, path.name)
        yield part
        if path.exists():
            shutil.copymode(path, part)
        part.replace(path)


def write_text(path: FilePath, text: str) -> None:
    """Write a text file as UTF-8."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")
