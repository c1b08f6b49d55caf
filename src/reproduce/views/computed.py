"""What a build of the book computes once and keeps for its pages, and what that depends on.

The environment variable ``REPRODUCE_BUILD`` names the folder. Without it nothing is kept, and every
page and every reader computes anew.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TypeVar

from reproduce.audit.report import Audit, audit_paper
from reproduce.judge import ledger
from reproduce.judge.ledger import Ledger
from reproduce.locate import data_folder

__all__ = ["FOLDER", "fingerprint", "item_ledger", "kept", "once", "paper_audit", "whole_ledger"]

FOLDER = "REPRODUCE_BUILD"
Result = TypeVar("Result")


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
def kept() -> Path | None:
    """Return the folder for results of the present files; those of other files are removed."""
    if not (root := os.environ.get(FOLDER)):
        return None
    folder = Path(root) / fingerprint()
    for other in folder.parent.glob("*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def once(name: str, compute: Callable[[], Result]) -> Result:
    """Return what `compute` does, which no other process of the build does again."""
    folder = kept()
    if folder is None:
        return compute()
    path = folder / f"{name.replace('/', '-')}.pickle"
    if not path.exists():
        part = path.with_suffix(f".{os.getpid()}")
        part.write_bytes(pickle.dumps(compute()))
        part.replace(path)
    result: Result = pickle.loads(path.read_bytes())
    return result


@cache
def item_ledger(*keys: str) -> Ledger:
    """Return the ledger of some items."""
    if kept() is None:
        return ledger.build(keys)
    whole = whole_ledger()
    records = tuple(record for record in whole.records if record.key in keys)
    tables = tuple(table for table in whole.tables if table.key in keys)
    return Ledger(records=records, tables=tables, altered=whole.altered)


@cache
def whole_ledger() -> Ledger:
    """Return the ledger of everything."""
    return once("ledger", ledger.build)


@cache
def paper_audit(paper: str) -> Audit:
    """Return what the cross-examination of a paper found."""
    return once(f"audit-{paper}", lambda: audit_paper(paper))
