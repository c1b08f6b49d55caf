"""Running a slow study again: `python tools/evidence/recompute.py NAME`.

A run that was killed goes on where it was: finished parts are kept until the study is stored.
"""

from __future__ import annotations

import os
import platform
import shutil
import sys
import tempfile
from concurrent.futures import Executor
from importlib import import_module
from pathlib import Path

import numpy as np

from reproduce.inference import processes
from reproduce.judge.studies import SLOW
from reproduce.store import studies
from reproduce.version import __version__
from reproduce.views.computed import fingerprint


def _processor_seconds() -> float:
    """Return what this process and its finished children have worked, whatever else ran beside."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def run(name: str, where: Path | None = None, executor: Executor | None = None) -> None:
    """Run a study again and store it; the seconds are those of this run alone."""
    if name not in SLOW:
        raise KeyError(f"unknown study {name!r}; expected one of {', '.join(SLOW)}")
    module = import_module(SLOW[name])
    folder = Path(tempfile.gettempdir()) / f"reproduce-{name}-{fingerprint()[:12]}"
    begin = _processor_seconds()
    with executor or processes() as pool:
        arrays, replicates = module.recomputed(pool, folder, {"sources": fingerprint()})
    note: dict[str, str | int | float] = {
        "command": f"python tools/evidence/recompute.py {name}",
        "seed": module.SEED,
        "replicates": replicates,
        "versions": f"Python {platform.python_version()}, NumPy {np.__version__}, {__version__}",
        "processor_seconds": round(_processor_seconds() - begin, 1),
    }
    studies.write(name, arrays, note, where)
    shutil.rmtree(folder)


if __name__ == "__main__":
    for wanted in sys.argv[1:]:
        run(wanted)
