"""What a build of the book computes once and keeps for its pages, and what that depends on.

The environment variable ``REPRODUCE_BUILD`` names the folder. Without it nothing is kept, and every
page and every reader computes anew.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import platform
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import scipy

from reproduce.judge import ledger
from reproduce.judge.ledger import Ledger
from reproduce.locate import data_folder

if TYPE_CHECKING:
    from reproduce.audit.report import Audit

FOLDER = "REPRODUCE_BUILD"
Result = TypeVar("Result")


def fingerprint() -> str:
    """Return a hash of what all numbers depend on: our files, the data, the lock, the versions."""
    data = data_folder()
    package = Path(__file__).resolve().parent.parent
    files = [*package.rglob("*.py"), *(path for path in data.rglob("*") if path.is_file())]
    versions = (platform.python_version(), np.__version__, scipy.__version__)
    digest = hashlib.sha256(" ".join(versions).encode())
    for path in [*sorted(files), data.parent / "environment.txt"]:
        if path.is_file():
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def kept() -> Path | None:
    """Return the folder for results of the present files, None outside of a build."""
    return Path(os.environ[FOLDER]) / fingerprint() if os.environ.get(FOLDER) else None


def once(name: str, kind: type[Result], compute: Callable[[], Result]) -> Result:
    """Return what `compute` does, which no other process of the build does again.

    What is kept and cannot be read, or is not of that kind, is computed again.
    """
    folder = kept()
    if folder is None:
        return compute()
    path = folder / f"{name.replace('/', '-')}.pickle"
    try:
        found = pickle.loads(path.read_bytes())
    except Exception:  # half a pickle raises nearly anything
        found = None
    if isinstance(found, kind):
        return found
    result = compute()
    folder.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".{os.getpid()}")
    part.write_bytes(pickle.dumps(result))
    part.replace(path)
    return result


@cache
def item_ledger(*keys: str) -> Ledger:
    """Return the ledger of some items."""
    if kept() is None:
        return ledger.build(keys)
    whole = whole_ledger()
    parts = {
        name: tuple(one for one in getattr(whole, name) if one.key in keys)
        for name in ("records", "tables")
    }
    return whole.model_copy(update=parts)


@cache
def whole_ledger() -> Ledger:
    """Return the ledger of everything."""
    return once("ledger", Ledger, ledger.build)


@cache
def paper_audit(paper: str) -> Audit:
    """Return what the cross-examination of a paper found."""
    from reproduce.audit.report import Audit, audit_paper  # only now: most pages have none

    return once(f"audit-{paper}", Audit, lambda: audit_paper(paper))
