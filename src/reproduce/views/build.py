"""What a build of the book keeps between its steps, and what it depends on."""

from __future__ import annotations

import hashlib
import os
import shutil
from functools import cache
from pathlib import Path

from reproduce.locate import data_folder

# Names the folder where a build keeps the chains of the posteriors, so that a page need not sample
# them again. Without it nothing is kept.
CHAINS = "REPRODUCE_CHAINS"


def fingerprint() -> str:
    """Return a hash of what all numbers depend on: the package's own files, the data, the lock."""
    data = data_folder()
    package = Path(__file__).resolve().parent.parent
    files = [*package.rglob("*.py"), *(path for path in data.rglob("*") if path.is_file())]
    digest = hashlib.sha256()
    for path in [*sorted(files), data.parent / "environment.txt"]:
        if path.is_file():
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def chains() -> Path | None:
    """Return the folder for the chains of the present files; those of other files are removed."""
    if not (build := os.environ.get(CHAINS)):
        return None
    folder = Path(build) / fingerprint()
    for other in folder.parent.glob("*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    return folder
