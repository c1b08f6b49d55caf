"""Results that a build of the book computes once and stores for its pages.

The environment variable ``REPRODUCE_BUILD`` names the folder. Without it nothing is stored. The
files contain JSON or arrays: to read them executes no code.
"""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np
import scipy

from reproduce.judge import ledger
from reproduce.judge.ledger import Ledger
from reproduce.locate import data_folder
from reproduce.store.files import replacing

FOLDER = "REPRODUCE_BUILD"
Result = TypeVar("Result")


def _fingerprint() -> str:
    """Return a hash of the code, the data, the locked packages and the versions of Python, NumPy.

    All numbers depend on them.
    """
    package, data = Path(__file__).resolve().parent.parent, data_folder()
    files = [*package.rglob("*"), *data.rglob("*"), data.parent / "environment.txt"]
    versions = (platform.python_version(), np.__version__, scipy.__version__)
    digest = hashlib.sha256(" ".join(versions).encode())
    for path in sorted(files):
        if path.is_file() and path.suffix != ".pyc":
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def kept() -> Path | None:
    """Return the folder for results of the present files, None outside of a build."""
    folder = os.environ.get(FOLDER)
    return Path(folder) / _fingerprint() if folder else None


def cached(
    name: str,
    compute: Callable[[], Result],
    dump: Callable[[Result], str | bytes],
    load: Callable[[bytes], Result],
) -> Result:
    """Return a result that only one process of a build computes.

    `dump` makes the content of the file `name`, and `load` the result of this content. A file that
    cannot be read is computed again.
    """
    folder = kept()
    if folder is None:
        return compute()
    path = folder / name.replace("/", "-")
    try:
        return load(path.read_bytes())
    except Exception:  # readers of damaged files raise many types
        result = compute()
    folder.mkdir(parents=True, exist_ok=True)
    content = dump(result)
    # On Windows a file that another process reads cannot be replaced; its content is the same.
    with suppress(PermissionError), replacing(path) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
    return result


@cache
def whole_ledger() -> Ledger:
    """Return the ledger of all items."""
    return cached(
        "ledger.json", ledger.build, Ledger.model_dump_json, Ledger.model_validate_json
    )
